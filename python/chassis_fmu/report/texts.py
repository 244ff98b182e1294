"""Fills the numbers from the results, with units, into claims, explanations and captions."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from .. import _native
from ..evaluation import metrics
from ..evaluation.grading import Status, paired
from ..evaluation.results_table import Numbers, Statistic
from ..files.plan import Cell, Check, Metric, Number, Part, Plan
from . import tables

NONE = "–"


def fill(text: Sequence[Part], numbers: Numbers) -> str:
    """Return a text with its numbers filled in."""
    return " ".join("".join(p if isinstance(p, str) else number(p, numbers) for p in text).split())


def number(item: Number, numbers: Numbers) -> str:
    """Format a number in a text; several cells give the range from the smallest to the largest."""
    metric = numbers.plan.metrics[item.metric]
    if item.format == "threshold":
        return tables.scientific(metric.threshold) if metric.threshold is not None else NONE
    if item.format == "band":
        return _range([tables.scientific(f) for f in metric.band or ()], "Hz")
    if item.format in ("from", "to"):
        return NONE if metric.window is None else f"{tables.scientific(metric.window[item.format == 'to'])} s"
    if item.format == "spread":
        unit = tables.pretty_unit(metric.unit)
        parts = [tables.spread(numbers.statistic(c), metric.digits, len(numbers.plan.seeds)) for c in item.cells]
        return " and ".join(f"{p} {unit}".rstrip() for p in parts)
    against: Sequence[Cell | None] = item.against or [None] * len(item.cells)
    found = [_single(item.format, cell, other, numbers) for cell, other in zip(item.cells, against, strict=True)]
    values = sorted(v for v in found if v is not None)
    if len(values) < len(found) or not values:
        return NONE
    shown = _FORMATS[item.format]
    unit = _unit(item, numbers)
    return _range([shown(v, metric.digits) for v in dict.fromkeys((values[0], values[-1]))], unit)


def _range(ends: Sequence[str], unit: str) -> str:
    text = " to ".join(dict.fromkeys(ends))
    return f"{text} {unit}".rstrip() if text else NONE


def _unit(item: Number, numbers: Numbers) -> str:
    if item.format in ("percent", "change", "by", "paper_change", "paper_by"):
        return "%"
    if item.format in ("number", "ratio"):
        return ""
    return tables.pretty_unit(numbers.plan.metrics[item.metric].unit)


_FORMATS: dict[str, Callable[[float, int | None], str]] = {
    **dict.fromkeys(("value", "number", "difference"), tables.number),
    **dict.fromkeys(("change", "paper_change"), lambda value, _: tables.signed(value).removesuffix(" %")),
    **dict.fromkeys(("by", "paper_by"), lambda value, _: tables.signed(value).removesuffix(" %").lstrip("+−")),
    "paper": lambda value, _: tables.scientific(value),
    "percent": lambda value, _: tables.number(100.0 * value, 0 if abs(value) >= 0.1 else 1),
    "ratio": lambda value, _: tables.scientific(value, 2),
}


def _single(form: str, cell: Cell, against: Cell | None, numbers: Numbers) -> float | None:
    if form == "paper":
        return numbers.paper_value(cell)
    ours = numbers.statistic(cell)
    if form in ("value", "number", "percent"):
        return None if ours is None else ours.mean
    if against is None:
        return None
    if form in ("paper_change", "paper_by"):
        found = numbers.paper_change(cell, against)
        return found if found is None or form == "paper_change" else abs(found)
    if form in ("change", "by"):
        percent = numbers.change(cell, against)
        return None if percent is None else percent.mean if form == "change" else abs(percent.mean)
    base = numbers.statistic(against)
    if ours is None or base is None:
        return None
    if form == "difference":
        return ours.mean - base.mean
    return None if numbers.is_negligible(against) or base.mean == 0.0 else ours.mean / base.mean


def check(item: Check, numbers: Numbers) -> str:
    """Describe a check and the numbers that it compares."""
    metric = numbers.metric(item.cell)
    unit = metric.unit
    plan = numbers.plan

    def place(cell: Cell, beside: Cell | None = None) -> str:
        named = [] if beside is not None and beside.metric == cell.metric else [numbers.metric(cell).title]
        point = None if beside and beside.point == cell.point else cell.point
        return ", ".join([*named, plan.place(cell.case, point)])

    def value(found: Statistic | None) -> str:
        text = tables.spread(found, metric.digits, len(plan.seeds))
        return f"{text} {tables.pretty_unit(unit)}".rstrip()

    def exact(number: float | None) -> str:
        return f"{tables.printed(number, metric.digits)} {tables.pretty_unit(unit)}".rstrip()

    head = place(item.cell)
    ours = value(numbers.statistic(item.cell))
    if item.expect == "never":
        return f"{head}: no number expected, {ours}"
    if item.expect == "paper_value":
        return f"{head}: {ours}, paper {exact(numbers.paper_value(item.cell))}"
    if item.expect in ("below", "above"):
        return f"{head}: {ours}, expected {item.expect} {exact(item.level)}"
    if item.against is None:
        return head
    if item.expect == "falls_more":
        mine, other = (Statistic.of(list(numbers.changes(c).values())) for c in (item.cell, item.against))
        found = f"{tables.spread_percent(mine)} against {tables.spread_percent(other)}"
        return f"{head} against {place(item.against, item.cell)}: {found}, expected to fall more"
    percent = numbers.change(item.cell, item.against)
    pairs = numbers.pairs(item.cell, item.against)
    if percent is not None:
        found = tables.spread_percent(percent)
    elif pairs:
        found = f"{value(numbers.statistic(item.cell))} against {value(numbers.statistic(item.against))}"
    else:
        found = NONE
    wanted = {
        "paper_change": f"paper {tables.signed(numbers.paper_change(item.cell, item.against))}",
        "lower": "expected lower",
        "higher": "expected higher",
        "unchanged": "expected unchanged",
    }[item.expect]
    doubt = ""
    if len(pairs) > 1 and not paired(pairs).is_clear:
        doubt = "; within the scatter of the seeds"
    return f"{head} against {place(item.against, item.cell)}: {found}, {wanted}{doubt}"


def definition(metric: Metric, plan: Plan) -> str:
    """Describe the computation of a number: signals, window, formula and number of rows."""
    if metric.value is not None:
        return f"{metric.value}, computed from the metrics of the same run"
    names = ", ".join(plan.columns[index].name for index in metric.columns)
    combined = {"min": "the smallest", "max": "the largest", "norm": "the root of the sum of the squares"}
    if metric.combine == "squares":
        names = (
            f"the sum of the squares of {names} with the weights {', '.join(map(tables.scientific, metric.weights))}"
        )
    elif metric.combine is not None:
        names = f"{combined[metric.combine]} of {names} at each time"
    parts = [f"x: {names}"]
    if metric.minus is not None:
        parts.append(f"minus {plan.columns[metric.minus].name}")
    if metric.from_baseline:
        parts.append("minus the same signal in the baseline's run")
    unit = tables.pretty_unit(metric.unit)
    if (metric.factor, metric.offset) != (1.0, 0.0):
        shift = f" and plus {tables.scientific(metric.offset)}" if metric.offset else ""
        parts.append(f"times {tables.scientific(metric.factor)}{shift}")
    text = f"{_native.formula(metric.kind or '')} of {', '.join(parts)}"
    if metric.threshold is not None:
        text += f"; threshold {tables.scientific(metric.threshold)}"
    if metric.band is not None:
        text += f"; band {_range([tables.scientific(f) for f in metric.band], 'Hz')}"
    start, stop = metric.window or (plan.simulation.start, plan.simulation.stop)
    text += f"; rows from {tables.scientific(start)} s to {tables.scientific(min(stop, plan.simulation.stop))} s"
    if metric.until is not None:
        side = "above" if metric.until.above else "below"
        level = tables.scientific(metric.until.level)
        text += f", up to the first one where {plan.columns[metric.until.column].name} is {side} {level}"
    rows = metrics.window(plan.simulation.times, metric.window, plan.simulation.step)
    count = f"{rows.stop - rows.start:,}".replace(",", " ")
    text += f" ({'at most ' if metric.until else ''}{count} rows)"
    return text + (f"; in {unit}" if unit else "")


def checks(items: Sequence[Check], numbers: Numbers) -> list[tuple[Status, str]]:
    """Return badge and description of each check."""
    return [(numbers.status(item), check(item, numbers)) for item in items]

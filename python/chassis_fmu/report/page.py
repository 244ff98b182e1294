"""The page of a scenario: one self-contained HTML file."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import msgspec

from ..evaluation.grading import MEANINGS, Status
from ..evaluation.results_table import Numbers, Row
from ..files.describe import Variable, describe, sha256
from ..files.plan import Bytes, Component, Plan, Run, Setting, Value
from . import page_data, plots, rendering, system, tables, texts


class Steps(msgspec.Struct, frozen=True):
    """Numbers of the steps of a run, and the sizes of the accepted ones (s)."""

    accepted: int
    rejected: int
    inaccurate: int
    smallest: float
    largest: float


@dataclass(frozen=True)
class Context:
    """How the results were produced."""

    master: str
    command: str
    inputs: str | None = None
    shortened: str | None = None
    """Options that shortened the runs, such as "--stop 2 --seeds 1"."""
    files: tuple[str, ...] = ()
    """Files with recorded signals, relative to the page."""
    steps: Mapping[str, Steps] = field(default_factory=dict)
    """Steps of each run that chooses or repeats them."""
    replays: tuple[tuple[str, str], ...] = ()
    """Cases, with the addresses of their replays in the lab."""
    converge: Mapping[str, Any] | None = None
    """Contents of converge.json, if these runs were repeated with other steps."""


def _bar(percent: float | None, limit: float) -> tuple[float, float] | None:
    """Return left edge and width of the bar from zero to a change, in percent of the box; zero is in its middle."""
    if percent is None:
        return None
    half = 50.0 * min(abs(percent) / limit, 1.0)
    return round(50.0 - half if percent < 0.0 else 50.0, 2), round(half, 2)


def _limit(cells: Sequence[Row]) -> float:
    """Return the change (percent) at the edge of the box that contains the bars."""
    changes = [c.paper_change for c in cells if c.paper_change is not None]
    changes += [c.change.mean for c in cells if c.change is not None]
    return max([*(min(abs(v), 100.0) for v in changes), 1.0])


def _places(plan: Plan, name: str | None) -> tuple[str, str] | None:
    """Return the row and the column of a point in the matrix of a sweep over two parameters."""
    point = next((p for p in plan.points if p.name == name), None)
    if point is None or point.second is None or plan.sweep is None or plan.sweep.second is None:
        return None
    ends = ((point.second, plan.sweep.second.unit), (point.value, plan.sweep.unit))
    row, column = (f"{tables.scientific(value)} {tables.pretty_unit(unit)}".rstrip() for value, unit in ends)
    return row, column


# Hexadecimal digits of a Binary that a page shows.
SHOWN_DIGITS = 32


def _value(setting: Setting, variable: Variable | None) -> str:
    value = setting.value
    if isinstance(value, bool) or setting.type == "Boolean":
        return "on" if value else "off"
    if isinstance(value, str) or setting.type == "String":
        return str(value)
    if isinstance(value, Bytes):
        digits = value.hex if len(value.hex) <= SHOWN_DIGITS else f"{value.hex[:SHOWN_DIGITS]}..."
        return f"0x{digits} ({len(value.hex) // 2} bytes)"
    if isinstance(value, int) and setting.type == "Integer":
        return str(value)
    if variable is None or setting.type == "Integer":
        return f"{value:.9g}"
    shown = variable.unit
    text = tables.scientific(value * shown.factor + shown.offset)
    unit = tables.pretty_unit(shown.unit)
    return f"{text} {unit}" if unit else text


_TYPES: dict[str, Any] = {"Real": float, "Integer": int, "Boolean": bool, "String": str}


def _default(setting: Setting, variable: Variable | None) -> str:
    if variable is None or variable.start is None:
        return ""
    try:
        if setting.type == "Binary":
            start: Value = Bytes(variable.start)
        else:
            start = msgspec.convert(variable.start, _TYPES[setting.type], strict=False)
    except msgspec.ValidationError:
        return variable.start
    return _value(Setting(setting.name, setting.type, setting.reference, start), variable)


def _collapse(plan: Plan, values: Mapping[tuple[str, str | None], str]) -> tuple[tuple[str, str], ...]:
    """List a value once if it is the same in all runs, otherwise by the case or point that it depends on."""
    labels: tuple[Callable[[str, str | None], str | None], ...] = (
        lambda *_: "",
        lambda case, _: plan.case_titles[case],
        # In a sweep over two parameters, most values depend on one of them.
        lambda _, point: (_places(plan, point) or (None, None))[0],
        lambda _, point: (_places(plan, point) or (None, None))[1],
        lambda _, point: plan.point_titles[point],
    )
    for label in labels:
        by_label: dict[str | None, set[str]] = {}
        for place, value in values.items():
            by_label.setdefault(label(*place), set()).add(value)
        if all(text is not None and len(found) == 1 for text, found in by_label.items()):
            return tuple((str(text), found.pop()) for text, found in by_label.items())
    return tuple((plan.place(c, p), v) for (c, p), v in values.items())


def order_of(runs: Sequence[Run]) -> list[str]:
    """Return all components, in an order that agrees with the execution order of every run."""
    orders = list(dict.fromkeys(tuple(component.name for component in run.components) for run in runs))
    left = list(dict.fromkeys(name for order in orders for name in order))
    found: list[str] = []
    while left:
        # The first component that no run executes after another remaining component.
        behind = {name for order in orders for name in [n for n in order if n in left][1:]}
        found.append(next((name for name in left if name not in behind), left[0]))
        left.remove(found[-1])
    return found


def components(plan: Plan) -> list[dict[str, Any]]:
    """Collect the components of all runs with the parameters that differ from the defaults of their FMUs."""
    runs = [r for r in plan.runs if r.seed == plan.seed_values[0]]
    found: dict[tuple[str, Path], list[tuple[Run, Component]]] = {}
    for run in runs:
        for component in run.components:
            found.setdefault((component.name, component.fmu), []).append((run, component))
    order = {name: i for i, name in enumerate(order_of(runs))}
    given = {(r.id, u.name, s.name): s.value for r in plan.runs for u in r.components for s in u.parameters}
    sections = []
    for (name, fmu), places in sorted(found.items(), key=lambda item: order[item[0][0]]):
        text = describe(fmu)
        inside = {run.case for run, _ in places}
        parameters = []
        # Runs that do not set a parameter use its default.
        settings = {s.name: s for _, component in places for s in component.parameters}
        for setting in settings.values():
            variable = text.variables.get(setting.name)
            default = _default(setting, variable)
            values = {}
            for run, component in places:
                own = next((s for s in component.parameters if s.name == setting.name), None)
                values[run.case, run.point] = default if own is None else _value(own, variable)
            different = {given.get((r.id, name, setting.name)) for r in plan.runs if r.case in inside}
            if len(plan.seeds) > 1 and len(different) > len(set(values.values())):
                shown: tuple[tuple[str, str], ...] = (("", "one value per seed"),)
            else:
                shown = _collapse(plan, values)
            if default and shown == (("", default),):
                continue
            parameters.append((setting.name, variable.description if variable else "", default, shown))
        grouped: dict[str, list[str]] = {}
        for s in places[0][1].constants:
            grouped.setdefault(_value(s, text.variables.get(s.name)), []).append(s.name)
        sections.append(
            {
                "name": name,
                "fmu": fmu.stem,
                "guid": places[0][1].guid,
                "sha256": sha256(fmu),
                "description": text.text,
                # Empty if all cases contain the component.
                "cases": [c.title for c in plan.cases if c.name in inside] if len(inside) < len(plan.cases) else [],
                # Each with name, description, default, and formatted values with the cases or points where they apply.
                "parameters": parameters,
                "constants": [(", ".join(names), value) for value, names in grouped.items()],
            }
        )
    return sections


def unread(plan: Plan) -> dict[tuple[str, tuple[str, ...]], list[str]]:
    """Group the outputs that nothing reads by component; the values are the cases with the same unread outputs."""
    cases: dict[tuple[str, tuple[str, ...]], list[str]] = {}
    for case in plan.wiring:
        components: dict[str, list[str]] = {}
        for signal in case.unread:
            components.setdefault(signal.component, []).append(signal.variable)
        for component, outputs in components.items():
            cases.setdefault((component, tuple(outputs)), []).append(case.case)
    return cases


def counts(numbers: Numbers) -> dict[Status, int]:
    """Count the badges of findings and requirements, best first."""
    found = [numbers.finding(f) for f in numbers.plan.findings]
    found += [verdict.status for verdict in numbers.verdicts]
    return {status: found.count(status) for status in Status if status in found}


def verdict_meanings(numbers: Numbers) -> list[tuple[Status, str]]:
    """Define the badges of the requirements that the page shows."""
    shown = {verdict.status for verdict in numbers.verdicts}
    runs = "run and seed" if len(numbers.plan.seeds) > 1 else "run"
    meanings = {
        Status.PASSED: f"the metric is within the limits for every {runs}",
        Status.FAILED: f"the metric is outside the limits, or has no value, for some {runs}",
        Status.OPEN: "a run failed, or ended before the metric could be computed",
    }
    return [(status, meaning) for status, meaning in meanings.items() if status in shown]


def render(
    numbers: Numbers,
    drawings: Sequence[plots.Drawing],
    data: str,
    failures: Mapping[str, str],
    context: Context,
) -> str:
    """Return the page. `data` contains the data of the figures as JSON (`page_data`)."""
    plan = numbers.plan
    cells = numbers.table()
    s = plan.simulation
    limit = _limit(cells)
    badges = {c.status for c in cells} | {numbers.finding(f) for f in plan.findings}
    badges |= {numbers.status(check) for f in plan.findings for check in f.checks}
    return rendering.render(
        "page.html.j2",
        plan=plan,
        paragraphs=rendering.paragraphs(plan.description),
        groups=[(metric, [c for c in cells if c.metric is metric]) for metric in plan.metrics],
        tables=tables,
        texts=texts,
        numbers=numbers,
        bar=lambda percent: _bar(percent, limit),
        places=lambda point: _places(plan, point),
        colors={case.name: index % len(plots.PALETTE) for index, case in enumerate(plan.cases)},
        has_paper=any(c.paper is not None or c.paper_change is not None for c in cells),
        has_change=any(c.change is not None or c.paper_change is not None for c in cells),
        has_status=any(c.status for c in cells),
        negligible=tables.NEGLIGIBLE if any(c.negligible for c in cells) else "",
        counts=counts(numbers),
        verdicts=[(verdict.status, verdict.text) for verdict in numbers.verdicts],
        verdict_meanings=verdict_meanings(numbers),
        legend=[(status, meaning) for status, meaning in MEANINGS.items() if status in badges],
        figures=[(d.figure, texts.fill(d.figure.caption or (), numbers), rendering.inline_svg(d)) for d in drawings],
        systems=system.systems(plan),
        components=components(plan),
        unread=unread(plan).items(),
        failures=failures,
        context=context,
        interactive=page_data.Interactive.of(data),
        duration=f"{s.stop - s.start:g} s",
        step=f"{s.step * 1e3:g} ms",
    )

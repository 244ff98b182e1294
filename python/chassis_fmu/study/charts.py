"""The figures of a study: distributions, factors, trade-offs, time histories."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from ..files.plan import Case, Conversion
from ..report import tables
from ..report.figures import brief, metric_axis
from ..report.panels import Array, Axis, Line, Panel, PanelKind, heat_maps
from .job import Limits
from .statistics import Numbers

# Maximum number of points in a scatter plot and of steps in a distribution; more would only overlap.
MOST_POINTS = 400
MOST_STEPS = 400
BINS = 30


@dataclass(frozen=True)
class Group:
    """The samples of a cell with the same FMUs; each group has its own color."""

    cell: int
    point: str | None
    case: Case
    choice: tuple[str, ...]
    rows: NDArray[np.bool_]

    def of(self, values: Array) -> Array:
        """Return the values of the group's samples; NaN for all others."""
        return np.where(self.rows, values, math.nan)


def groups(numbers: Numbers) -> Iterator[Group]:
    """Return all groups: one for each case, or for each choice of FMUs in a case."""
    job = numbers.job
    named = {case.name: case for case in job.plan.cases}
    fmus = [values for factor, values in zip(job.study.vary, numbers.values, strict=True) if factor.fmu is not None]
    chosen = list(zip(*fmus, strict=True)) if fmus else [()] * numbers.count
    for cell, run in enumerate(job.cells):
        for choice in dict.fromkeys(chosen):
            case = named[run.case]
            if choice:
                title = ", ".join((*([case.title] if len(named) > 1 else []), *choice))
                case = Case(" ".join((case.name, *choice)), title, None)
            yield Group(cell, run.point, case, choice, np.array([other == choice for other in chosen]))


def cases(numbers: Numbers) -> list[Case]:
    """Return the figure cases of all groups, each once."""
    return list({group.case.name: group.case for group in groups(numbers)}.values())


def _at_points(numbers: Numbers) -> Iterator[tuple[str, list[Group]]]:
    """Return the title and the groups of each point."""
    for point in dict.fromkeys(run.point for run in numbers.job.cells):
        yield numbers.job.plan.point_titles[point], [group for group in groups(numbers) if group.point == point]


def _numeric(numbers: Numbers) -> list[int]:
    """Return the factors whose values are numbers."""
    factors = enumerate(zip(numbers.job.study.vary, numbers.values, strict=True))
    return [i for i, (of, values) in factors if of.distribution != "seed" and not isinstance(values[0], str | bool)]


def distributions(numbers: Numbers, index: int) -> list[Panel]:
    """Return the cumulative distribution and histogram of a metric at each point, with its required limits."""
    job = numbers.job
    metric = job.plan.metrics[index]
    wanted = [r for r in job.requirements if r.metric == index and not r.of_change]
    values = {i: numbers.of(index, i) for i in range(len(job.cells))}
    return _distributions(numbers, metric.title, metric_axis(metric), values, wanted)


def changes(numbers: Numbers, requirement: Limits) -> list[Panel]:
    """Return the distribution of a metric's change against the baseline, with its required limits."""
    job = numbers.job
    title = f"{job.plan.metrics[requirement.metric].title}, change against the baseline"
    values = {i: numbers.changes(requirement, i) for i, run in enumerate(job.cells) if run.case in requirement.cases}
    x = Axis("Change against the baseline", (Conversion("%"),))
    return _distributions(numbers, title, x, values, [requirement])


def _distributions(
    numbers: Numbers, title: str, x: Axis, values: Mapping[int, Array], wanted: Sequence[Limits]
) -> list[Panel]:
    limits = [limit for of in wanted for limit in (of.min, of.max) if limit is not None]
    found = []
    for note, of_point in _at_points(numbers):
        shown = [group for group in of_point if group.cell in values]
        known = [np.sort(v[np.isfinite(v)]) for v in (group.of(values[group.cell]) for group in shown)]
        if not any(v.size for v in known):
            continue
        edges = _edges(np.concatenate(known))
        cumulative, histogram = [], []
        for group, v in zip(shown, known, strict=True):
            if not v.size:
                continue
            # The shares include failed runs, which have no number, so the curve can end below 1.
            case, count = group.case, int(group.rows.sum())
            cumulative.append(Line("run", case.title, *_steps(v, count), case))
            histogram.append(Line("run", case.title, *_outline(v, edges), case))
        top = max(float(line.y.max()) for line in histogram)
        for name, panel_lines, height in (("cumulative", cumulative, 1.0), ("histogram", histogram, top)):
            ends = np.array([0.0, height])
            marked = [
                Line("reference", f"limit {tables.scientific(limit)}", np.array([limit, limit]), ends)
                for limit in dict.fromkeys(limits)
            ]
            y = Axis("Share of the runs", (Conversion(""),), range=(0.0, 1.0) if name == "cumulative" else None)
            what = "cumulative distribution" if name == "cumulative" else "histogram"
            found.append(Panel(f"{title}: {what}", note, x, y, (*panel_lines, *marked), kind="curve"))
    return found


def _edges(values: Array) -> Array:
    low, high = float(values.min()), float(values.max())
    if low == high:
        low, high = low - 0.5, high + 0.5
    bins = max(5, min(BINS, round(math.sqrt(values.size))))
    return np.linspace(low, high, bins + 1)


def _steps(values: Array, count: int) -> tuple[Array, Array]:
    shares = np.arange(1, values.size + 1) / count
    if values.size > MOST_STEPS:
        rows = np.unique(np.linspace(0, values.size - 1, MOST_STEPS).astype(np.intp))
        values, shares = values[rows], shares[rows]
    x = np.repeat(values, 2)
    y = np.concatenate([[0.0], np.repeat(shares, 2)[:-1]])
    return x, y


def _outline(values: Array, edges: Array) -> tuple[Array, Array]:
    counts, _ = np.histogram(values, edges)
    shares = counts / max(1, values.size)
    x = np.repeat(edges, 2)
    y = np.concatenate([[0.0], np.repeat(shares, 2), [0.0]])
    return x, y


def over_factors(numbers: Numbers, index: int) -> list[Panel]:
    """Return a metric over each factor: a point for each sample, or the mean at each level of a factor."""
    return [panel for at in _numeric(numbers) for panel in _over_factor(numbers, index, at, means=True)]


def _over_factor(numbers: Numbers, index: int, at: int, *, means: bool) -> list[Panel]:
    job = numbers.job
    metric, factor = job.plan.metrics[index], job.study.vary[at]
    x, of = _factor_axis(numbers, at), np.array(numbers.values[at], np.float64)
    has_means = means and bool(factor.levels)
    found = []
    for note, of_point in _at_points(numbers):
        lines: list[Line] = []
        for group in of_point:
            make = _means if has_means else _cloud
            lines += filter(None, [make(of, group.of(numbers.of(index, group.cell)), group.case)])
        if lines:
            kind: PanelKind = "function" if has_means else "curve"
            title = f"{metric.title} over {factor.name}"
            found.append(Panel(title, note, x, metric_axis(metric), tuple(lines), kind=kind))
    return found


def over_two_factors(numbers: Numbers, index: int) -> list[Panel]:
    """Return heat maps of a metric over each pair of factors with levels: means over the other factors.

    Full factorial designs only: in other designs, the levels of different factors may be correlated.
    """
    job = numbers.job
    if job.study.method != "sweep" or job.study.chosen_design != "full_factorial":
        return []
    metric = job.plan.metrics[index]
    factors = [i for i in _numeric(numbers) if len(job.study.vary[i].levels or ()) > 2]
    found: list[Panel] = []
    for first, second in itertools.combinations(factors, 2):
        x, y = (np.array(numbers.values[i], np.float64) for i in (first, second))
        names = [job.study.vary[i].name for i in (first, second)]
        axes = (_factor_axis(numbers, first), _factor_axis(numbers, second), metric_axis(metric))
        for note, of_point in _at_points(numbers):
            maps = []
            for group in of_point:
                values, case = group.of(numbers.of(index, group.cell)), group.case
                known = np.isfinite(values)
                if not known.any():
                    continue
                centers, at = np.unique(np.stack((x[known], y[known])), axis=1, return_inverse=True)
                means = np.bincount(at.ravel(), weights=values[known]) / np.bincount(at.ravel())
                notes = (case.title if len(cases(numbers)) > 1 else "", note)
                maps.append((case, ", ".join(filter(None, notes)), (centers[0], centers[1], means)))
            found += heat_maps(f"{metric.title} over {names[0]} and {names[1]}", axes, maps)
    return found


def matrix(numbers: Numbers, shown: Sequence[int]) -> list[Panel]:
    """Return the scatter matrix of factors and metrics, with a point for each sample."""
    factors = _numeric(numbers)
    found = [_between_factors(numbers, *pair) for pair in itertools.combinations(factors, 2)]
    for index in shown:
        for at in factors:
            found += _over_factor(numbers, index, at, means=False)
    for first, second in itertools.combinations(shown, 2):
        found += trade_off(numbers, first, second)
    return found


def _factor_axis(numbers: Numbers, factor: int) -> Axis:
    of = numbers.job.study.vary[factor]
    unit = "times its own value" if of.relative else tables.pretty_unit(numbers.job.unit(of))
    is_log = of.distribution in ("log_uniform", "lognormal") or of.scale == "log"
    return Axis(of.name, (Conversion(unit),), log=is_log)


def _between_factors(numbers: Numbers, first: int, second: int) -> Panel:
    """Return one factor over another, with the failed samples of each case marked."""
    job = numbers.job
    x, y = (np.array(numbers.values[i], np.float64) for i in (first, second))
    failed: dict[str, NDArray[np.bool_]] = {}
    for group in groups(numbers):
        of = (numbers.rows.get((number, group.cell)) for number in range(numbers.count))
        is_failed = np.array([done is not None and done.status != "ok" for done in of]) & group.rows
        failed[group.case.name] = is_failed | failed.get(group.case.name, np.zeros_like(is_failed))
    whole = ~np.any(list(failed.values()), axis=0)
    lines = [_cloud(x[whole], y[whole], None, title="samples")]
    for case in cases(numbers):
        rows = failed[case.name]
        lines.append(_cloud(x[rows], y[rows], case, title=f"{case.title}: failed"))
    names = [job.study.vary[i].name for i in (first, second)]
    axes = [_factor_axis(numbers, i) for i in (first, second)]
    return Panel(f"{names[1]} over {names[0]}", "", axes[0], axes[1], tuple(filter(None, lines)), kind="curve")


def _cloud(x: Array, y: Array, case: Case | None, *, title: str | None = None) -> Line | None:
    known = np.flatnonzero(np.isfinite(y))
    if not known.size:
        return None
    rows = known[:: -(-known.size // MOST_POINTS)]
    rows = rows[np.argsort(x[rows], kind="stable")]
    name = title or ("" if case is None else case.title)
    return Line("run", name, x[rows], y[rows], case, marks=True, apart=True)


def _means(of: Array, values: Array, case: Case) -> Line | None:
    known = np.isfinite(values)
    if not known.any():
        return None
    x, at = np.unique(of[known], return_inverse=True)
    return Line("run", case.title, x, np.bincount(at, values[known]) / np.bincount(at), case, marks=True)


def trade_off(numbers: Numbers, first: int, second: int) -> list[Panel]:
    """Return one metric over another, with the Pareto front: the samples that no other sample beats in both."""
    job = numbers.job
    across, up = (job.plan.metrics[i] for i in (first, second))
    signs = [_better(numbers, i) for i in (first, second)]
    found = []
    for note, of_point in _at_points(numbers):
        lines: list[Line] = []
        everything = []
        for group in of_point:
            x, y = (group.of(numbers.of(metric, group.cell)) for metric in (first, second))
            known = np.isfinite(x) & np.isfinite(y)
            if known.any():
                everything.append(np.stack([x[known], y[known]], axis=1))
                lines += filter(None, [_cloud(x[known], y[known], group.case)])
        if not lines:
            continue
        front = pareto(np.concatenate(everything), signs)
        lines.append(Line("reference", "Pareto front", front[:, 0], front[:, 1]))
        title = f"{up.title} over {across.title}"
        found.append(Panel(title, note, metric_axis(across), metric_axis(up), tuple(lines), kind="curve"))
    return found


def _better(numbers: Numbers, index: int) -> float:
    """Return -1 if larger values of a metric are better, according to its requirement, otherwise 1."""
    limits = next((r for r in numbers.job.requirements if r.metric == index), None)
    return -1.0 if limits is not None and limits.max is None else 1.0


def pareto(points: Array, signs: Sequence[float]) -> Array:
    """Return the Pareto-optimal points (rows), sorted by the first coordinate.

    `signs` are 1 where smaller is better, -1 where larger is better.
    """
    costs = points * np.array(signs)
    order = np.lexsort((costs[:, 1], costs[:, 0]))
    best = math.inf
    rows = []
    for row in order:
        if costs[row, 1] < best:
            best = float(costs[row, 1])
            rows.append(row)
    return points[rows]


History: TypeAlias = tuple[Array, Sequence[Array | None]]
"""Times and columns of a run."""

Recorded: TypeAlias = Mapping[tuple[int, int], History]
"""Recorded runs, by sample number and cell index."""


def history_cases(numbers: Numbers, recorded: Recorded) -> dict[tuple[int, int], Case]:
    """Return a figure case for each recorded run, by case and sample number; its title contains the factor values."""
    found = {}
    for number, cell in sorted(recorded, key=lambda key: (key[1], key[0])):
        shown = [at for at, factor in enumerate(numbers.job.study.vary) if factor.distribution != "seed"]
        values = ", ".join(_setting(numbers, at, number) for at in shown)
        title = f"{numbers.job.place(cell)}, sample {number}: {values}"
        found[number, cell] = Case(f"run {number} {cell}", title, None)
    return found


def _setting(numbers: Numbers, factor: int, number: int) -> str:
    of, value = numbers.job.study.vary[factor], numbers.values[factor][number]
    if of.fmu is not None:
        return str(value)
    text = str(value) if isinstance(value, str | bool) else tables.significant(float(value), 4)
    unit = "times" if of.relative else tables.pretty_unit(numbers.job.unit(of))
    return f"{of.name} {text} {unit}".rstrip()


def histories(
    numbers: Numbers, columns: Sequence[int], recorded: Recorded, of_runs: Mapping[tuple[int, int], Case]
) -> Iterator[Panel]:
    """Return the panels of the recorded signals over time."""
    plan = numbers.job.plan
    for index in columns:
        column = plan.columns[index]
        lines = []
        for key, case in of_runs.items():
            times, values = recorded[key]
            signal = values[index]
            if signal is not None:
                lines.append(Line("run", case.title.partition(":")[0], times, signal, case))
        if lines:
            of = column.shown
            shown = Conversion(tables.pretty_unit(of.unit), of.factor, of.offset)
            title = column.description or column.name
            y = Axis(brief(column), (shown,))
            x = Axis("Time", (Conversion("s"),), range=(float(lines[0].x[0]), float(lines[0].x[-1])))
            yield Panel(f"{title} ({column.name})", "", x, y, tuple(lines))

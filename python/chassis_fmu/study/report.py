"""The page of a study."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from .. import _native
from ..files.describe import sha256
from ..files.plan import Metric
from ..report import index, rendering, tables, texts
from ..report.panels import Chart
from . import charts, design, search, statistics
from .charts import Recorded
from .file import Study
from .job import Done
from .statistics import Distribution, Effect, Numbers, Sensitivities, Share, Swing

# If a study has more metrics than this, its page has figures only for the metrics of interest (requirements, search),
# or for the first metrics if there are none of interest.
MOST_METRICS = 4

STATUS = {
    "rejected": "values that an FMU does not accept",
    "diverged": "a step failed, or a signal is not finite",
    "crashed": "the process that executed it ended",
    "timed_out": "a step took too long",
}


@dataclass(frozen=True)
class EffectTable:
    """Effects of the factors on a metric in a case."""

    title: str
    kind: str
    effects: Sequence[Effect]
    scale: float
    note: str = ""

    def place(self, value: float) -> float:
        """Return the place of a value on the bar, in percent."""
        if self.kind == "correlation":
            return 50.0 + 50.0 * value
        return max(0.0, min(100.0, 100.0 * value / self.scale)) if self.scale else 0.0


@dataclass(frozen=True)
class Tornado:
    """The change in a metric that each factor causes in a case."""

    title: str
    swings: Sequence[Swing]

    def bar(self, swing: Swing) -> tuple[float, float]:
        """Return both ends of the bar of a factor, in percent."""
        ends = [v for s in self.swings for v in (s.at_low, s.at_high)]
        low, span = min(ends), max(ends) - min(ends)
        first, second = sorted((swing.at_low, swing.at_high))
        return (100.0 * (first - low) / span, 100.0 * (second - low) / span) if span else (0.0, 0.0)


def _groups(numbers: Numbers, metric: int) -> Iterator[tuple[str, Distribution | None, int]]:
    """Return title, distribution of a metric and number of runs for each case, point and choice of FMUs."""
    for group in charts.groups(numbers):
        done = sum((number, group.cell) in numbers.rows for number in np.flatnonzero(group.rows))
        title = ", ".join((numbers.job.place(group.cell), *group.choice))
        yield title, Distribution.of(numbers.of(metric, group.cell)[group.rows]), done


def _wanted(numbers: Numbers) -> list[int]:
    """Return the metrics of interest: the metric of the search, and metrics with requirements."""
    job = numbers.job
    found = [r.metric for r in job.requirements]
    if job.study.search is not None:
        found.insert(0, [m.name for m in job.plan.metrics].index(job.study.search.metric))
    return list(dict.fromkeys(found))


def shown_metrics(numbers: Numbers) -> list[int]:
    """Return the metrics that have figures."""
    job = numbers.job
    chosen = _wanted(numbers) or job.metrics
    return chosen[:MOST_METRICS] if len(job.metrics) > MOST_METRICS else job.metrics


def _effect_tables(numbers: Numbers, metric: int) -> list[EffectTable]:
    job = numbers.job
    found = []
    shares = design.shares(job.study) if job.study.method == "sensitivity" else None
    for cell in range(len(job.cells)):
        title = job.place(cell)
        if shares is not None:
            of = statistics.sensitivities(job.study, shares, numbers.of(metric, cell))
            ends = [e.total_interval or e.interval or (0.0, 0.0) for e in of.effects]
            scale = max([1.0 if job.study.analysis == "sobol" else 0.0, *(end[1] for end in ends)])
            found.append(EffectTable(title, job.study.analysis or "", of.effects, scale, _left_out(job.study, of)))
        elif job.study.method == "sample":
            effects = statistics.effects(numbers, metric, cell)
            if effects:
                found.append(EffectTable(title, "correlation", effects, 1.0))
    return found


def _left_out(study: Study, of: Sensitivities) -> str:
    """Describe the samples that a sensitivity analysis leaves out."""
    if not of.missing:
        return ""
    some = ", ".join(map(str, of.missing[:10])) + (", …" if len(of.missing) > 10 else "")
    groups = "trajectories" if study.analysis == "morris" else "groups of samples"
    text = f"{len(of.missing)} samples have no value ({some}), so {of.left_out} of {of.groups} {groups} are left out"
    return f"{text}." if of.effects else f"{text}; too few are left for indices."


def _changes(numbers: Numbers, metric: int, drawings: rendering.Drawings) -> Iterator[dict[str, Any]]:
    """Return the changes against the baseline for requirements of a metric."""
    job = numbers.job
    for requirement in job.requirements:
        if requirement.metric != metric or not requirement.of_change:
            continue
        rows = []
        for cell, run in enumerate(job.cells):
            if run.case in requirement.cases:
                done = sum((n, cell) in numbers.rows for n in range(numbers.count))
                rows.append((job.place(cell), Distribution.of(numbers.changes(requirement, cell)), done))
        of_metric = job.plan.metrics[metric]
        panels = charts.changes(numbers, requirement)
        caption = "Change against the baseline of the case in the same sample. Dashed: the limits of the requirement."
        chart = Chart(f"{of_metric.name}_change", f"{of_metric.title}: change", "xy", caption, panels)
        yield {"rows": rows, "drawing": drawings.draw(chart) if panels else None}


def _charts(numbers: Numbers, metric: int) -> list[Chart]:
    of = numbers.job.plan.metrics[metric]
    name, title = of.name, of.title
    has_means = any(f.levels for f in numbers.job.study.vary)
    is_short = numbers.job.study.method == "sweep" and numbers.count < 20
    found = [
        Chart(
            f"{name}_distribution",
            f"{title}: distribution",
            "xy",
            "A curve that ends below 1 includes runs without a value.",
            [] if is_short else charts.distributions(numbers, metric),
        ),
        Chart(
            f"{name}_factors",
            f"{title} over the factors",
            "scatter",
            f"A point for each run{'; for factors with few values, means over all others' if has_means else ''}.",
            charts.over_factors(numbers, metric),
        ),
        Chart(
            f"{name}_map",
            f"{title} over two factors",
            "heat_map",
            "Means over all other factors. All cases have the same color scale.",
            charts.over_two_factors(numbers, metric),
        ),
    ]
    return [chart for chart in found if chart.panels]


def _scatter_matrix(numbers: Numbers, shown: Sequence[int]) -> Chart | None:
    panels = charts.matrix(numbers, shown)
    caption = (
        f"Every pair of factors and metrics, with a point for each run (at most {charts.MOST_POINTS} per case). "
        "Dashed, between metrics: the Pareto front, the runs of all cases that no other run beats in both metrics."
    )
    return Chart("scatter_matrix", "Scatter matrix", "scatter", caption, panels) if panels else None


def worst_first(numbers: Numbers, metric: int, cell: int) -> list[int]:
    """Return the samples of a cell, worst value of a metric first, according to the search or the requirement."""
    values = numbers.of(metric, cell)
    limits = next((r for r in numbers.job.requirements if r.metric == metric), None)
    sign = 1.0 if limits is not None and limits.max is None else -1.0
    wanted = numbers.job.study.search
    if wanted is not None and wanted.metric == numbers.job.plan.metrics[metric].name:
        # The extreme that the search looks for comes first.
        sign = -1.0 if wanted.direction == "maximize" else 1.0
    known = np.flatnonzero(np.isfinite(values))
    order = np.argsort(sign * values[known], kind="stable")
    return [int(n) for n in known[order]]


def _section(numbers: Numbers, metric: int, drawings: rendering.Drawings, is_shown: bool) -> dict[str, Any]:
    """Return the section of a metric, with figures and effects if `is_shown`."""
    job = numbers.job
    of = job.plan.metrics[metric]
    rows = list(_groups(numbers, metric))
    found: dict[str, Any] = {
        "metric": of,
        "number": lambda value: tables.number(value, of.digits),
        "rows": rows,
        "has_gaps": any(found is None or found.count < done for _, found, done in rows),
        "compared": [
            (job.plan.place(c.case, c.point), job.plan.place(c.against, None), c)
            for c in statistics.compared(numbers, metric)
        ],
        "changes": list(_changes(numbers, metric, drawings)),
    }
    cells = [(job.place(cell), cell) for cell in range(len(job.cells))]
    choices = [(title, statistics.choices(numbers, metric, cell)) for title, cell in cells]
    found["choices"] = [(title, of_cell) for title, of_cell in choices if of_cell]
    if is_shown:
        tornados = [Tornado(title, statistics.swings(numbers, metric, cell)) for title, cell in cells]
        found["tornados"] = [tornado for tornado in tornados if tornado.swings]
        found["effects"] = _effect_tables(numbers, metric)
        found["drawings"] = [drawings.draw(chart) for chart in _charts(numbers, metric)]
    return {"tornados": (), "effects": (), "drawings": (), **found}


def render(numbers: Numbers, recorded: Recorded, context: Mapping[str, Any], folder: Path) -> str:
    """Return the page, and write its figures beside it."""
    job = numbers.job
    shown = shown_metrics(numbers)
    drawings = rendering.Drawings(charts.cases(numbers), folder / "figures")
    metrics = dict.fromkeys([*_wanted(numbers), *job.metrics])
    sections = [_section(numbers, metric, drawings, metric in shown) for metric in metrics]
    matrix = _scatter_matrix(numbers, shown)
    history = None
    if recorded:
        of_runs = charts.history_cases(numbers, recorded)
        columns = list(dict.fromkeys(_columns(job.plan.metrics, series_metric(numbers))))
        panels = list(charts.histories(numbers, columns, recorded, of_runs))
        drawn_runs = " and some at random" if job.study.series is not None and job.study.series.random else ""
        caption = f"The runs whose signals were recorded: the worst ones{drawn_runs}."
        title, runs = "Signals of the chosen runs", list(of_runs.values())
        history = Chart("histories", title, "time", caption, panels, runs) if panels else None
    return rendering.render(
        "study.html.j2",
        study=job.study,
        name=job.name,
        plan=job.plan,
        paragraphs=rendering.paragraphs(job.study.description),
        count=numbers.count,
        cells=job.cells,
        rows=len(numbers.rows),
        failed=_failed(numbers),
        statuses=STATUS,
        shares=numbers.shares(),
        factors=[(f, f.text(tables.pretty_unit(job.unit(f)))) for f in job.study.vary],
        units={f.name: tables.pretty_unit(job.unit(f)) for f in job.study.vary},
        sections=sections,
        scatter_matrix=matrix and drawings.draw(matrix),
        history=history and drawings.draw(history),
        best=best(numbers),
        failure_text=lambda done: failure_text(numbers, done),
        percentiles=statistics.PERCENTILES if job.study.has_probability else (),
        percentages=[f">{p:g} %" for p in statistics.PERCENTILES] if job.study.has_probability else [],
        confidence=100 * statistics.CONFIDENCE,
        interactive=drawings.interactive,
        **context,
        hashes={path.stem: sha256(path) for path in job.fmu_files()},
        title_of=job.plan.place,
        definition=texts.definition,
        limits=lambda share: limits_text(numbers, share),
        unit=tables.pretty_unit,
        percent=percent,
        index=index_text,
        value=tables.scientific,
        end=lambda value: tables.scientific(value, 5),
        effect_title=EFFECTS.get,
    )


EFFECTS = {
    "correlation": "Rank correlation with the factors",
    "morris": "Elementary effects (Morris)",
    "sobol": "Share of the variance (Sobol): first-order and total index",
}


def index_text(value: float | None) -> str:
    """Format a sensitivity index or a correlation."""
    return "–" if value is None else tables.scientific(value, 3)


def percent(share: float) -> str:
    """Format a share in percent; 100 % and 0 % only if the share is exactly 1 or 0."""
    if math.isnan(share):
        return "–"
    text = f"{100.0 * share:.1f}"
    if text == "100.0" and share < 1.0:
        text = "99.9"
    if text == "0.0" and share > 0.0:
        text = "0.1"
    return f"{text} %"


def series_metric(numbers: Numbers) -> int:
    """Return the metric whose worst runs are recorded."""
    series = numbers.job.study.series
    names = [m.name for m in numbers.job.plan.metrics]
    named = None if series is None or series.metric is None else names.index(series.metric)
    return (_wanted(numbers) or numbers.job.metrics)[0] if named is None else named


def _columns(metrics: Sequence[Metric], at: int) -> list[int]:
    """Return the columns of the plan that a metric is computed from."""
    metric = metrics[at]
    if metric.uses:
        return [column for used in metric.uses for column in _columns(metrics, used)]
    return [*metric.columns, *([] if metric.minus is None else [metric.minus])]


def _failed(numbers: Numbers) -> list[tuple[str, list[Done]]]:
    found: dict[str, list[Done]] = {}
    for key in sorted(numbers.rows):
        done = numbers.rows[key]
        if done.status != "ok":
            found.setdefault(done.status, []).append(done)
    return [(status, found[status]) for status in STATUS if status in found]


@dataclass(frozen=True)
class Found:
    """Result of a search."""

    sample: int
    value: float
    values: Mapping[str, Any]
    failure: Done | None
    """The failed run that is the worst case, if any."""
    failed: int
    """Number of samples with a failed run."""


def best(numbers: Numbers) -> Found | None:
    """Return the result of the search; None without a search, or if nothing was found."""
    wanted = numbers.job.study.search
    if wanted is None:
        return None
    found = []
    for sample in range(numbers.count):
        rows = [numbers.rows[sample, c] for c in range(len(numbers.job.cells)) if (sample, c) in numbers.rows]
        value = search.objective(numbers.job, wanted, rows)
        if value is not None:
            found.append((value, sample))
    if not found:
        return None
    value, sample = (max if wanted.direction == "maximize" else min)(found, key=lambda pair: pair[0])
    failure = None
    if math.isinf(value):
        cells = (c for c, run in enumerate(numbers.job.cells) if wanted.case in (None, run.case))
        failure = next(numbers.rows[sample, c] for c in cells if numbers.rows[sample, c].status != "ok")
    return Found(sample, value, numbers.sample(sample), failure, sum(math.isinf(v) for v, _ in found))


def failure_text(numbers: Numbers, done: Done) -> str:
    """Describe a failed run."""
    at = "" if done.time is None else f" at {done.time:g} s"
    return f"{numbers.job.place(done.cell)}: {done.status.replace('_', ' ')}{at}: {done.message}"


def write(numbers: Numbers, recorded: Recorded, context: Mapping[str, Any], folder: Path) -> None:
    """Write the page of a study and the list of all results; `context` has its command, engine and files."""
    shares = numbers.shares()
    counts = {"passed": sum(s.holds for s in shares), "failed": sum(not s.holds for s in shares)}
    study = numbers.job.study
    entry = index.Entry(study.title, study.reference, {k: v for k, v in counts.items() if v})
    index.write(folder, render(numbers, recorded, context, folder), entry)


def console(numbers: Numbers) -> str:
    """Return the text for the terminal: values of the metrics, sensitivities, requirements, failed runs."""
    job = numbers.job
    # If the values are chosen, not drawn, percentiles would only describe the choice.
    picked = (0, 2, 4) if job.study.has_probability else ()
    named = [f"{statistics.PERCENTILES[i]:g} %" for i in picked]
    header = ["Metric", "Case", "runs", "mean", *named, "min", "max"]
    rows = []
    notes = []
    for metric in job.metrics:
        of = job.plan.metrics[metric]
        for title, found, _ in _groups(numbers, metric):
            shown = ["–"] * (3 + len(picked))
            if found is not None:
                values = (found.mean, *(found.percentiles[i] for i in picked), found.min, found.max)
                shown = [tables.number(value, of.digits) for value in values]
            count = "0" if found is None else str(found.count)
            rows.append([tables.with_unit(of.title, of.unit), title, count, *shown])
        at = job.metrics.index(metric)
        undefined = sum(done.status == "ok" and done.numbers[at] is None for done in numbers.rows.values())
        if undefined:
            notes.append(
                f"{of.title}: undefined in {undefined} of {len(numbers.rows)} runs, which fail all its requirements"
            )
    parts = [tables.text(header, rows, 2, "simple"), *notes]
    if job.study.method == "sensitivity":
        parts += _console_effects(numbers)
    verdicts = [_verdict(numbers, share) for share in numbers.shares()]
    if verdicts:
        parts.append("\nRequirements\n" + "\n".join(verdicts))
    found_best = best(numbers)
    if found_best is not None:
        parts.append(f"\n{_found(numbers, found_best)}")
    failed = {status: len(rows) for status, rows in _failed(numbers)}
    if failed:
        words = ", ".join(f"{count} {status.replace('_', ' ')}" for status, count in failed.items())
        parts.append(f"\n{sum(failed.values())} of {len(numbers.rows)} runs failed: {words}")
    return "\n".join(parts)


def _found(numbers: Numbers, best: Found) -> str:
    job = numbers.job
    units = {factor.name: tables.pretty_unit(job.unit(factor)) for factor in job.study.vary}
    texts = {name: f"{v:g}" if isinstance(v, float) else str(v) for name, v in best.values.items()}
    at = ", ".join(f"{name} {text} {units[name]}".rstrip() for name, text in texts.items())
    if best.failure is not None:
        what = f"a run that fails ({failure_text(numbers, best.failure)})"
    else:
        wanted = job.study.search.metric if job.study.search else ""
        metric = next(m for m in job.plan.metrics if m.name == wanted)
        what = f"{metric.title} {best.value:g} {tables.pretty_unit(metric.unit)}".rstrip()
    return f"Found in sample {best.sample}: {what} at {at}"


def _console_effects(numbers: Numbers) -> Iterator[str]:
    """Return the sensitivities of the metrics that have figures, as tables for the terminal."""

    def ends(interval: tuple[float, float] | None) -> str:
        return "–" if interval is None else f"{index_text(interval[0])} to {index_text(interval[1])}"

    of_interval = f"{100 * statistics.CONFIDENCE:g} % interval"
    for metric in shown_metrics(numbers):
        for table in _effect_tables(numbers, metric):
            if table.kind == "sobol":
                header = ["Factor", "first order", of_interval, "total", of_interval]
                rows = [
                    [e.factor, index_text(e.value), ends(e.interval), index_text(e.total), ends(e.total_interval)]
                    for e in table.effects
                ]
            else:
                header = ["Factor", "µ*", of_interval, "σ"]  # noqa: RUF001, the deviation
                rows = [[e.factor, index_text(e.value), ends(e.interval), index_text(e.sigma)] for e in table.effects]
            yield f"\n{numbers.job.plan.metrics[metric].title}, {table.title}: {EFFECTS[table.kind]}"
            if rows:
                yield tables.text(header, rows, 1, "simple").rstrip()
            if table.note:
                yield table.note


def limits_text(numbers: Numbers, share: Share) -> str:
    """Format the limits of a requirement."""
    limits = share.limits
    if limits.of_change:
        return f"change of {_native.limits(limits.min, limits.max, '%')}"
    metric = numbers.job.plan.metrics[limits.metric]
    return _native.limits(limits.min, limits.max, tables.pretty_unit(metric.unit))


def _verdict(numbers: Numbers, share: Share) -> str:
    metric = numbers.job.plan.metrics[share.limits.metric]
    limits = limits_text(numbers, share)
    limits = f"a {limits}" if share.limits.of_change else limits
    place = f"{metric.title}, {numbers.job.plan.place(share.case, share.point)}"
    # If the values are chosen, not drawn, the share is exact and needs no confidence interval.
    interval = ""
    if numbers.job.study.has_probability:
        low, high = share.interval
        interval = f" ({100 * statistics.CONFIDENCE:g} % interval {percent(low)} to {percent(high)})"
    return (
        f"{'Passed' if share.holds else 'Failed'}  {place}: {limits} in {percent(share.share)} of the runs"
        f"{interval}, required {percent(share.limits.share)}"
    )

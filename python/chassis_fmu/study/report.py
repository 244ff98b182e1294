"""The page of a study. Its text takes every number from the rows."""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import jinja2
import numpy as np

from .. import index, page, page_data, plots, results, tables
from ..charts import Chart, figure
from ..describe import sha256
from ..plan import Metric
from . import charts, design, search, statistics
from .charts import Recorded
from .job import Done
from .statistics import Compared, Distribution, Effect, Numbers, Share

# A study with more metrics than this shows figures of those with requirements, else of the first ones.
MOST_METRICS = 4

STATUS = {
    "rejected": "values that an FMU does not accept",
    "diverged": "a step failed, or a signal is not finite",
    "crashed": "the process that executed it ended",
    "timed_out": "a step took too long",
}


@dataclass(frozen=True)
class Context:
    """How the study was executed, for whoever repeats it."""

    command: str
    engine: str
    versions: Sequence[tuple[str, str]]
    files: Sequence[str] = ()


@dataclass(frozen=True)
class EffectTable:
    """Effects of the factors on a metric in a case."""

    title: str
    kind: str
    effects: Sequence[Effect]
    scale: float

    def place(self, value: float) -> float:
        """Return the place of a value on the bar, in percent."""
        if self.kind == "correlation":
            return 50.0 + 50.0 * value
        return max(0.0, min(100.0, 100.0 * value / self.scale)) if self.scale else 0.0


@dataclass(frozen=True)
class Section:
    """What is said of a metric."""

    metric: Metric
    rows: Sequence[tuple[str, Distribution | None, int]]
    compared: Sequence[tuple[str, str, Compared]]
    effects: Sequence[EffectTable]
    drawings: Sequence[tuple[Chart, Any]]

    @property
    def has_gaps(self) -> bool:
        """Tell whether a run has no number."""
        return any(found is None or found.count < done for _, found, done in self.rows)


def shown_metrics(numbers: Numbers) -> list[int]:
    """Return the metrics that have figures."""
    job = numbers.job
    required = [r.metric for r in job.requirements]
    if job.study.search is not None:
        required.insert(0, [m.name for m in job.plan.metrics].index(job.study.search.metric))
    chosen = list(dict.fromkeys(required)) or job.metrics
    return chosen[:MOST_METRICS] if len(job.metrics) > MOST_METRICS else job.metrics


def _titles(numbers: Numbers, case: str, point: str | None) -> str:
    plan = numbers.job.plan
    title = next(c.title for c in plan.cases if c.name == case)
    at = next((p.title for p in plan.points if p.name == point), None)
    return title if at is None else f"{title}, {at}"


def _effect_tables(numbers: Numbers, metric: int) -> list[EffectTable]:
    job = numbers.job
    found = []
    shares = design.shares(job.study) if job.study.method == "sensitivity" else None
    for cell, run in enumerate(job.cells):
        title = _titles(numbers, run.case, run.point)
        if shares is not None:
            effects = statistics.sensitivities(job.study, shares, numbers.of(metric, cell))
            if effects:
                ends = [e.total_interval or e.interval or (0.0, 0.0) for e in effects]
                scale = max([1.0 if job.study.analysis == "sobol" else 0.0, *(end[1] for end in ends)])
                found.append(EffectTable(title, job.study.analysis or "", effects, scale))
        elif job.study.method == "sample":
            effects = statistics.effects(numbers, metric, cell)
            if effects:
                found.append(EffectTable(title, "correlation", effects, 1.0))
    return found


def _charts(numbers: Numbers, metric: int) -> list[Chart]:
    cases = numbers.job.plan.cases
    name = numbers.job.plan.metrics[metric].name
    title = numbers.job.plan.metrics[metric].title
    found = []
    if not (numbers.job.study.method == "sweep" and numbers.count < 20):
        found.append(
            Chart(
                figure(f"{name}_distribution", f"{title}: distribution", "xy", cases),
                "How large it is in how many runs. A curve that ends below 1: the other runs have no number.",
                charts.distributions(numbers, metric),
            )
        )
    has_means = any(f.levels for f in numbers.job.study.vary)
    found.append(
        Chart(
            figure(f"{name}_factors", f"{title} over what varies", "scatter", cases),
            "A point for each run"
            + ("; where a factor has few values, the means over all others." if has_means else "."),
            charts.over_factors(numbers, metric),
        )
    )
    return [chart for chart in found if chart.panels]


def _scatter_matrix(numbers: Numbers, shown: Sequence[int]) -> Chart | None:
    panels = [p for first, second in itertools.combinations(shown, 2) for p in charts.trade_off(numbers, first, second)]
    own = figure("scatter_matrix", "Metrics over each other", "scatter", numbers.job.plan.cases)
    caption = "A point for each run. Dashed: the Pareto front, the runs of all cases than which none is better in both."
    return Chart(own, caption, panels) if panels else None


def worst_first(numbers: Numbers, metric: int, cell: int) -> list[int]:
    """Return the samples of a cell, the worst number of a metric first: what is worst the requirement says."""
    values = numbers.of(metric, cell)
    limits = next((r for r in numbers.job.requirements if r.metric == metric), None)
    sign = 1.0 if limits is not None and limits.max is None else -1.0
    known = np.flatnonzero(np.isfinite(values))
    order = np.argsort(sign * values[known], kind="stable")
    return [int(n) for n in known[order]]


def render(numbers: Numbers, recorded: Recorded, context: Context, folder: Path) -> str:
    """Return the page, and write its figures beside it."""
    job = numbers.job
    shown = shown_metrics(numbers)
    drawn: list[tuple[str, Sequence[Any]]] = []

    def drawing(chart: Chart) -> tuple[Chart, Any]:
        made = plots.draw(job.plan, chart.figure, chart.panels)
        made.write(folder / "figures")
        drawn.append((chart.figure.name, chart.panels))
        return chart, page.inline_svg(made)

    sections = []
    for metric in job.metrics:
        rows = []
        for cell, run in enumerate(job.cells):
            values = numbers.of(metric, cell)
            done = sum((n, cell) in numbers.rows for n in range(numbers.count))
            rows.append((_titles(numbers, run.case, run.point), Distribution.of(values), done))
        pairs = [
            (_titles(numbers, c.case, c.point), _titles(numbers, c.against, None), c)
            for c in statistics.compared(numbers, metric)
        ]
        is_shown = metric in shown
        sections.append(
            Section(
                job.plan.metrics[metric],
                rows,
                pairs,
                _effect_tables(numbers, metric) if is_shown else (),
                [drawing(c) for c in _charts(numbers, metric)] if is_shown else (),
            )
        )
    matrix = _scatter_matrix(numbers, shown)
    history = None
    if recorded:
        columns = history_columns(numbers)
        panels = list(charts.histories(numbers, columns, recorded))
        own = figure("histories", "Signals of the chosen runs", "time", job.plan.cases)
        history = Chart(own, "The runs whose signals were recorded: the worst ones, and some at random.", panels)
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(Path(__file__).parents[1]),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
    )
    matrix_drawing = None if matrix is None else drawing(matrix)
    history_drawing = None if history is None or not history.panels else drawing(history)
    return environment.get_template("study.html.j2").render(
        study=job.study,
        name=job.name,
        plan=job.plan,
        paragraphs=[" ".join(p.split()) for p in re.split(r"\n\s*\n", job.study.description) if p.strip()],
        count=numbers.count,
        cells=job.cells,
        rows=len(numbers.rows),
        failed=_failed(numbers),
        statuses=STATUS,
        shares=numbers.shares(),
        factors=[(f, f.text) for f in job.study.vary],
        sections=sections,
        scatter_matrix=matrix_drawing,
        history=history_drawing,
        best=best(numbers),
        percentiles=statistics.PERCENTILES,
        confidence=100 * statistics.CONFIDENCE,
        interactive=page_data.Interactive.of(page_data.render(job.plan.cases, [], drawn)),
        context=context,
        hashes={path.stem: sha256(path) for path in job.fmu_files()},
        title_of=lambda case, point: _titles(numbers, case, point),
        number=number,
        limit=tables.scientific,
        unit=tables.pretty_unit,
        percent=percent,
        index=lambda value: f"{value:.3g}".replace("-", "−"),
        effect_title=EFFECTS.get,
        is_search=job.study.is_adaptive,
    )


EFFECTS = {
    "correlation": "Rank correlation with what varies",
    "morris": "Mean magnitude of the elementary effects (Morris)",
    "sobol": "Share of the variance (Sobol): first-order and total index",
}


def number(value: float | None, metric: Metric) -> str:
    """Write a number of a metric."""
    return tables.number(value, metric.digits)


def percent(share: float) -> str:
    """Write a share in percent; 100 % and 0 % only if it is just that."""
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
    return shown_metrics(numbers)[0] if named is None else named


def history_columns(numbers: Numbers) -> list[int]:
    """Return the columns of the plan that this metric is made of."""
    return list(dict.fromkeys(_columns(numbers.job.plan.metrics, series_metric(numbers))))


def _columns(metrics: Sequence[Metric], at: int) -> list[int]:
    metric = metrics[at]
    if metric.uses:
        return [column for used in metric.uses for column in _columns(metrics, used)]
    return [*metric.columns, *([] if metric.minus is None else [metric.minus])]


def _failed(numbers: Numbers) -> list[tuple[str, list[Done]]]:
    """Return the rows of each status but ok."""
    found: dict[str, list[Done]] = {}
    for key in sorted(numbers.rows):
        done = numbers.rows[key]
        if done.status != "ok":
            found.setdefault(done.status, []).append(done)
    return [(status, found[status]) for status in STATUS if status in found]


def best(numbers: Numbers) -> tuple[int, float, Mapping[str, Any]] | None:
    """Return sample, metric and values of what a search has found; None without a search, or if nothing was found."""
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
    names = [f.name for f in numbers.job.study.vary]
    return sample, value, dict(zip(names, (column[sample] for column in numbers.values), strict=True))


def write(numbers: Numbers, recorded: Recorded, context: Context, folder: Path) -> None:
    """Write the page of a study and the list of all results."""
    results.write_text(folder / "index.html", render(numbers, recorded, context, folder))
    shares = numbers.shares()
    counts = {"passed": sum(s.holds for s in shares), "failed": sum(not s.holds for s in shares)}
    study = numbers.job.study
    index.note(folder, index.Entry(study.title, study.reference, {k: v for k, v in counts.items() if v}))
    index.write(folder.parent)


def console(numbers: Numbers) -> str:
    """Return what the terminal shows: numbers of the metrics, requirements, failed runs."""
    job = numbers.job
    header = ["Metric", "Case", "runs", "mean", "5 %", "50 %", "95 %", "min", "max"]
    rows = []
    for metric in job.metrics:
        of = job.plan.metrics[metric]
        for cell, run in enumerate(job.cells):
            found = Distribution.of(numbers.of(metric, cell))
            title = tables.with_unit(of.title, of.conversion.unit)
            if found is None:
                rows.append([title, _titles(numbers, run.case, run.point), "0", *["–"] * 6])
                continue
            picked = (
                found.mean,
                found.percentiles[0],
                found.percentiles[2],
                found.percentiles[4],
                found.min,
                found.max,
            )
            shown = [number(value, of) for value in picked]
            rows.append([title, _titles(numbers, run.case, run.point), str(found.count), *shown])
    parts = [tables.text(header, rows, 2, "simple")]
    verdicts = [_verdict(numbers, share) for share in numbers.shares()]
    if verdicts:
        parts.append("\nRequirements\n" + "\n".join(verdicts))
    found_best = best(numbers)
    if found_best is not None:
        sample, value, values = found_best
        words = ", ".join(f"{name} {v:g}" if isinstance(v, float) else f"{name} {v}" for name, v in values.items())
        parts.append(
            f"\nFound in sample {sample}: {job.study.search.metric if job.study.search else ''} {value:g} at {words}"
        )
    failed = {status: len(rows) for status, rows in _failed(numbers)}
    if failed:
        words = ", ".join(f"{count} {status.replace('_', ' ')}" for status, count in failed.items())
        parts.append(f"\n{sum(failed.values())} of {len(numbers.rows)} runs failed: {words}")
    return "\n".join(parts)


def _verdict(numbers: Numbers, share: Share) -> str:
    metric = numbers.job.plan.metrics[share.limits.metric]
    ends = [("at least", share.limits.min), ("at most", share.limits.max)]
    unit = "%" if share.limits.of_change else tables.pretty_unit(metric.conversion.unit)
    limits = " and ".join(f"{word} {tables.scientific(v)} {unit}".rstrip() for word, v in ends if v is not None)
    limits = f"a change of {limits}" if share.limits.of_change else limits
    low, high = share.interval
    place = f"{metric.title}, {_titles(numbers, share.case, share.point)}"
    return (
        f"{'Passed' if share.holds else 'Failed'}  {place}: {limits} in {percent(share.share)} of the runs "
        f"({percent(low)} to {percent(high)}), required {percent(share.limits.share)}"
    )

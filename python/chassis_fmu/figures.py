"""Panels and lines of the figures of a plan, as arrays. `plots` draws them, `page_data` embeds them in a page."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from . import metrics, tables
from .numbers import Row
from .plan import Case, Column, Conversion, Figure, Level, Plan, Run
from .results import Recording

# A line is drawn from at most this many pairs of extremes: finer than the width of a panel in points.
BUCKETS = 600

# Seeds whose runs a page contains one by one; more of them would make it large.
MOST_SEEDS = 12

# Pairs of extremes of a run other than that of the first seed, and instants at which its spread is taken.
FEW_BUCKETS = 200

Array = NDArray[np.floating[Any]]
Key = tuple[str, "str | None"]
"""Case and point."""

LineKind: TypeAlias = Literal["run", "mean", "paper", "reference"]
"""A run, the mean over the seeds, numbers of the paper, what the others are compared with."""


@dataclass(frozen=True)
class Axis:
    """An axis: its title and the units of measure it can be in, the one shown first."""

    title: str
    units: tuple[Conversion, ...]
    log: bool = False
    zero: bool = False
    """Whether zero is part of the picture, so that differences show in their true proportion."""
    range: tuple[float, float] | None = None


@dataclass(frozen=True)
class Line:
    """A line; the units of both coordinates are those that the first unit of the axis converts from."""

    kind: LineKind
    title: str
    x: Array
    y: Array
    case: Case | None = None
    seed: int | None = None
    spread: Array | None = None
    """Standard deviation over the seeds."""
    marks: bool = False
    steps: bool = False
    """Whether a value holds until the next one."""
    run: str | None = None
    """The run whose file has all samples, and its column."""
    signal: str | None = None


@dataclass(frozen=True)
class Panel:
    """One pair of axes."""

    title: str
    note: str
    x: Axis
    y: Axis
    lines: tuple[Line, ...]
    levels: tuple[Level, ...] = ()
    ticks: tuple[float, ...] = ()
    """Points of the abscissa that are marked one by one."""


# Frequencies (Hz) and densities by figure, column, case and point.
Spectra = dict[tuple[str, int, str, "str | None"], tuple[Array, Array]]


def decimate(times: Array, values: Array, buckets: int = BUCKETS) -> tuple[Array, Array]:
    """Reduce a line to the smallest and the largest value of each of `buckets` pieces, and both ends.

    The picture stays the same as long as a piece is narrower than the line, peaks included.
    """
    if len(values) <= 2 * buckets + 2:
        return times, values
    size = -(-len(values) // buckets)
    whole = len(values) // size * size
    pieces = values[:whole].reshape(-1, size)
    first = np.arange(len(pieces)) * size
    keep = np.concatenate(
        [
            [0, len(values) - 1],
            first + pieces.argmin(axis=1),
            first + pieces.argmax(axis=1),
            *([] if whole == len(values) else [[whole + values[whole:].argmin(), whole + values[whole:].argmax()]]),
        ]
    )
    keep = np.unique(keep)
    return times[keep], values[keep]


@dataclass
class _Seeds:
    """A signal over the seeds: lines of single runs, and values at common instants."""

    lines: dict[int, tuple[Array, Array]] = field(default_factory=dict)
    times: Array | None = None
    samples: list[Array] = field(default_factory=list)


class Recordings:
    """What the figures show of finished runs: the runs of the first seed whole, the others reduced."""

    def __init__(self, plan: Plan) -> None:
        self._plan = plan
        self._columns = {plan.columns[c].name for f in plan.figures for c in columns_of(plan, f)}
        self.first: dict[Key, Recording] = {}
        self._seeds: dict[tuple[str, int, str, str | None], _Seeds] = {}
        self._spectra: dict[tuple[str, int, str, str | None], list[tuple[Array, Array]]] = {}

    @property
    def columns(self) -> set[str]:
        """Names of the signals that the figures need."""
        return self._columns

    def add(self, run: Run, recording: Recording) -> None:
        """Take what the figures show of a run.

        Raises MetricError for a recording too short for a spectrum.
        """
        if run.seed == self._plan.seed_values[0]:
            kept = {n: v for n, v in recording.values.items() if n in self._columns}
            self.first[run.case, run.point] = Recording(recording.times, kept)
        for (name, column), spectrum in spectra_of(self._plan, run, recording).items():
            self._spectra.setdefault((name, column, run.case, run.point), []).append(spectrum)
        if run.seed is None or len(self._plan.seeds) < 2:
            return
        for figure in self._plan.figures:
            if figure.kind != "time" or run.case not in figure.cases:
                continue
            rows = metrics.window(recording.times, figure.window, self._plan.simulation.step)
            times = recording.times[rows]
            every = max(1, len(times) // FEW_BUCKETS)
            for index in figure.columns:
                values = recording.values.get(self._plan.columns[index].name)
                if values is None or not len(times):
                    continue
                seeds = self._seeds.setdefault((figure.name, index, run.case, run.point), _Seeds())
                if run.seed in self._plan.seeds[1:MOST_SEEDS]:
                    seeds.lines[run.seed] = decimate(times, values[rows], FEW_BUCKETS)
                seeds.times = times[::every]
                seeds.samples.append(values[rows][::every])

    @property
    def spectra(self) -> Spectra:
        """Mean spectra over the seeds."""
        return {key: (own[0][0], np.mean([d for _, d in own], axis=0)) for key, own in self._spectra.items()}

    def others(self, figure: Figure, column: int, case: Case, point: str | None) -> Iterator[Line]:
        """Lines of a signal besides that of the first seed: the mean with its spread, the other seeds."""
        seeds = self._seeds.get((figure.name, column, case.name, point))
        if seeds is None or seeds.times is None or len(seeds.samples) < 2:
            return
        samples = np.array(seeds.samples)
        title = f"{case.title}, mean of {len(samples)}"
        mean, spread = samples.mean(axis=0), samples.std(axis=0, ddof=1)
        yield Line("mean", title, seeds.times, mean, case, spread=spread)
        for seed, (times, values) in seeds.lines.items():
            stem = self._plan.run(case.name, point, seed).stem
            name = self._plan.columns[column].name
            yield Line("run", f"{case.title}, seed {seed}", times, values, case, seed, run=stem, signal=name)


def columns_of(plan: Plan, figure: Figure) -> set[int]:
    """Return the columns that a figure shows, or computes what it shows from."""
    running = figure.metrics if figure.kind == "running" else ()
    of_metrics = {c for m in running for c in plan.metrics[m].columns}
    return {*figure.columns, *([] if figure.against is None else [figure.against]), *of_metrics}


def label(column: Column) -> str:
    """Return the essence of a description: what stands before its first remark."""
    text = column.description
    for stop in (";", ":", " (", ". "):
        text = text.split(stop)[0]
    text = text.strip().rstrip(".")
    return text[:1].upper() + text[1:] if text else column.name


def axis_unit(unit: str) -> str:
    """Return a unit as the label of an axis, where a lone degree sign would be lost."""
    pretty = tables.pretty_unit(unit)
    return unit if pretty == "°" else pretty


def density_unit(unit: str) -> str:
    """Return the unit of a power spectral density."""
    pretty = axis_unit(unit)
    return f"({pretty})²/Hz" if pretty else "1/Hz"


def _shown(column: Column, figure: Figure) -> Conversion:
    """Return the unit a column is plotted in: the figure's, the display unit of the variable, its unit."""
    return figure.conversion or column.shown


def _units(column: Column, figure: Figure) -> tuple[Conversion, ...]:
    shown = _shown(column, figure)
    base = Conversion(column.unit or "")
    units = (shown,) if (shown.factor, shown.offset) == (1.0, 0.0) else (shown, base)
    return tuple(Conversion(axis_unit(u.unit), u.factor, u.offset) for u in units)


def _cases(plan: Plan, figure: Figure) -> list[Case]:
    return [c for c in plan.cases if c.name in figure.cases]


@dataclass(frozen=True)
class _Shown:
    """A run of a case that a figure shows, and the rows of its window."""

    case: Case
    run: Run
    recording: Recording
    rows: slice

    def line(self, kind: LineKind, title: str, column: Column) -> Line:
        """Return the line of a signal."""
        times, values = self.recording.times[self.rows], self.recording.values[column.name][self.rows]
        return Line(kind, title, times, values, self.case, self.run.seed, run=self.run.stem, signal=column.name)


def _time(plan: Plan, figure: Figure, recordings: Recordings) -> Iterator[Panel]:
    cases = _cases(plan, figure)
    titles: dict[str | None, str] = {None: "", **{p.name: p.title for p in plan.points}}
    beside = None if figure.against is None else plan.columns[figure.against]
    first = plan.seed_values[0]
    x = Axis("Time", (Conversion("s"),), range=figure.window or (plan.simulation.start, plan.simulation.stop))
    for index in figure.columns:
        column = plan.columns[index]
        # Side by side are the points, also where every case has panels of its own.
        for together in [[c] for c in cases] if figure.separate else [cases]:
            for point in plan.point_names:
                lines: list[Line] = []
                found = False
                for case in together:
                    recording = recordings.first.get((case.name, point))
                    if recording is None or column.name not in recording.values:
                        continue
                    found = True
                    rows = metrics.window(recording.times, figure.window, plan.simulation.step)
                    if rows.start >= rows.stop:
                        # A run stopped before the window.
                        continue
                    title = case.title if len(plan.seeds) < 2 else f"{case.title}, seed {first}"
                    shown = _Shown(case, plan.run(case.name, point, first), recording, rows)
                    lines.append(shown.line("run", title, column))
                    if beside is not None and beside.name in recording.values:
                        lines.append(shown.line("reference", label(beside), beside))
                    lines += recordings.others(figure, index, case, point)
                if found:
                    note = ", ".join(t for t in (together[0].title if figure.separate else "", titles[point]) if t)
                    y = Axis("", _units(column, figure))
                    yield Panel(label(column), note, x, y, tuple(lines), figure.levels)


def _spectrum(plan: Plan, figure: Figure, spectra: Spectra) -> Iterator[Panel]:
    titles: dict[str | None, str] = {None: "", **{p.name: p.title for p in plan.points}}
    x = Axis("Frequency", (Conversion("Hz"),), log=True)
    for index in figure.columns:
        column = plan.columns[index]
        y = Axis("", (Conversion(density_unit(_shown(column, figure).unit)),), log=True)
        for point in plan.point_names:
            lines = []
            for case in _cases(plan, figure):
                key = (figure.name, index, case.name, point)
                if key in spectra and np.any(spectra[key][1] > 0.0):
                    frequencies, densities = spectra[key]
                    # A logarithmic axis has no place for 0, the density of a constant.
                    positive = np.where(densities > 0.0, densities, np.nan)
                    lines.append(Line("run", case.title, frequencies, positive, case))
            if lines:
                yield Panel(label(column), titles[point], x, y, tuple(lines))


def spectra_of(plan: Plan, run: Run, recording: Recording) -> dict[tuple[str, int], tuple[Array, Array]]:
    """Return the spectra of a run that the figures show, by figure and column.

    Raises MetricError for a recording too short for a spectrum.
    """
    out = {}
    for figure in plan.figures:
        if figure.kind != "spectrum" or run.case not in figure.cases:
            continue
        rows = metrics.window(recording.times, figure.window, plan.simulation.step)
        for index in figure.columns:
            column = plan.columns[index]
            if column.name in recording.values:
                values = recording.values[column.name][rows] * _shown(column, figure).factor
                out[figure.name, index] = metrics.spectrum(recording.times[rows], values)
    return out


def _sweep(plan: Plan, figure: Figure, cells: Sequence[Row]) -> Iterator[Panel]:
    if plan.sweep is None:
        return
    points = sorted(plan.points, key=lambda p: p.value)
    x = Axis(plan.sweep.title, (Conversion(axis_unit(plan.sweep.unit)),))
    for index in figure.metrics:
        metric = plan.metrics[index]
        found = {(c.case, c.point): c for c in cells if c.metric is metric}
        lines = []
        for case in _cases(plan, figure):
            row = [(p.value, found[case.name, p.name]) for p in points]
            ours = [(value, c.ours) for value, c in row if c.ours is not None]
            if ours:
                values = np.array([s.mean for _, s in ours])
                spread = np.array([s.deviation or 0.0 for _, s in ours])
                places = np.array([value for value, _ in ours])
                has_spread = bool(spread.any())
                lines.append(
                    Line("run", case.title, places, values, case, spread=spread if has_spread else None, marks=True)
                )
            paper = [(value, c.paper) for value, c in row if c.paper is not None]
            if paper:
                values, places = np.array([v for _, v in paper]), np.array([value for value, _ in paper])
                lines.append(Line("paper", f"{case.title}, paper", places, values, case, marks=True))
        y = Axis("", (Conversion(axis_unit(metric.conversion.unit)),), zero=True)
        yield Panel(metric.title, "", x, y, tuple(lines), ticks=tuple(p.value for p in points))


def _running(plan: Plan, figure: Figure, recordings: Mapping[Key, Recording]) -> Iterator[Panel]:
    titles: dict[str | None, str] = {None: "", **{p.name: p.title for p in plan.points}}
    for index in figure.metrics:
        metric = plan.metrics[index]
        for point in plan.point_names:
            lines = []
            for case in _cases(plan, figure):
                recording = recordings.get((case.name, point))
                line = None if recording is None else metrics.running(metric, plan, recording)
                if line is not None:
                    lines.append(Line("run", case.title, *line, case))
            if lines:
                x = Axis("Time", (Conversion("s"),), range=(float(lines[0].x[0]), float(lines[0].x[-1])))
                y = Axis("", (Conversion(axis_unit(metric.conversion.unit)),), zero=True)
                yield Panel(metric.title, titles[point], x, y, tuple(lines))


def panels(plan: Plan, figure: Figure, recordings: Recordings, cells: Sequence[Row]) -> list[Panel]:
    """Return the panels of a figure of the plan; none if there is nothing to draw. `cells` is the table of metrics."""
    if figure.kind == "time":
        return list(_time(plan, figure, recordings))
    if figure.kind == "spectrum":
        return list(_spectrum(plan, figure, recordings.spectra))
    if figure.kind == "running":
        return list(_running(plan, figure, recordings.first))
    return list(_sweep(plan, figure, cells))

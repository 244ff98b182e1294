"""The panels of the figures of a plan."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import TypeAlias

import numpy as np

from ..evaluation import metrics
from ..evaluation.results_table import Numbers
from ..files.plan import Case, Cell, Column, Conversion, Figure, Metric, Plan, Run
from ..files.results import Recording
from . import tables
from .panels import Array, Axis, Line, LineKind, Panel, PanelKind, decimate, heat_maps

# A page contains the single runs of at most this many seeds, and states the number. With more, it would exceed 1 MB.
MOST_SEEDS = 48

# Resolution for all seeds after the first: number of pairs of extremes in a line, and of instants at which the spread
# is computed.
FEW_BUCKETS = 200

# Up to this many seeds, each line has FEW_BUCKETS pairs; with more seeds, the total stays the same.
FEW_SEEDS = 12

# Number of characters that fit in a title beside an axis.
MOST_LETTERS = 40

# Free space above and below lines that share a scale, as a share of its range.
ROOM = 0.08

Key = tuple[str, "str | None"]
"""Case and point."""

Place = tuple[str, int, str, "str | None"]
"""Figure, column, case and point."""

Estimate: TypeAlias = "Array | tuple[Array, Array]"
"""Rows of `metrics.cross`, or frequencies (Hz) and densities of a spectrum."""


@dataclass
class _Seeds:
    """A signal over the seeds: lines of single runs, and values at common instants."""

    lines: dict[int, tuple[Array, Array]] = field(default_factory=dict)
    times: Array | None = None
    samples: list[Array] = field(default_factory=list)


class Recordings:
    """Recorded signals that the figures show: all samples for the first seed, fewer for the other seeds."""

    def __init__(self, plan: Plan) -> None:
        self._plan = plan
        self.columns = {plan.columns[c].name for f in plan.figures for c in columns_of(plan, f)}
        self.first: dict[Key, Recording] = {}
        self._seeds: dict[Place, _Seeds] = {}
        self._estimates: dict[Place, list[Estimate]] = {}

    def add(self, run: Run, recording: Recording) -> None:
        """Add a run.

        Raises MetricError for a recording too short for a spectrum.
        """
        if run.seed == self._plan.seed_values[0]:
            kept = {n: v for n, v in recording.values.items() if n in self.columns}
            self.first[run.case, run.point] = Recording(recording.times, kept)
        for (name, column), estimate in estimates_of(self._plan, run, recording).items():
            self._estimates.setdefault((name, column, run.case, run.point), []).append(estimate)
        if run.seed is None or len(self._plan.seeds) < 2:
            return
        for figure, of_window in _windows(self._plan, ("time",), run, recording):
            times = recording.times[of_window]
            every = max(1, len(times) // FEW_BUCKETS)
            for index in figure.columns:
                values = recording.values.get(self._plan.columns[index].name)
                if values is None or not len(times):
                    continue
                seeds = self._seeds.setdefault((figure.name, index, run.case, run.point), _Seeds())
                if run.seed in self._plan.seeds[1:MOST_SEEDS]:
                    buckets = FEW_BUCKETS * FEW_SEEDS // max(FEW_SEEDS, min(len(self._plan.seeds), MOST_SEEDS))
                    seeds.lines[run.seed] = decimate(times, values[of_window], buckets)
                seeds.times = times[::every]
                seeds.samples.append(values[of_window][::every])

    def spectrum(self, key: Place) -> tuple[Array, Array] | None:
        """Return frequencies (Hz) and densities, which are means over the seeds."""
        own = self._estimates.get(key)
        return None if own is None else (own[0][0], np.mean([densities for _, densities in own], axis=0))

    def transfer(self, key: Place) -> tuple[Array, Array, Array, Array] | None:
        """Return frequencies (Hz), gain, phase (rad) and coherence, estimated from all seeds."""
        own = self._estimates.get(key)
        if own is None:
            return None
        mean = np.mean(own, axis=0)
        return (mean[0], *metrics.transfer(mean))

    def shown(self, figure: Figure, cases: Sequence[Case], point: str | None, *names: str) -> Iterator[_Shown]:
        """Return the runs of the first seed that have all signals in `names` and a row in the window of a figure."""
        for case in cases:
            recording = self.first.get((case.name, point))
            if recording is not None and recording.values.keys() >= set(names):
                rows = metrics.window(recording.times, figure.window, self._plan.simulation.step)
                if rows.start < rows.stop:
                    run = self._plan.run(case.name, point, self._plan.seed_values[0])
                    yield _Shown(case, run, recording, rows)

    def others(self, figure: Figure, column: int, case: Case, point: str | None) -> Iterator[Line]:
        """Lines of a signal beyond the first seed: the mean with its spread, and the other seeds."""
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


def _windows(plan: Plan, kinds: Sequence[str], run: Run, recording: Recording) -> Iterator[tuple[Figure, slice]]:
    """Return the figures of some kinds that show a run, and the rows of their windows."""
    for figure in plan.figures:
        if figure.kind in kinds and run.case in figure.cases:
            yield figure, metrics.window(recording.times, figure.window, plan.simulation.step)


def columns_of(plan: Plan, figure: Figure) -> set[int]:
    """Return the columns that a figure needs, for signals or metrics."""
    running = figure.metrics if figure.kind == "running" else ()
    of_metrics = {c for m in running for c in metrics.columns_of(plan.metrics[m])}
    over = figure.over if figure.kind in ("xy", "transfer") else None
    beside = (c for c in (figure.against, figure.right, over) if c is not None)
    return {*figure.columns, *beside, *of_metrics}


def label(column: Column) -> str:
    """Return the description up to its first remark, with a note if the values come from the input file."""
    return _marked(column, _essence(column))


def _marked(column: Column, text: str) -> str:
    return f"{text} (input file)" if column.from_file else text


def _essence(column: Column) -> str:
    text = column.description
    for stop in (";", ":", " (", ". "):
        text = text.split(stop)[0]
    text = text.strip().rstrip(".")
    return text[:1].upper() + text[1:] if text else column.name


def brief(column: Column) -> str:
    """Return a description that fits beside an axis: without the sign convention, or only the signal name."""
    text = _essence(column).split(", positive")[0]
    return _marked(column, text if len(text) <= MOST_LETTERS else column.name)


def density_unit(unit: str) -> str:
    """Return the unit of a power spectral density."""
    pretty = tables.pretty_unit(unit)
    return f"({pretty})²/Hz" if pretty else "1/Hz"


def _shown(column: Column, figure: Figure) -> Conversion:
    """Return the unit that a column is plotted in: the figure's unit, or the display unit or unit of the variable."""
    return column.shown if figure.unit is None else Conversion(figure.unit, figure.factor, figure.offset)


def _units(column: Column, figure: Figure | None) -> tuple[Conversion, ...]:
    """Return the units that can be chosen for a column, the default first; `figure` may replace the display unit."""
    shown = column.shown if figure is None else _shown(column, figure)
    base = Conversion(column.unit or "")
    units = (shown,) if (shown.factor, shown.offset) == (1.0, 0.0) else (shown, base)
    return tuple(Conversion(tables.pretty_unit(u.unit), u.factor, u.offset) for u in units)


def _cases(plan: Plan, figure: Figure) -> list[Case]:
    return [c for c in plan.cases if c.name in figure.cases]


@dataclass(frozen=True)
class _Shown:
    """A run that a figure shows, and the rows of its window."""

    case: Case
    run: Run
    recording: Recording
    rows: slice

    def line(self, kind: LineKind, title: str, column: Column, *, right: bool = False) -> Line:
        times, values = self.recording.times[self.rows], self.recording.values[column.name][self.rows]
        stem, name = self.run.stem, column.name
        return Line(kind, title, times, values, self.case, self.run.seed, run=stem, signal=name, right=right)


def _at_points(plan: Plan, indices: Sequence[int]) -> Iterator[tuple[int, str | None, str]]:
    """Return each index at each point, with the title of the point."""
    for index, point in itertools.product(indices, plan.point_names):
        yield index, point, plan.point_titles[point]


def _title_of(plan: Plan, case: Case) -> str:
    """Return the title of the run of the first seed."""
    return case.title if len(plan.seeds) < 2 else f"{case.title}, seed {plan.seed_values[0]}"


def _time(plan: Plan, figure: Figure, recordings: Recordings) -> Iterator[Panel]:
    cases = _cases(plan, figure)
    titles = plan.point_titles
    beside = [
        (plan.columns[index], is_right)
        for index, is_right in ((figure.against, False), (figure.right, True))
        if index is not None
    ]
    right = None
    if figure.right is not None:
        column = plan.columns[figure.right]
        right = Axis(brief(column), _units(column, None))
    x = Axis("Time", (Conversion("s"),), range=figure.window or (plan.simulation.start, plan.simulation.stop))
    for index in figure.columns:
        column = plan.columns[index]
        # Levels are in the unit of the figure, or of its first signal. Panels with other units do not show them.
        of_levels = _units(plan.columns[figure.columns[0]], figure)[0]
        levels = figure.levels if _units(column, figure)[0] == of_levels else ()
        # The panels of the points of a sweep are side by side, even if every case has separate panels.
        for together in [[c] for c in cases] if figure.separate else [cases]:
            for point in plan.point_names:
                lines: list[Line] = []
                for shown in recordings.shown(figure, together, point, column.name):
                    lines.append(shown.line("run", _title_of(plan, shown.case), column))
                    for other, is_right in beside:
                        if other.name in shown.recording.values:
                            title = brief(other) if is_right else label(other)
                            lines.append(shown.line("reference", title, other, right=is_right))
                    lines += recordings.others(figure, index, shown.case, point)
                recorded = (recordings.first.get((case.name, point)) for case in together)
                # The panel of a run that stopped before the window is empty.
                if any(found is not None and column.name in found.values for found in recorded):
                    note = ", ".join(t for t in (together[0].title if figure.separate else "", titles[point]) if t)
                    y = Axis(brief(column), _units(column, figure))
                    yield Panel(label(column), note, x, y, tuple(lines), levels, right=right)


def _xy(plan: Plan, figure: Figure, recordings: Recordings) -> Iterator[Panel]:
    if figure.over is None:
        return
    over = plan.columns[figure.over]
    # Equal axes need the same unit.
    x = Axis(brief(over), _units(over, figure if figure.equal_axes else None))
    kind: PanelKind = "map" if figure.equal_axes else "curve"
    for index, point, note in _at_points(plan, figure.columns):
        column = plan.columns[index]
        y = Axis(brief(column), _units(column, figure))
        lines = []
        for shown in recordings.shown(figure, _cases(plan, figure), point, column.name, over.name):
            across, up = (shown.recording.values[name][shown.rows] for name in (over.name, column.name))
            times = shown.recording.times[shown.rows]
            line = Line("run", _title_of(plan, shown.case), across, up, shown.case, t=times)
            lines.append(replace(line, run=shown.run.stem, signal=column.name, over=over.name))
        if lines:
            title = f"{brief(column)} over {_in_sentence(brief(over))}"
            yield Panel(title, note, x, y, tuple(lines), kind=kind)


def _in_sentence(title: str) -> str:
    """Return a title for use within a sentence: lowercase, except for abbreviations."""
    return title if title[1:2].isupper() or "." in title else title[:1].lower() + title[1:]


def _transfer(plan: Plan, figure: Figure, recordings: Recordings) -> Iterator[Panel]:
    if figure.over is None:
        return
    over = plan.columns[figure.over]
    for index, point, note in _at_points(plan, figure.columns):
        column = plan.columns[index]
        per, unit = (tables.pretty_unit(u.unit) or "1" for u in (over.shown, _shown(column, figure)))
        ratio = f"({unit})/({per})" if "/" in unit + per else f"{unit}/{per}"
        name = f"{brief(column)} per {_in_sentence(brief(over))}"
        found = [(c, recordings.transfer((figure.name, index, c.name, point))) for c in _cases(plan, figure)]
        estimates = [(case, estimate) for case, estimate in found if estimate is not None]
        if not estimates:
            continue
        frequencies = estimates[0][1][0]
        band = figure.band or (float(frequencies[0]), float(frequencies[-1]))
        x = Axis("Frequency", (Conversion("Hz"),), log=True, range=band)
        parts = (
            ("gain", Axis("Gain", (Conversion("" if ratio == "1/1" else ratio),), log=True)),
            ("phase", Axis("Phase", (Conversion("°"),))),
            ("coherence", Axis("Coherence", (Conversion(""),), range=(0.0, 1.0))),
        )
        for part, (word, y) in enumerate(parts):
            lines = []
            for case, estimate in estimates:
                kept = (estimate[0] >= band[0]) & (estimate[0] <= band[1])
                values = np.degrees(estimate[2]) if word == "phase" else estimate[1 + part]
                # The estimate is undefined at frequencies without input power, and a logarithmic axis needs positive
                # values.
                known = np.isfinite(values) & ((values > 0.0) | (not y.log))
                lines.append(Line("run", case.title, estimate[0][kept], np.where(known, values, np.nan)[kept], case))
            yield Panel(f"{name}: {word}", note, x, y, tuple(lines))


def _spectrum(plan: Plan, figure: Figure, recordings: Recordings) -> Iterator[Panel]:
    x = Axis("Frequency", (Conversion("Hz"),), log=True, range=figure.band)
    for index, point, note in _at_points(plan, figure.columns):
        column = plan.columns[index]
        unit = Conversion(density_unit(_shown(column, figure).unit))
        y = Axis(f"Density of {_in_sentence(brief(column))}", (unit,), log=True)
        lines = []
        for case in _cases(plan, figure):
            spectrum = recordings.spectrum((figure.name, index, case.name, point))
            if spectrum is not None and np.any(spectrum[1] > 0.0):
                # A logarithmic axis cannot show 0, the density of a constant.
                positive = np.where(spectrum[1] > 0.0, spectrum[1], np.nan)
                lines.append(Line("run", case.title, spectrum[0], positive, case))
        if lines:
            yield Panel(label(column), note, x, y, tuple(lines))


def estimates_of(plan: Plan, run: Run, recording: Recording) -> dict[tuple[str, int], Estimate]:
    """Return the spectra that the figures show for a run, and the cross spectra for their transfer functions.

    They are by figure and column. Raises MetricError for a recording too short for a spectrum.
    """
    out: dict[tuple[str, int], Estimate] = {}
    for figure, rows in _windows(plan, ("spectrum", "transfer"), run, recording):
        over = plan.columns[figure.over] if figure.kind == "transfer" and figure.over is not None else None
        for column, index in ((plan.columns[index], index) for index in figure.columns):
            if not recording.values.keys() >= {column.name, (over or column).name}:
                continue
            times, values = recording.times[rows], recording.values[column.name][rows] * _shown(column, figure).factor
            if over is None:
                out[figure.name, index] = metrics.spectrum(times, values)
            else:
                given = recording.values[over.name][rows] * over.shown.factor
                out[figure.name, index] = metrics.cross(times, given, values)
    return out


def metric_axis(metric: Metric, *, zero: bool = False) -> Axis:
    """Return the axis of a metric."""
    return Axis(metric.title, (Conversion(tables.pretty_unit(metric.unit)),), zero=zero)


def _distribution(plan: Plan, figure: Figure, numbers: Numbers) -> Iterator[Panel]:
    y = Axis("Share of the runs", (Conversion(""),), range=(0.0, 1.0))
    for index, point, note in _at_points(plan, figure.metrics):
        metric = plan.metrics[index]
        lines = []
        for case in _cases(plan, figure):
            values = np.sort(np.array(list(numbers.by_seed(Cell(index, case.name, point)).values())))
            if values.size:
                share = np.arange(1, values.size + 1) / values.size
                lines.append(Line("run", case.title, values, share, case, marks=True, steps=True))
        if lines:
            yield Panel(metric.title, note, metric_axis(metric), y, tuple(lines))


def _scatter(plan: Plan, figure: Figure, numbers: Numbers) -> Iterator[Panel]:
    if figure.over is None:
        return
    over = plan.metrics[figure.over]
    for index in figure.metrics:
        metric = plan.metrics[index]
        lines = []
        for case in _cases(plan, figure):
            pairs = sorted(
                pair
                for point in plan.point_names
                for pair in numbers.pairs(Cell(figure.over, case.name, point), Cell(index, case.name, point))
            )
            if pairs:
                across, up = np.array(pairs).T
                lines.append(Line("run", case.title, across, up, case, marks=True, apart=True))
        if lines:
            x, y = metric_axis(over), metric_axis(metric)
            yield Panel(f"{metric.title} over {_in_sentence(over.title)}", "", x, y, tuple(lines))


def _sweep(plan: Plan, figure: Figure, numbers: Numbers) -> Iterator[Panel]:
    if plan.sweep is None:
        return
    cells = numbers.table()
    points = sorted(plan.points, key=lambda p: p.value)
    x = Axis(plan.sweep.title, (Conversion(tables.pretty_unit(plan.sweep.unit)),))
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
                known = spread if spread.any() else None
                lines.append(Line("run", case.title, places, values, case, spread=known, marks=True))
            paper = [(value, c.paper) for value, c in row if c.paper is not None]
            if paper:
                values, places = np.array([v for _, v in paper]), np.array([value for value, _ in paper])
                lines.append(Line("paper", f"{case.title}, paper", places, values, case, marks=True))
        y = metric_axis(metric, zero=True)
        yield Panel(metric.title, "", x, y, tuple(lines), ticks=tuple(p.value for p in points))


def _heat_map(plan: Plan, figure: Figure, numbers: Numbers) -> Iterator[Panel]:
    if plan.sweep is None or plan.sweep.second is None:
        return
    first, second = (
        Axis(axis.title, (Conversion(tables.pretty_unit(axis.unit)),)) for axis in (plan.sweep, plan.sweep.second)
    )
    for index in figure.metrics:
        metric = plan.metrics[index]
        found: list[tuple[Case, str, tuple[Array, Array, Array]]] = []
        for case in _cases(plan, figure):
            ours = [(point, numbers.statistic(Cell(index, case.name, point.name))) for point in plan.points]
            known = [(p.value, p.second, s.mean) for p, s in ours if p.second is not None and s is not None]
            if known:
                across, up, values = np.array(known, np.float64).T
                found.append((case, case.title if len(plan.cases) > 1 else "", (across, up, values)))
        yield from heat_maps(metric.title, (first, second, metric_axis(metric)), found)


def _running(plan: Plan, figure: Figure, recordings: Recordings) -> Iterator[Panel]:
    for index, point, note in _at_points(plan, figure.metrics):
        metric = plan.metrics[index]
        lines = []
        for case in _cases(plan, figure):
            recording = recordings.first.get((case.name, point))
            line = None if recording is None else metrics.running(metric, plan, recording)
            if line is not None:
                lines.append(Line("run", case.title, *line, case))
        if lines:
            x = Axis("Time", (Conversion("s"),), range=(float(lines[0].x[0]), float(lines[0].x[-1])))
            y = metric_axis(metric, zero=True)
            yield Panel(metric.title, note, x, y, tuple(lines))


def _limits(panel: Panel, *, of_abscissa: bool) -> tuple[float, float]:
    """Return the smallest and the largest value that a panel shows on an axis, in its unit."""
    unit = (panel.x if of_abscissa else panel.y).units[0]
    values = [line.x if of_abscissa else line.y for line in panel.lines if not line.right]
    values += [] if of_abscissa else [np.array([(v.value - unit.offset) / unit.factor for v in panel.levels])]
    known = np.concatenate(values) * unit.factor + unit.offset
    known = known[np.isfinite(known) & ((known > 0.0) | (not panel.y.log) | of_abscissa)]
    return (float(known.min()), float(known.max())) if known.size else (0.0, 1.0)


def _alike(panels: Sequence[Panel], *, abscissa: bool) -> list[Panel]:
    """Give panels the same scale on the ordinate, and on the abscissa too if `abscissa` is true."""

    def common(*, of_abscissa: bool) -> tuple[float, float]:
        ends = [_limits(panel, of_abscissa=of_abscissa) for panel in panels]
        low, high = min(end[0] for end in ends), max(end[1] for end in ends)
        if not of_abscissa and panels[0].y.log:
            ratio = (high / low) ** ROOM if high > low else 2.0
            return low / ratio, high * ratio
        room = ROOM * (high - low) or abs(high) or 1.0
        return low - room, high + room

    y = common(of_abscissa=False)
    x = common(of_abscissa=True) if abscissa else None
    return [
        replace(p, y=replace(p.y, range=y), x=p.x if x is None else replace(p.x, range=x)) if p.lines else p
        for p in panels
    ]


def _scaled(figure: Figure, found: list[Panel]) -> list[Panel]:
    """Give the same scale to panels that should be compared."""
    if figure.same_scale:
        return _alike(found, abscissa=figure.kind == "xy") if any(p.lines for p in found) else found
    if not figure.separate:
        return found
    by_title: dict[str, list[Panel]] = {}
    for panel in found:
        by_title.setdefault(panel.title, []).append(panel)
    alike = {title: iter(_alike(same, abscissa=False)) for title, same in by_title.items()}
    return [next(alike[panel.title]) for panel in found]


def panels(plan: Plan, figure: Figure, recordings: Recordings, numbers: Numbers) -> list[Panel]:
    """Return the panels of a figure of the plan; none if there is nothing to draw."""
    of_recordings = {"time": _time, "transfer": _transfer, "spectrum": _spectrum, "running": _running, "xy": _xy}
    of_numbers = {"distribution": _distribution, "scatter": _scatter, "heat_map": _heat_map, "sweep": _sweep}
    if figure.kind in of_recordings:
        found = of_recordings[figure.kind](plan, figure, recordings)
    else:
        found = of_numbers[figure.kind](plan, figure, numbers)
    return _scaled(figure, list(found))

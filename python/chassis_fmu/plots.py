"""Figures of a plan: signals over time, their spectra, and metrics over a sweep, as SVG and PNG.

The files depend on the data alone: fixed salt for the identifiers, no date.
"""

from __future__ import annotations

import io
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Canvas
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from . import metrics, results, tables
from .numbers import Row
from .plan import Case, Column, Conversion, Figure, Plan, Run
from .results import Recording

# Okabe and Ito's palette, which the color-blind can tell apart; darkest first.
PALETTE = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9")
DASHES = ("solid", "dashed", "dotted")
INK = "#1c2733"
MUTED = "#64717f"
GRID = "#dde2e8"
PAPER = "#ffffff"

# A line is drawn from at most this many pairs of extremes: finer than the width of a panel in points.
BUCKETS = 600

# Up to this many points of a sweep are marked on the abscissa one by one.
MOST_TICKS = 8

# A legend with entries of up to so many characters fits in one row, if a line and the gaps beside count as so many.
LEGEND_ROOM = 106
LEGEND_HANDLE = 7

# A line whose way up and down is longer than this many times its height is noise and drawn thin.
NOISY = 20.0

STYLE = {
    "svg.hashsalt": "chassis-fmu",
    "svg.fonttype": "path",
    "font.family": ["DejaVu Sans"],
    "font.size": 9.0,
    "text.color": INK,
    "axes.labelcolor": INK,
    "axes.edgecolor": MUTED,
    "axes.linewidth": 0.8,
    "axes.titlesize": 9.5,
    "axes.titlepad": 7.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.facecolor": PAPER,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.unicode_minus": True,
    "axes.xmargin": 0.0,
    "axes.ymargin": 0.08,
    "figure.facecolor": PAPER,
    "grid.color": GRID,
    "grid.linewidth": 0.7,
    "xtick.color": MUTED,
    "ytick.color": MUTED,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "legend.frameon": False,
    "lines.solid_joinstyle": "round",
    "path.simplify": True,
    "path.simplify_threshold": 0.1,
}

Array = NDArray[np.floating[Any]]
Key = tuple[str, "str | None"]
# Frequencies (Hz) and densities by figure, column, case and point.
Spectra = Mapping[tuple[str, int, str, "str | None"], tuple[Array, Array]]


@dataclass(frozen=True)
class Drawing:
    """A finished figure."""

    figure: Figure
    svg: str
    png: bytes

    def write(self, folder: Path) -> None:
        """Write `<name>.svg` and `<name>.png` to a folder."""
        results.write_text(folder / f"{self.figure.name}.svg", self.svg)
        with results.replacing(folder / f"{self.figure.name}.png") as temporary:
            temporary.write_bytes(self.png)


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


def is_noisy(values: Array) -> bool:
    """Tell whether a line goes up and down all the time."""
    return bool(np.abs(np.diff(values)).sum() > NOISY * np.ptp(values))


def color_of(plan: Plan, case: Case) -> str:
    """Return the color of a case, the same in all figures."""
    return PALETTE[plan.cases.index(case) % len(PALETTE)]


def dashes_of(plan: Plan, case: Case) -> str:
    """Return the line style of a case: solid, then others where the colors are used up."""
    return DASHES[plan.cases.index(case) // len(PALETTE) % len(DASHES)]


def _label(column: Column) -> str:
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


def _title(ax: Axes, column: Column, right: str, room: int) -> None:
    """Write the title of a panel: the description, shortened to fit beside what stands on the right."""
    label = _label(column)
    if len(label) + len(right) >= room:
        label = label.split(", ")[0]
    ax.set_title(textwrap.shorten(label, max(room - len(right), 12), placeholder=" …"), loc="left", color=INK)
    if right:
        ax.set_title(right, loc="right", color=MUTED, fontsize=9.0)


def _canvas(panels: int, across: int, height: float) -> tuple[Canvas, list[Axes]]:
    down = -(-panels // across)
    canvas = Canvas(figsize=(8.4, 0.65 + height * down), layout="constrained")
    grid = canvas.subplots(down, across, squeeze=False)
    axes: list[Axes] = list(grid.flat)
    for ax in axes[panels:]:
        ax.remove()
    return canvas, axes[:panels]


def density_unit(unit: str) -> str:
    """Return the unit of a power spectral density."""
    pretty = axis_unit(unit)
    return f"({pretty})²/Hz" if pretty else "1/Hz"


def _cases(plan: Plan, figure: Figure) -> list[Case]:
    return [c for c in plan.cases if c.name in figure.cases]


def _legend(canvas: Canvas, handles: Sequence[Line2D], least: int = 2) -> None:
    if len(handles) >= least:
        lengths = [len(str(h.get_label())) + LEGEND_HANDLE for h in handles]
        # one row, or columns as wide as the longest entry
        fits = sum(lengths) <= LEGEND_ROOM
        canvas.legend(
            handles=list(handles),
            loc="outside upper left",
            ncols=len(handles) if fits else max(1, LEGEND_ROOM // max(lengths)),
            handlelength=1.6,
            columnspacing=1.6,
        )


def columns_of(plan: Plan, figure: Figure) -> set[int]:
    """Return the columns that a figure shows, or computes what it shows from."""
    running = figure.metrics if figure.kind == "running" else ()
    of_metrics = {c for m in running for c in plan.metrics[m].columns}
    return {*figure.columns, *([] if figure.against is None else [figure.against]), *of_metrics}


def _shown(column: Column, figure: Figure) -> Conversion:
    """Return the unit a column is plotted in: the figure's, the display unit of the variable, its unit."""
    return figure.conversion or column.shown


def _panels(
    plan: Plan, figure: Figure, recordings: Mapping[Key, Recording]
) -> Iterator[tuple[Column, str | None, list[tuple[Case, Recording]]]]:
    cases = _cases(plan, figure)
    for index in figure.columns:
        column = plan.columns[index]
        # Side by side are the points, also where every case has panels of its own.
        for together in [[c] for c in cases] if figure.separate else [cases]:
            for point in plan.point_names:
                lines = [
                    (case, recording)
                    for case in together
                    if (recording := recordings.get((case.name, point))) is not None and column.name in recording.values
                ]
                if lines:
                    yield column, point, lines


def _time(plan: Plan, figure: Figure, recordings: Mapping[Key, Recording]) -> Canvas | None:
    panels = list(_panels(plan, figure, recordings))
    if not panels:
        return None
    titles = {p.name: p.title for p in plan.points}
    across = 2 if len(plan.points) > 1 else 1
    canvas, axes = _canvas(len(panels), across, 1.75 if len(panels) > 1 else 2.9)
    used: dict[str, Line2D] = {}
    beside = None if figure.against is None else plan.columns[figure.against]
    for i, (ax, (column, point, lines)) in enumerate(zip(axes, panels, strict=True)):
        shown = _shown(column, figure)
        # States and switches have no values between.
        whole = not figure.levels
        for case, recording in lines:
            rows = metrics.window(recording.times, figure.window, plan.simulation.step)
            times = recording.times[rows]
            if not len(times):
                # A run stopped before the window.
                continue
            values = recording.values[column.name][rows] * shown.factor + shown.offset
            whole = whole and bool(np.all(values == np.round(values)))
            line = decimate(times, values)
            noisy = is_noisy(line[1])
            color = color_of(plan, case)
            # The first line is the widest, so that it shows even where the others lie on it.
            width = 0.6 if noisy else 2.0 if case is lines[0][0] and len(lines) > 1 else 1.2
            dashes = dashes_of(plan, case)
            ax.plot(*line, color=color, linewidth=width, linestyle=dashes, alpha=0.9)
            used[case.name] = Line2D([], [], color=color, linewidth=2.0, linestyle=dashes, label=case.title)
            if beside is not None and beside.name in recording.values:
                values = recording.values[beside.name][rows] * shown.factor + shown.offset
                # In ink where a case has the panel for itself, in its color among others.
                style: dict[str, Any] = {"color": INK if figure.separate else color, "linestyle": (0, (3, 2))}
                ax.plot(*decimate(times, values), linewidth=0.9, **style)
                used[""] = Line2D([], [], color=INK, linewidth=1.2, linestyle=(0, (3, 2)), label=_label(beside))
        for level in figure.levels:
            ax.axhline(level.value, color=INK, linewidth=0.9, linestyle=(0, (5, 3)))
            ax.annotate(
                level.title,
                (0.0, level.value),
                xytext=(4.0, 3.0),
                xycoords=("axes fraction", "data"),
                textcoords="offset points",
                color=INK,
                fontsize=8.0,
                # Readable on top of lines, too.
                bbox={"facecolor": PAPER, "edgecolor": "none", "alpha": 0.75, "pad": 0.5},
                zorder=4.0,
            )
        if whole and (ax.dataLim.y0 != 0.0 or ax.dataLim.y1 != 0.0):
            ax.yaxis.set_major_locator(MaxNLocator("auto", integer=True, steps=[1, 2, 5, 10]))
        right = ", ".join(
            [*([lines[0][0].title] if figure.separate else []), *([] if point is None else [titles[point]])]
        )
        _title(ax, column, right, 95 if across == 1 else 48)
        ax.set_ylabel(axis_unit(shown.unit))
        if i + across >= len(panels):
            ax.set_xlabel("Time (s)")
        else:
            ax.tick_params(labelbottom=False)
        ax.set_xlim(figure.window or (plan.simulation.start, plan.simulation.stop))
    if figure.separate:
        # Panels of the same signal are there to be compared.
        for name in {column.name for column, _, _ in panels}:
            same = [ax for ax, (column, _, _) in zip(axes, panels, strict=True) if column.name == name]
            limits = [ax.get_ylim() for ax in same]
            for ax in same:
                ax.set_ylim(min(low for low, _ in limits), max(high for _, high in limits))
    canvas.align_ylabels(axes)
    dashed = [used[""]] if "" in used else []
    if figure.separate:
        _legend(canvas, dashed, least=1)
    else:
        _legend(canvas, [*(used[c.name] for c in plan.cases if c.name in used), *dashed])
    return canvas


def _spectrum(plan: Plan, figure: Figure, spectra: Spectra) -> Canvas | None:
    panels = [
        (plan.columns[column], point, lines)
        for column in figure.columns
        for point in plan.point_names
        if (
            lines := [
                (case, spectra[key])
                for case in _cases(plan, figure)
                if (key := (figure.name, column, case.name, point)) in spectra and np.any(spectra[key][1] > 0.0)
            ]
        )
    ]
    if not panels:
        return None
    titles = {p.name: p.title for p in plan.points}
    across = 2 if len(plan.points) > 1 else 1
    canvas, axes = _canvas(len(panels), across, 2.2 if len(panels) > 1 else 2.9)
    used: dict[str, Line2D] = {}
    for i, (ax, (column, point, lines)) in enumerate(zip(axes, panels, strict=True)):
        for case, (frequencies, densities) in lines:
            color, dashes = color_of(plan, case), dashes_of(plan, case)
            # A logarithmic axis has no place for 0, the density of a constant.
            positive = np.where(densities > 0.0, densities, np.nan)
            ax.plot(frequencies, positive, color=color, linewidth=1.0, linestyle=dashes, alpha=0.9)
            used[case.name] = Line2D([], [], color=color, linewidth=2.0, linestyle=dashes, label=case.title)
        ax.set_xscale("log")
        ax.set_yscale("log")
        ax.xaxis.set_major_formatter("{x:g}")
        _title(ax, column, "" if point is None else titles[point], 95 if across == 1 else 48)
        ax.set_ylabel(density_unit(_shown(column, figure).unit))
        if i + across >= len(panels):
            ax.set_xlabel("Frequency (Hz)")
    canvas.align_ylabels(axes)
    _legend(canvas, [used[c.name] for c in plan.cases if c.name in used])
    return canvas


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


def _sweep(plan: Plan, figure: Figure, cells: Sequence[Row]) -> Canvas | None:
    if plan.sweep is None or not figure.metrics:
        return None
    canvas, axes = _canvas(len(figure.metrics), 2 if len(figure.metrics) > 1 else 1, 2.7)
    points = sorted(plan.points, key=lambda p: p.value)
    handles: dict[str, Line2D] = {}
    for ax, index in zip(axes, figure.metrics, strict=True):
        metric = plan.metrics[index]
        found = {(c.case, c.point): c for c in cells if c.metric is metric}
        for case in _cases(plan, figure):
            color = color_of(plan, case)
            row = [(p.value, found[case.name, p.name]) for p in points]
            ours = [(x, c.ours) for x, c in row if c.ours is not None]
            if ours:
                ax.errorbar(
                    [x for x, _ in ours],
                    [s.mean for _, s in ours],
                    yerr=[s.deviation or 0.0 for _, s in ours] if any(s.deviation for _, s in ours) else None,
                    color=color,
                    marker="o",
                    markersize=4.5,
                    linewidth=1.5,
                    capsize=3.0,
                )
                handles[f"{case.name} ours"] = Line2D([], [], color=color, marker="o", linewidth=1.5, label=case.title)
            paper = [(x, c.paper) for x, c in row if c.paper is not None]
            if paper:
                style = {"color": color, "marker": "s", "markerfacecolor": PAPER, "linestyle": (0, (4, 2))}
                ax.plot([x for x, _ in paper], [v for _, v in paper], markersize=5.0, linewidth=1.1, **style)  # type: ignore[arg-type]
                handles[f"{case.name} paper"] = Line2D([], [], linewidth=1.1, label=f"{case.title}, paper", **style)  # type: ignore[arg-type]
        ax.margins(x=0.06)
        if len(points) <= MOST_TICKS:
            ax.set_xticks([p.value for p in points], [f"{p.value:g}" for p in points])
        # Zero is part of the picture, so that differences show in their true proportion.
        low, high = min(0.0, ax.dataLim.y0), max(0.0, ax.dataLim.y1)
        if ax.has_data() and low < high:
            room = 0.08 * (high - low)
            ax.set_ylim(low - room if low < 0.0 else 0.0, high + room if high > 0.0 else 0.0)
        ax.set_title(metric.title, loc="left")
        ax.set_ylabel(axis_unit(metric.conversion.unit))
        ax.set_xlabel(tables.with_unit(plan.sweep.title, plan.sweep.unit))
    _legend(canvas, list(handles.values()))
    return canvas


def _running(plan: Plan, figure: Figure, recordings: Mapping[Key, Recording]) -> Canvas | None:
    panels = [
        (plan.metrics[index], point, lines)
        for index in figure.metrics
        for point in plan.point_names
        if (
            lines := [
                (case, line)
                for case in _cases(plan, figure)
                if (recording := recordings.get((case.name, point))) is not None
                and (line := metrics.running(plan.metrics[index], plan, recording)) is not None
            ]
        )
    ]
    if not panels:
        return None
    titles = {p.name: p.title for p in plan.points}
    across = 2 if len(plan.points) > 1 else 1
    canvas, axes = _canvas(len(panels), across, 2.2 if len(panels) > 1 else 2.9)
    used: dict[str, Line2D] = {}
    for ax, (metric, point, lines) in zip(axes, panels, strict=True):
        for case, line in lines:
            color, dashes = color_of(plan, case), dashes_of(plan, case)
            ax.plot(*decimate(*line), color=color, linewidth=1.2, linestyle=dashes, alpha=0.9)
            used[case.name] = Line2D([], [], color=color, linewidth=2.0, linestyle=dashes, label=case.title)
        ax.set_title(metric.title if point is None else f"{metric.title}, {titles[point]}", loc="left", color=INK)
        ax.set_ylabel(axis_unit(metric.conversion.unit))
        ax.set_xlabel("Time (s)")
        ax.set_xlim(lines[0][1][0][0], lines[0][1][0][-1])
        ax.set_ylim(bottom=0.0)
    canvas.align_ylabels(axes)
    _legend(canvas, [used[c.name] for c in plan.cases if c.name in used])
    return canvas


def draw(
    plan: Plan,
    figure: Figure,
    recordings: Mapping[Key, Recording],
    spectra: Spectra,
    cells: Sequence[Row],
) -> Drawing | None:
    """Draw a figure of the plan.

    `recordings` holds the run of each (case, point) that is shown, `cells` the table of metrics.
    Returns None if there is nothing to draw.
    """
    with mpl.rc_context(STYLE):
        if figure.kind == "time":
            canvas = _time(plan, figure, recordings)
        elif figure.kind == "spectrum":
            canvas = _spectrum(plan, figure, spectra)
        elif figure.kind == "running":
            canvas = _running(plan, figure, recordings)
        else:
            canvas = _sweep(plan, figure, cells)
        if canvas is None:
            return None
        text = io.StringIO()
        canvas.savefig(text, format="svg", metadata={"Date": None, "Title": figure.title})
        image = io.BytesIO()
        canvas.savefig(image, format="png", dpi=150)
    return Drawing(figure, text.getvalue(), image.getvalue())

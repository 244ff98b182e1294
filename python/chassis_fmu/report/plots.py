"""Draws the figures of a plan as SVG and PNG.

The same data always gives the same bytes: the salt for identifiers is fixed, and the files contain no date.
"""

from __future__ import annotations

import io
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Canvas
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, LogFormatter, MaxNLocator

from ..files import results
from ..files.plan import Case, Figure
from . import tables
from .panels import Array, Chart, Line, Panel, decimate

# Okabe and Ito's palette, whose colors color-blind readers can distinguish; darkest first.
PALETTE = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9")
DASHES = ("solid", "dashed", "dotted")
INK = "#1c2733"
MUTED = "#64717f"
GRID = "#dde2e8"
PAPER = "#ffffff"

# Dashes of a line on the right axis.
RIGHT_DASHES = (0, (1, 1.5))

# Scatter plots: up to OPAQUE points are opaque vector graphics; more are translucent (down to LEAST_OPAQUE), in a
# bitmap within the SVG. A picture has at most MOST_DRAWN points, to keep pages with a scatter matrix small; the
# interactive plots show all.
OPAQUE = 40
LEAST_OPAQUE = 0.25
MOST_DRAWN = 120
CLOUD_DPI = 60

# Characters per line in the title of a vertical axis, per inch of panel height.
LETTERS = 10.0

# Up to this many points of a sweep have individual tick marks.
MOST_TICKS = 8

# A legend fits in one row if its entries have at most LEGEND_ROOM characters; the line sample and gaps of an entry add
# LEGEND_HANDLE.
LEGEND_ROOM = 106
LEGEND_HANDLE = 7

# Color map of heat maps, the same as in interactive plots. Cells show their numbers if a row has up to MOST_NUMBERS
# cells.
COLORS = "viridis"
MOST_NUMBERS = 9

# A line is drawn thin, as noise, if its total variation exceeds this many times its range.
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


@dataclass(frozen=True)
class Drawing:
    """A finished figure."""

    figure: Figure | Chart
    svg: str
    png: bytes

    @staticmethod
    def of(figure: Figure | Chart, canvas: Canvas) -> Drawing:
        """Save a canvas."""
        text, image = io.StringIO(), io.BytesIO()
        canvas.savefig(text, format="svg", dpi=CLOUD_DPI, metadata={"Date": None, "Title": figure.title})
        canvas.savefig(image, format="png", dpi=150)
        return Drawing(figure, text.getvalue(), image.getvalue())

    def write(self, folder: Path) -> None:
        """Write `<name>.svg` and `<name>.png` to a folder."""
        results.write_text(folder / f"{self.figure.name}.svg", self.svg)
        with results.replacing(folder / f"{self.figure.name}.png") as temporary:
            temporary.write_bytes(self.png)


def is_noisy(values: Array) -> bool:
    """Return whether a line is noise, which is drawn thin."""
    return bool(np.abs(np.diff(values)).sum() > NOISY * np.ptp(values))


def color_of(cases: Sequence[Case], case: Case | None) -> str:
    """Return the color of a case, the same in all figures; the text color for None."""
    return INK if case is None else PALETTE[cases.index(case) % len(PALETTE)]


def dashes_of(cases: Sequence[Case], case: Case | None) -> str:
    """Return the line style of a case: solid, and other styles for cases after all colors are used."""
    return "solid" if case is None else DASHES[cases.index(case) // len(PALETTE) % len(DASHES)]


def _title(ax: Axes, panel: Panel, room: int) -> None:
    """Write the title of a panel, shortened to fit beside the note on the right."""
    title = panel.title
    if len(title) + len(panel.note) >= room:
        title = title.split(", ")[0]
    short = textwrap.shorten(title, max(room - len(panel.note), 12), placeholder=" …")
    ax.set_title(short, loc="left", color=INK)
    if panel.note:
        ax.set_title(panel.note, loc="right", color=MUTED, fontsize=9.0)


def _legend(canvas: Canvas, handles: Sequence[Line2D], least: int = 2) -> None:
    if len(handles) >= least:
        lengths = [len(str(h.get_label())) + LEGEND_HANDLE for h in handles]
        # Arrange the legend in one row, or in columns as wide as the longest entry.
        fits = sum(lengths) <= LEGEND_ROOM
        canvas.legend(
            handles=list(handles),
            loc="outside upper left",
            ncols=len(handles) if fits else max(1, LEGEND_ROOM // max(lengths)),
            handlelength=1.6,
            columnspacing=1.6,
        )


def _levels(ax: Axes, panel: Panel) -> None:
    for i, level in enumerate(panel.levels):
        ax.axhline(level.value, color=INK, linewidth=0.9, linestyle=(0, (5, 3)))
        # Labels alternate between left and right, because two levels may be close.
        is_left = i % 2 == 0
        ax.annotate(
            level.title,
            (0.0 if is_left else 1.0, level.value),
            xytext=(4.0 if is_left else -4.0, 3.0),
            horizontalalignment="left" if is_left else "right",
            xycoords=("axes fraction", "data"),
            textcoords="offset points",
            color=INK,
            fontsize=8.0,
            # Keeps the label readable on top of lines.
            bbox={"facecolor": PAPER, "edgecolor": "none", "alpha": 0.75, "pad": 0.5},
            zorder=4.0,
        )


def _lines(panel: Panel) -> list[Line]:
    """Return the lines that a picture shows: those of the first seed."""
    first = panel.lines[0].seed if panel.lines else None
    return [line for line in panel.lines if line.kind != "mean" and line.seed in (None, first)]


def borders(centers: Array, *, log: bool) -> Array:
    """Return the borders between cells with rising `centers`: arithmetic means, or geometric means on a log axis."""
    at = np.log10(centers) if log else centers
    if len(at) < 2:
        found = np.array([at[0] - 0.5, at[0] + 0.5])
    else:
        inner = 0.5 * (at[1:] + at[:-1])
        found = np.concatenate([[2.0 * at[0] - inner[0]], inner, [2.0 * at[-1] - inner[-1]]])
    return 10.0**found if log else found


def _draw_cells(ax: Axes, panel: Panel) -> None:
    line, z = panel.lines[0], panel.z or panel.y
    units = [axis.units[0] for axis in (panel.x, panel.y, z)]
    columns = (line.x, line.y, line.y if line.z is None else line.z)
    x, y, values = (v * u.factor + u.offset for v, u in zip(columns, units, strict=True))
    across, up = np.unique(x), np.unique(y)
    cells = np.full((len(up), len(across)), np.nan)
    cells[np.searchsorted(up, y), np.searchsorted(across, x)] = values
    low, high = z.range or (float(np.nanmin(cells)), float(np.nanmax(cells)))
    sides = borders(across, log=panel.x.log), borders(up, log=panel.y.log)
    mesh = ax.pcolormesh(*sides, cells, cmap=COLORS, vmin=low, vmax=high, edgecolors="face", linewidth=0.3)
    ax.grid(visible=False)
    if len(across) <= MOST_NUMBERS:
        for place, value in np.ndenumerate(cells):
            if np.isfinite(value):
                share = (value - low) / (high - low) if high > low else 0.5
                red, green, blue, _ = colormaps[COLORS](share)
                # Choose black or white, whichever is more readable on a color of this luminance.
                color = "black" if 0.299 * red + 0.587 * green + 0.114 * blue > 0.5 else "white"
                text = tables.significant(float(value), 3)
                ax.text(across[place[1]], up[place[0]], text, ha="center", va="center", color=color, fontsize=7.0)
    if ax.figure is not None:
        bar = ax.figure.colorbar(mesh, ax=ax, pad=0.02)
        bar.set_label(z.label)
        bar.formatter = NUMBERS
        bar.outline.set_visible(False)  # type: ignore[operator]


class _Decades(LogFormatter):
    """Numbers of a logarithmic axis, also between its decades where there is room."""

    def __call__(self, x: float, pos: int | None = None) -> str:
        return tables.scientific(x) if super().__call__(x, pos) else ""


NUMBERS = FuncFormatter(lambda value, _: tables.scientific(0.0 if abs(value) < 1e-12 else value))
"""Numbers of an axis, formatted as in the tables."""


def _scale(ax: Axes, panel: Panel) -> None:
    for axis, scale, drawn in ((panel.x, ax.set_xscale, ax.xaxis), (panel.y, ax.set_yscale, ax.yaxis)):
        if axis.log:
            scale("log")
            drawn.set_minor_formatter(_Decades(minor_thresholds=(1.5, 0.5)))
        drawn.set_major_formatter(NUMBERS)


class _Pen:
    """Draws the panels of a figure, and collects the entries of its legend, in the order of the cases."""

    def __init__(self, cases: Sequence[Case], figure: Figure | Chart) -> None:
        self._cases = cases
        self._figure = figure
        self._entries: dict[tuple[int, str], Line2D] = {}

    def _add(self, line: Line, title: str, **style: object) -> None:
        place = -1 if line.case is None else self._cases.index(line.case)
        order = len(self._cases) if line.kind == "reference" else place
        self._entries.setdefault((order, title), Line2D([], [], label=title, **style))  # type: ignore[arg-type]

    @property
    def entries(self) -> list[Line2D]:
        return [self._entries[key] for key in sorted(self._entries, key=lambda key: key[0])]

    def _line(self, ax: Axes, line: Line, x: Array, y: Array, is_widest: bool) -> None:
        color = color_of(self._cases, line.case)
        if line.kind == "reference":
            # The line has the text color if the panel shows one case, otherwise the color of its case.
            dashed = RIGHT_DASHES if line.right else (0, (3, 2))
            ax.plot(*decimate(x, y), linewidth=0.9, color=INK if self._figure.separate else color, linestyle=dashed)
            title = f"{line.title} (right)" if line.right else line.title
            if line.title:
                self._add(line, title, color=INK, linewidth=1.2, linestyle=dashed)
            return
        is_curve = self._figure.kind == "xy"
        x, y = decimate(x, y, is_curve=is_curve)
        dashes = dashes_of(self._cases, line.case)
        has_one_width = self._figure.kind in ("spectrum", "transfer")
        width = 1.0 if has_one_width else 0.6 if is_noisy(y) and not is_curve else 2.0 if is_widest else 1.2
        ax.plot(x, y, color=color, linewidth=width, linestyle=dashes, alpha=0.9)
        if not self._figure.separate:
            title = line.title if line.case is None else line.case.title
            self._add(line, title, color=color, linewidth=2.0, linestyle=dashes)

    def _points(self, ax: Axes, line: Line, y: Array) -> None:
        """Draw points of a sweep with their spread, single runs, or the steps of a distribution."""
        color = color_of(self._cases, line.case)
        if line.apart or line.steps:
            steps: dict[str, Any] = {"drawstyle": "steps-post", "linewidth": 1.5}
            joined = {"linestyle": "none"} if line.apart else steps
            style: dict[str, Any] = {"color": color, "marker": "x" if line.crosses else "o", "markersize": 4.5}
            every = slice(None, None, -(-len(line.x) // MOST_DRAWN) if line.apart else 1)
            x, y = line.x[every], y[every]
            opaque = max(LEAST_OPAQUE, min(0.9, OPAQUE / len(x)))
            ax.plot(x, y, **style, **joined, alpha=opaque, rasterized=line.apart and len(x) > OPAQUE)
            self._add(line, line.title, **style, linestyle="none" if line.apart else "solid", linewidth=1.5)
            return
        if line.kind == "paper":
            style = {"color": color, "marker": "s", "markerfacecolor": PAPER, "linestyle": (0, (4, 2))}
            ax.plot(line.x, y, markersize=5.0, linewidth=1.1, **style)
            self._add(line, line.title, linewidth=1.1, **style)
            return
        ax.errorbar(line.x, y, yerr=line.spread, color=color, marker="o", markersize=4.5, linewidth=1.5, capsize=3.0)
        self._add(line, line.title, color=color, marker="o", linewidth=1.5)

    def panel(self, ax: Axes, panel: Panel, letters: int) -> None:
        """Draw a panel. Titles of vertical axes wrap after `letters` characters."""
        ax.set_ylabel(textwrap.fill(panel.y.label, letters))
        if panel.kind == "heat":
            _draw_cells(ax, panel)
            _scale(ax, panel)
            return
        across, unit = panel.x.units[0], panel.y.units[0]
        shown = _lines(panel)
        runs = [line for line in shown if line.kind == "run"]
        beside = None if panel.right is None else _right_axis(ax, textwrap.fill(panel.right.label, letters))
        # A panel with whole numbers only (states, switches) needs no ticks between them.
        whole = self._figure.kind == "time" and not panel.levels
        for line in shown:
            own = panel.right.units[0] if line.right and panel.right is not None else unit
            x, y = line.x * across.factor + across.offset, line.y * own.factor + own.offset
            if line.marks:
                self._points(ax, line, y)
                continue
            # The first line is the widest, so it remains visible under the other lines.
            is_widest = self._figure.kind == "time" and line is runs[0] and len(runs) > 1
            axes = beside if line.right and beside is not None else ax
            self._line(axes, line, x, y, is_widest)
            whole = whole and (line.kind == "reference" or bool(np.all(y == np.round(y))))
        _levels(ax, panel)
        if whole and (ax.dataLim.y0 != 0.0 or ax.dataLim.y1 != 0.0):
            ax.yaxis.set_major_locator(MaxNLocator("auto", integer=True, steps=[1, 2, 5, 10]))
        _scale(ax, panel)
        if panel.x.range is not None:
            ax.set_xlim(panel.x.range)
        elif self._figure.kind in ("xy", "distribution", "scatter"):
            ax.margins(x=0.06)
        if panel.ticks:
            ax.margins(x=0.06)
            if len(panel.ticks) <= MOST_TICKS:
                ax.set_xticks(panel.ticks)
        low, high = min(0.0, ax.dataLim.y0), max(0.0, ax.dataLim.y1)
        if panel.y.range is not None:
            # Room for points at a share of 0 or 1.
            room = 0.03 if panel.y.range == (0.0, 1.0) else 0.0
            ax.set_ylim(panel.y.range[0] - room, panel.y.range[1] + room)
        elif panel.y.zero and ax.has_data() and low < high:
            room = 0.08 * (high - low)
            ax.set_ylim(low - room if low < 0.0 else 0.0, high + room if high > 0.0 else 0.0)
        if panel.kind == "map":
            ax.set_aspect("equal", adjustable="datalim" if panel.x.range is None else "box")


def _right_axis(ax: Axes, label: str) -> Axes:
    right = ax.twinx()
    right.grid(visible=False)
    right.spines["right"].set_visible(True)
    right.yaxis.set_major_formatter(NUMBERS)
    right.set_ylabel(label)
    return right


def _shape(panel: Panel) -> float:
    """Return the ratio of height to width of the data in a panel."""
    width, height = (
        np.ptp(values[np.isfinite(values)]) if (values := np.concatenate(columns)).size else 0.0
        for columns in ([line.x for line in panel.lines], [line.y for line in panel.lines])
    )
    return float(height / width) if width > 0.0 else 1.0


def draw(cases: Sequence[Case], figure: Figure | Chart, panels: Sequence[Panel], *, is_swept: bool = False) -> Drawing:
    """Draw a figure with at least one panel. With `is_swept`, panels of the points of a sweep are side by side."""
    is_of_points = figure.kind in ("sweep", "heat_map", "distribution", "scatter", "xy")
    is_map = all(panel.kind == "map" for panel in panels)
    is_wide = len(panels) > 1 and not is_map if is_of_points else is_swept
    across = 2 if is_wide and figure.kind != "transfer" else 1
    height = 2.7 if is_of_points else 2.9 if len(panels) == 1 else 1.75 if figure.kind in ("time", "transfer") else 2.2
    if is_map:
        # High enough for the data at equal scales, plus title and abscissa.
        height = max(1.6, min(4.2, 0.9 + 7.4 * max(_shape(panel) for panel in panels)))
    elif figure.kind == "xy" and across == 1:
        height = 4.2
    with mpl.rc_context(STYLE):
        down = -(-len(panels) // across)
        canvas = Canvas(figsize=(8.4, 0.65 + height * down), layout="constrained")
        grid: list[Axes] = list(canvas.subplots(down, across, squeeze=False).flat)
        axes = grid[: len(panels)]
        for ax in grid[len(panels) :]:
            ax.remove()
        pen = _Pen(cases, figure)
        for i, (ax, panel) in enumerate(zip(axes, panels, strict=True)):
            pen.panel(ax, panel, int(LETTERS * height))
            _title(ax, panel, 95 if across == 1 else 48)
            if is_of_points or i + across >= len(panels):
                ax.set_xlabel(panel.x.label)
            elif figure.kind in ("time", "transfer"):
                ax.tick_params(labelbottom=False)
        canvas.align_ylabels(axes)
        _legend(canvas, pen.entries, least=1 if figure.separate else 2)
        return Drawing.of(figure, canvas)

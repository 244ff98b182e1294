"""Panels of figures: axes and lines as arrays. `plots` draws them, `page_data` embeds them in a page."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ..files.plan import Case, Conversion, Level
from .tables import pretty_unit

# A line is drawn from at most this many pairs of extremes: finer than the width of a panel in points.
BUCKETS = 600

Array = NDArray[np.floating[Any]]
PanelKind: TypeAlias = Literal["function", "curve", "map", "heat"]
"""One value for each abscissa, a curve that may go back, a curve with the same scale on both axes, colored cells."""

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

    @property
    def label(self) -> str:
        """The title with the unit shown; a dash for a number without unit."""
        return f"{self.title} ({pretty_unit(self.units[0].unit) or '–'})"


@dataclass(frozen=True)
class Line:
    """A line; the units of both coordinates are those that the first unit of the axis converts from."""

    kind: LineKind
    title: str
    """Empty: it has no key of its own, as one of many lines that look the same."""
    x: Array
    y: Array
    case: Case | None = None
    seed: int | None = None
    spread: Array | None = None
    """Standard deviation over the seeds."""
    t: Array | None = None
    """Times of the points of a curve, s."""
    z: Array | None = None
    """Values of the cells of a heat map, whose centers are the points."""
    marks: bool = False
    steps: bool = False
    """Whether a value holds until the next one."""
    apart: bool = False
    """Whether the points are not joined; they have marks."""
    crosses: bool = False
    """Whether the marks are crosses."""
    right: bool = False
    """Whether it belongs to the axis on the right."""
    run: str | None = None
    """The run whose file has all samples, and its column."""
    signal: str | None = None
    over: str | None = None
    """The column of the abscissa of a curve."""


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
    kind: PanelKind = "function"
    right: Axis | None = None
    """A second vertical axis."""
    z: Axis | None = None
    """What the colors of a heat map mean."""


def decimate(times: Array, values: Array, buckets: int = BUCKETS, *, is_curve: bool = False) -> tuple[Array, Array]:
    """Reduce a line to the smallest and the largest value of each of `buckets` pieces, and both ends.

    Of a curve the extremes of the abscissa stay, too. The picture stays the same as long as a piece is narrower than
    the line, peaks included.
    """
    if is_curve:
        rows = rows_of_curve(times, values, buckets)
        return times[rows], values[rows]
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


def rows_of_curve(across: Array, up: Array, buckets: int = BUCKETS) -> NDArray[np.intp]:
    """Return the rows that keep the picture of a curve: extremes of both coordinates in each piece, and the ends."""
    numbers = np.arange(len(across), dtype=np.float64)
    kept = [decimate(numbers, of, buckets // 2)[0] for of in (across, up)]
    rows: NDArray[np.intp] = np.unique(np.concatenate(kept)).astype(np.intp)
    return rows


def heat_maps(
    title: str, axes: tuple[Axis, Axis, Axis], found: Sequence[tuple[Case, str, tuple[Array, Array, Array]]]
) -> Iterator[Panel]:
    """Return a heat map for each case with its note: axes across, up and of the colors; centers and values of cells."""
    if not found:
        return
    # Colors are there to be compared: those of all cases mean the same.
    everything = np.concatenate([values for _, _, (_, _, values) in found])
    colors = replace(axes[2], range=(float(everything.min()), float(everything.max())))
    for case, note, (across, up, values) in found:
        line = Line("run", case.title, across, up, case, z=values)
        yield Panel(title, note, axes[0], axes[1], (line,), kind="heat", z=colors)

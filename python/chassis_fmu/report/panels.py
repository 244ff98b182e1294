"""Panels of figures: axes and lines as arrays. `plots` draws panels, `page_data` embeds their data in a page."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ..files.plan import Case, Conversion, Level
from .tables import pretty_unit

# A line is drawn from at most this many pairs of extremes, which is finer than the width of a panel in points.
BUCKETS = 600

Array = NDArray[np.floating[Any]]
PanelKind: TypeAlias = Literal["function", "curve", "map", "heat"]
"""Kinds of panels: function of the abscissa, curve that may turn back, curve with equal scales, or colored cells."""

LineKind: TypeAlias = Literal["run", "mean", "paper", "reference"]
"""Kinds of lines: a run, the mean over the seeds, numbers from the paper, or a line to compare with."""


@dataclass(frozen=True)
class Axis:
    """An axis: its title, and the units that it can be shown in, the default first."""

    title: str
    units: tuple[Conversion, ...]
    log: bool = False
    zero: bool = False
    """Whether the axis includes zero, so that values appear in proportion."""
    range: tuple[float, float] | None = None

    @property
    def label(self) -> str:
        """The title with the unit that is shown; a dash for a number without unit."""
        return f"{self.title} ({pretty_unit(self.units[0].unit) or '–'})"


@dataclass(frozen=True)
class Line:
    """A line. The units of its axis convert its coordinates to displayed values."""

    kind: LineKind
    title: str
    """Empty for a line without a legend entry, such as one of many similar lines."""
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
    """Whether the points have marks instead of being joined."""
    crosses: bool = False
    """Whether the marks are crosses."""
    right: bool = False
    """Whether the line belongs to the right axis."""
    run: str | None = None
    """The run whose file contains all samples, and the name of the column."""
    signal: str | None = None
    over: str | None = None
    """The column with the abscissa of a curve."""


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
    """Values on the abscissa that have individual tick marks."""
    kind: PanelKind = "function"
    right: Axis | None = None
    """A second vertical axis."""
    z: Axis | None = None
    """The axis of the colors of a heat map."""


@dataclass(frozen=True)
class Chart:
    """A figure that no scenario declares; `name` is its file name without extension."""

    name: str
    title: str
    kind: str
    caption: str
    panels: Sequence[Panel]
    cases: Sequence[Case] | None = None
    """Cases of this figure, which then has separate case switches; None for the cases of the page."""
    separate: bool = False


def decimate(times: Array, values: Array, buckets: int = BUCKETS, *, is_curve: bool = False) -> tuple[Array, Array]:
    """Reduce a line to the smallest and the largest value in each of `buckets` pieces, and both ends.

    For a curve, the extremes of the abscissa are kept, too. The picture, including its peaks, does not change as long
    as a piece is narrower than the line.
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
    """Return the rows of a reduced curve: the extremes of both coordinates in each piece, and both ends."""
    numbers = np.arange(len(across), dtype=np.float64)
    kept = [decimate(numbers, of, buckets // 2)[0] for of in (across, up)]
    rows: NDArray[np.intp] = np.unique(np.concatenate(kept)).astype(np.intp)
    return rows


def heat_maps(
    title: str, axes: tuple[Axis, Axis, Axis], found: Sequence[tuple[Case, str, tuple[Array, Array, Array]]]
) -> Iterator[Panel]:
    """Return a heat map for each case. `axes` are abscissa, ordinate and colors; `found` has case, note, and cells."""
    if not found:
        return
    # All cases share one color scale, to be comparable.
    everything = np.concatenate([values for _, _, (_, _, values) in found])
    colors = replace(axes[2], range=(float(everything.min()), float(everything.max())))
    for case, note, (across, up, values) in found:
        line = Line("run", case.title, across, up, case, z=values)
        yield Panel(title, note, axes[0], axes[1], (line,), kind="heat", z=colors)

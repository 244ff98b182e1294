"""Pictures of models, `model.png`: a block with its ports, as in a block diagram, and a result.

A picture depends only on the FMU and the drawing programs; it contains no date and no program names. All lengths are in
pixels, for a picture 400 pixels wide; the file has twice the resolution, for high-density screens.
"""

from __future__ import annotations

import csv
import io
import math
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from fmpy import read_model_description
from fmpy.model_description import ModelDescription
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.patches import FancyBboxPatch, Polygon, Rectangle
from matplotlib.textpath import text_to_path
from numpy.typing import NDArray
from PIL import Image

from chassis_fmu.files.describe import display_units
from chassis_fmu.files.plan import Conversion
from chassis_fmu.report import panels, plots
from chassis_fmu.report.tables import pretty_unit
from model_pictures import demos

WIDTH = 400.0
SCALE = 2.0
PER_INCH = 100.0
POINT = 72.0 / PER_INCH

# Accent color by folder of the model, dark enough for white text.
ACCENTS = {"fmu-plant": "#0b5f94", "fmu-controllers": "#a8480a"}
PANEL = "#f6f8fa"

PLACES = frozenset(("fl", "fr", "ml", "mr", "rl", "rr", "l", "r", "front", "middle", "rear"))

# Groups with more variables than this are always one line.
FEW = 3

# Largest number of lines of ports on one side.
MOST_LINES = 12

# Outputs to show from a reference run, in order of preference.
SHOWN = ("body.roll", "body.heave", "vehicle.yaw_rate")

BOX = (22.0, 378.0)
PAD = 10.0
HEADER = 36.0
LINE = 14.0
ROW = 17.0
LABEL = 11.0
SMALLEST = 9.0
PLOT = 116.0
COLORS = 64

# Peaks in this range need no power of ten in the unit of the axis.
SHORT = (0.05, 10000.0)

Array = NDArray[np.floating[Any]]


@dataclass(frozen=True)
class Port:
    """A line of ports: a variable, or a group of `count` variables."""

    label: str
    count: int = 1


@dataclass(frozen=True)
class Result:
    """The drawn results of a run: one axis, with a curve for each name."""

    title: str
    unit: str
    times: Array
    lines: Mapping[str, Array]


@dataclass(frozen=True)
class Block:
    """The contents of a picture."""

    name: str
    description: str
    folder: str
    inputs: tuple[Port, ...]
    outputs: tuple[Port, ...]
    result: Result | None


def ports(names: Sequence[str]) -> tuple[Port, ...]:
    """Group variables into at most `MOST_LINES` lines.

    Groups of more than `FEW` variables over wheels or axles always become one line. While there are too many lines, the
    largest other group with a common prefix becomes one line. A last line counts the variables that still do not fit.
    """
    groups: dict[str, list[str]] = {}
    for name in names:
        stem, dot, last = name.rpartition(".")
        groups.setdefault(stem if dot else name, []).append(last)
    folded = {s for s, members in groups.items() if len(members) > FEW and PLACES.issuperset(members)}

    def lines() -> list[Port]:
        found: dict[str, Port] = {}
        for name in names:
            stem = name.rpartition(".")[0]
            if stem in folded:
                found[stem] = Port(f"{stem}.*", len(groups[stem]))
            else:
                found[name] = Port(name)
        return list(found.values())

    while len(lines()) > MOST_LINES:
        rest = {s: len(m) for s, m in groups.items() if s not in folded and len(m) > 1}
        if not rest:
            break
        folded.add(max(rest, key=lambda s: rest[s]))
    found = lines()
    if len(found) > MOST_LINES:
        kept = found[: MOST_LINES - 1]
        found = [*kept, Port(f"+ {len(names) - sum(p.count for p in kept)} more")]
    return tuple(found)


def _width(text: str, size: float, bold: bool = False) -> float:
    # matplotlib takes the size in points; the width then has the same unit as `size`.
    font = FontProperties(family=["DejaVu Sans"], weight="bold" if bold else "normal", size=size)
    width, _, _ = text_to_path.get_text_width_height_descent(text, font, ismath=False)
    return float(width)


def wrap(text: str, size: float, width: float) -> list[str]:
    """Break a text into lines that fit."""
    out: list[str] = []
    for word in text.split():
        if out and _width(f"{out[-1]} {word}", size) <= width:
            out[-1] += f" {word}"
        else:
            out.append(word)
    return out


def balanced(text: str, size: float, width: float) -> list[str]:
    """Break a text into as few lines as fit, of about the same length."""
    lines = wrap(text, size, width)
    while (narrower := wrap(text, size, width - size)) and len(narrower) == len(lines):
        width, lines = width - size, narrower
    return lines


def _count(port: Port) -> str:
    return f" ×{port.count}" if port.count > 1 else ""


def _side(lines: Sequence[Port], size: float) -> float:
    return max((_width(p.label, size) + _width(_count(p), size - 1.0) + 3.0 for p in lines), default=0.0)


def _label_size(block: Block) -> float:
    """Return the size of the labels at which inputs and outputs fit side by side."""
    room = BOX[1] - BOX[0] - 2.0 * PAD - 14.0
    needed = _side(block.inputs, LABEL) + _side(block.outputs, LABEL)
    return max(SMALLEST, min(LABEL, LABEL * room / needed)) if needed else LABEL


def _ports(ax: Axes, lines: Sequence[Port], top: float, size: float, accent: str, left: bool) -> None:
    """Draw the ports of one side: an arrow each, thicker for a group."""
    edge, away = (BOX[0], -1.0) if left else (BOX[1], 1.0)
    align = "left" if left else "right"
    for i, port in enumerate(lines):
        y = top + (i + 0.5) * ROW
        x = edge - away * PAD
        note, label = {"fontsize": (size - 1.0) * POINT, "color": plots.MUTED}, {"fontsize": size * POINT}
        if port.label.startswith("+"):
            ax.text(x, y, port.label, ha=align, va="center", **note)  # type: ignore[arg-type]
            continue
        # Signals run from left to right: inputs end at the box, outputs start there.
        tip, tail = (edge, edge - 17.0) if left else (edge + 17.0, edge)
        half = 4.2 if port.count > 1 else 3.2
        ax.plot([tail, tip - 5.0], [y, y], color=accent, linewidth=2.2 if port.count > 1 else 1.0)
        ax.add_patch(Polygon([(tip, y), (tip - 7.0, y - half), (tip - 7.0, y + half)], color=accent, linewidth=0.0))
        count, width = _count(port).strip(), _width(port.label, size)
        ax.text(x, y, port.label, ha=align, va="center_baseline", color=plots.INK, **label)  # type: ignore[arg-type]
        if count:
            ax.text(x - away * (width + 5.0), y, count, ha=align, va="center_baseline", **note)  # type: ignore[arg-type]


def scaled(result: Result) -> Result:
    """Move a power of 1000 from very large or small values into the unit, so that the axis has short numbers."""
    peak = max(float(np.abs(values).max()) for values in result.lines.values())
    if peak == 0.0 or SHORT[0] <= peak < SHORT[1]:
        return result
    power = 3 * math.floor(math.log10(peak) / 3.0)
    exponent = str(power).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))
    unit = f"10{exponent} {result.unit}".strip()
    lines = {name: values / 10.0**power for name, values in result.lines.items()}
    return Result(result.title, unit, result.times, lines)


def _result(canvas: Figure, ax: Axes, result: Result, top: float, height: float, single: str) -> None:
    """Draw the result below `top`: title, legend, axes with curves."""
    left, right = BOX[0] + PAD, BOX[1] - PAD
    ax.plot([BOX[0], BOX[1]], [top, top], color=plots.GRID, linewidth=0.8)
    small = 9.5 * POINT
    y = top + 14.0
    ax.text(left, y, result.title, va="center_baseline", fontsize=10.5 * POINT, color=plots.MUTED)
    if result.unit:
        ax.text(right, y, f"in {result.unit}", ha="right", va="center_baseline", fontsize=small, color=plots.MUTED)
    y += 16.0
    colors = (single, *plots.PALETTE[1:]) if len(result.lines) == 1 else plots.PALETTE
    mark, gap = 16.0, 14.0
    needed = sum(_width(name, 10.0) for name in result.lines)
    size = min(10.0, 10.0 * (right - left - (mark + gap) * len(result.lines)) / needed)
    x = left
    for name, color in zip(result.lines, colors, strict=False):
        ax.plot([x, x + 12.0], [y - 1.0, y - 1.0], color=color, linewidth=2.0, solid_capstyle="butt")
        ax.text(x + mark, y, name, va="center_baseline", fontsize=size * POINT, color=plots.INK)
        x += mark + _width(name, size) + gap

    y += 12.0
    x, end, low = left + 26.0, right - 4.0, y + PLOT - 30.0
    inner = canvas.add_axes((x / WIDTH, 1.0 - low / height, (end - x) / WIDTH, (low - y) / height))
    for values, color in zip(result.lines.values(), colors, strict=False):
        times, reduced = panels.decimate(result.times, values)
        inner.plot(times, reduced, color=color, linewidth=0.7 if plots.is_noisy(values) else 1.2)
    inner.set_xlim(float(result.times[0]), float(result.times[-1]))
    inner.locator_params(axis="y", nbins=4)
    inner.locator_params(axis="x", nbins=6)
    inner.tick_params(labelsize=small, length=2.0, pad=2.0)
    ax.text((x + end) / 2.0, low + 25.0, "time in s", ha="center", fontsize=small, color=plots.MUTED)


def draw(block: Block) -> bytes:
    """Draw a block. Returns the bytes of a PNG file, the same for the same block."""
    accent = ACCENTS.get(block.folder, plots.INK)
    room = BOX[1] - BOX[0] - 2.0 * PAD
    lines = balanced(block.description, LABEL, room)
    body = 6.0 + HEADER + 8.0 + LINE * len(lines) + 8.0
    rows = max(len(block.inputs), len(block.outputs), 1)
    below = body + rows * ROW + 6.0
    bottom = below + (0.0 if block.result is None else PLOT + 46.0)
    height = bottom + 6.0

    style = plots.STYLE | {"path.simplify": False}
    with mpl.rc_context(style):
        canvas = Figure(figsize=(WIDTH / PER_INCH, height / PER_INCH), dpi=PER_INCH * SCALE)
        ax = canvas.add_axes((0.0, 0.0, 1.0, 1.0))
        ax.set_axis_off()
        ax.set_xlim(0.0, WIDTH)
        ax.set_ylim(height, 0.0)

        def frame(**how: Any) -> FancyBboxPatch:
            shape = "round,pad=0,rounding_size=8"
            return FancyBboxPatch((BOX[0], 6.0), BOX[1] - BOX[0], bottom - 6.0, boxstyle=shape, **how)

        ax.add_patch(frame(facecolor=PANEL, edgecolor="none"))
        band = ax.add_patch(Rectangle((0.0, 0.0), WIDTH, 6.0 + HEADER, facecolor=accent, edgecolor="none"))
        clip = ax.add_patch(frame(facecolor="none", edgecolor="none"))
        band.set_clip_path(clip)
        ax.add_patch(frame(facecolor="none", edgecolor=accent, linewidth=1.2, zorder=3.0))

        title = min(18.0, 18.0 * room / _width(block.name, 18.0, bold=True))

        def centered(y: float, text: str, size: float, color: str, weight: str = "normal") -> None:
            how = {"fontsize": size * POINT, "fontweight": weight, "color": color}
            ax.text(WIDTH / 2.0, y, text, ha="center", va="center_baseline", **how)  # type: ignore[arg-type]

        centered(6.0 + HEADER / 2.0, block.name, title, plots.PAPER, "bold")
        for i, line in enumerate(lines):
            centered(6.0 + HEADER + 8.0 + (i + 0.5) * LINE, line, LABEL, plots.INK)
        size = _label_size(block)
        _ports(ax, block.inputs, body, size, accent, left=True)
        _ports(ax, block.outputs, body, size, accent, left=False)
        if block.result is not None:
            _result(canvas, ax, scaled(block.result), below, height, accent)
        full = io.BytesIO()
        canvas.savefig(full, format="png", dpi=PER_INCH * SCALE)
    # A file with a palette needs a quarter of the space. Saving again also drops the name and version of the drawing
    # library.
    with Image.open(full) as image:
        reduced = io.BytesIO()
        image.convert("RGB").quantize(COLORS, dither=Image.Dither.NONE).save(reduced, format="png", optimize=True)
    return reduced.getvalue()


def shown_unit(description: ModelDescription, name: str) -> Conversion:
    """Return the unit to show a variable in: its display unit if it has one, otherwise its unit.

    Raises LookupError if the FMU has no variable with this name.
    """
    variable = demos.variable(description, name)
    shown = display_units(description).get((variable.unit, variable.displayUnit))
    return shown or Conversion(variable.unit or "1")


def _reference(fmu: Path, names: Sequence[str]) -> tuple[Array, dict[str, Array]] | None:
    """Return times and an output of the reference run that changes, preferably one of `SHOWN`, or None."""
    with zipfile.ZipFile(fmu) as archive:
        path = "extra/io.github.chassis-fmu/reference.csv"
        if path not in archive.namelist():
            return None
        rows = list(csv.reader(io.StringIO(archive.read(path).decode("utf-8"))))
    if "time" not in rows[0]:
        return None
    # Between samples, an output may have empty cells.
    values = np.array([[cell or "nan" for cell in row] for row in rows[1:]], dtype=float)
    columns = {name: values[:, i] for i, name in enumerate(rows[0])}
    for name in [n for n in (*SHOWN, *names) if n in names and n in columns]:
        given = np.isfinite(columns[name])
        if given.any() and np.ptp(columns[name][given]) > 0.0:
            return columns["time"][given], {name: columns[name][given]}
    return None


def _unit(unit: str) -> str:
    """Return a unit for the axis label; `deg` stays a word, because a single degree sign is hard to see."""
    pretty = pretty_unit(unit)
    return unit if pretty == "°" else pretty


def read(fmu: Path, folder: str) -> Block:
    """Read the contents of the picture from an FMU; `folder` is the top folder of its package.

    Raises LookupError if a demo uses a variable that the FMU does not have.
    """
    description = read_model_description(str(fmu), validate=False)
    inputs = [v.name for v in description.modelVariables if v.causality == "input"]
    outputs = [v.name for v in description.modelVariables if v.causality == "output"]
    demo = demos.DEMOS.get(description.modelName)
    found: tuple[Array, dict[str, Array]] | None
    if demo is None:
        title, found = "Reference run", _reference(fmu, outputs)
    else:
        title = demo.title
        found = demos.run(demo, fmu, description)
    result = None
    if found is not None:
        times, lines = found
        shown = shown_unit(description, next(iter(lines)))
        converted = {name: values * shown.factor + shown.offset for name, values in lines.items()}
        result = Result(title, _unit(shown.unit), times, converted)
    return Block(
        name=description.modelName,
        description=description.description or "",
        folder=folder,
        inputs=ports(inputs),
        outputs=ports(outputs),
        result=result,
    )

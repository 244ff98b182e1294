"""The data of the figures of a page, as JSON that `web/page-data.schema.json` describes."""

from __future__ import annotations

import base64
import json
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import quote

import markupsafe
import numpy as np
from numpy.typing import NDArray

from ..files.plan import Case, Figure, Plan
from . import plots
from .panels import Array, Axis, Line, Panel, decimate, rows_of_curve

FORMAT = 1

# The 16-bit word for a missing number, and the largest word for a number.
MISSING = 65535
LARGEST = MISSING - 1

# A number is on a grid if it differs from a grid point by at most this share of the grid step.
ON_GRID = 1e-6


@dataclass(frozen=True)
class Interactive:
    """Parts of an interactive page: its data, and the style and code bundled from the sources in `web/`."""

    data: markupsafe.Markup
    style: markupsafe.Markup
    code: markupsafe.Markup

    @classmethod
    def of(cls, data: str) -> Interactive:
        """Return the parts for a page with data from `render`."""
        folder = Path(__file__).parents[1] / "web"
        style, code = ((folder / name).read_text(encoding="utf-8") for name in ("page.css", "page.js"))
        return cls(markupsafe.Markup(data), markupsafe.Markup(style), markupsafe.Markup(code))


class _Block:
    """Columns of numbers as 16-bit words."""

    def __init__(self) -> None:
        self._parts: list[NDArray[np.uint16]] = []
        self._size = 0

    def column(self, values: Array, *, grid: float = 1.0, log: bool = False) -> dict[str, Any]:
        """Add a column. Values on the grid are exact up to floating-point errors; others are rounded to 16 bits."""
        known = np.isfinite(values) & ((values > 0.0) | (not log))
        numbers = np.log10(np.where(known, values, 1.0)) if log else np.where(known, values, 0.0)
        used = numbers[known]
        first = float(used.min()) if used.size else 0.0
        span = float(used.max()) - first if used.size else 0.0
        steps = (used - first) / grid
        is_on_grid = not log and span <= grid * LARGEST and bool(np.all(np.abs(steps - np.round(steps)) < ON_GRID))
        step = grid if is_on_grid else span / LARGEST
        words = np.round((numbers - first) / step) if step > 0.0 else np.zeros(len(values))
        words = np.where(known, words, MISSING).astype(np.uint16)
        at = self._size
        self._parts.append(np.diff(words, prepend=np.uint16(0)).astype(np.uint16))
        self._size += len(words)
        return {"at": at, "count": len(words), "first": first, "step": step, "log": log}

    def text(self) -> str:
        words = np.concatenate(self._parts) if self._parts else np.zeros(0, np.uint16)
        return base64.b64encode(zlib.compress(words.astype("<u2").tobytes(), 9)).decode("ascii")


def _axis(axis: Axis) -> dict[str, Any]:
    return {
        "title": axis.title,
        "units": [{"name": u.unit, "factor": u.factor, "offset": u.offset} for u in axis.units],
        "log": axis.log,
        "zero": axis.zero,
        "range": None if axis.range is None else list(axis.range),
    }


def _distance(values: Array) -> float:
    """Return the smallest distance between different values; 1 if all are equal."""
    return float(np.diff(np.unique(values)).min(initial=np.inf)) if np.unique(values).size > 1 else 1.0


def _line(line: Line, panel: Panel, block: _Block, grid: float) -> dict[str, Any]:
    times = line.t
    own_grids = (grid, 1.0)
    if panel.kind == "heat":
        x, y = line.x, line.y
        own_grids = (_distance(x), _distance(y))
    elif panel.kind != "function":
        rows = rows_of_curve(line.x, line.y)
        x, y, times = line.x[rows], line.y[rows], None if times is None else times[rows]
    elif line.marks or line.steps or line.spread is not None:
        x, y = line.x, line.y
    else:
        x, y = decimate(line.x, line.y)
    data: dict[str, Any] = {
        "title": line.title,
        "kind": line.kind,
        "case": None if line.case is None else line.case.name,
        "seed": line.seed,
        "x": block.column(x, grid=own_grids[0], log=panel.x.log),
        "y": block.column(y, grid=own_grids[1], log=panel.y.log),
    }
    if line.z is not None:
        data["z"] = block.column(line.z, log=panel.z is not None and panel.z.log)
    if times is not None:
        data["t"] = block.column(times, grid=grid)
    if line.spread is not None:
        data["spread"] = block.column(line.spread)
    data |= {name: True for name in ("marks", "steps", "apart", "crosses", "right") if getattr(line, name)}
    if line.run is not None and line.signal is not None:
        data["file"] = f"runs/{quote(line.run)}.csv"
        data["signal"] = line.signal
        if line.over is not None:
            data["over"] = line.over
    return data


def _panel(panel: Panel, block: _Block, grid: float) -> dict[str, Any]:
    data: dict[str, Any] = {
        "kind": panel.kind,
        "title": panel.title,
        "note": panel.note,
        "x": _axis(panel.x),
        "y": _axis(panel.y),
        "lines": [_line(line, panel, block, grid) for line in panel.lines],
        "levels": [{"value": level.value, "title": level.title} for level in panel.levels],
    }
    if panel.z is not None:
        data["z"] = _axis(panel.z)
    if panel.right is not None:
        data["right"] = _axis(panel.right)
    return data


def render(
    cases: Sequence[Case],
    seeds: Sequence[int],
    figures: Sequence[tuple[str, Sequence[Panel]]],
    grid: float = 1.0,
    own: Mapping[str, Sequence[Case]] | None = None,
) -> str:
    """Serialize named figures as JSON that is safe inside a script element.

    `grid` is the interval between recorded values on the abscissa; values on this grid are stored exactly. `own`
    contains the cases of figures that do not use `cases`.
    """
    block = _Block()
    drawn = [
        {"name": name, "panels": [_panel(panel, block, grid) for panel in panels if panel.lines]}
        for name, panels in figures
    ]
    data = {
        "format": FORMAT,
        "cases": [
            {
                "name": case.name,
                "title": case.title,
                "color": i % len(plots.PALETTE),
                "dash": i // len(plots.PALETTE) % len(plots.DASHES),
                **({} if figure is None else {"figure": figure}),
            }
            for figure, listed in ((None, cases), *(own or {}).items())
            for i, case in enumerate(listed)
        ],
        "seeds": list(seeds),
        "figures": [figure for figure in drawn if figure["panels"]],
        "block": block.text(),
    }
    # Without "<", no text can end the script element or begin a comment.
    return json.dumps(data, ensure_ascii=False, separators=(",", ":")).replace("<", "\\u003c")


def of_plan(plan: Plan, figures: Sequence[tuple[Figure, Sequence[Panel]]]) -> str:
    """Return the data of the page of a plan."""
    grid = plan.simulation.step * plan.simulation.every
    return render(plan.cases, plan.seeds, [(figure.name, panels) for figure, panels in figures], grid)

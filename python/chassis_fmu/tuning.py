"""Tuning studies: converts the histories from `chassis study` to Parquet, and makes a plot and a page."""

from __future__ import annotations

import json
import math
import re
import sys
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import markupsafe
import matplotlib as mpl
import msgspec
import numpy as np
import pyarrow as pa
import pyarrow.compute
import pyarrow.csv
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator
from numpy.typing import NDArray

from . import _native
from .files import results
from .files.describe import sha256
from .files.plan import Case, Conversion, Level
from .report import index, page_data, plots, rendering, tables
from .report.panels import Axis, Chart, Line, Panel
from .terminal import escaped

FORMAT = 3

ENDS = {"generations": "all generations", "budget": "budget spent", "target": "target reached"}

# Vertical range of the plot. Its top is the median objective of the slowest method after the share EARLY of the
# evaluations, but not before FEW evaluations (or a third of all evaluations, if that is fewer): earlier objectives
# depend on chance. An objective to compare with is drawn as a line if it is within NEAR times this range; a higher
# objective only has a label with an arrow.
EARLY = 0.05
FEW = 10
NEAR = 1.5
# The axis is logarithmic if the ratio of the highest to the lowest objective exceeds this.
DECADES = 5.0
# Labels beside the plot: number of characters per line, and height of a line as a share of the plot's height.
LABEL = 28
LINE = 0.045

Array = NDArray[np.floating[Any]]


class StudyError(Exception):
    """The results of a study cannot be read."""


class Candidate(msgspec.Struct, frozen=True):
    """Parameter values and their objective; `reason` says why they are infeasible."""

    values: tuple[float | None, ...]
    objective: float
    reason: str | None = None
    title: str = ""
    evaluation: int | None = None


class Method(msgspec.Struct, frozen=True):
    """Progress and results of a method."""

    name: str
    title: str
    group: str
    kind: str
    seed: int
    settings: dict[str, Any]
    end: str
    evaluations: int
    generations: int
    infeasible: int
    best: Candidate | None


@dataclass(frozen=True)
class Group:
    """The runs of a method with all seeds."""

    title: str
    methods: tuple[Method, ...]

    @property
    def best(self) -> Candidate | None:
        """The best candidate of all seeds."""
        return min((m.best for m in self.methods if m.best is not None), key=lambda b: b.objective, default=None)

    @property
    def objectives(self) -> list[float]:
        """Best objectives of the seeds, best first; infinite where nothing feasible was found."""
        return sorted(math.inf if m.best is None else m.best.objective for m in self.methods)


class Study(msgspec.Struct, frozen=True):
    """The summary that `chassis study` writes."""

    parameters: tuple[dict[str, Any], ...]
    methods: tuple[Method, ...]
    baseline: Candidate
    comparisons: tuple[dict[str, Any], ...]
    """Parameter values from the file, with which the results of the methods are compared."""
    improved: bool
    raw: dict[str, Any] = {}

    @property
    def references(self) -> tuple[Candidate, ...]:
        """Candidates to compare with: the scenario's values, then the comparisons."""
        names = [parameter["name"] for parameter in self.parameters]
        others = (c | {"values": [c["values"].get(name) for name in names]} for c in self.comparisons)
        return (self.baseline, *(msgspec.convert(other, Candidate) for other in others))

    @property
    def groups(self) -> tuple[Group, ...]:
        """The methods, grouped by title without the seed."""
        titles = dict.fromkeys(m.group for m in self.methods)
        return tuple(Group(t, tuple(m for m in self.methods if m.group == t)) for t in titles)


def parse(text: str) -> Study:
    """Read `summary.json`."""
    try:
        raw = json.loads(text)
        if raw["format"] != FORMAT:
            raise StudyError(
                f"summary of format {raw['format']}, this version reads {FORMAT}: "
                "--resume regenerates it from the history"
            )
        return msgspec.convert(raw | {"raw": raw}, Study)
    except (ValueError, KeyError, TypeError, msgspec.ValidationError) as error:
        raise StudyError(f"not a summary of a study: {error!r}") from error


def read_history(study: Study, folder: Path) -> pa.Table:
    """Read the histories of all methods into one table with a column `method`."""
    parts = []
    names = [p["name"] for p in study.parameters]
    types = {n: pa.float64() for n in [*names, "objective"]}
    types |= {"evaluation": pa.int64(), "generation": pa.int64(), "feasible": pa.bool_(), "reason": pa.string()}
    for method in study.methods:
        path = folder / method.name / "history.csv"
        try:
            options = pyarrow.csv.ConvertOptions(column_types=types, strings_can_be_null=False)
            # After a run with a smaller budget, the history contains more rows than were used.
            table = pyarrow.csv.read_csv(path, convert_options=options).slice(0, method.evaluations)
        except (OSError, pa.ArrowException) as error:
            raise StudyError(f"{path}: cannot read the history: {error}") from error
        parts.append(table.add_column(0, "method", pa.array([method.name] * len(table), pa.string())))
    return pa.concat_tables(parts)


def write_history(study: Study, table: pa.Table, path: Path) -> None:
    """Write the histories as Parquet, units of measure as field metadata."""
    units = {p["name"]: p["unit"] or "1" for p in study.parameters}
    fields = [f.with_metadata({"unit": units[f.name]}) if f.name in units else f for f in table.schema]
    results.write_table(path, table.cast(pa.schema(fields)))


def best_so_far(table: pa.Table, method: str) -> Array:
    """Return the best feasible objective up to each evaluation, NaN before the first feasible one."""
    rows = table.filter(pa.compute.equal(table["method"], method))
    objective = rows["objective"].to_numpy().astype(np.float64)
    feasible = rows["feasible"].to_numpy(zero_copy_only=False).astype(np.bool_)
    best = np.minimum.accumulate(np.where(feasible, objective, np.inf))
    return np.where(np.isfinite(best), best, np.nan)


def _short(value: float) -> str:
    return tables.scientific(value, 4)


def median(curves: Sequence[Array]) -> Array:
    """Return the median of curves.

    A curve that ends early keeps its last value; before its first value, it is infinite.
    """
    length = max(len(c) for c in curves)
    padded = [np.pad(np.nan_to_num(c, nan=np.inf), (0, length - len(c)), mode="edge") for c in curves]
    middle = np.median(padded, axis=0)
    return np.where(np.isfinite(middle), middle, np.nan)


@dataclass(frozen=True)
class Scale:
    """The axis of the objective: its ends, and the highest level that is drawn as a line (`reach`)."""

    logarithmic: bool
    bottom: float
    top: float
    reach: float

    @staticmethod
    def of(groups: Sequence[Sequence[Array]], levels: Sequence[float]) -> Scale:
        """Choose the axis for the curves of the methods and the levels of the comparisons."""
        low = min(float(np.nanmin(c)) for group in groups for c in group)
        high = low
        for curve in map(median, groups):
            late = curve[max(int(EARLY * len(curve)), min(FEW, len(curve) // 3)) :]
            # The curve falls, so its first value is its largest.
            high = max([high, *late[np.isfinite(late)][:1].tolist()])
        logarithmic = low > 0.0 and high > DECADES * low
        there, back = (math.log, math.exp) if logarithmic else (float, float)
        start, end = there(low), there(high)
        reach = start + NEAR * (end - start if end > start else 0.1 * abs(start) or 1.0)
        # Levels below the curves are always shown, except values up to 0 on a logarithmic axis.
        near = [there(v) for v in levels if not (logarithmic and v <= 0.0) and there(v) <= reach]
        start, end = min([start, *near]), max([end, *near])
        room = 0.06 * (end - start) or 1.0
        return Scale(logarithmic, back(start - room), back(end + room), back(reach))

    def share(self, value: float) -> float:
        """Height of a value: 0 at the bottom of the plot, 1 at the top."""
        if self.logarithmic:
            if value <= 0.0:
                return 0.0
            return math.log(value / self.bottom) / math.log(self.top / self.bottom)
        return (value - self.bottom) / (self.top - self.bottom)


def spread(places: Sequence[float], heights: Sequence[float]) -> list[float]:
    """Move overlapping labels apart and into the plot; `places` are the heights of the labels, from the top down."""

    def inside(center: float, rows: list[float]) -> float:
        # The first and the last label may extend beyond the plot by half a line.
        half = (sum(rows) - LINE) / 2
        return min(max(center, half), 1.0 - half)

    blocks: list[tuple[float, list[float]]] = []
    for place, height in zip(places, heights, strict=True):
        blocks.append((inside(place, [height]), [height]))
        # Blocks that touch are joined, around the mean of their centers.
        while len(blocks) > 1 and blocks[-2][0] - sum(blocks[-2][1]) / 2 < blocks[-1][0] + sum(blocks[-1][1]) / 2:
            (center, rows), (above, above_rows) = blocks.pop(), blocks.pop()
            mean = (above * len(above_rows) + center * len(rows)) / (len(rows) + len(above_rows))
            joined = [*above_rows, *rows]
            blocks.append((inside(mean, joined), joined))
    out = []
    for center, rows in blocks:
        edge = center + sum(rows) / 2
        for height in rows:
            out.append(edge - height / 2)
            edge -= height
    return out


@dataclass(frozen=True)
class Convergence:
    """The curves of the methods (one case each), the axis of the objective, and the levels of the comparisons."""

    cases: list[Case]
    panel: Panel
    scale: Scale
    levels: list[tuple[str, float]]


def convergence(study: Study, table: pa.Table) -> Convergence | None:
    """Return the curves of the methods; None if nothing feasible was found."""
    cases: list[Case] = []
    lines: list[Line] = []
    groups = []
    for group in study.groups:
        curves = {m.title: best_so_far(table, m.name) for m in group.methods if m.best is not None}
        if not curves:
            continue
        case = Case(group.title, group.title, None)
        cases.append(case)
        groups.append(list(curves.values()))
        if len(curves) > 1:
            curve = median(groups[-1])
            title = f"{group.title}, median of {len(curves)} seeds"
            lines.append(Line("mean", title, np.arange(1.0, len(curve) + 1), curve, case, steps=True))
        for title, curve in curves.items():
            lines.append(Line("run", title, np.arange(1.0, len(curve) + 1), curve, case, steps=True))
    if not lines:
        return None
    levels = [(c.title, c.objective) for c in study.references if c.reason is None]
    scale = Scale.of(groups, [v for _, v in levels])
    x = Axis("Evaluations", (Conversion(""),))
    y = Axis("Objective", (Conversion(""),), log=scale.logarithmic, range=(scale.bottom, scale.top))
    shown = tuple(Level(value, title) for title, value in levels if value <= scale.reach)
    return Convergence(cases, Panel("Best objective so far (no unit)", "", x, y, tuple(lines), shown), scale, levels)


def draw(found: Convergence) -> plots.Drawing:
    """Draw the convergence of the methods."""
    scale = found.scale
    lines = found.panel.lines
    with mpl.rc_context(plots.STYLE):
        canvas = Figure(figsize=(8.4, 4.2), layout="constrained")
        ax = canvas.subplots()
        for line in lines:
            case = found.cases[0] if line.case is None else line.case
            color = plots.PALETTE[found.cases.index(case) % len(plots.PALETTE)]
            has_median = any(other.kind == "mean" and other.case == line.case for other in lines)
            if has_median and line.kind == "run":
                ax.step(line.x, line.y, where="post", color=color, linewidth=0.7, alpha=0.45)
            else:
                label = line.title if has_median else case.title
                ax.step(line.x, line.y, where="post", color=color, linewidth=1.9, label=label, zorder=2.5)
        # Labels beside the plot, from the top down.
        levels = sorted(found.levels, key=lambda level: -level[1])
        arrows = ["" if v <= scale.reach else "\N{NO-BREAK SPACE}\N{UPWARDS ARROW}" for _, v in levels]
        labels = [
            textwrap.fill(f"{t}: {_short(v)}{arrow}", LABEL) for (t, v), arrow in zip(levels, arrows, strict=True)
        ]
        places = spread([min(scale.share(v), 1.0) for _, v in levels], [LINE * (1 + t.count("\n")) for t in labels])
        for (_, value), label, place in zip(levels, labels, places, strict=True):
            if value <= scale.reach:
                ax.axhline(value, color=plots.MUTED, linewidth=1.0, linestyle=(0, (4, 2)))
            ax.annotate(
                label,
                xy=(1.0, min(scale.share(value), 1.0)),
                xycoords="axes fraction",
                xytext=(1.03, place),
                textcoords="axes fraction",
                va="center",
                color=plots.MUTED,
                fontsize=8.0,
                arrowprops={
                    "arrowstyle": "-",
                    "color": plots.MUTED,
                    "linewidth": 0.6,
                    "relpos": (0.0, 0.5),
                    "shrinkA": 2.0,
                    "shrinkB": 0.0,
                },
            )
        if scale.logarithmic:
            ax.set_yscale("log")
            ax.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
            ax.yaxis.set_major_formatter(FuncFormatter(lambda value, _: _short(value)))
            ax.yaxis.set_minor_locator(NullLocator())
        ax.set_ylim(scale.bottom, scale.top)
        ax.set_xlim(1, max(len(line.x) for line in lines))
        ax.set_xlabel("Evaluations")
        ax.set_ylabel("Best objective so far (no unit)")
        if len(lines) > 1:
            canvas.legend(loc="outside upper left", ncols=4, handlelength=1.6, columnspacing=1.6)
        return plots.Drawing.of(Chart("convergence", "Convergence", "running", "", [found.panel]), canvas)


def definitions(raw: dict[str, Any]) -> list[str]:
    """Describe how each term of the objective is computed: formula, window and number of rows."""
    found = []
    for term, rows in zip(raw["terms"], raw.get("rows") or [None] * len(raw["terms"]), strict=True):
        squared = "²" if term["kind"] == "mean_square" else ""
        formula = _native.formula(term["kind"])
        text = f"{_short(term['weight'])} times the magnitude of {formula}, where x is {term['signal']}"
        text += f", over {_short(term['reference'])}{squared}"
        window = term["window"]
        text += "; all rows" if window is None else f"; rows from {_short(window[0])} s to {_short(window[1])} s"
        count = "" if rows is None else f" ({rows:,} rows)".replace(",", " ")
        found.append(f"{text}{count} of each run; the objective is the sum of the terms, in the mean over the runs")
    return found


def render(study: Study, drawing: plots.Drawing | None, data: str, command: str) -> str:
    """Return the page. `data` contains the data of the figure as JSON (`page_data`)."""
    found = [m.best.objective for m in study.methods if m.best is not None]
    columns: list[tuple[str, Candidate | None, int | None]] = [(g.title, g.best, i) for i, g in enumerate(study.groups)]
    columns += [(candidate.title, candidate, None) for candidate in study.references]
    return rendering.render(
        "tuning.html.j2",
        study=study.raw,
        paragraphs=rendering.paragraphs(study.raw["description"]),
        groups=study.groups,
        parameters=study.parameters,
        columns=columns,
        several=len(study.groups) < len(study.methods),
        best=min(found, default=math.nan),
        ends=ENDS,
        figure=None if drawing is None else rendering.themed_svg(drawing.svg, drawing.figure.title),
        interactive=page_data.Interactive.of(data),
        command=command,
        hashes={path.stem: sha256(path) for path in map(Path, study.raw["fmus"])},
        definitions=definitions(study.raw),
        value=lambda value: "–" if value is None else tables.scientific(value),
        # A long name may break after its colon and its dots, nowhere else.
        breakable=lambda name: markupsafe.Markup(re.sub(r"([.:])", r"\1<wbr>", str(markupsafe.escape(name)))),
        unit=lambda unit: tables.pretty_unit(unit or "1"),
    )


def report(folder: Path, command: str) -> Path:
    """Write the Parquet file, the figure and the page of a finished study; returns the path of the page."""
    path = folder / "summary.json"
    try:
        study = parse(path.read_text(encoding="utf-8"))
    except (OSError, StudyError) as error:
        raise StudyError(f"{path}: {error}") from error
    table = read_history(study, folder)
    write_history(study, table, folder / "history.parquet")
    found = convergence(study, table)
    drawing = None if found is None else draw(found)
    if drawing is not None:
        drawing.write(folder / "figures")
    cases, panels = ([], []) if found is None else (found.cases, [found.panel])
    data = page_data.render(cases, [], [("convergence", panels)])
    entry = index.Entry(study.raw["title"], study.raw["reference"] or "")
    return index.write(folder, render(study, drawing, data, command), entry)


def main(argv: Sequence[str] | None = None) -> int:
    """Make the page of a study. `argv` is `FOLDER COMMAND`: its folder, and the command that repeats it."""
    folder, command = sys.argv[1:] if argv is None else argv
    try:
        print(report(Path(folder), command))
    except (StudyError, OSError) as error:
        print(f"error: {escaped(error)}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())

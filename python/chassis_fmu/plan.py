"""The plan of a scenario: what `cargo fmu plan --json` prints, as typed values.

A plan is complete: every connection is a pair of bus slots, every parameter has its value reference and its
value in the unit of the variable. Nothing here reads the scenario file itself, so that both masters (the native
one and the one in `master`) execute exactly the same thing and every scenario error has one source.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

FORMAT = 3

Kind = Literal["Real", "Integer", "Boolean", "String"]


class PlanError(Exception):
    """The text is not a plan this version understands."""


@dataclass(frozen=True)
class Conversion:
    """A unit of measure with its conversion: shown value = factor * value + offset."""

    unit: str
    factor: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True)
class Setting:
    """A value for a variable: a parameter, or a constant input."""

    name: str
    kind: Kind
    reference: int
    value: float | int | bool | str


@dataclass(frozen=True)
class Wire:
    """A variable and the bus slot it reads from or writes to."""

    reference: int
    kind: Kind
    slot: int


@dataclass(frozen=True)
class Component:
    """An FMU instance of a run."""

    name: str
    fmu: Path
    model_identifier: str
    guid: str
    parameters: tuple[Setting, ...]
    constants: tuple[Setting, ...]
    inputs: tuple[Wire, ...]
    outputs: tuple[Wire, ...]


@dataclass(frozen=True)
class InputSeries:
    """A signal from an input file, held between its rows."""

    slot: int
    times: tuple[float, ...]
    values: tuple[float, ...]


@dataclass(frozen=True)
class Run:
    """One simulation: a case at a point with a seed."""

    id: str
    case: str
    point: str | None
    seed: int | None
    components: tuple[Component, ...]
    series: tuple[InputSeries, ...]
    slots: int
    columns: tuple[int | None, ...]

    @property
    def stem(self) -> str:
        """File name of the results of the run, without extension."""
        return self.id.replace("@", "_").replace("#", "_")


@dataclass(frozen=True)
class Simulation:
    """Time grid (s), recording interval in steps, and order of execution."""

    start: float
    stop: float
    step: float
    steps: int
    order: Literal["sequential", "jacobi"]
    every: int

    @property
    def rows(self) -> int:
        """Number of recorded rows, the first one at the start time."""
        return self.steps // self.every + 1


@dataclass(frozen=True)
class Case:
    """A variant of the system; `baseline` names the case its changes are relative to."""

    name: str
    title: str
    baseline: str | None


@dataclass(frozen=True)
class Point:
    """A point of the sweep."""

    name: str
    title: str
    value: float


@dataclass(frozen=True)
class Sweep:
    """The abscissa of the points."""

    title: str
    unit: str


@dataclass(frozen=True)
class Column:
    """A recorded signal. `display` is the preferred unit for people, where the variable declares one."""

    name: str
    unit: str
    display: Conversion | None
    description: str


@dataclass(frozen=True)
class Cell:
    """A cell of the table of metrics; `metric` is an index into the list of the plan."""

    metric: int
    case: str
    point: str | None = None

    @property
    def key(self) -> str:
        """Return the name that the paper's numbers have: `case` or `case@point`."""
        return self.case if self.point is None else f"{self.case}@{self.point}"


@dataclass(frozen=True)
class Paper:
    """Numbers of a paper for one metric, by `case` or `case@point`, and to which of them something was fitted.

    `changes` are in percent, by two such names with a slash between, where the paper gives no values.
    """

    table: str
    values: Mapping[str, float]
    calibrated: frozenset[str] | None
    changes: Mapping[str, float] = field(default_factory=dict)

    def origin(self, key: str) -> str:
        """Say how our number for a value came about: calibrated, predicted; empty if the scenario does not say."""
        if self.calibrated is None or key not in self.values:
            return ""
        return "calibrated" if key in self.calibrated else "predicted"


@dataclass(frozen=True)
class Until:
    """The end of a window: the rows from the first one on where a column is above or below a level do not count."""

    column: int
    above: bool
    level: float


@dataclass(frozen=True)
class Metric:
    """A number computed from one column, or several combined, less another one; its values are converted before.

    Its own unit may be another one. With `from_baseline` the same signal of the baseline's run is subtracted before.
    """

    name: str
    title: str
    columns: tuple[int, ...]
    kind: str
    conversion: Conversion
    threshold: float | None = None
    window: tuple[float, float] | None = None
    until: Until | None = None
    minus: int | None = None
    digits: int | None = None
    paper: Paper | None = None
    combine: Literal["min", "max", "norm", "squares"] | None = None
    weights: tuple[float, ...] = ()
    from_baseline: bool = False
    band: tuple[float, float] | None = None


@dataclass(frozen=True)
class Level:
    """A level that is marked in a plot."""

    value: float
    title: str


@dataclass(frozen=True)
class Figure:
    """A plot: columns over time, their spectra, metrics over the points of the sweep or over windows that grow.

    `cases` are the names of those shown, `separate` gives each a panel in a plot over time, `columns` and `metrics`
    are indices into the lists of the plan.
    """

    name: str
    title: str
    kind: Literal["time", "spectrum", "sweep", "running"]
    cases: tuple[str, ...]
    separate: bool
    columns: tuple[int, ...]
    against: int | None
    metrics: tuple[int, ...]
    window: tuple[float, float] | None
    conversion: Conversion | None
    levels: tuple[Level, ...]
    caption: Text


@dataclass(frozen=True)
class Number:
    """A number of the results in a text: what number, of which cells (several give a range), compared with what."""

    format: str
    metric: int
    cells: tuple[Cell, ...]
    against: tuple[Cell, ...]


Text = tuple["str | Number", ...]
"""Words, and numbers that the results fill in."""


Expect = Literal["paper_change", "paper_value", "lower", "higher", "unchanged", "falls_more", "below", "above", "never"]


@dataclass(frozen=True)
class Check:
    """A comparison that decides on a finding."""

    cell: Cell
    against: Cell | None
    expect: Expect
    level: float | None


@dataclass(frozen=True)
class Finding:
    """A claim, of a paper or (`own`) of this project, and what decides on it."""

    claim: Text
    explanation: Text
    own: bool
    checks: tuple[Check, ...]


@dataclass(frozen=True)
class Unread:
    """Outputs of a component that nothing reads, and in which cases."""

    component: str
    outputs: tuple[str, ...]
    cases: tuple[str, ...]


@dataclass(frozen=True)
class Plan:
    """A resolved scenario."""

    name: str
    file: str
    title: str
    description: str
    reference: str
    simulation: Simulation
    cases: tuple[Case, ...]
    points: tuple[Point, ...]
    sweep: Sweep | None
    seeds: tuple[int, ...]
    columns: tuple[Column, ...]
    runs: tuple[Run, ...]
    metrics: tuple[Metric, ...]
    figures: tuple[Figure, ...]
    findings: tuple[Finding, ...]
    warnings: tuple[str, ...]
    unread: tuple[Unread, ...]

    def run(self, case: str, point: str | None, seed: int | None) -> Run:
        """Return the run of a case, point and seed."""
        for run in self.runs:
            if (run.case, run.point, run.seed) == (case, point, seed):
                return run
        raise KeyError(f"the plan has no run for case {case}, point {point}, seed {seed}")

    @property
    def point_names(self) -> tuple[str | None, ...]:
        """Names of the points; a single None without a sweep."""
        return tuple(p.name for p in self.points) or (None,)

    @property
    def seed_values(self) -> tuple[int | None, ...]:
        """Values of the seeds; a single None without seeds."""
        return self.seeds or (None,)


def _setting(item: Mapping[str, Any]) -> Setting:
    return Setting(item["name"], item["type"], int(item["reference"]), item["value"])


def _wires(items: Sequence[Mapping[str, Any]]) -> tuple[Wire, ...]:
    return tuple(Wire(int(w["reference"]), w["type"], int(w["slot"])) for w in items)


def _component(item: Mapping[str, Any], root: Path) -> Component:
    return Component(
        name=item["name"],
        fmu=root / item["fmu"],
        model_identifier=item["model_identifier"],
        guid=item["guid"],
        parameters=tuple(map(_setting, item["parameters"])),
        constants=tuple(map(_setting, item["constants"])),
        inputs=_wires(item["inputs"]),
        outputs=_wires(item["outputs"]),
    )


def _run(item: Mapping[str, Any], root: Path) -> Run:
    return Run(
        id=item["id"],
        case=item["case"],
        point=item["point"],
        seed=item["seed"],
        components=tuple(_component(c, root) for c in item["components"]),
        series=tuple(
            InputSeries(int(f["slot"]), tuple(map(float, f["times"])), tuple(map(float, f["values"])))
            for f in item["series"]
        ),
        slots=int(item["slots"]),
        columns=tuple(None if c is None else int(c) for c in item["columns"]),
    )


def _window(value: Sequence[float] | None) -> tuple[float, float] | None:
    return None if value is None else (float(value[0]), float(value[1]))


def _conversion(item: Mapping[str, Any], unit: str) -> Conversion | None:
    if item.get(unit) is None:
        return None
    return Conversion(item[unit], float(item["factor"]), float(item["offset"]))


def _until(item: Mapping[str, Any] | None) -> Until | None:
    return None if item is None else Until(int(item["column"]), bool(item["above"]), float(item["level"]))


def _paper(item: Mapping[str, Any] | None) -> Paper | None:
    if item is None:
        return None
    calibrated = item["calibrated"]
    known = None if calibrated is None else frozenset(calibrated)
    return Paper(item["table"] or "", dict(item["values"]), known, dict(item["changes"]))


def _cell(item: Mapping[str, Any]) -> Cell:
    return Cell(int(item["metric"]), item["case"], item["point"])


def _text(items: Sequence[str | Mapping[str, Any]] | None) -> Text:
    return tuple(
        item
        if isinstance(item, str)
        else Number(
            item["format"], int(item["metric"]), tuple(map(_cell, item["cells"])), tuple(map(_cell, item["against"]))
        )
        for item in items or ()
    )


def _finding(item: Mapping[str, Any]) -> Finding:
    return Finding(
        claim=_text(item["claim"]),
        explanation=_text(item["explanation"]),
        own=bool(item["own"]),
        checks=tuple(
            Check(
                cell=_cell(check["cell"]),
                against=None if check["against"] is None else _cell(check["against"]),
                expect=check["expect"],
                level=None if check["level"] is None else float(check["level"]),
            )
            for check in item["checks"]
        ),
    )


def _metric(item: Mapping[str, Any]) -> Metric:
    return Metric(
        name=item["name"],
        title=item["title"],
        columns=tuple(map(int, item["columns"])),
        combine=item["combine"],
        weights=tuple(map(float, item["weights"])),
        kind=item["kind"],
        threshold=None if item["threshold"] is None else float(item["threshold"]),
        band=_window(item["band"]),
        window=_window(item["window"]),
        until=_until(item["until"]),
        minus=item["minus"],
        from_baseline=bool(item["from_baseline"]),
        conversion=_conversion(item, "unit") or Conversion(""),
        digits=item["digits"],
        paper=_paper(item["paper"]),
    )


def _figure(item: Mapping[str, Any]) -> Figure:
    return Figure(
        name=item["name"],
        title=item["title"],
        kind=item["kind"],
        cases=tuple(item["cases"]),
        separate=bool(item["separate"]),
        columns=tuple(map(int, item["columns"])),
        against=item["against"],
        metrics=tuple(map(int, item["metrics"])),
        window=_window(item["window"]),
        conversion=_conversion(item, "unit"),
        levels=tuple(Level(float(v["value"]), v["title"]) for v in item["levels"]),
        caption=_text(item["caption"]),
    )


def _unread(wiring: Sequence[Mapping[str, Any]]) -> tuple[Unread, ...]:
    """Group the outputs that nothing reads by component; cases that leave the same ones are joined."""
    cases: dict[tuple[str, tuple[str, ...]], list[str]] = {}
    for case in wiring:
        components: dict[str, list[str]] = {}
        for signal in case["unread"]:
            components.setdefault(signal["component"], []).append(signal["variable"])
        for component, outputs in components.items():
            cases.setdefault((component, tuple(outputs)), []).append(case["case"])
    return tuple(Unread(component, outputs, tuple(names)) for (component, outputs), names in cases.items())


def parse(text: str, root: Path) -> Plan:
    """Read a plan; relative paths of FMUs are relative to `root`.

    Raises PlanError if the text is not JSON, has another format number, or lacks a field.
    """
    try:
        data = json.loads(text)
    except ValueError as error:
        raise PlanError(f"the plan is not JSON: {error}") from error
    if not isinstance(data, dict) or data.get("format") != FORMAT:
        found = data.get("format") if isinstance(data, dict) else type(data).__name__
        raise PlanError(f"plan format {found}, expected {FORMAT}: cargo-fmu and the scripts differ in version")
    try:
        s = data["simulation"]
        sweep = data["sweep"]
        return Plan(
            name=data["name"],
            file=data["file"],
            title=data["title"],
            description=data["description"] or "",
            reference=data["reference"] or "",
            simulation=Simulation(
                start=float(s["start"]),
                stop=float(s["stop"]),
                step=float(s["step"]),
                steps=int(s["steps"]),
                order=s["order"],
                every=int(s["every"]),
            ),
            cases=tuple(Case(c["name"], c["title"], c["baseline"]) for c in data["cases"]),
            points=tuple(Point(p["name"], p["title"], float(p["value"])) for p in data["points"]),
            sweep=None if sweep is None else Sweep(sweep["title"], sweep["unit"]),
            seeds=tuple(int(v) for v in data["seeds"]),
            columns=tuple(
                Column(c["name"], c["unit"] or "", _conversion(c, "display_unit"), c["description"] or "")
                for c in data["columns"]
            ),
            runs=tuple(_run(r, root) for r in data["runs"]),
            metrics=tuple(map(_metric, data["metrics"])),
            figures=tuple(map(_figure, data["figures"])),
            findings=tuple(map(_finding, data["findings"])),
            warnings=tuple(map(str, data["warnings"])),
            unread=_unread(data["wiring"]),
        )
    except KeyError as error:
        raise PlanError(f"the plan has no field {error}") from error
    except (TypeError, ValueError, IndexError) as error:
        raise PlanError(f"a field of the plan has an unexpected type: {error}") from error

"""The plan of a scenario: what `chassis plan --json` prints, as typed values.

A plan is complete: every connection is a pair of bus slots, every parameter has its value reference and its
value in the unit of the variable. Nothing here reads the scenario file itself, so that both masters (the native
one and the one in `master`) execute exactly the same thing and every scenario error has one source.

The types have the fields of the JSON text, which msgspec validates. A test compares them with the schema that
`chassis schema plan` prints.
"""

from __future__ import annotations

from pathlib import Path
from typing import Literal, TypeAlias

import msgspec
import numpy as np
from numpy.typing import NDArray

FORMAT = 7

Kind = Literal["Real", "Integer", "Boolean", "String"]
Version = Literal["2.0", "3.0"]


class PlanError(Exception):
    """The text is not a plan this version understands."""


class Conversion(msgspec.Struct, frozen=True):
    """A unit of measure with its conversion: shown value = factor * value + offset."""

    unit: str
    factor: float = 1.0
    offset: float = 0.0


class _Part(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A part of a plan."""


class Setting(_Part, frozen=True, rename={"kind": "type"}):
    """A value for a variable: a parameter, or a constant input."""

    name: str
    kind: Kind
    reference: int
    value: bool | int | float | str


class Wire(_Part, frozen=True, rename={"kind": "type"}):
    """A variable and the bus slot it reads from or writes to."""

    reference: int
    kind: Kind
    slot: int
    name: str


class Component(_Part, frozen=True):
    """An FMU instance of a run."""

    name: str
    fmu: Path
    fmi: Version
    model_identifier: str
    guid: str
    parameters: tuple[Setting, ...]
    constants: tuple[Setting, ...]
    inputs: tuple[Wire, ...]
    outputs: tuple[Wire, ...]
    # Start values of a steady state, set after the parameters; empty if they have not been found.
    steady: tuple[Setting, ...] | None = None

    @property
    def starts(self) -> tuple[Setting, ...]:
        """What is set before initialization, in this order."""
        if self.steady is None:
            return self.parameters
        if not self.steady:
            raise PlanError(
                f"the steady state in which `{self.name}` starts has not been found; `chassis plan --json` finds it"
            )
        return self.parameters + self.steady


class InputSeries(_Part, frozen=True):
    """A signal from an input file. At equal times it jumps."""

    slot: int
    interpolation: Literal["linear", "hold"]
    times: tuple[float, ...]
    values: tuple[float, ...]


class Run(_Part, frozen=True):
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


class Simulation(_Part, frozen=True):
    """Time grid (s), recording interval in steps, and order of execution."""

    start: float
    stop: float
    step: float
    steps: int
    order: Literal["sequential", "jacobi"]
    every: int

    def step_size(self, time: float) -> float:
        """Return the size of the step from a time: the communication step, or what is left of it before the stop time.

        An FMU that was told the stop time may refuse to go beyond it, and the sum of the two may do so by rounding.
        """
        return self.stop - time if time + self.step > self.stop else self.step

    @property
    def rows(self) -> int:
        """Number of recorded rows, the first one at the start time."""
        return self.steps // self.every + 1

    @property
    def times(self) -> NDArray[np.float64]:
        """Times of the recorded rows, s."""
        return self.start + self.step * self.every * np.arange(self.rows, dtype=np.float64)


class Case(_Part, frozen=True):
    """A variant of the system; `baseline` names the case its changes are relative to."""

    name: str
    title: str
    baseline: str | None


class Point(_Part, frozen=True):
    """A point of the sweep; `second` is its place on the second axis, if there is one."""

    name: str
    title: str
    value: float
    second: float | None


class SecondSweep(_Part, frozen=True):
    """The second axis of a sweep over two parameters."""

    title: str
    unit: str


class Sweep(_Part, frozen=True):
    """The abscissa of the points, and the second axis of a sweep over two parameters."""

    title: str
    unit: str
    second: SecondSweep | None


class DisplayUnit(_Part, frozen=True):
    """A unit that values can be shown in: shown value = factor * value + offset."""

    name: str
    factor: float
    offset: float


class Column(_Part, frozen=True):
    """A recorded signal. `display_unit` is the preferred unit for people, where the variable declares one.

    With `from_file` the values are those of the input file, not of the component.
    """

    name: str
    unit: str | None
    display_unit: str | None
    factor: float
    offset: float
    description: str
    units: tuple[DisplayUnit, ...]
    from_file: bool

    @property
    def shown(self) -> Conversion:
        """Unit for people."""
        if self.display_unit is None:
            return Conversion(self.unit or "")
        return Conversion(self.display_unit, self.factor, self.offset)


class Cell(_Part, frozen=True):
    """A cell of the table of metrics; `metric` is an index into the list of the plan."""

    metric: int
    case: str
    point: str | None

    @property
    def key(self) -> str:
        """Return the name that the paper's numbers have: `case` or `case@point`."""
        return self.case if self.point is None else f"{self.case}@{self.point}"


class Paper(_Part, frozen=True):
    """Numbers of a paper for one metric, by `case` or `case@point`, and to which of them something was fitted.

    `changes` are in percent, by two such names with a slash between, where the paper gives no values.
    """

    table: str | None
    values: dict[str, float]
    changes: dict[str, float]
    calibrated: frozenset[str] | None

    def origin(self, key: str) -> str:
        """Say how our number for a value came about: calibrated, predicted; empty if the scenario does not say."""
        if self.calibrated is None or key not in self.values:
            return ""
        return "calibrated" if key in self.calibrated else "predicted"


class Until(_Part, frozen=True):
    """The end of a window: the rows from the first one on where a column is above or below a level do not count."""

    column: int
    above: bool
    level: float


MetricKind: TypeAlias = Literal[
    "rms",
    "mean_square",
    "peak",
    "max",
    "min",
    "mean",
    "final",
    "peak_to_peak",
    "deviation",
    "changes",
    "integral",
    "band_power",
    "crossing",
    "magnitude_crossing",
    "share",
    "share_below",
    "magnitude_share",
    "overshoot",
    "rise_time",
    "settling_time",
]


class Requirement(_Part, frozen=True):
    """Limits that the numbers of a share of the runs of some cases keep, and what demands it, such as a standard."""

    min: float | None
    max: float | None
    cases: tuple[str, ...]
    share: float
    source: str | None


class Metric(_Part, frozen=True):
    """A number computed from signals, or from other metrics.

    Signals: one column, or several combined, less another one; its values are converted before. Its own unit may be
    another one. With `from_baseline` the same signal of the baseline's run is subtracted before.

    Metrics: `value` is a formula of other metrics of the same run, which `uses` lists; the fields of signals are empty.
    """

    name: str
    title: str
    unit: str | None
    digits: int | None
    paper: Paper | None
    requirement: Requirement | None
    value: str | None = None
    uses: tuple[int, ...] = ()
    columns: tuple[int, ...] = ()
    combine: Literal["min", "max", "norm", "squares"] | None = None
    weights: tuple[float, ...] = ()
    kind: MetricKind | None = None
    window: tuple[float, float] | None = None
    until: Until | None = None
    minus: int | None = None
    from_baseline: bool = False
    band: tuple[float, float] | None = None
    threshold: float | None = None
    factor: float = 1.0
    offset: float = 0.0

    @property
    def conversion(self) -> Conversion:
        """Unit of the number, and how the signal is converted before."""
        return Conversion(self.unit or "", self.factor, self.offset)


class Level(_Part, frozen=True):
    """A level that is marked in a plot."""

    value: float
    title: str


class Number(_Part, frozen=True):
    """A number of the results in a text: what number, of which cells (several give a range), compared with what."""

    format: Literal[
        "value",
        "number",
        "percent",
        "spread",
        "change",
        "by",
        "ratio",
        "difference",
        "paper",
        "paper_change",
        "paper_by",
        "threshold",
        "from",
        "to",
        "band",
    ]
    metric: int
    cells: tuple[Cell, ...]
    against: tuple[Cell, ...]


Text: TypeAlias = tuple[str | Number, ...]
"""Words, and numbers that the results fill in."""


class Figure(_Part, frozen=True):
    """A plot: columns over time or over another one, their spectra or transfer functions, or metrics.

    `cases` are the names of those shown, `separate` gives each a panel in a plot over time, `columns` and `metrics`
    are indices into the lists of the plan, as are `against` (drawn beside each column), `right` (drawn over a second
    axis) and `over` (what is on the abscissa: a column, or a metric in a scatter plot).
    """

    name: str
    title: str
    kind: Literal["time", "spectrum", "sweep", "heat_map", "running", "xy", "transfer", "distribution", "scatter"]
    cases: tuple[str, ...]
    separate: bool
    columns: tuple[int, ...]
    against: int | None
    right: int | None
    over: int | None
    metrics: tuple[int, ...]
    same_scale: bool
    equal_axes: bool
    band: tuple[float, float] | None
    window: tuple[float, float] | None
    levels: tuple[Level, ...]
    unit: str | None
    factor: float
    offset: float
    caption: Text | None

    @property
    def conversion(self) -> Conversion | None:
        """Unit of the signals; None: that of each column."""
        return None if self.unit is None else Conversion(self.unit, self.factor, self.offset)


Expect = Literal["paper_change", "paper_value", "lower", "higher", "unchanged", "falls_more", "below", "above", "never"]


class Check(_Part, frozen=True):
    """A comparison that decides on a finding."""

    cell: Cell
    against: Cell | None
    expect: Expect
    level: float | None


class Finding(_Part, frozen=True):
    """A claim, of a paper or (`own`) of this project, and what decides on it."""

    claim: Text
    explanation: Text
    own: bool
    checks: tuple[Check, ...]


class Signal(_Part, frozen=True):
    """A variable of a component."""

    component: str
    variable: str


class Constant(_Part, frozen=True):
    """A value that an input keeps, in its unit."""

    value: bool | int | float | str
    unit: str | None


class Origin(_Part, frozen=True):
    """Where the value of an input comes from: one of the three."""

    output: Signal | None = None
    file: str | None = None
    constant: Constant | None = None


class Connected(_Part, frozen=True):
    """An input and where its value comes from."""

    input: Signal
    source: Origin
    type_change: Literal["boolean_to_real", "real_to_boolean"] | None


class Wiring(_Part, frozen=True):
    """Inputs of a case, and outputs that nothing reads."""

    case: str
    inputs: tuple[Connected, ...]
    unread: tuple[Signal, ...]


class Unread(msgspec.Struct, frozen=True):
    """Outputs of a component that nothing reads, and in which cases."""

    component: str
    outputs: tuple[str, ...]
    cases: tuple[str, ...]


class Plan(_Part, frozen=True):
    """A resolved scenario."""

    format: int
    name: str
    file: str
    title: str
    description: str
    reference: str
    simulation: Simulation
    is_cut: bool
    cases: tuple[Case, ...]
    points: tuple[Point, ...]
    sweep: Sweep | None
    seeds: tuple[int, ...]
    columns: tuple[Column, ...]
    runs: tuple[Run, ...]
    metrics: tuple[Metric, ...]
    figures: tuple[Figure, ...]
    findings: tuple[Finding, ...]
    wiring: tuple[Wiring, ...]
    warnings: tuple[str, ...]

    def run(self, case: str, point: str | None, seed: int | None) -> Run:
        """Return the run of a case, point and seed."""
        for run in self.runs:
            if (run.case, run.point, run.seed) == (case, point, seed):
                return run
        raise KeyError(f"the plan has no run for case {case}, point {point}, seed {seed}")

    @property
    def case_titles(self) -> dict[str, str]:
        """Titles of the cases by their names."""
        return {case.name: case.title for case in self.cases}

    @property
    def point_titles(self) -> dict[str | None, str]:
        """Titles of the points by their names; an empty one without a sweep."""
        return {None: "", **{point.name: point.title for point in self.points}}

    def place(self, case: str, point: str | None) -> str:
        """Return the title of a case at a point."""
        return ", ".join(filter(None, (self.case_titles[case], self.point_titles[point])))

    @property
    def point_names(self) -> tuple[str | None, ...]:
        """Names of the points; a single None without a sweep."""
        return tuple(p.name for p in self.points) or (None,)

    @property
    def seed_values(self) -> tuple[int | None, ...]:
        """Values of the seeds; a single None without seeds."""
        return self.seeds or (None,)

    @property
    def unread(self) -> tuple[Unread, ...]:
        """Group the outputs that nothing reads by component; cases that leave the same ones are joined."""
        cases: dict[tuple[str, tuple[str, ...]], list[str]] = {}
        for case in self.wiring:
            components: dict[str, list[str]] = {}
            for signal in case.unread:
                components.setdefault(signal.component, []).append(signal.variable)
            for component, outputs in components.items():
                cases.setdefault((component, tuple(outputs)), []).append(case.case)
        return tuple(Unread(component, outputs, tuple(names)) for (component, outputs), names in cases.items())


class _Version(msgspec.Struct):
    format: int


def parse(text: str, root: Path) -> Plan:
    """Read a plan; relative paths of FMUs are relative to `root`.

    Raises PlanError if the text is not JSON, has another format number, or does not have the fields of a plan.
    """

    def path(_type: type, value: str) -> Path:
        return root / value

    try:
        found = msgspec.json.decode(text, type=_Version).format
        if found != FORMAT:
            raise PlanError(
                f"plan format {found}, expected {FORMAT}: `chassis` and the Python package differ in version"
            )
        return msgspec.json.decode(text, type=Plan, dec_hook=path)
    except msgspec.ValidationError as error:
        raise PlanError(f"the plan does not have the expected fields: {error}") from error
    except msgspec.DecodeError as error:
        raise PlanError(f"the plan is not JSON: {error}") from error

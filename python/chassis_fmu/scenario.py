"""Scenarios as objects: run them with changed values, at native speed."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, TypeAlias

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from . import _native, program
from .files import plan
from .program import PACKAGE, ROOT

Value: TypeAlias = "float | int | bool | str | bytes"
Values: TypeAlias = Mapping[str, Value]
"""Values by `component:variable`, in the units of the variables; enumerations by name or number, Binaries as bytes."""

Column: TypeAlias = "NDArray[np.float64]"

Recorded: TypeAlias = "tuple[Column, list[Column | None]]"
"""Times of a run, and the columns of the plan; None where the case has no such component."""

ExactColumn: TypeAlias = "Column | NDArray[np.int64] | NDArray[np.uint64] | list[bytes]"
"""A column with the exact values: those of an Int64 or UInt64 are integers, those of a Binary are bytes."""

Status = Literal["ok", "rejected", "diverged", "crashed", "timed_out"]

ScenarioError = _native.ScenarioError


class RunError(Exception):
    """A run that failed: its status, the time of the failure (s) and the message."""

    def __init__(self, status: Status, time: float | None, message: str) -> None:
        at = "" if time is None else f" at {time:g} s"
        super().__init__(f"{status.replace('_', ' ')}{at}: {message}")
        self.status = status
        self.time = time
        self.message = message

    def __reduce__(self) -> tuple[type[RunError], tuple[Status, float | None, str]]:
        return type(self), (self.status, self.time, self.message)


@contextmanager
def run_error() -> Iterator[None]:
    """Raise `RunError` for a run that fails in this process."""
    try:
        yield
    except _native.RunFailedError as failure:
        time, message = failure.args
        raise RunError("rejected" if time is None else "diverged", time, message) from None


@dataclass(frozen=True)
class Variable:
    """A variable that can be set, with its value in the scenario."""

    name: str
    base_type: str
    unit: str | None
    units: tuple[plan.Conversion, ...]
    min: float | None
    max: float | None
    value: Value | None
    description: str

    def from_unit(self, value: float, unit: str) -> float:
        """Convert a value to the unit of the variable."""
        if unit == self.unit:
            return value
        for known in self.units:
            if known.unit == unit:
                return (value - known.offset) / known.factor
        names = ", ".join(f"`{u}`" for u in dict.fromkeys([self.unit or "no unit", *(u.unit for u in self.units)]))
        raise ScenarioError(f"`{self.name}` cannot be given in `{unit}`, expected {names}")


@dataclass(frozen=True)
class Sample:
    """Changed values, and the indices of the runs in the plan that use them."""

    values: tuple[tuple[str, Value], ...]
    runs: tuple[int, ...]


@dataclass(frozen=True)
class Outcome:
    """Result of a run with the values of a sample."""

    sample: int
    run: int
    numbers: tuple[float | None, ...]
    """Values of the plan's metrics; empty if the run failed."""
    status: Status
    time: float | None
    component: str | None
    """Component that failed, if known."""
    variable: str | None
    """Recorded signal that is not finite."""
    message: str | None
    seconds: float


def fmus() -> dict[str, Path]:
    """Return the FMUs of this package by name, or those of the repository it is installed from."""
    return {path.stem: path for path in sorted(default_folder().glob("*.fmu"))}


def default_folder() -> Path:
    """Return the folder that is searched for FMUs."""
    folders = (PACKAGE / "fmus", ROOT / "target" / "fmu")
    return next((folder for folder in folders if any(folder.glob("*.fmu"))), folders[-1])


def worker_program() -> Path:
    """Return the program that executes FMUs in separate processes."""
    try:
        return program.find()
    except program.ProgramError as error:
        raise ScenarioError(str(error)) from error


def _split(name: str) -> tuple[str, str]:
    component, colon, variable = name.partition(":")
    if not colon or not component or not variable:
        raise ScenarioError(f'"{name}", expected "component:variable"')
    return component, variable


class Scenario:
    """A scenario file with its FMUs.

    `fmus` lists folders with FMUs (default: the folder of `fmus()`), `stop` ends the runs earlier (s),
    `step` is another communication step (s), and `replace` gives other FMUs for components. Raises `ScenarioError`,
    with file, line and column, if the file or an FMU cannot be used.
    """

    def __init__(
        self,
        file: str | Path,
        *,
        fmus: Sequence[str | Path] | None = None,
        stop: float | None = None,
        step: float | None = None,
        replace: Mapping[str, str] | None = None,
        keep_parameters: bool = False,
    ) -> None:
        self.file = Path(file).resolve()
        self._folders = [Path(f).resolve() for f in ([default_folder()] if fmus is None else fmus)]
        self._stop = stop
        self._step = step
        self._replace = dict(replace or {})
        self._keep_parameters = keep_parameters
        self._connect()

    def _connect(self) -> None:
        replaced = {component: (fmu, self._keep_parameters) for component, fmu in self._replace.items()}
        self._native = _native.System(self.file, self._folders, self._stop, self._step, replaced)
        self.plan = plan.Plan.parse(self._native.plan(), Path())

    def __getstate__(self) -> dict[str, Any]:
        return {key: value for key, value in vars(self).items() if key not in ("_native", "plan")}

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state)
        self._connect()

    def __repr__(self) -> str:
        return f"Scenario({str(self.file)!r})"

    def json(self) -> str:
        """Return the plan as JSON."""
        return self._native.plan()

    @property
    def cases(self) -> tuple[str, ...]:
        """Names of all cases."""
        return tuple(case.name for case in self.plan.cases)

    @property
    def metrics(self) -> tuple[str, ...]:
        """Names of all metrics."""
        return tuple(metric.name for metric in self.plan.metrics)

    def variable(self, name: str) -> Variable:
        """Return the variable `component:variable`; raises `ScenarioError` if it cannot be set."""
        base, unit, units, least, greatest, value, description = self._native.variable(*_split(name))
        conversions = tuple(plan.Conversion(*u) for u in units)
        return Variable(name, base, unit, conversions, least, greatest, value, description or "")

    def index(self, case: str | None = None, point: str | None = None, seed: int | None = None) -> int:
        """Return the index of a run in the plan, by case, point and seed; each defaults to the first one."""
        case = self.cases[0] if case is None else case
        point = self.plan.point_names[0] if point is None else point
        seed = self.plan.seed_values[0] if seed is None else seed
        for known, given, what in (
            (self.cases, case, "case"),
            (self.plan.point_names, point, "point"),
            (self.plan.seed_values, seed, "seed"),
        ):
            if known == (None,) and given is not None:
                raise ScenarioError(f"{what} is {given!r}, but the scenario has no {what}s: leave it out")
            if given not in known:
                raise ScenarioError(f"unknown {what} {given!r}, expected one of {', '.join(map(repr, known))}")
        return next(i for i, r in enumerate(self.plan.runs) if (r.case, r.point, r.seed) == (case, point, seed))

    def run(
        self,
        values: Values | None = None,
        *,
        case: str | None = None,
        point: str | None = None,
        seed: int | None = None,
    ) -> dict[str, float | None]:
        """Run a case with changed values and return its metrics.

        A value is a plain number in the unit of its variable, `variable(name).unit`; `variable(name).from_unit(100.0,
        "km/h")` converts a number from another unit. A Boolean takes a bool, an enumeration a name or number.

        The run is executed in this process, without the interpreter's lock. If an FMU crashes, the process ends; to
        avoid that, use `run_many` with `workers`. Raises `RunError` if the run fails.
        """
        outcome = self.run_many([values or {}], case=case, point=point, seed=seed)[0]
        return self.numbers(outcome)

    def numbers(self, outcome: Outcome) -> dict[str, float | None]:
        """Return the metrics of a run by name; raises `RunError` if it failed."""
        if outcome.status != "ok":
            raise RunError(outcome.status, outcome.time, outcome.message or "")
        return dict(zip(self.metrics, outcome.numbers, strict=True))

    def run_many(
        self,
        values: Sequence[Values],
        *,
        case: str | None = None,
        point: str | None = None,
        seed: int | None = None,
        workers: int | None = None,
        timeout: float = 60.0,
        progress: Callable[[int], object] | None = None,
    ) -> list[Outcome]:
        """Run a case with each of several sets of values; a run that fails also gives an outcome.

        `workers` is the number of processes that execute the FMUs; without it, this process executes them.
        `timeout` limits the duration of a step (s). `progress` is called with the number of finished runs.
        """
        index = self.index(case, point, seed)
        samples = [Sample(tuple(v.items()), (index,)) for v in values]
        found: list[Outcome] = []

        def take(outcome: Outcome) -> bool:
            found.append(outcome)
            if progress is not None:
                progress(len(found))
            return True

        if workers is None:
            for number, sample in enumerate(samples):
                rows = self._native.execute_here(self._changes(sample), list(sample.runs))
                take(self._outcome((number, *rows[0][1:])))
        else:
            self.start(workers, timeout)
            self.execute(samples, take)
        return sorted(found, key=lambda o: o.sample)

    def start(self, jobs: int, timeout: float = 60.0) -> None:
        """Prepare worker processes for `execute`; each starts when it is first needed."""
        self._native.start(worker_program(), jobs, timeout, program.python_library())

    def execute(self, samples: Sequence[Sample], take: Callable[[Outcome], bool]) -> None:
        """Execute samples in the workers. `take` gets outcomes in any order and returns False to stop."""
        changes = [(self._changes(s), list(s.runs)) for s in samples]
        self._native.execute(changes, lambda row: take(self._outcome(row)))

    def record_many(self, runs: Sequence[tuple[tuple[tuple[str, Value], ...], int]]) -> list[Recorded | str]:
        """Execute runs with changed values in the workers; returns the signals of each run, or its failure."""
        found: dict[int, Recorded | str] = {}

        def take(index: int, times: Column | None, columns: list[Column | None], message: str | None) -> None:
            found[index] = (times, columns) if times is not None else message or ""

        self._native.record([(self._changes(Sample(values, (run,))), run) for values, run in runs], take)
        return [found[index] for index in range(len(runs))]

    def _outcome(self, row: _native.Row) -> Outcome:
        """Return a row as an outcome; paths in its message are shortened to the names of the FMU files."""
        sample, run, numbers, status, time, place, variable, message, seconds = row
        if message is not None:
            for component in self.plan.runs[run].components:
                message = message.replace(str(component.fmu), component.fmu.name)
        return Outcome(sample, run, tuple(numbers), status, time, place, variable, message, seconds)

    def simulate(
        self,
        values: Values | None = None,
        *,
        case: str | None = None,
        point: str | None = None,
        seed: int | None = None,
    ) -> pa.Table:
        """Run a case with changed values in this process and return its recorded signals, with a column `time` (s).

        Units are in the field metadata; `to_pandas()` makes a data frame. Columns of Int64, UInt64 and Binary variables
        have these types. The arrays are not copied. Raises `RunError` if the run fails.
        """
        index = self.index(case, point, seed)
        times, columns = self.record(tuple((values or {}).items()), index)
        signals = [("time", pa.array(times), "s")]
        for column, array in zip(self.plan.columns, columns, strict=True):
            if array is not None:
                signals.append((column.name, pa.array(array), column.unit or "1"))
        fields = [pa.field(name, array.type, metadata={"unit": unit}) for name, array, unit in signals]
        return pa.table([array for _, array, _ in signals], schema=pa.schema(fields))

    def record(self, values: tuple[tuple[str, Value], ...], run: int) -> tuple[Column, list[ExactColumn | None]]:
        """Run with changed values in this process; returns the times and the columns of the plan."""
        with run_error():
            return self._native.simulate(self._changes(Sample(values, (run,))), run)

    def session(
        self, values: Values | None = None, *, run: int = 0, inputs: Sequence[str] = (), columns: Sequence[int] = ()
    ) -> _native.Session:
        """Instantiate and initialize a run of the plan in this process, to advance it step by step.

        `inputs` lists the inputs that `Session.step` overwrites, each as `component:input`; `columns` lists the indices
        of the plan's columns that `Session.read` returns. Raises `RunError` if the run cannot be initialized.
        """
        changes = self._changes(Sample(tuple((values or {}).items()), (run,)))
        with run_error():
            return _native.Session(self._native, run, changes, [_split(name) for name in inputs], columns)

    def _changes(self, sample: Sample) -> list[tuple[str, str, Value]]:
        """Return the changes of a sample; raises `TypeError` for a value that is not a number, bool, str or bytes."""
        for name, value in sample.values:
            if isinstance(value, bool | int | float | str | bytes):
                continue
            try:
                # Accepts NumPy numbers.
                float(value)
            except (TypeError, ValueError):
                raise TypeError(
                    f"`{name}` must be a number in the unit of the variable, a bool, a str or bytes, got {value!r}; "
                    f'`variable("{name}").from_unit(number, "unit")` converts a number from another unit'
                ) from None
        return [(*_split(name), value) for name, value in sample.values]

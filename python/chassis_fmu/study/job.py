"""The work of a study: a scenario for each choice of FMUs and step (a variant), and the changes for each sample."""

from __future__ import annotations

import contextlib
import functools
import hashlib
import itertools
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgspec

from .. import _native
from ..evaluation.results_table import change
from ..files import plan
from ..scenario import Outcome, Sample, Scenario, ScenarioError, Value, Variable
from .factors import Factor
from .file import Study


@dataclass(frozen=True)
class Task:
    """A sample: its number in the study, its variant, its values, and the runs of the plan to execute."""

    number: int
    variant: int
    sample: Sample


@dataclass(frozen=True, slots=True)
class Done:
    """A completed run, which is a row of the results: sample number, cell index, outcome."""

    number: int
    cell: int
    numbers: tuple[float | None, ...]
    status: str
    time: float | None
    component: str | None
    variable: str | None
    message: str | None
    seconds: float


@dataclass(frozen=True)
class Limits:
    """Required limits of a metric, in its unit, or of its change against the baseline, in percent."""

    metric: int
    min: float | None
    max: float | None
    cases: tuple[str, ...]
    share: float
    source: str | None = None
    of_change: bool = False

    def holds(self, value: float | None) -> bool:
        """Return whether a number is within the limits; False if it is missing or not finite."""
        return _native.holds(self.min, self.max, value)


class Job:
    """A study with its scenario: the input for an engine, and the meaning of its rows."""

    def __init__(self, study: Study, path: Path, folders: Sequence[Path]) -> None:
        self.study = study
        self.name = path.stem
        open_scenario = functools.partial(Scenario, (path.parent / study.scenario).resolve(), fmus=tuple(folders))
        factors = [f for f in study.vary if f.fmu is not None or f.is_step]
        choices = list(itertools.product(*(f.values or () for f in factors)))
        keep = any(f.keep_parameters for f in factors)
        self._factors = factors
        # For each variant, the function that opens its scenario; small, because a cluster sends it to its workers.
        self.sources = [
            functools.partial(
                open_scenario,
                stop=study.stop,
                step=next((float(value) for f, value in zip(factors, choice, strict=True) if f.is_step), None),
                replace={f.fmu: str(name) for f, name in zip(factors, choice, strict=True) if f.fmu is not None},
                keep_parameters=keep,
            )
            for choice in choices
        ]
        self._choices: dict[tuple[Value, ...], int] = {choice: index for index, choice in enumerate(choices)}
        self.scenarios = [source() for source in self.sources]
        self.plan = self.scenarios[0].plan
        self.cells = self._cells()
        self.metrics = self._metrics()
        self.requirements = self._requirements()
        # Indices of the cells in the plan of each variant.
        known = [{run.id: index for index, run in enumerate(s.plan.runs)} for s in self.scenarios]
        self._runs = [tuple(of[run.id] for run in self.cells) for of in known]
        self._variables = {f.name: [self._variable(name) for name in f.variables] for f in study.vary if f.fmu is None}

    def _cells(self) -> list[plan.Run]:
        """Return the runs of the plan that each sample executes: cases and points, with the first seed."""
        seed = self.plan.seed_values[0]
        return [
            run
            for run in self.plan.runs
            if run.seed == seed
            and (self.study.cases is None or run.case in self.study.cases)
            and (self.study.points is None or run.point in self.study.points)
        ]

    def _metrics(self) -> list[int]:
        """Return the indices of the metrics that are reported."""
        names = [m.name for m in self.plan.metrics]
        wanted = {*(self.study.metrics or names), *(r.metric for r in self.study.requirement)}
        if self.study.search is not None:
            wanted.add(self.study.search.metric)
        return [index for index, name in enumerate(names) if name in wanted]

    def _requirements(self) -> list[Limits]:
        cases = tuple(dict.fromkeys(run.case for run in self.cells))
        names = [m.name for m in self.plan.metrics]
        own = {r.metric for r in self.study.requirement}
        found = []
        for index in self.metrics:
            metric = self.plan.metrics[index]
            if metric.requirement is not None and metric.name not in own:
                of = tuple(c for c in metric.requirement.cases if c in cases)
                if of:
                    limits = metric.requirement
                    found.append(Limits(index, limits.min, limits.max, of, limits.share, limits.source))
        known = [c.name for c in self.plan.cases if c.baseline in cases]
        compared = tuple(c for c in cases if c in known)
        for written in self.study.requirement:
            of = compared if written.of_change else cases
            of = of if written.cases is None else tuple(written.cases)
            index = names.index(written.metric)
            found.append(Limits(index, written.min, written.max, of, written.share, of_change=written.of_change))
        return found

    def _variable(self, name: str) -> Variable:
        """Return a variable, from the first variant that has it."""
        for scenario in self.scenarios[:-1]:
            with contextlib.suppress(ScenarioError):
                return scenario.variable(name)
        return self.scenarios[-1].variable(name)

    def unit(self, factor: Factor) -> str:
        """Return the unit of a factor's values: as written, or the unit of its variables if they share one."""
        if factor.is_step:
            return "s"
        if factor.unit is not None or factor.relative or factor.distribution == "seed":
            return factor.unit or ""
        known = {variable.unit or "" for variable in self._variables.get(factor.name, ())}
        is_number = all(not isinstance(level, str | bool) for level in factor.levels or ())
        return known.pop() if len(known) == 1 and is_number else ""

    def place(self, cell: int) -> str:
        """Return the title of a cell: its case and point."""
        return self.plan.place(self.cells[cell].case, self.cells[cell].point)

    def baseline(self, cell: int) -> int | None:
        """Return the cell of the baseline of a case, at the same point; None if it is not executed."""
        run = self.cells[cell]
        name = next(c.baseline for c in self.plan.cases if c.name == run.case)
        return next((i for i, r in enumerate(self.cells) if name and (r.case, r.point) == (name, run.point)), None)

    def judged(self, limits: Limits, rows: Mapping[tuple[int, int], Done], number: int, cell: int) -> float | None:
        """Return the number in a run that `limits` apply to; None if the run has no such number."""
        value = self._number(rows, limits.metric, number, cell)
        if not limits.of_change:
            return value
        baseline = self.baseline(cell)
        base = None if baseline is None else self._number(rows, limits.metric, number, baseline)
        return None if value is None or base is None else change(value, base)

    def _number(self, rows: Mapping[tuple[int, int], Done], metric: int, number: int, cell: int) -> float | None:
        row = rows.get((number, cell))
        return row.numbers[self.metrics.index(metric)] if row is not None and row.numbers else None

    def task(self, number: int, values: Mapping[str, Value]) -> Task:
        """Return the task of a sample: its values as changes to the scenario."""
        variant = self._choices[tuple(values[f.name] for f in self._factors)]
        changes: list[tuple[str, Value]] = []
        for factor in self.study.vary:
            if factor.fmu is not None:
                continue
            for variable in self._variables[factor.name]:
                changes.append((variable.name, _in_unit(factor, variable, values[factor.name])))
        return Task(number, variant, Sample(tuple(changes), self._runs[variant]))

    def done(self, task: Task, outcome: Outcome) -> Done:
        """Return the row of an outcome, with the metrics that the study reports."""
        cell = task.sample.runs.index(outcome.run)
        numbers = tuple(outcome.numbers[m] for m in self.metrics) if outcome.numbers else ()
        rest = {name: value for name, value in vars(outcome).items() if name not in ("sample", "run", "numbers")}
        return Done(task.number, cell, numbers, **rest)

    def lost(self, task: Task, message: str) -> list[Done]:
        """Return the rows of a task whose worker processes ended, for whatever reason."""
        return [
            Done(task.number, cell, (), "crashed", None, None, None, message, 0.0) for cell in range(len(self.cells))
        ]

    def fmu_files(self) -> list[Path]:
        """Return all FMUs, each once."""
        return sorted({unit.fmu for s in self.scenarios for run in s.plan.runs for unit in run.components})

    def data_files(self) -> list[Path]:
        """Return all files that the FMUs read, each once: their paths are in Strings and in levels of factors."""
        named = {text for _, text in self._strings()}
        # Strings in a plan that name files are absolute paths.
        found = {path for path in map(Path, named) if path.is_absolute() and path.is_file()}
        return sorted(found | set(self._levels().values()))

    def warnings(self) -> list[str]:
        """Return a warning for each String that names a folder, because a study does not track the files in it."""
        named = set(self._strings())
        named |= {
            (f"a value of `{factor.name}`", level)
            for factor in self.study.vary
            if factor.fmu is None
            for level in factor.levels or ()
            if isinstance(level, str)
        }
        top = self.scenarios[0].file.parent
        return [
            f"{what} names the folder {text}: `--resume` does not detect changes in its files, and they are not sent "
            "to other machines; use Strings that name files"
            for what, text in sorted(named)
            # A String such as "." or "/" is a separator, not a folder.
            if any(map(str.isalnum, text)) and _tells((top / text).is_dir)
        ]

    def _strings(self) -> Iterator[tuple[str, str]]:
        """Iterate over the Strings in all scenarios: a description of the parameter or input, and the value."""
        for unit in (unit for s in self.scenarios for run in s.plan.runs for unit in run.components):
            for setting in (*unit.parameters, *unit.constants):
                if setting.type == "String":
                    yield f"`{setting.name}` of `{unit.name}`", str(setting.value)

    def _levels(self) -> dict[str, Path]:
        """Return the files that levels of factors name; a relative path starts at the folder of the scenario."""
        levels = {str(level) for factor in self.study.vary for level in factor.levels or () if isinstance(level, str)}
        files = {level: self.scenarios[0].file.parent / level for level in levels if level}
        return {level: path for level, path in files.items() if _tells(path.is_file)}

    def fingerprint(self) -> str:
        """Return a hash of everything that determines the rows: study, scenario, FMUs and the files that they read."""
        # Paths are replaced by hashes of the files, so the folder of the FMUs does not matter.
        hashes = {str(path): _hash(path) for path in (*self.fmu_files(), *self.data_files())}
        plans = [[_without_paths(s.json(), hashes) for s in self.scenarios], sorted(set(hashes.values()))]
        parts: list[Any] = [_of_study(self.study), plans]
        parts += [[level, _hash(path)] for level, path in sorted(self._levels().items())]
        return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()


def _hash(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _tells(test: Callable[[], bool]) -> bool:
    """Return the result of a path test; False for text that is not a valid path, such as a very long one."""
    try:
        return test()
    except (OSError, ValueError):
        return False


def _of_study(study: Study) -> Any:
    raw = msgspec.to_builtins(study)
    for key in ("title", "description", "reference", "scenario", "series", "requirement"):
        raw.pop(key, None)
    return raw


def _without_paths(text: str, hashes: Mapping[str, str]) -> str:
    found = json.loads(text)
    for key in ("file", "title", "description", "reference", "figures", "findings", "warnings"):
        found.pop(key, None)
    for run in found["runs"]:
        for unit in run["components"]:
            unit["fmu"] = hashes.get(unit["fmu"], unit["fmu"])
            for setting in (*unit["parameters"], *unit["constants"]):
                if setting["type"] == "String":
                    setting["value"] = hashes.get(setting["value"], setting["value"])
    return hashlib.sha256(json.dumps(found, sort_keys=True).encode()).hexdigest()


def _in_unit(factor: Factor, variable: Variable, value: Value) -> Value:
    if isinstance(value, str | bool | bytes) or factor.distribution == "seed":
        return value
    if factor.relative and isinstance(variable.value, float):
        return value * variable.value
    if variable.base_type == "Real":
        return variable.from_unit(float(value), factor.unit) if factor.unit is not None else float(value)
    return value

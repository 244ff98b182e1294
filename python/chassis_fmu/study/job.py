"""What a study executes: its scenario once for each choice of FMUs, and the changes of each sample."""

from __future__ import annotations

import hashlib
import itertools
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from .. import _native
from ..evaluation.results_table import change
from ..files import plan
from ..names import unknown
from ..scenario import Outcome, Sample, Scenario, ScenarioError, Value, Variable
from .factors import Factor
from .file import Requirement, Study, StudyError


@dataclass(frozen=True)
class Source:
    """How a scenario is opened; small, so that it can travel."""

    file: Path
    folders: tuple[Path, ...]
    stop: float | None
    replace: tuple[tuple[str, str], ...]
    keep_parameters: bool

    def open(self) -> Scenario:
        """Open the scenario."""
        return Scenario(
            self.file,
            fmus=self.folders,
            stop=self.stop,
            replace=dict(self.replace),
            keep_parameters=self.keep_parameters,
        )


@dataclass(frozen=True)
class Task:
    """A sample of a variant: its number in the study, values, and runs of the plan."""

    number: int
    variant: int
    sample: Sample


@dataclass(frozen=True, slots=True)
class Done:
    """What came of a run: number of the sample, index of the cell, and the outcome."""

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
    """A requirement of a metric, in its unit, or of its change against the baseline, in percent."""

    metric: int
    min: float | None
    max: float | None
    cases: tuple[str, ...]
    share: float
    source: str | None = None
    of_change: bool = False

    def holds(self, value: float | None) -> bool:
        """Tell whether a number keeps the limits; one that is not there or not finite does not."""
        return _native.holds(self.min, self.max, value)


class Job:
    """A study with its scenario: all that an engine needs, and what its rows mean."""

    def __init__(self, study: Study, path: Path, folders: Sequence[Path]) -> None:
        self.study = study
        self.name = path.stem
        scenario = (path.parent / study.scenario).resolve()
        if not scenario.is_file():
            raise StudyError(f"{path}: scenario: there is no file {scenario}")
        factors = [f for f in study.vary if f.fmu is not None]
        choices = list(itertools.product(*((str(v) for v in f.values or ()) for f in factors)))
        keep = any(f.keep_parameters for f in factors)
        self._factors = factors
        self.sources = [
            Source(
                scenario,
                tuple(folders),
                study.stop,
                tuple((f.fmu or "", name) for f, name in zip(factors, choice, strict=True)),
                keep,
            )
            for choice in choices
        ]
        self._choices = {choice: index for index, choice in enumerate(choices)}
        self.scenarios = [_open(source, path) for source in self.sources]
        self.plan = self.scenarios[0].plan
        problems: list[str] = []
        self.cells = self._cells(problems)
        self.metrics = self._metrics(problems)
        self.requirements = self._requirements(problems)
        # Indices of the cells in the plan of each variant.
        known = [{run.id: index for index, run in enumerate(s.plan.runs)} for s in self.scenarios]
        self._runs = [tuple(of[run.id] for run in self.cells) for of in known]
        self._variables = {f.name: self._variables_of(f, problems) for f in study.vary if f.fmu is None}
        self._check_names(problems)
        if problems:
            raise StudyError("\n".join(f"{path}: {problem}" for problem in problems))

    def _cells(self, problems: list[str]) -> list[plan.Run]:
        """Return the runs of the plan that each sample is tried in: cases and points, with the first seed."""
        for kind, wanted, known in (
            ("case", self.study.cases, [c.name for c in self.plan.cases]),
            ("point", self.study.points, [p.name for p in self.plan.points]),
        ):
            problems += [f"{kind}s: {unknown(kind, name, known)}" for name in wanted or () if name not in known]
            if wanted == []:
                problems.append(f"{kind}s is empty; without the key all {kind}s are run")
        seed = self.plan.seed_values[0]
        return [
            run
            for run in self.plan.runs
            if run.seed == seed
            and (self.study.cases is None or run.case in self.study.cases)
            and (self.study.points is None or run.point in self.study.points)
        ]

    def _metrics(self, problems: list[str]) -> list[int]:
        """Return the indices of the metrics that are reported."""
        names = [m.name for m in self.plan.metrics]
        if not names:
            problems.append("scenario: it has no [[metric]], so there is nothing to report")
        problems += [f"metrics: {unknown('metric', m, names)}" for m in self.study.metrics or () if m not in names]
        wanted = {*(self.study.metrics or names), *(r.metric for r in self.study.requirement)}
        if self.study.search is not None:
            wanted.add(self.study.search.metric)
            if self.study.search.metric not in names:
                problems.append(f"search: {unknown('metric', self.study.search.metric, names)}")
            cases = {run.case for run in self.cells}
            if self.study.search.case is not None and self.study.search.case not in cases:
                problems.append(f"search: {unknown('case', self.study.search.case, sorted(cases))}")
        series = self.study.series
        if series is not None and series.metric is not None and series.metric not in names:
            problems.append(f"series: {unknown('metric', series.metric, names)}")
        return [index for index, name in enumerate(names) if name in wanted]

    def _requirements(self, problems: list[str]) -> list[Limits]:
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
        for written in self.study.requirement:
            if written.metric not in names:
                problems.append(f"requirement: {unknown('metric', written.metric, names)}")
                continue
            for case in written.cases or ():
                if case not in cases:
                    problems.append(f"requirement of `{written.metric}`: {unknown('case', case, cases)}")
            known = [c.name for c in self.plan.cases if c.baseline in cases]
            compared = tuple(c for c in cases if c in known)
            if written.of_change and cases and not set(written.cases or compared) <= set(compared):
                problems.append(f"requirement of `{written.metric}`: a case has no baseline that is run")
            if written.of_change and cases and not compared:
                problems.append(f"requirement of `{written.metric}`: no case has a baseline that is run")
            found.append(self._limits(written, names.index(written.metric), compared if written.of_change else cases))
        return found

    @staticmethod
    def _limits(written: Requirement, metric: int, cases: tuple[str, ...]) -> Limits:
        of = cases if written.cases is None else tuple(written.cases)
        return Limits(metric, written.min, written.max, of, written.share, of_change=written.of_change)

    def _variables_of(self, factor: Factor, problems: list[str]) -> list[Variable]:
        """Return the variables of a factor, of the first choice of FMUs that has them."""
        found = []
        for name in factor.variables:
            first: ScenarioError | None = None
            for scenario in self.scenarios:
                try:
                    variable = scenario.variable(name)
                except ScenarioError as error:
                    first = first or error
                else:
                    found.append(variable)
                    problems += [f"[[vary]] `{factor.name}`: {p}" for p in _misfits(factor, variable)]
                    first = None
                    break
            if first is not None:
                problems.append(f"[[vary]] `{factor.name}`: {first}")
        return found

    def _check_names(self, problems: list[str]) -> None:
        metrics = {m.name for m in self.plan.metrics}
        problems += [
            f"[[vary]] `{f.name}`: the scenario has a metric of that name, choose another one"
            for f in self.study.vary
            if f.name in metrics
        ]

    def unit(self, factor: Factor) -> str:
        """Return the unit of the values of a factor: as written, or that of its variables if it is the same."""
        if factor.unit is not None or factor.relative or factor.distribution == "seed":
            return factor.unit or ""
        known = {variable.unit or "" for variable in self._variables.get(factor.name, ())}
        is_number = all(not isinstance(level, str | bool) for level in factor.levels or ())
        return known.pop() if len(known) == 1 and is_number else ""

    def baseline(self, cell: int) -> int | None:
        """Return the cell of the baseline of a case, at the same point; None if it is not run."""
        run = self.cells[cell]
        name = next(c.baseline for c in self.plan.cases if c.name == run.case)
        return next((i for i, r in enumerate(self.cells) if name and (r.case, r.point) == (name, run.point)), None)

    def judged(self, limits: Limits, rows: Mapping[tuple[int, int], Done], number: int, cell: int) -> float | None:
        """Return the number of a run that a requirement is about; None if there is none."""
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
        """Return the task of a sample: its values as changes of the scenario."""
        choice = tuple(str(values[f.name]) for f in self._factors)
        variant = self._choices[choice]
        changes: list[tuple[str, Value]] = []
        for factor in self.study.vary:
            if factor.fmu is not None:
                continue
            for variable in self._variables[factor.name]:
                changes.append((variable.name, _in_unit(factor, variable, values[factor.name])))
        return Task(number, variant, Sample(tuple(changes), self._runs[variant]))

    def done(self, task: Task, outcome: Outcome) -> Done:
        """Return the row of an outcome: with the metrics that the study reports."""
        cell = task.sample.runs.index(outcome.run)
        numbers = tuple(outcome.numbers[m] for m in self.metrics) if outcome.numbers else ()
        rest = {name: value for name, value in vars(outcome).items() if name not in ("sample", "run", "numbers")}
        return Done(task.number, cell, numbers, **rest)

    def lost(self, task: Task, message: str) -> list[Done]:
        """Return the rows of a task whose processes ended, whatever it was that ended them."""
        return [
            Done(task.number, cell, (), "crashed", None, None, None, message, 0.0) for cell in range(len(self.cells))
        ]

    def fmu_files(self) -> list[Path]:
        """Return all FMUs, each once."""
        return sorted({unit.fmu for s in self.scenarios for run in s.plan.runs for unit in run.components})

    def data_files(self) -> list[Path]:
        """Return all files that the FMUs read: those that Strings and levels of factors name, each once."""
        named = {text for _, text in self._strings()}
        # Absolute already, because they are those of a plan.
        found = {path for path in map(Path, named) if path.is_absolute() and path.is_file()}
        return sorted(found | set(self._levels().values()))

    def warnings(self) -> list[str]:
        """Return a warning for each String that names a folder, whose files are not part of the study."""
        named = set(self._strings())
        named |= {
            (f"a value of `{factor.name}`", level)
            for factor in self.study.vary
            if factor.fmu is None
            for level in factor.levels or ()
            if isinstance(level, str)
        }
        top = self.sources[0].file.parent
        return [
            f"{what} names the folder {text}: `--resume` ignores changes of its files, and other machines do not get "
            "them; use Strings that name files"
            for what, text in sorted(named)
            # A decimal or path separator is an option, not a folder.
            if any(map(str.isalnum, text)) and _tells((top / text).is_dir)
        ]

    def _strings(self) -> Iterator[tuple[str, str]]:
        """Iterate over the Strings of all scenarios: parameter or input with its component, and value."""
        for unit in (unit for s in self.scenarios for run in s.plan.runs for unit in run.components):
            for setting in (*unit.parameters, *unit.constants):
                if setting.type == "String":
                    yield f"`{setting.name}` of `{unit.name}`", str(setting.value)

    def _levels(self) -> dict[str, Path]:
        """Return the files that levels of factors name; a relative path starts at the folder of the scenario."""
        levels = {str(level) for factor in self.study.vary for level in factor.levels or () if isinstance(level, str)}
        files = {level: self.sources[0].file.parent / level for level in levels if level}
        return {level: path for level, path in files.items() if _tells(path.is_file)}

    def fingerprint(self) -> str:
        """Return a hash of all that decides about the rows: study, scenario, FMUs and the files that they read."""
        parts: list[Any] = [_of_study(self.study), self.plan_hash()]
        parts += [[level, _hash(path)] for level, path in sorted(self._levels().items())]
        return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()

    def plan_hash(self) -> list[Any]:
        """Return what identifies the runs, wherever the FMUs lie."""
        files = [*self.fmu_files(), *self.data_files()]
        hashes = {str(path): _hash(path) for path in files}
        return [[_without_paths(s.json(), hashes) for s in self.scenarios], sorted(set(hashes.values()))]


def _hash(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _tells(test: Callable[[], bool]) -> bool:
    """Return what a test of a path tells; the path of any other text, however long, is neither file nor folder."""
    try:
        return test()
    except (OSError, ValueError):
        return False


def _open(source: Source, path: Path) -> Scenario:
    """Open a scenario of a study; what is wrong with it is about a key of the study."""
    try:
        return source.open()
    except ScenarioError as error:
        chosen = " and ".join(f"{fmu} as `{component}`" for component, fmu in source.replace)
        with_fmus = f" with {chosen}" if chosen else ""
        raise StudyError(f"{path}: scenario{with_fmus}: {error}") from error


def _of_study(study: Study) -> Any:
    import msgspec

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


def _misfits(factor: Factor, variable: Variable) -> Iterator[str]:
    """Say what of a factor does not fit a variable."""
    levels = factor.levels
    is_number = not (levels and isinstance(levels[0], str | bool))
    if factor.distribution == "seed":
        if variable.base_type != "Integer":
            yield f"`{variable.name}` is {variable.base_type}, a seed is an Integer"
        return
    if factor.relative and (variable.base_type != "Real" or not isinstance(variable.value, float)):
        yield f"`{variable.name}` has no Real value of its own that a relative value could multiply"
        return
    if factor.is_continuous and variable.base_type != "Real":
        yield f"`{variable.name}` is {variable.base_type}, expected values instead of a distribution"
        return
    if factor.unit is not None:
        try:
            variable.from_unit(0.0, factor.unit)
        except ScenarioError as error:
            yield str(error)
            return
    if not is_number:
        return
    ends = [factor.value(0.0), factor.value(1.0)] if factor.min is not None or levels else []
    numbers = [v for v in (*(levels or ()), *ends) if isinstance(v, int | float)]
    for value in dict.fromkeys(numbers):
        found = _in_unit(factor, variable, value)
        if not isinstance(found, float | int):
            continue
        for limit, is_beyond in (
            (variable.min, found < (variable.min or 0.0)),
            (variable.max, found > (variable.max or 0.0)),
        ):
            if limit is not None and is_beyond:
                unit = f" {variable.unit}" if variable.unit and variable.unit != "1" else ""
                side = "at least" if limit == variable.min else "at most"
                yield f"`{variable.name}` would be {found:g}{unit}, expected {side} {limit:g}"


def _in_unit(factor: Factor, variable: Variable, value: Value) -> Value:
    """Return a value of a factor in the unit of a variable."""
    if isinstance(value, str | bool) or factor.distribution == "seed":
        return value
    if factor.relative and isinstance(variable.value, float):
        return value * variable.value
    if variable.base_type == "Real":
        return variable.from_unit(float(value), factor.unit) if factor.unit is not None else float(value)
    return value

"""Study files: TOML. Their reference is `studies/README.md`."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Literal

import msgspec
import msgspec.inspect
import numpy as np
from numpy.typing import NDArray

from ..names import suggestion
from .factors import Factor, FactorError

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

Method = Literal["sweep", "sample", "sensitivity", "worst_case", "optimize"]
Design = Literal["full_factorial", "list", "one_at_a_time", "random", "latin_hypercube", "sobol"]

DESIGNS: dict[str, tuple[str, ...]] = {
    "sweep": ("full_factorial", "list", "one_at_a_time"),
    "sample": ("latin_hypercube", "random", "sobol"),
}

# Samples of a study that does not say how many, and of one that searches.
SAMPLES = 100

# A name that a column of the tables has.
TAKEN = ("sample", "case", "point", "seed", "status", "time", "component", "variable", "message", "seconds")

# Types of TOML by the names that msgspec gives them.
WORDS = {
    "float": "a number",
    "int": "a whole number",
    "bool": "true or false",
    "str": "text in quotes",
    "array": "a list",
    "object": "a table",
}


class StudyError(Exception):
    """A study that cannot be carried out; the text says what, where and what to do."""


class Correlation(msgspec.Struct, kw_only=True, frozen=True, forbid_unknown_fields=True):
    """`[[correlation]]`: the coefficient of correlation of two normal factors."""

    between: tuple[str, str]
    coefficient: float


class Requirement(msgspec.Struct, kw_only=True, frozen=True, forbid_unknown_fields=True):
    """`[[requirement]]`: limits of a metric, instead of those of the scenario, and how many runs keep them.

    With `of_change` the limits are those of its change against the baseline of the case, in percent.
    """

    metric: str
    of_change: bool = False
    min: float | None = None
    max: float | None = None
    cases: list[str] | None = None
    share: float = 1.0


class Series(msgspec.Struct, kw_only=True, frozen=True, forbid_unknown_fields=True):
    """`[series]`: runs whose signals are recorded."""

    metric: str | None = None
    worst: int = 0
    random: int = 0


class Search(msgspec.Struct, kw_only=True, frozen=True, forbid_unknown_fields=True):
    """`[search]`: which metric of which case is searched for its extreme, and how."""

    metric: str
    direction: Literal["minimize", "maximize"]
    case: str | None = None
    sampler: str = "TPESampler"
    options: dict[str, Any] = {}
    batch: int = 8


class Study(msgspec.Struct, kw_only=True, frozen=True, forbid_unknown_fields=True):
    """A study as written."""

    title: str
    scenario: str
    method: Method
    vary: list[Factor]
    description: str = ""
    reference: str = ""
    cases: list[str] | None = None
    points: list[str] | None = None
    stop: float | None = None
    runs: int | None = None
    seed: int = 1
    design: Design | None = None
    analysis: Literal["morris", "sobol"] | None = None
    metrics: list[str] | None = None
    correlation: list[Correlation] = []
    requirement: list[Requirement] = []
    series: Series | None = None
    search: Search | None = None

    @property
    def chosen_design(self) -> str:
        """Return the design of a sweep or a sample."""
        return self.design or DESIGNS[self.method][0]

    @property
    def has_probability(self) -> bool:
        """Tell whether the samples are drawn from distributions: others have no percentiles and no confidence."""
        return self.method == "sample" or (self.method == "sensitivity" and self.analysis != "morris")

    @property
    def is_adaptive(self) -> bool:
        """Tell whether the samples depend on the runs before."""
        return self.method in ("worst_case", "optimize")

    @property
    def correlations(self) -> NDArray[np.float64]:
        """Return the matrix of the coefficients of correlation."""
        names = [factor.name for factor in self.vary]
        matrix = np.eye(len(names))
        for correlation in self.correlation:
            i, j = (names.index(n) for n in correlation.between)
            matrix[i, j] = matrix[j, i] = correlation.coefficient
        return matrix

    def factor(self, name: str) -> Factor:
        """Return the factor of a name."""
        return next(f for f in self.vary if f.name == name)


def load(path: Path) -> dict[str, Any]:
    """Read a file of TOML; raises OSError or ValueError."""
    table: dict[str, Any] = tomllib.loads(path.read_text(encoding="utf-8"))
    return table


def is_tuning(path: Path) -> bool:
    """Tell whether a study optimizes by the methods of `chassis study`. False if it cannot be read."""
    try:
        table = load(path)
    except (OSError, ValueError):
        return False
    return table.get("method") == "optimize" and "vary" not in table


def read(path: Path, runs: int | None = None) -> Study:
    """Read a study, with another number of samples if there is one, and check all that needs no scenario."""
    try:
        table = load(path)
    except OSError as error:
        raise StudyError(f"cannot read {path}: {error.strerror or error}") from error
    except ValueError as error:
        raise StudyError(f"{path}: {error}") from error
    try:
        study = msgspec.convert(table, Study)
    except msgspec.ValidationError as error:
        raise StudyError(f"{path}: {_explained(str(error), table)}") from error
    if runs is not None:
        if study.method == "sweep":
            raise StudyError(f"{path}: a sweep has as many samples as its values make, it takes no --runs")
        study = msgspec.structs.replace(study, runs=runs)
    problems = _problems(study)
    if problems:
        raise StudyError("\n".join(f"{path}: {problem}" for problem in problems))
    return study


def _explained(message: str, table: dict[str, Any]) -> str:
    """Say what does not fit the layout of a study, in the words of the other messages: key, value, what is valid."""
    said, _, where = message.partition(" - at `$")
    steps = re.findall(r"\.([^.\[]+)|\[(\d+)\]", where.rstrip("`"))
    place: list[str] = []
    at: Any = table
    kind: msgspec.inspect.Type | None = msgspec.inspect.type_info(Study)
    for key, index in steps:
        at, kind = at[key or int(index)], _inside(kind, key)
        if key:
            place.append(key)
            continue
        name = at.get("name") if isinstance(at, dict) else None
        place[-1] = (
            f"[[{place[-1]}]] {int(index) + 1}" if isinstance(at, dict) else f"{place[-1]}, item {int(index) + 1}"
        )
        place[-1] += f", `{name}`" if isinstance(name, str) else ""
    before = "".join(f"{part}: " for part in place)
    if said.startswith("Invalid enum value"):
        known = [str(v) for of in _kinds(kind) if isinstance(of, msgspec.inspect.LiteralType) for v in of.values]
        return f"{before}unknown value `{at}`, expected one of {', '.join(known)}{suggestion(str(at), known)}"
    found = re.fullmatch(r"Object contains unknown field `(.*)`", said)
    if found:
        keys = [f.name for of in _kinds(kind) if isinstance(of, msgspec.inspect.StructType) for f in of.fields]
        return f"{before}unknown key `{found[1]}`, expected one of {', '.join(keys)}{suggestion(found[1], keys)}"
    found = re.fullmatch(r"Object missing required field `(.*)`", said)
    if found:
        return f"{before}missing key `{found[1]}`"
    found = re.fullmatch(r"Expected `(.*)`, got `(.*)`", said)
    if found:
        wanted, given = ([WORDS.get(w, w) for w in of.split(" | ") if w != "null"] for of in found.groups())
        return f"{before}expected {' or '.join(dict.fromkeys(wanted))}, got {' or '.join(given)}"
    return f"{before}{said[:1].lower()}{said[1:]}"


def _kinds(kind: msgspec.inspect.Type | None) -> Iterator[msgspec.inspect.Type]:
    """Return the types that a value may have."""
    if isinstance(kind, msgspec.inspect.UnionType):
        yield from kind.types
    elif kind is not None:
        yield kind


def _inside(kind: msgspec.inspect.Type | None, key: str) -> msgspec.inspect.Type | None:
    """Return the type of a field, or that of the items where the key is empty; None if it is not known."""
    for of in _kinds(kind):
        if isinstance(of, msgspec.inspect.StructType) and key:
            return next((field.type for field in of.fields if field.name == key), None)
        if isinstance(of, msgspec.inspect.ListType) and not key:
            return of.item_type
    return None


def _problems(study: Study) -> list[str]:
    found: list[str] = []
    names = [factor.name for factor in study.vary]
    if not names:
        found.append("nothing varies: expected at least one [[vary]]")
    for number, factor in enumerate(study.vary, 1):
        place = f"[[vary]] {number}, `{factor.name}`"
        try:
            factor.check()
            if factor.is_continuous:
                factor.value(0.5)
        except FactorError as error:
            found.append(f"{place}: {error}")
        if names.count(factor.name) > 1:
            found.append(f"{place}: the name appears twice")
        if factor.name in TAKEN or not factor.name:
            found.append(f"{place}: the tables have a column of that name, choose another one")
    if study.runs is not None and study.runs < 1:
        found.append(f"runs is {study.runs}, expected at least 1")
    found += _of_method(study)
    found += _correlations(study)
    for requirement in study.requirement:
        if not 0.0 < requirement.share <= 1.0:
            found.append(
                f"requirement of `{requirement.metric}`: share is {requirement.share:g}, expected above 0, up to 1"
            )
        if requirement.min is None and requirement.max is None:
            found.append(f"requirement of `{requirement.metric}`: expected min, max or both")
    if study.series is not None and (study.series.worst < 0 or study.series.random < 0):
        found.append("series: expected worst and random of at least 0")
    return found


def _of_method(study: Study) -> list[str]:
    found = []
    designs = DESIGNS.get(study.method)
    if study.design is not None and (designs is None or study.design not in designs):
        known = f"one of {', '.join(designs)}" if designs else "none"
        found.append(f"design is {study.design}, expected {known} for method {study.method}")
    if (study.analysis is not None) != (study.method == "sensitivity"):
        found.append('expected analysis = "morris" or "sobol" with method sensitivity, and only with it')
    if (study.search is not None) != study.is_adaptive:
        found.append("expected a table [search] with the methods worst_case and optimize, and only with them")
    if study.search is not None and study.search.batch < 1:
        found.append(f"search: batch is {study.search.batch}, expected at least 1")
    if study.method == "sweep":
        if study.runs is not None:
            found.append("a sweep has as many samples as its values make, it takes no runs")
        for factor in study.vary:
            if factor.is_continuous or factor.distribution == "seed":
                found.append(f"`{factor.name}`: a sweep needs values or distribution grid")
        if study.design == "list" and len({len(f.levels or []) for f in study.vary}) > 1:
            found.append("design list needs as many values of each factor as of the others")
    runs = study.runs or SAMPLES
    if study.analysis == "sobol" and runs & (runs - 1):
        below = 1 << (runs.bit_length() - 1)
        given = f"runs is {runs}" if study.runs else "runs is missing"
        found.append(f"{given}, expected a power of two for Sobol indices, as {below} or {2 * below}")
    if study.method == "sensitivity":
        found += [
            f"`{f.name}`: sensitivities need a factor with a distribution, not FMUs or seeds"
            for f in study.vary
            if f.fmu is not None or f.distribution == "seed"
        ]
    return found


def _correlations(study: Study) -> list[str]:
    found = []
    names = [factor.name for factor in study.vary]
    for correlation in study.correlation:
        place = f"correlation between {' and '.join(correlation.between)}"
        unknown = [n for n in correlation.between if n not in names]
        if unknown or len(set(correlation.between)) < 2:
            found.append(f"{place}: expected the names of two factors")
            continue
        if not -1.0 < correlation.coefficient < 1.0:
            found.append(f"{place}: coefficient is {correlation.coefficient:g}, expected between -1 and 1")
        for name in correlation.between:
            factor = study.factor(name)
            if factor.distribution != "normal" or factor.min is not None or factor.max is not None:
                found.append(f"{place}: `{name}` is not normal without limits")
    if study.correlation and study.method != "sample":
        found.append("correlations belong to method sample")
    if not found and study.correlation and np.linalg.eigvalsh(study.correlations)[0] <= 0.0:
        found.append("the correlations contradict each other: their matrix is not positive definite")
    return found

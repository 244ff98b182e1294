"""Studies with `[[vary]]`, as `fmu_system::study` reads them. The reference of their files is `studies/README.md`."""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal

import msgspec
import numpy as np
from numpy.typing import NDArray

from .. import _native
from ..program import ROOT
from .factors import Factor

Method = Literal["sweep", "sample", "sensitivity", "worst_case", "optimize"]
Design = Literal["full_factorial", "list", "one_at_a_time", "random", "latin_hypercube", "sobol"]

# Designs of studies that do not choose one.
DESIGNS: dict[str, Design] = {"sweep": "full_factorial", "sample": "latin_hypercube"}

# Samples of a study that does not say how many, and of one that searches.
SAMPLES = 100


class StudyError(Exception):
    """A study that cannot be carried out; the text says what, where and what to do."""


def needed(what: str, *packages: str, otherwise: str = "") -> None:
    """Raise StudyError if a package is not installed that something needs; `otherwise` is another way out."""
    missing = [package for package in packages if importlib.util.find_spec(package) is None]
    if missing:
        # In the repository, with the versions of its lockfile.
        is_ours = (ROOT / "scripts" / "setup").exists() and "torch" not in missing
        remedy = "scripts/setup --all" if is_ours else f"{sys.executable} -m pip install {' '.join(missing)}"
        raise StudyError(
            f"{what} needs the Python package {' and '.join(missing)}, which is not installed: `{remedy}`{otherwise}"
        )


class Correlation(msgspec.Struct, kw_only=True, frozen=True):
    """`[[correlation]]`: the coefficient of correlation of two normal factors."""

    between: tuple[str, str]
    coefficient: float


class Requirement(msgspec.Struct, kw_only=True, frozen=True):
    """`[[requirement]]`: limits of a metric, instead of those of the scenario, and how many runs keep them.

    With `of_change` the limits are those of its change against the baseline of the case, in percent.
    """

    metric: str
    of_change: bool = False
    min: float | None = None
    max: float | None = None
    cases: list[str] | None = None
    share: float = 1.0


class Series(msgspec.Struct, kw_only=True, frozen=True):
    """`[series]`: runs whose signals are recorded."""

    metric: str | None = None
    worst: int = 0
    random: int = 0


class Search(msgspec.Struct, kw_only=True, frozen=True):
    """`[search]`: which metric of which case is searched for its extreme, and how."""

    metric: str
    direction: Literal["minimize", "maximize"]
    case: str | None = None
    sampler: str = "TPESampler"
    options: dict[str, Any] = {}
    batch: int = 8


class Study(msgspec.Struct, kw_only=True, frozen=True):
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
        return self.design or DESIGNS[self.method]

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


def read(path: Path, folders: Sequence[Path], runs: int | None = None) -> Study:
    """Read a study and check it against its scenario; `runs` replaces its number of samples."""
    try:
        return msgspec.json.decode(_native.study(path, folders, runs), type=Study)
    except _native.ScenarioError as error:
        raise StudyError(str(error)) from None

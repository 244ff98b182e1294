"""Studies with `[[vary]]`, as `fmu_system::study` reads them. `studies/README.md` is the reference for their files."""

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

# Default designs, by method.
DESIGNS: dict[str, Design] = {"sweep": "full_factorial", "sample": "latin_hypercube"}

# Default number of samples, also for searches.
SAMPLES = 100


class StudyError(Exception):
    """A study cannot be executed."""


def needed(what: str, *packages: str, otherwise: str = "") -> None:
    """Raise StudyError if packages that `what` needs are not installed; `otherwise` is an alternative for the user."""
    missing = [package for package in packages if importlib.util.find_spec(package) is None]
    if missing:
        # In the repository, scripts/setup installs the versions in the lockfile.
        is_ours = (ROOT / "scripts" / "setup").exists() and "torch" not in missing
        remedy = "scripts/setup --all" if is_ours else f"{sys.executable} -m pip install {' '.join(missing)}"
        raise StudyError(
            f"{what} needs the Python package {' and '.join(missing)}, which is not installed: `{remedy}`{otherwise}"
        )


class Correlation(msgspec.Struct, kw_only=True, frozen=True):
    """`[[correlation]]`: the correlation coefficient of two normal factors."""

    between: tuple[str, str]
    coefficient: float


class Requirement(msgspec.Struct, kw_only=True, frozen=True):
    """`[[requirement]]`: limits for a metric, instead of the scenario's, and the share of runs that must meet them.

    With `of_change`, the limits apply to the change against the baseline of the case, in percent.
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
    """`[search]`: the metric and case whose extreme is searched for, and the sampler."""

    metric: str
    direction: Literal["minimize", "maximize"]
    case: str | None = None
    sampler: str = "TPESampler"
    options: dict[str, Any] = {}
    batch: int = 8


class Study(msgspec.Struct, kw_only=True, frozen=True):
    """The content of a study file."""

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
        """True if the samples are drawn from distributions; otherwise percentiles and confidence are meaningless."""
        return self.method == "sample" or (self.method == "sensitivity" and self.analysis != "morris")

    @property
    def is_adaptive(self) -> bool:
        """True if the samples depend on earlier runs."""
        return self.method in ("worst_case", "optimize")

    @property
    def correlations(self) -> NDArray[np.float64]:
        """Return the matrix of the correlation coefficients."""
        names = [factor.name for factor in self.vary]
        matrix = np.eye(len(names))
        for correlation in self.correlation:
            i, j = (names.index(n) for n in correlation.between)
            matrix[i, j] = matrix[j, i] = correlation.coefficient
        return matrix

    def factor(self, name: str) -> Factor:
        """Return the factor with a name."""
        return next(f for f in self.vary if f.name == name)


def read(path: Path, folders: Sequence[Path], runs: int | None = None) -> Study:
    """Read a study and check it against its scenario; `runs` replaces its number of samples."""
    try:
        return msgspec.json.decode(_native.study(path, folders, runs), type=Study)
    except _native.ScenarioError as error:
        raise StudyError(str(error)) from None

"""Methods of the types of a plan.

In a plan, every connection is a pair of bus slots, and every parameter has its value reference and its value in the
unit of the variable. Both masters execute plans, so the rules for scenarios exist only once, in the resolver.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

import msgspec
import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from . import plan

FORMAT = 9


class PlanError(Exception):
    """The text is not a plan that this version can read."""


class Conversion(msgspec.Struct, frozen=True):
    """A unit of measure with its conversion: shown value = factor * value + offset."""

    unit: str
    factor: float = 1.0
    offset: float = 0.0


class RunMixin:
    """A case at a point with a seed."""

    __slots__ = ()
    id: str

    @property
    def stem(self) -> str:
        """File name of the results of the run, without extension."""
        return self.id.replace("@", "_").replace("#", "_")


class SimulationMixin:
    """Time grid (s)."""

    __slots__ = ()
    start: float
    step: float
    steps: int
    every: int

    @property
    def rows(self) -> int:
        """Number of recorded rows, the first one at the start time."""
        return self.steps // self.every + 1

    @property
    def times(self) -> NDArray[np.float64]:
        """Times of the recorded rows, s."""
        return self.start + self.step * self.every * np.arange(self.rows, dtype=np.float64)


class ColumnMixin:
    """A recorded signal."""

    __slots__ = ()
    unit: str | None
    display_unit: str | None
    factor: float
    offset: float

    @property
    def shown(self) -> Conversion:
        """Conversion to the unit that results are shown in."""
        if self.display_unit is None:
            return Conversion(self.unit or "")
        return Conversion(self.display_unit, self.factor, self.offset)


P = TypeVar("P", bound="PlanMixin")


class PlanMixin:
    """A resolved scenario."""

    __slots__ = ()
    cases: tuple[plan.Case, ...]
    points: tuple[plan.Point, ...]
    seeds: tuple[int, ...]
    runs: tuple[plan.Run, ...]

    @classmethod
    def parse(cls: type[P], text: str, root: Path) -> P:
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
            return msgspec.json.decode(text, type=cls, dec_hook=path)
        except msgspec.ValidationError as error:
            raise PlanError(f"the plan does not have the expected fields: {error}") from error
        except msgspec.DecodeError as error:
            raise PlanError(f"the plan is not JSON: {error}") from error

    def run(self, case: str, point: str | None, seed: int | None) -> plan.Run:
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
        """Titles of the points by their names; without a sweep, an empty title for None."""
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


class _Version(msgspec.Struct):
    format: int

"""Types of the native code (python/src/lib.rs). All arrays must be contiguous."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

_Array: TypeAlias = NDArray[np.float64]
_Values: TypeAlias = _Array | NDArray[np.int64] | NDArray[np.uint64] | list[bytes]

class MetricError(Exception):
    """A metric that cannot be computed."""

def value(
    metric: bytes, times: _Array, columns: Mapping[int, _Array], baseline: Mapping[int, _Array] | None, step: float
) -> float | None: ...
def running(
    metric: bytes, times: _Array, columns: Mapping[int, _Array], step: float
) -> tuple[int, int, _Array] | None: ...
def formula(kind: str) -> str: ...
def holds(least: float | None, greatest: float | None, value: float | None) -> bool: ...
def is_enough(kept: int, of: int, share: float) -> bool: ...
def spectrum(times: _Array, values: _Array) -> tuple[_Array, _Array]: ...
def cross(times: _Array, given: _Array, found: _Array) -> tuple[_Array, _Array, _Array, _Array, _Array]: ...
def transfer(given: _Array, found: _Array, real: _Array, imaginary: _Array) -> tuple[_Array, _Array, _Array]: ...
def window(times: _Array, window: tuple[float, float] | None, step: float) -> tuple[int, int]: ...
def compare(
    simulated: tuple[_Array, _Array],
    measured: tuple[_Array, _Array],
    window: tuple[float, float] | None,
    tolerance: tuple[float, float] | None,
    tube: tuple[float, float | None] | None,
    max_shift: float | None,
) -> dict[str, float | None]: ...
def number(value: float, digits: int | None) -> str: ...
def scientific(value: float) -> str: ...
def unit(name: str) -> str: ...
def limits(least: float | None, greatest: float | None, unit: str) -> str: ...

class NoSolutionError(Exception):
    """An algebraic loop without a solution."""

def solve(
    start: Sequence[float],
    nominal: Sequence[float],
    evaluate: Callable[[list[float]], list[float] | None],
    derivatives: Callable[[], list[list[float]] | None] | None,
) -> list[float]:
    """Return the solution of z = evaluate(z); `derivatives` returns the derivatives at the last z by columns.

    Both return None where they are not defined.
    """

class ScenarioError(Exception):
    """A scenario or a value that cannot be used."""

class RunFailedError(Exception):
    """A run that failed: its arguments are the time (s; None before the first step) and a message."""

_Value: TypeAlias = float | int | bool | str | bytes
_Change: TypeAlias = tuple[str, str, _Value]
_Status: TypeAlias = Literal["ok", "rejected", "diverged", "crashed", "timed_out"]
Row: TypeAlias = tuple[
    int, int, tuple[float | None, ...], _Status, float | None, str | None, str | None, str | None, float
]

def study(file: Path, folders: Sequence[Path], runs: int | None) -> str:
    """Return a study with `[[vary]]` as JSON; raises ScenarioError if it is invalid."""

class System:
    """A resolved scenario with its FMUs."""

    def __init__(
        self,
        file: Path,
        folders: Sequence[Path],
        stop: float | None,
        step: float | None,
        fmus: Mapping[str, tuple[str, bool]],
    ) -> None: ...
    def plan(self) -> str: ...
    def variable(
        self, component: str, name: str
    ) -> tuple[
        str, str | None, list[tuple[str, float, float]], float | None, float | None, _Value | None, str | None
    ]: ...
    def start(self, program: Path, jobs: int, timeout: float, libpython: Path | None) -> None: ...
    def execute(
        self, samples: Sequence[tuple[Sequence[_Change], Sequence[int]]], take: Callable[[Row], bool]
    ) -> None: ...
    def record(
        self,
        runs: Sequence[tuple[Sequence[_Change], int]],
        take: Callable[[int, _Array | None, list[_Array | None], str | None], None],
    ) -> None: ...
    def execute_here(self, changes: Sequence[_Change], runs: Sequence[int]) -> list[Row]: ...
    def simulate(self, changes: Sequence[_Change], run: int) -> tuple[_Array, list[_Values | None]]: ...

class Session:
    """A run that advances step by step. Inputs can be overwritten, signals read, and states saved and restored."""

    def __init__(
        self,
        system: System,
        run: int,
        changes: Sequence[_Change],
        inputs: Sequence[tuple[str, str]],
        columns: Sequence[int],
    ) -> None: ...
    @property
    def time(self) -> float: ...
    @property
    def steps(self) -> int: ...
    @property
    def is_over(self) -> bool: ...
    def step(self, count: int = 1, values: _Array | None = None) -> None: ...
    def read(self) -> _Array: ...
    def save(self) -> int: ...
    def restore(self, key: int) -> None: ...
    def free(self, key: int) -> None: ...

"""Types of the native code (python/src/lib.rs). Arrays are contiguous."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from .files.plan import Metric

_Array: TypeAlias = NDArray[np.float64]

class MetricError(Exception):
    """A metric that has no number."""

def value(
    metric: Metric, times: _Array, columns: Mapping[int, _Array], baseline: Mapping[int, _Array] | None, step: float
) -> float | None: ...
def running(
    metric: Metric, times: _Array, columns: Mapping[int, _Array], step: float
) -> tuple[int, int, _Array] | None: ...
def evaluate(text: str, values: Mapping[str, float | None]) -> float | None: ...
def formula(kind: str) -> str: ...
def holds(least: float | None, greatest: float | None, value: float | None) -> bool: ...
def is_enough(kept: int, of: int, share: float) -> bool: ...
def requirement_status(
    least: float | None,
    greatest: float | None,
    share: float,
    numbers: Sequence[float | None],
    runs: int,
    is_cut_off: bool,
    kind: str | None,
) -> tuple[Literal["passed", "failed", "open"], float | None, int]: ...
def spectrum(times: _Array, values: _Array) -> tuple[_Array, _Array]: ...
def cross(times: _Array, given: _Array, found: _Array) -> tuple[_Array, _Array, _Array, _Array, _Array]: ...
def transfer(given: _Array, found: _Array, real: _Array, imaginary: _Array) -> tuple[_Array, _Array, _Array]: ...
def window(times: _Array, window: tuple[float, float] | None, step: float) -> tuple[int, int]: ...

class ScenarioError(Exception):
    """A scenario or a value that cannot be used."""

class RunFailedError(Exception):
    """A run that failed: its arguments are the time (s; None before the first step) and a message."""

_Value: TypeAlias = float | int | bool | str
_Change: TypeAlias = tuple[str, str, _Value]
_Status: TypeAlias = Literal["ok", "rejected", "diverged", "crashed", "timed_out"]
Row: TypeAlias = tuple[
    int, int, tuple[float | None, ...], _Status, float | None, str | None, str | None, str | None, float
]

class System:
    """A resolved scenario with its FMUs."""

    def __init__(
        self,
        file: Path,
        folders: Sequence[Path],
        stop: float | None = None,
        seeds: int | None = None,
        fmus: Mapping[str, tuple[str, bool]] = ...,
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
    def simulate(self, changes: Sequence[_Change], run: int) -> tuple[_Array, list[_Array | None]]: ...

class Session:
    """A run between two steps: its inputs can be overwritten, its signals read, its state saved and restored."""

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

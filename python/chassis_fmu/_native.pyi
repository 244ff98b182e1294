"""Types of the native code (python/src/lib.rs). Arrays are contiguous."""

from collections.abc import Mapping
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from .plan import Metric

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
def spectrum(times: _Array, values: _Array) -> tuple[_Array, _Array]: ...
def cross(times: _Array, given: _Array, found: _Array) -> tuple[_Array, _Array, _Array, _Array, _Array]: ...
def transfer(given: _Array, found: _Array, real: _Array, imaginary: _Array) -> tuple[_Array, _Array, _Array]: ...
def window(times: _Array, window: tuple[float, float] | None, step: float) -> tuple[int, int]: ...

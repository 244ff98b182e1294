"""Comparison of a simulated signal with a measured one. The Rust module `comparison` computes the metrics."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _native


def _samples(name: str, signal: tuple[ArrayLike, ArrayLike]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    times, values = (np.ascontiguousarray(part, dtype=np.float64) for part in signal)
    if times.ndim != 1 or times.shape != values.shape:
        raise ValueError(f"{name} must be two arrays of one length, got {times.shape} and {values.shape}")
    if not (np.isfinite(times).all() and np.isfinite(values).all() and (np.diff(times) >= 0.0).all()):
        raise ValueError(f"{name} must have finite values at times that do not fall")
    return times, values


def compare(
    simulated: tuple[ArrayLike, ArrayLike],
    measured: tuple[ArrayLike, ArrayLike],
    *,
    window: tuple[float, float] | None = None,
    tolerance: tuple[float, float] | None = None,
    tube: tuple[float, float] | float | None = None,
    max_shift: float | None = None,
) -> dict[str, float | None]:
    """Compare a simulated signal with a measured one, as `chassis compare` does.

    Both signals are times (s) and values, in the same unit. Only samples of the measurement count that are in the
    window (s) and within the time of the simulation, which is linear between its rows.

    `tolerance`: absolute and relative part (1 for 100 %), for `share_within`.
    `tube`: half width (s) and half height, or one number for both relative to the extent of the measurement.
    `max_shift`: the largest time shift that is tried, s, for `shift`.

    Returns the metrics of the guide's page *Compare a simulation with a measurement* by name; None for one that does
    not exist.

    Raises ValueError for arrays that are not samples of a signal.
    """
    size = (tube, None) if isinstance(tube, int | float) else tube
    signals = (_samples("simulated", simulated), _samples("measured", measured))
    return _native.compare(*signals, window, tolerance, size, max_shift)

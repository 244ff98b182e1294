"""Spectra and running values of recordings, and formulas of metrics.

The Rust module `metrics` defines and computes them; this module passes recordings to it.
"""

from __future__ import annotations

import msgspec
import numpy as np
from numpy.typing import NDArray

from .. import _native
from .._native import MetricError as MetricError
from ..files.plan import Metric, Plan
from ..files.results import Array, Recording


def _native_array(values: Array) -> NDArray[np.float64]:
    """Return the array as contiguous doubles for the native code; copies only if necessary."""
    return np.ascontiguousarray(values, dtype=np.float64)


def columns_of(metric: Metric) -> set[int]:
    """Return the columns that a metric needs."""
    others = (metric.minus, None if metric.until is None else metric.until.column)
    return {*metric.columns, *(c for c in others if c is not None)}


def running(metric: Metric, plan: Plan, recording: Recording) -> tuple[Array, Array] | None:
    """Compute a metric up to each row of its window: times and values.

    None if a signal that it needs was not recorded, or if the window has fewer than two rows.

    Raises MetricError for a kind without running values.
    """
    times = _native_array(recording.times)
    names = {index: plan.columns[index].name for index in columns_of(metric)}
    columns = {i: _native_array(recording.values[name]) for i, name in names.items() if name in recording.values}
    found = _native.running(msgspec.json.encode(metric), times, columns, plan.simulation.step)
    if found is None:
        return None
    first, end, values = found
    return times[first:end], values


def window(times: Array, limits: tuple[float, float] | None, step: float) -> slice:
    """Return the rows within a window, both ends included; all rows for None. Times must rise."""
    return slice(*_native.window(_native_array(times), limits, step))


def spectrum(times: Array, values: Array) -> tuple[Array, Array]:
    """Estimate the one-sided power spectral density of a signal: frequencies (Hz) and densities (square per Hz).

    Welch's method with eight half-overlapping Hann windows; the mean of each segment is subtracted. The frequency 0 is
    left out.

    Raises MetricError for a signal of fewer than 18 rows.
    """
    return _native.spectrum(_native_array(times), _native_array(values))


def cross(times: Array, given: Array, found: Array) -> Array:
    """Estimate the cross power spectral density of an input and an output, with the segments and windows of `spectrum`.

    Returns rows: frequencies (Hz), densities of the input and the output, real and imaginary part of the cross density.
    `transfer` computes the transfer function from these rows, or from their mean over several runs.

    Raises MetricError for signals of fewer than 18 rows.
    """
    return np.array(_native.cross(*(_native_array(values) for values in (times, given, found))))


def transfer(rows: Array) -> tuple[Array, Array, Array]:
    """Estimate a transfer function from the rows of `cross`: gain, phase (rad, without jumps), coherence (0 to 1)."""
    return _native.transfer(*(_native_array(values) for values in rows[1:]))

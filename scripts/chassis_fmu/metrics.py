"""Metrics of recorded signals: numbers, spectra and values over a window that grows."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .plan import Metric, Plan
from .results import Recording

Array = NDArray[np.floating[Any]]

# A row counts as inside a window if it misses it by less than this share of the step: t_k = start + k*step is rounded.
WINDOW_SLACK = 1e-6


class MetricError(Exception):
    """A metric that has no value."""


def _mean(x: Array) -> float:
    # fsum is exact, so that the result does not depend on the vector width of the machine
    return math.fsum(x.tolist()) / len(x)


def _threshold(metric: Metric) -> float:
    if metric.threshold is None:
        raise MetricError(f"metric {metric.name}: {metric.kind} without a threshold")
    return metric.threshold


def _crossing(metric: Metric, times: Array, values: Array) -> float | None:
    above = values > _threshold(metric)
    return float(times[above.argmax()]) if above.any() else None


def _of_last(values: Array) -> Array | None:
    # The values as shares of the last one; None if that is 0.
    return None if values[-1] == 0.0 else values / values[-1]


def _overshoot(values: Array) -> float | None:
    shares = _of_last(values)
    return None if shares is None else float(np.max(shares)) - 1.0


def _rise_time(metric: Metric, times: Array, values: Array) -> float | None:
    threshold, shares = _threshold(metric), _of_last(values)
    if shares is None or not (reached := shares >= threshold).any():
        return None
    return float(times[reached.argmax()] - times[0])


def _settling_time(metric: Metric, times: Array, values: Array) -> float | None:
    threshold, shares = _threshold(metric), _of_last(values)
    if shares is None:
        return None
    # the row after the last one outside; the last row of all is never outside
    outside = np.flatnonzero(np.abs(shares - 1.0) > threshold)
    return float(times[outside[-1] + 1] - times[0]) if len(outside) else 0.0


_KINDS: dict[str, Callable[[Array], float]] = {
    "rms": lambda x: math.sqrt(_mean(x * x)),
    "peak": lambda x: float(np.max(np.abs(x))),
    "max": lambda x: float(np.max(x)),
    "min": lambda x: float(np.min(x)),
    "mean": _mean,
    "final": lambda x: float(x[-1]),
    "peak_to_peak": lambda x: float(np.max(x) - np.min(x)),
    "changes": lambda x: float(np.count_nonzero(np.diff(x))),
    "deviation": lambda x: math.sqrt(_mean((x - _mean(x)) ** 2)),
}


def _interval(times: Array) -> float:
    """Return the distance of the rows, s."""
    if len(times) < 2:
        raise MetricError("a single row has no extent in time")
    return float(times[-1] - times[0]) / (len(times) - 1)


def _band_power(metric: Metric, times: Array, values: Array) -> float:
    if metric.band is None:
        raise MetricError(f"metric {metric.name}: {metric.kind} without a band")
    frequencies, densities = spectrum(times, values)
    inside = (frequencies >= metric.band[0]) & (frequencies < metric.band[1])
    return math.fsum(densities[inside].tolist()) * float(frequencies[0])


# Kinds that may have no value (None), and those that need the threshold, the band or the times.
_THRESHOLD_KINDS: dict[str, Callable[[Metric, Array, Array], float | None]] = {
    "crossing": _crossing,
    "magnitude_crossing": lambda metric, times, x: _crossing(metric, times, np.abs(x)),
    "share": lambda metric, _, x: float(np.mean(x > _threshold(metric))),
    "share_below": lambda metric, _, x: float(np.mean(x < _threshold(metric))),
    "magnitude_share": lambda metric, _, x: float(np.mean(np.abs(x) > _threshold(metric))),
    "overshoot": lambda _metric, _times, x: _overshoot(x),
    "rise_time": _rise_time,
    "settling_time": _settling_time,
    "integral": lambda _metric, times, x: math.fsum(x.tolist()) * _interval(times),
    "band_power": _band_power,
}

# Kinds whose value over a window that ends at each row follows from sums.
_RUNNING: dict[str, Callable[[Array, float], Array]] = {
    "mean": lambda x, _: np.cumsum(x) / np.arange(1, len(x) + 1),
    "rms": lambda x, _: np.sqrt(np.cumsum(x * x) / np.arange(1, len(x) + 1)),
    "integral": lambda x, interval: np.cumsum(x) * interval,
}


def window_mask(times: Array, window: tuple[float, float] | None, step: float) -> NDArray[np.bool_]:
    """Return which rows lie in a window, both ends included."""
    if window is None:
        return np.ones(len(times), dtype=np.bool_)
    slack = WINDOW_SLACK * step
    return np.asarray((times >= window[0] - slack) & (times <= window[1] + slack), dtype=np.bool_)


def columns_of(metric: Metric) -> set[int]:
    """Return the columns that a metric needs."""
    others = (metric.minus, None if metric.until is None else metric.until.column)
    return {*metric.columns, *(c for c in others if c is not None)}


def _combined(metric: Metric, signals: list[Array]) -> Array:
    """Return the signal of a metric, made of its columns row by row."""
    if metric.combine is None:
        return signals[0]
    if metric.combine == "min":
        return np.asarray(np.minimum.reduce(signals))
    if metric.combine == "max":
        return np.asarray(np.maximum.reduce(signals))
    weights = metric.weights if metric.combine == "squares" else (1.0,) * len(signals)
    total = np.sum([w * x * x for w, x in zip(weights, signals, strict=True)], axis=0)
    return np.asarray(total if metric.combine == "squares" else np.sqrt(total))


def _signal(metric: Metric, plan: Plan, recording: Recording) -> Array | None:
    """Return the signal of a metric in a recording; None if it was not recorded."""
    signals = [recording.values.get(plan.columns[i].name) for i in metric.columns]
    present = [s for s in signals if s is not None]
    return _combined(metric, present) if len(present) == len(signals) else None


def of_recording(metric: Metric, plan: Plan, recording: Recording, baseline: Recording | None = None) -> float | None:
    """Compute a metric of a recording, as `evaluate` does. `baseline` is that of the baseline's run.

    None also: a signal it needs was not recorded, or there is no baseline that it refers to.
    """
    values = _signal(metric, plan, recording)
    beside = None if metric.minus is None else recording.values.get(plan.columns[metric.minus].name)
    until = None if metric.until is None else recording.values.get(plan.columns[metric.until.column].name)
    if values is None or (metric.minus is not None and beside is None) or (metric.until is not None and until is None):
        return None
    if beside is not None:
        values = values - beside
    if metric.from_baseline:
        other = None if baseline is None else _signal(metric, plan, baseline)
        if other is None:
            return None
        values = values - other
    return evaluate(metric, recording.times, values, plan.simulation.step, until)


def running(metric: Metric, plan: Plan, recording: Recording) -> tuple[Array, Array] | None:
    """Compute a metric over windows that begin with its own and end at each row of it: times and values.

    None: a signal it needs was not recorded, or the recording ends before the window.

    Raises MetricError for a kind that has no such values.
    """
    if metric.kind not in _RUNNING:
        raise MetricError(f"metric {metric.name}: {metric.kind} has no value over a growing window")
    values = _signal(metric, plan, recording)
    mask = window_mask(recording.times, metric.window, plan.simulation.step)
    if values is None or mask.sum() < 2:
        return None
    times = recording.times[mask]
    inside = values[mask] * metric.conversion.factor + metric.conversion.offset
    return times, _RUNNING[metric.kind](inside, _interval(times))


def evaluate(metric: Metric, times: Array, values: Array, step: float, until: Array | None = None) -> float | None:
    """Compute a metric of one signal, in the unit of the metric. None: the signal never crosses the threshold.

    `until` is the signal that ends the window, for a metric with such an end. None also: it never does.

    Raises MetricError for an unknown kind, a threshold or band that is missing, and a window without rows.
    """
    mask = window_mask(times, metric.window, step)
    if metric.until is not None and until is not None and mask.any():
        ends = mask & (until > metric.until.level if metric.until.above else until < metric.until.level)
        if not ends.any():
            return None
        mask &= ~np.logical_or.accumulate(ends)
    inside = values[mask] * metric.conversion.factor + metric.conversion.offset
    if not len(inside):
        raise MetricError(f"metric {metric.name}: no recorded row lies in the window {metric.window}")
    if metric.kind in _THRESHOLD_KINDS:
        return _THRESHOLD_KINDS[metric.kind](metric, times[mask], inside)
    try:
        return _KINDS[metric.kind](inside)
    except KeyError as error:
        raise MetricError(f"metric {metric.name}: unknown kind {metric.kind}") from error


# Welch's method: half overlapping segments, as many as fit of this share of the whole.
SEGMENT = 2.0 / 9.0


def spectrum(times: Array, values: Array) -> tuple[Array, Array]:
    """Estimate the one-sided power spectral density of a signal: frequencies (Hz) and densities (square per Hz).

    Welch's method with eight half overlapping Hann windows, the mean of each taken off (P. D. Welch, IEEE Trans.
    Audio Electroacoust. 15, 1967). The frequency 0, which says nothing then, is left out.

    Raises MetricError for a signal too short for that.
    """
    size = int(len(values) * SEGMENT)
    if size < 4:
        raise MetricError(f"{len(values)} rows are too few for a spectrum")
    interval = float(times[-1] - times[0]) / (len(times) - 1)
    window = 0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(size) / size)
    segments = np.lib.stride_tricks.sliding_window_view(values, size)[:: size // 2]
    segments = (segments - segments.mean(axis=1, keepdims=True)) * window
    density = np.mean(np.abs(np.fft.rfft(segments, axis=1)) ** 2, axis=0)
    density *= 2.0 * interval / np.sum(window**2)
    if size % 2 == 0:
        # the highest frequency is its own mirror image
        density[-1] *= 0.5
    return np.fft.rfftfreq(size, interval)[1:], density[1:]

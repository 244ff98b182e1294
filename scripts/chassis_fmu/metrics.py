"""Metrics of recorded signals, their statistics over the seeds and their changes against a baseline."""

from __future__ import annotations

import math
import statistics
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
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
}

# Kinds that may have no value (None), and those that need the threshold or the times.
_THRESHOLD_KINDS: dict[str, Callable[[Metric, Array, Array], float | None]] = {
    "crossing": _crossing,
    "magnitude_crossing": lambda metric, times, x: _crossing(metric, times, np.abs(x)),
    "share": lambda metric, _, x: float(np.mean(x > _threshold(metric))),
    "magnitude_share": lambda metric, _, x: float(np.mean(np.abs(x) > _threshold(metric))),
    "overshoot": lambda _metric, _times, x: _overshoot(x),
    "rise_time": _rise_time,
    "settling_time": _settling_time,
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
    return {metric.column, *(c for c in others if c is not None)}


def of_recording(metric: Metric, plan: Plan, recording: Recording) -> float | None:
    """Compute a metric of a recording, as `evaluate` does. None also: a signal it needs was not recorded."""
    signals = {i: recording.values.get(plan.columns[i].name) for i in columns_of(metric)}
    if any(v is None for v in signals.values()):
        return None
    found = {i: v for i, v in signals.items() if v is not None}
    values = found[metric.column] if metric.minus is None else found[metric.column] - found[metric.minus]
    until = None if metric.until is None else found[metric.until.column]
    return evaluate(metric, recording.times, values, plan.simulation.step, until)


def evaluate(metric: Metric, times: Array, values: Array, step: float, until: Array | None = None) -> float | None:
    """Compute a metric of one signal, in the unit of the metric. None: the signal never crosses the threshold.

    `until` is the signal that ends the window, for a metric with such an end. None also: it never does.

    Raises MetricError for an unknown kind, a threshold that is missing, and a window without rows.
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


@dataclass(frozen=True)
class Statistic:
    """Mean over the seeds, and sample standard deviation where there are several."""

    mean: float
    deviation: float | None
    count: int

    @staticmethod
    def of(values: Sequence[float]) -> Statistic | None:
        """Return the statistic of some values; None if there are none."""
        if not values:
            return None
        deviation = statistics.stdev(values) if len(values) > 1 else None
        return Statistic(statistics.fmean(values), deviation, len(values))


def change(value: float, baseline: float) -> float | None:
    """Return the change in percent of the magnitude of the baseline; None if that is zero."""
    return None if baseline == 0.0 else 100.0 * (value - baseline) / abs(baseline)


@dataclass(frozen=True)
class Cell:
    """One metric of one case at one point: ours and the paper's. Changes and differences are in percent.

    `origin` says whether ours was calibrated on the paper's or predicted, where the scenario says so.
    """

    metric: Metric
    case: str
    point: str | None
    ours: Statistic | None
    change: Statistic | None
    paper: float | None
    paper_change: float | None
    origin: str = ""

    @property
    def difference(self) -> float | None:
        """Difference of our mean from the paper's number, in percent of the latter."""
        return None if self.ours is None or self.paper is None else change(self.ours.mean, self.paper)


Values = Mapping[tuple[str, str, "str | None", "int | None"], float]


def table(plan: Plan, values: Values) -> list[Cell]:
    """Put the values of all metrics, keyed (metric, case, point, seed), beside the numbers of the paper.

    Changes are taken seed by seed against the baseline with the same seed and then averaged: the scatter that
    the cases share drops out. Rows are ordered by metric, point, case; a value may be missing.
    """
    cells = []
    for metric in plan.metrics:
        paper_values = metric.paper.values if metric.paper else {}

        def ours(case: str, point: str | None, seed: int | None, name: str = metric.name) -> float | None:
            return values.get((name, case, point, seed))

        def key(case: str, point: str | None) -> str:
            return case if point is None else f"{case}@{point}"

        def printed(case: str, point: str | None, known: Mapping[str, float] = paper_values) -> float | None:
            return known.get(key(case, point))

        for point in plan.point_names:
            for case in plan.cases:
                own = [v for s in plan.seed_values if (v := ours(case.name, point, s)) is not None]
                changes: list[float] = []
                paper = printed(case.name, point)
                paper_change = None
                if case.baseline is not None:
                    for seed in plan.seed_values:
                        value = ours(case.name, point, seed)
                        base = ours(case.baseline, point, seed)
                        if value is None or base is None:
                            continue
                        percent = change(value, base)
                        if percent is not None:
                            changes.append(percent)
                    paper_base = printed(case.baseline, point)
                    if paper is not None and paper_base is not None:
                        paper_change = change(paper, paper_base)
                cells.append(
                    Cell(
                        metric=metric,
                        case=case.name,
                        point=point,
                        ours=Statistic.of(own),
                        change=Statistic.of(changes),
                        paper=paper,
                        paper_change=paper_change,
                        origin=metric.paper.origin(key(case.name, point)) if metric.paper else "",
                    )
                )
    return cells

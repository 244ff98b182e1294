"""What the rows of a study say: shares with confidence, percentiles, effects of factors, comparisons of cases."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.stats
from numpy.typing import NDArray

from . import design
from .file import Study
from .job import Done, Job, Limits

Array = NDArray[np.float64]

# Confidence of all intervals.
CONFIDENCE = 0.95

PERCENTILES = (5.0, 25.0, 50.0, 75.0, 95.0)


@dataclass(frozen=True)
class Share:
    """How many of some runs keep a requirement, with the interval of confidence of their share (Wilson)."""

    limits: Limits
    case: str
    point: str | None
    met: int
    of: int

    @property
    def share(self) -> float:
        """Return the share."""
        return self.met / self.of if self.of else math.nan

    @property
    def interval(self) -> tuple[float, float]:
        """Return the interval of confidence of the share."""
        return wilson(self.met, self.of)

    @property
    def holds(self) -> bool:
        """Tell whether enough runs keep it."""
        return self.of > 0 and self.share >= self.limits.share


def wilson(met: int, of: int) -> tuple[float, float]:
    """Return Wilson's interval of confidence of a share (E. B. Wilson, 1927)."""
    if of == 0:
        return 0.0, 1.0
    z = float(scipy.stats.norm.ppf(0.5 + CONFIDENCE / 2.0))
    p = met / of
    center = (p + z * z / (2 * of)) / (1 + z * z / of)
    half = z / (1 + z * z / of) * math.sqrt(p * (1 - p) / of + z * z / (4 * of * of))
    # At the ends exactly, which rounding misses.
    return (0.0 if met == 0 else center - half), (1.0 if met == of else center + half)


class Numbers:
    """The metrics of the rows of a study, by cell."""

    def __init__(self, job: Job, values: Sequence[Sequence[Any]], rows: dict[tuple[int, int], Done]) -> None:
        self.job = job
        self.values = values
        self.rows = rows
        self.count = len(values[0])

    def of(self, metric: int, cell: int) -> Array:
        """Return the numbers of a metric in a cell, one for each sample; NaN where there is none."""
        at = self.job.metrics.index(metric)
        out = np.full(self.count, math.nan)
        for number in range(self.count):
            row = self.rows.get((number, cell))
            if row is not None and row.numbers:
                found = row.numbers[at]
                out[number] = math.nan if found is None else found
        return out

    def shares(self) -> list[Share]:
        """Return the share of the runs that keep each requirement, by case and point."""
        found = []
        for limits in self.job.requirements:
            for cell, run in enumerate(self.job.cells):
                if run.case not in limits.cases:
                    continue
                done = [number for number in range(self.count) if (number, cell) in self.rows]
                met = sum(limits.holds(self.job.judged(limits, self.rows, number, cell)) for number in done)
                found.append(Share(limits, run.case, run.point, met, len(done)))
        return found

    def statuses(self) -> dict[str, int]:
        """Return the number of rows of each status."""
        counts: dict[str, int] = {}
        for row in self.rows.values():
            counts[row.status] = counts.get(row.status, 0) + 1
        return counts


@dataclass(frozen=True)
class Distribution:
    """Numbers of a metric in a case."""

    count: int
    mean: float
    deviation: float
    percentiles: tuple[float, ...]
    min: float
    max: float

    @classmethod
    def of(cls, values: Array) -> Distribution | None:
        """Return the distribution of the finite values; None without any."""
        known = values[np.isfinite(values)]
        if not known.size:
            return None
        percentiles = tuple(float(p) for p in np.percentile(known, PERCENTILES))
        deviation = float(np.std(known, ddof=1)) if known.size > 1 else 0.0
        return cls(known.size, float(known.mean()), deviation, percentiles, float(known.min()), float(known.max()))


@dataclass(frozen=True)
class Compared:
    """The difference of a metric between two cases, sample by sample: mean and its interval of confidence (Student)."""

    case: str
    against: str
    point: str | None
    count: int
    mean: float
    interval: tuple[float, float]
    lower: int
    """Samples in which the number of the case is the lower one."""

    @property
    def is_clear(self) -> bool:
        """Tell whether the interval leaves out zero."""
        return self.interval[0] > 0.0 or self.interval[1] < 0.0


def compared(numbers: Numbers, metric: int) -> list[Compared]:
    """Compare every case with its baseline, by samples that both have."""
    found = []
    cells = numbers.job.cells
    for cell, run in enumerate(cells):
        at = numbers.job.baseline(cell)
        if at is None:
            continue
        difference = numbers.of(metric, cell) - numbers.of(metric, at)
        difference = difference[np.isfinite(difference)]
        if difference.size < 2:
            continue
        mean, deviation = float(difference.mean()), float(difference.std(ddof=1))
        half = (
            float(scipy.stats.t.ppf(0.5 + CONFIDENCE / 2.0, difference.size - 1))
            * deviation
            / math.sqrt(difference.size)
        )
        lower = int((difference < 0.0).sum())
        found.append(
            Compared(run.case, cells[at].case, run.point, difference.size, mean, (mean - half, mean + half), lower)
        )
    return found


@dataclass(frozen=True)
class Effect:
    """What a factor does to a metric."""

    factor: str
    value: float
    """Rank correlation (samples), difference of the means between the ends (sweeps), or the index of a sensitivity."""
    interval: tuple[float, float] | None = None
    total: float | None = None
    total_interval: tuple[float, float] | None = None


def effects(numbers: Numbers, metric: int, cell: int) -> list[Effect]:
    """Return the effect of each factor on a metric: rank correlation over the samples (Spearman), largest first.

    The interval is that of Fisher's transformation. A list of names has no order, and no effect is given for it.
    """
    y = numbers.of(metric, cell)
    found = []
    for factor, values in zip(numbers.job.study.vary, numbers.values, strict=True):
        if isinstance(values[0], str) or factor.distribution == "seed":
            continue
        x = np.array(values, np.float64)
        known = np.isfinite(y)
        if known.sum() < 4 or np.ptp(x[known]) == 0.0 or np.ptp(y[known]) == 0.0:
            continue
        rho = float(scipy.stats.spearmanr(x[known], y[known]).statistic)
        half = float(scipy.stats.norm.ppf(0.5 + CONFIDENCE / 2.0)) / math.sqrt(max(1, int(known.sum()) - 3))
        middle = math.atanh(max(-1.0 + 1e-12, min(1.0 - 1e-12, rho)))
        found.append(Effect(factor.name, rho, (math.tanh(middle - half), math.tanh(middle + half))))
    return sorted(found, key=lambda e: -abs(e.value))


def main_effects(numbers: Numbers, metric: int, cell: int) -> dict[str, list[tuple[Any, float, int]]]:
    """Return the mean of a metric at each level of each factor that has levels, with the number of samples."""
    y = numbers.of(metric, cell)
    found: dict[str, list[tuple[Any, float, int]]] = {}
    for factor, values in zip(numbers.job.study.vary, numbers.values, strict=True):
        for level in factor.levels or ():
            chosen = np.array([v == level for v in values]) & np.isfinite(y)
            if chosen.any():
                found.setdefault(factor.name, []).append((level, float(y[chosen].mean()), int(chosen.sum())))
    return found


def sensitivities(study: Study, shares: Array, y: Array) -> list[Effect] | None:
    """Return the sensitivities that SALib computes; None if a run failed, because the indices need all.

    Morris: mean of the magnitudes of the elementary effects, in the unit of the metric. Sobol: first-order and total
    index.
    """
    import SALib.analyze.morris
    import SALib.analyze.sobol

    if not np.isfinite(y).all():
        return None
    problem = design.problem(study)
    if study.analysis == "morris":
        of = SALib.analyze.morris.analyze(problem, shares, y, num_levels=4, seed=study.seed)
        rows = zip(problem["names"], of["mu_star"], of["mu_star_conf"], strict=True)
        return sorted((Effect(n, float(m), (float(m - c), float(m + c))) for n, m, c in rows), key=lambda e: -e.value)
    if np.ptp(y) == 0.0:
        return [Effect(name, 0.0, (0.0, 0.0), 0.0, (0.0, 0.0)) for name in problem["names"]]
    of = SALib.analyze.sobol.analyze(problem, y, calc_second_order=False, seed=study.seed)
    found = []
    for i, name in enumerate(problem["names"]):
        first, total = float(of["S1"][i]), float(of["ST"][i])
        half, wide = float(of["S1_conf"][i]), float(of["ST_conf"][i])
        found.append(Effect(name, first, (first - half, first + half), total, (total - wide, total + wide)))
    return sorted(found, key=lambda e: -(e.total or 0.0))

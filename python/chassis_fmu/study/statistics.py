"""Evaluates the rows of a study: shares with confidence, percentiles, effects of factors, comparisons of cases."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy.stats
from numpy.typing import NDArray

from .. import _native
from . import design
from .file import Study
from .job import Done, Job, Limits

Array = NDArray[np.float64]

# Confidence of all intervals.
CONFIDENCE = 0.95

# Minimum number of groups of samples for sensitivity indices.
FEWEST_GROUPS = 4

PERCENTILES = (5.0, 25.0, 50.0, 75.0, 95.0)


@dataclass(frozen=True)
class Share:
    """The share of runs that meet a requirement, with its confidence interval (Wilson)."""

    limits: Limits
    case: str
    point: str | None
    met: int
    of: int

    @property
    def share(self) -> float:
        """Return the share of runs that meet the requirement."""
        return self.met / self.of if self.of else math.nan

    @property
    def interval(self) -> tuple[float, float]:
        """Return the confidence interval of the share."""
        return wilson(self.met, self.of)

    @property
    def holds(self) -> bool:
        """True if the required share of runs meets the requirement."""
        return self.of > 0 and _native.is_enough(self.met, self.of, self.limits.share)


def wilson(met: int, of: int) -> tuple[float, float]:
    """Return Wilson's confidence interval of a share (E. B. Wilson, 1927)."""
    if of == 0:
        return 0.0, 1.0
    low, high = scipy.stats.binomtest(met, of).proportion_ci(CONFIDENCE, "wilson")
    return float(low), float(high)


class Numbers:
    """The metrics of the rows of a study, by cell."""

    def __init__(self, job: Job, values: Sequence[Sequence[Any]], rows: dict[tuple[int, int], Done]) -> None:
        self.job = job
        self.values = values
        self.rows = rows
        self.count = len(values[0])

    def sample(self, number: int) -> dict[str, Any]:
        """Return the values of a sample by factor."""
        return {f.name: column[number] for f, column in zip(self.job.study.vary, self.values, strict=True)}

    def of(self, metric: int, cell: int) -> Array:
        """Return the values of a metric in a cell, one for each sample; NaN where there is none."""
        at = self.job.metrics.index(metric)
        rows = [self.rows.get((number, cell)) for number in range(self.count)]
        return np.array([row.numbers[at] if row and row.numbers else None for row in rows], np.float64)

    def shares(self) -> list[Share]:
        """Return the share of the runs that meet each requirement, by case and point."""
        found = []
        for limits in self.job.requirements:
            for cell, run in enumerate(self.job.cells):
                if run.case not in limits.cases:
                    continue
                done = [number for number in range(self.count) if (number, cell) in self.rows]
                met = sum(limits.holds(self.job.judged(limits, self.rows, number, cell)) for number in done)
                found.append(Share(limits, run.case, run.point, met, len(done)))
        return found

    def changes(self, limits: Limits, cell: int) -> Array:
        """Return the values of a cell that `limits` apply to, one for each sample; NaN where there is none."""
        return np.array([self.job.judged(limits, self.rows, number, cell) for number in range(self.count)], np.float64)


@dataclass(frozen=True)
class Distribution:
    """Statistics of a metric in a case."""

    count: int
    mean: float
    deviation: float
    percentiles: tuple[float, ...]
    min: float
    max: float

    @classmethod
    def of(cls, values: Array) -> Distribution | None:
        """Return the statistics of the finite values; None if there are none."""
        known = values[np.isfinite(values)]
        if not known.size:
            return None
        percentiles = tuple(float(p) for p in np.percentile(known, PERCENTILES))
        deviation = float(np.std(known, ddof=1)) if known.size > 1 else 0.0
        return cls(known.size, float(known.mean()), deviation, percentiles, float(known.min()), float(known.max()))


@dataclass(frozen=True)
class Compared:
    """The difference of a metric between two cases, sample by sample: mean and its confidence interval (Student)."""

    case: str
    against: str
    point: str | None
    count: int
    mean: float
    interval: tuple[float, float]
    lower: int
    """Number of samples in which the case has the lower value."""

    @property
    def is_clear(self) -> bool:
        """True if the interval does not contain zero."""
        return self.interval[0] > 0.0 or self.interval[1] < 0.0


def student(values: Array) -> tuple[float, tuple[float, float]]:
    """Return the mean of at least two values and its confidence interval (Student)."""
    mean = float(values.mean())
    half = float(scipy.stats.t.ppf(0.5 + CONFIDENCE / 2.0, values.size - 1) * scipy.stats.sem(values))
    return mean, (mean - half, mean + half)


def welch(first: Array, second: Array) -> tuple[float, tuple[float, float]]:
    """Return the difference of the means of two independent groups, second minus first, and its interval (Welch)."""
    with warnings.catch_warnings():
        # SciPy warns about loss of precision if all values of a group are equal.
        warnings.simplefilter("ignore", RuntimeWarning)
        low, high = scipy.stats.ttest_ind(second, first, equal_var=False).confidence_interval(CONFIDENCE)
    return float(second.mean() - first.mean()), (float(low), float(high))


def compared(numbers: Numbers, metric: int) -> list[Compared]:
    """Compare every case with its baseline, using the samples for which both have a value."""
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
        mean, interval = student(difference)
        lower = int((difference < 0.0).sum())
        found.append(Compared(run.case, cells[at].case, run.point, difference.size, mean, interval, lower))
    return found


@dataclass(frozen=True)
class Choice:
    """A metric for one choice of an unordered factor, such as an FMU or a name, compared with the first choice."""

    factor: str
    level: str
    count: int
    mean: float
    interval: tuple[float, float] | None
    against: str | None = None
    """The first choice; None if this is the first."""
    difference: float | None = None
    difference_interval: tuple[float, float] | None = None
    pairs: int = 0
    """Number of pairs of samples that differ only in this factor; if 0, independent groups were compared."""
    lower: int = 0
    """Number of pairs in which this choice has the lower value."""

    @property
    def is_clear(self) -> bool:
        """True if the interval of the difference does not contain zero."""
        ends = self.difference_interval
        return ends is not None and (ends[0] > 0.0 or ends[1] < 0.0)


def choices(numbers: Numbers, metric: int, cell: int) -> list[Choice]:
    """Return the means of a metric for each choice of every unordered factor, and the differences from the first one.

    Two samples are a pair if they have the same values of all other factors.
    """
    y = numbers.of(metric, cell)
    found = []
    for at, (factor, values) in enumerate(zip(numbers.job.study.vary, numbers.values, strict=True)):
        if not isinstance(values[0], str | bool):
            continue
        others = [column for i, column in enumerate(numbers.values) if i != at]
        keys = list(zip(*others, strict=True)) if others else [()] * numbers.count
        levels = [level for level in factor.levels or () if level in set(values)]
        # The values for each choice, by the setting of all other factors.
        rows: dict[Any, dict[Any, float]] = {level: {} for level in levels}
        groups: dict[Any, list[float]] = {level: [] for level in levels}
        for level, key, value in zip(values, keys, y, strict=True):
            if math.isfinite(value):
                rows[level][key] = float(value)
                groups[level].append(float(value))
        first = levels[0]
        for level in levels:
            of = np.array(groups[level])
            if not of.size:
                continue
            interval = student(of)[1] if of.size > 1 else None
            row = Choice(factor.name, str(level), of.size, float(of.mean()), interval)
            if level != first:
                shared = [key for key in rows[level] if key in rows[first]]
                difference = np.array([rows[level][key] - rows[first][key] for key in shared])
                row = replace(row, against=str(first))
                if difference.size > 1:
                    mean, ends = student(difference)
                    lower = int((difference < 0.0).sum())
                    row = replace(row, difference=mean, difference_interval=ends, pairs=difference.size, lower=lower)
                elif of.size > 1 and len(groups[first]) > 1:
                    mean, ends = welch(np.array(groups[first]), of)
                    row = replace(row, difference=mean, difference_interval=ends)
            found.append(row)
    return found


@dataclass(frozen=True)
class Swing:
    """A bar of a tornado plot: a metric at the low and at the high end of a factor, in the unit of the metric."""

    factor: str
    low: float
    """Value of the factor at its low end, or the mean of several values."""
    high: float
    at_low: float
    """The metric at the low end."""
    at_high: float
    interval: tuple[float, float] | None = None
    """Confidence interval of the difference, high minus low; None if the samples are not random."""

    @property
    def difference(self) -> float:
        """Return the change of the metric from the low to the high end."""
        return self.at_high - self.at_low


# Share of the samples, the lowest or the highest, that represents an end of a factor, and their minimum number.
END = 0.2
FEWEST = 3


def swings(numbers: Numbers, metric: int, cell: int) -> list[Swing]:
    """Return the change of a metric that each factor causes, the largest change first.

    In a sweep, the change is from the lowest to the highest value of the factor, with the other factors at their middle
    values (one at a time) or averaged (all combinations). In samples, the change is from the mean over the lowest fifth
    of the factor's values to the mean over the highest fifth. If a factor has few values, its lowest and highest value
    are used. For the design "list", in which all factors vary together, the result is empty.
    """
    study = numbers.job.study
    if study.method not in ("sweep", "sample") or study.chosen_design == "list":
        return []
    y = numbers.of(metric, cell)
    known = np.isfinite(y)
    found = []
    for factor, values in zip(study.vary, numbers.values, strict=True):
        if isinstance(values[0], str | bool) or factor.distribution == "seed":
            continue
        x = np.array(values, np.float64)
        if factor.levels:
            low, high = x == x.min(), x == x.max()
            if study.chosen_design == "one_at_a_time":
                low, high = _alone(numbers, factor.name, low), _alone(numbers, factor.name, high)
        else:
            low, high = x <= np.quantile(x, END), x >= np.quantile(x, 1.0 - END)
        low, high = low & known, high & known
        is_random = study.method == "sample"
        fewest = FEWEST if is_random else 1
        if x.min() == x.max() or low.sum() < fewest or high.sum() < fewest:
            continue
        interval = welch(y[low], y[high])[1] if is_random else None
        start, end, at_start, at_end = (float(v.mean()) for v in (x[low], x[high], y[low], y[high]))
        found.append(Swing(factor.name, start, end, at_start, at_end, interval))
    return sorted(found, key=lambda s: -abs(s.difference))


def _alone(numbers: Numbers, name: str, chosen: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Select the `chosen` samples of a one-at-a-time design in which only the factor `name` is changed."""
    out = chosen.copy()
    for factor, values in zip(numbers.job.study.vary, numbers.values, strict=True):
        if factor.name != name:
            # The first sample has all factors at their middle value.
            out &= np.array([value == values[0] for value in values])
    return out


@dataclass(frozen=True)
class Effect:
    """The effect of a factor on a metric."""

    factor: str
    value: float
    """Rank correlation (samples), difference of the means between the ends (sweeps), or sensitivity index."""
    interval: tuple[float, float] | None = None
    total: float | None = None
    total_interval: tuple[float, float] | None = None
    sigma: float | None = None
    """Standard deviation of the elementary effects (Morris): large if an effect is nonlinear or depends on others."""


def effects(numbers: Numbers, metric: int, cell: int) -> list[Effect]:
    """Return the effect of each factor on a metric: rank correlation over the samples (Spearman), largest first.

    The interval is from Fisher's transformation. A list of names has no order and therefore no rank correlation.
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
        # Spearman's coefficient is Pearson's coefficient of the ranks.
        of = scipy.stats.pearsonr(*(scipy.stats.rankdata(v[known]) for v in (x, y)))
        low, high = of.confidence_interval(CONFIDENCE)
        found.append(Effect(factor.name, float(of.statistic), (float(low), float(high))))
    return sorted(found, key=lambda e: -abs(e.value))


@dataclass(frozen=True)
class Sensitivities:
    """Sensitivities of a metric, and the samples that they leave out."""

    effects: list[Effect]
    """Largest first; empty if too few groups of samples are left."""
    missing: list[int]
    """Samples without a number."""
    left_out: int
    """Number of groups of samples that the indices leave out, because a sample has no value."""
    groups: int


def sensitivities(study: Study, shares: Array, y: Array) -> Sensitivities:
    """Return the sensitivities that SALib computes.

    Morris: mean magnitude of the elementary effects, in the unit of the metric, and their deviation. Sobol: first-order
    and total index. Both use groups of samples: a trajectory, or a point with its exchanged coordinates. A group in
    which a sample has no value is left out.
    """
    import SALib.analyze.morris
    import SALib.analyze.sobol

    problem = design.problem(study)
    # A trajectory has one sample more than there are factors, a Sobol group has two more.
    size = len(study.vary) + (1 if study.analysis == "morris" else 2)
    missing = np.flatnonzero(~np.isfinite(y))
    groups = y.size // size
    kept = np.isfinite(y).reshape(groups, size).all(axis=1)
    rows = np.repeat(kept, size)
    x, y = shares[rows], y[rows]
    names = problem["names"]
    found: list[Effect] = []
    if kept.sum() < FEWEST_GROUPS:
        pass
    elif study.analysis == "morris":
        of = SALib.analyze.morris.analyze(problem, x, y, num_levels=4, seed=study.seed)
        for n, m, c, sigma in zip(names, of["mu_star"], of["mu_star_conf"], of["sigma"], strict=True):
            found.append(Effect(n, float(m), (float(m - c), float(m + c)), sigma=float(sigma)))
    elif np.ptp(y) == 0.0:
        found = [Effect(name, 0.0, (0.0, 0.0), 0.0, (0.0, 0.0)) for name in names]
    else:
        of = SALib.analyze.sobol.analyze(problem, y, calc_second_order=False, seed=study.seed)
        for i, name in enumerate(names):
            first, total = float(of["S1"][i]), float(of["ST"][i])
            half, wide = float(of["S1_conf"][i]), float(of["ST_conf"][i])
            found.append(Effect(name, first, (first - half, first + half), total, (total - wide, total + wide)))
    found.sort(key=lambda e: -(e.value if e.total is None else e.total))
    return Sensitivities(found, [int(n) for n in missing], int(groups - kept.sum()), groups)

"""Factors of a study: varied values with their distributions.

A factor maps a number u between 0 and 1 (a share) to a value, by the inverse of its distribution function. All designs
consist of such shares.
"""

from __future__ import annotations

import math
from typing import Any, Literal

import msgspec
import numpy as np
import scipy.stats
from numpy.typing import NDArray

from ..report.tables import scientific
from ..scenario import Value

Array = NDArray[np.float64]

Distribution = Literal["uniform", "log_uniform", "normal", "lognormal", "triangular", "grid", "seed"]

# Keys of distributions, in the order in which a description lists them.
NUMBERS = ("mean", "median", "deviation", "min", "mode", "max")

# Number of different seeds.
SEEDS = 2**31 - 1


class Factor(msgspec.Struct, kw_only=True, frozen=True):
    """`[[vary]]`: variables, or the FMU of a component, and their values."""

    name: str
    variable: str | list[str] | None = None
    fmu: str | None = None
    keep_parameters: bool = False
    unit: str | None = None
    relative: bool = False
    distribution: Distribution | None = None
    values: list[float | int | bool | str] | None = None
    weights: list[float] | None = None
    min: float | None = None
    max: float | None = None
    mean: float | None = None
    deviation: float | None = None
    median: float | None = None
    mode: float | None = None
    count: int | None = None
    scale: Literal["linear", "log"] | None = None

    @property
    def is_step(self) -> bool:
        """Return whether the communication step varies."""
        return self.variable == "simulation:step"

    @property
    def variables(self) -> list[str]:
        """Return all variables, as `component:variable`."""
        if self.variable is None or self.is_step:
            return []
        return [self.variable] if isinstance(self.variable, str) else self.variable

    @property
    def levels(self) -> list[Value] | None:
        """Return the values of a list or a grid; None for a continuous factor or a seed."""
        if self.values is not None:
            return list(self.values)
        if self.distribution == "grid" and self.min is not None and self.max is not None:
            space = np.geomspace if self.scale == "log" else np.linspace
            return [float(v) for v in space(self.min, self.max, self.count or 2)]
        return None

    @property
    def ends(self) -> Array:
        """Return the upper end of each level's interval of shares."""
        weights = np.ones(len(self.levels or ())) if self.weights is None else np.array(self.weights)
        return np.cumsum(weights / weights.sum())

    @property
    def reach(self) -> tuple[float, float]:
        """Return the range of shares for a search: 0 to 1, or from 1 % and to 99 % where the values have no limit."""
        is_open = self.distribution in ("normal", "lognormal")
        low = 0.01 if is_open and self.min is None else 0.0
        return low, 0.99 if is_open and self.max is None else 1.0

    def value(self, u: float) -> Value:
        """Return the value at a share u of the distribution, from 0 to 1."""
        found: Value = self.column(np.array([u]))[0]
        return found

    def column(self, u: Array) -> list[Any]:
        """Return the values at shares of the distribution."""
        levels = self.levels
        if levels is not None:
            # Rounding can make the last end less than 1.
            rows = np.minimum(np.searchsorted(self.ends, u, side="right"), len(levels) - 1)
            return [levels[row] for row in rows]
        if self.distribution == "seed":
            return [1 + min(int(share * SEEDS), SEEDS - 1) for share in u]
        return [float(v) for v in self._continuous().ppf(u)]

    def _continuous(self) -> Any:
        # The numbers that a distribution needs are present: `fmu_system::study` checks this.
        low: Any = self.min
        high: Any = self.max
        mode: Any = self.mode
        if self.distribution == "uniform":
            return scipy.stats.uniform(low, high - low)
        if self.distribution == "log_uniform":
            return scipy.stats.loguniform(low, high)
        if self.distribution == "triangular":
            return scipy.stats.triang((mode - low) / (high - low), low, high - low)
        if self.distribution == "normal":
            return _Truncated(scipy.stats.norm(self.mean, self.deviation), low, high)
        return _Truncated(scipy.stats.lognorm(self.deviation, scale=self.median), low, high)

    def text(self, unit: str) -> str:
        """Describe the distribution, with values in `unit` ("" for none)."""
        unit = " times the scenario's own value" if self.relative else f" {unit}" if unit else ""
        levels = self.levels
        if self.values is not None:
            shares = "" if self.weights is None else f" with weights {', '.join(f'{w:g}' for w in self.weights)}"
            return f"{', '.join(v if isinstance(v, str) else scientific(v) for v in self.values)}{unit}{shares}"
        if levels is not None:
            return f"{self.count} values from {scientific(self.min or 0.0)} to {scientific(self.max or 0.0)}{unit}"
        if self.distribution == "seed":
            return "a seed for each sample"
        known = [(key, getattr(self, key)) for key in NUMBERS]
        numbers = ", ".join(f"{key} {value:g}" for key, value in known if value is not None)
        return f"{(self.distribution or '').replace('_', '-')}, {numbers}{unit}"


class _Truncated:
    """A distribution truncated to the range between two limits."""

    def __init__(self, whole: Any, low: float | None, high: float | None) -> None:
        self._whole = whole
        self._low = 0.0 if low is None else float(whole.cdf(low))
        self._high = 1.0 if high is None else float(whole.cdf(high))
        self._limits = (-math.inf if low is None else low, math.inf if high is None else high)

    def ppf(self, u: Array) -> Array:
        found = self._whole.ppf(self._low + u * (self._high - self._low))
        return np.asarray(np.clip(found, *self._limits), np.float64)

"""What varies in a study: values with their distributions.

A factor maps a number u between 0 and 1 to a value, by the inverse of its distribution function. All designs are made
of such numbers.
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

# The keys that a distribution needs, and those that it may have.
KEYS: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "uniform": (("min", "max"), ()),
    "log_uniform": (("min", "max"), ()),
    "normal": (("mean", "deviation"), ("min", "max")),
    "lognormal": (("median", "deviation"), ("min", "max")),
    "triangular": (("min", "mode", "max"), ()),
    "grid": (("min", "max", "count"), ("scale",)),
    "seed": ((), ()),
}
NUMBERS = ("min", "max", "mean", "deviation", "median", "mode", "count", "scale")

# A seed is one of so many.
SEEDS = 2**31 - 1


class FactorError(Exception):
    """A factor that makes no sense; the text says why."""


class Factor(msgspec.Struct, kw_only=True, frozen=True, forbid_unknown_fields=True):
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
    def variables(self) -> list[str]:
        """Return all variables, as `component:variable`."""
        if self.variable is None:
            return []
        return [self.variable] if isinstance(self.variable, str) else self.variable

    @property
    def is_continuous(self) -> bool:
        """Tell whether it has values between any two."""
        return self.distribution not in (None, "grid", "seed")

    def check(self) -> None:
        """Raise FactorError if keys are missing or contradict each other."""
        if (self.variable is None) == (self.fmu is None) or self.variable == []:
            raise FactorError('expected either variable = "component:variable" or fmu = "component"')
        if (self.distribution is None) == (self.values is None):
            raise FactorError(f"expected either values or a distribution, one of {', '.join(KEYS)}")
        if self.values is not None:
            self._check_values()
        given = {key for key in NUMBERS if getattr(self, key) is not None}
        needed, allowed = KEYS[self.distribution] if self.distribution is not None else ((), ())
        what = f"distribution {self.distribution}" if self.distribution is not None else "a list of values"
        for key in needed:
            if key not in given:
                raise FactorError(f"missing key {key}, which {what} needs")
        for key in sorted(given - {*needed, *allowed}):
            raise FactorError(f"{what} has no key {key}")
        if self.weights is not None and self.values is None:
            raise FactorError("weights belong to a list of values")
        if self.fmu is not None and (self.values is None or not all(isinstance(v, str) for v in self.values)):
            raise FactorError("expected values with the names of FMUs")
        if self.fmu is None and self.keep_parameters:
            raise FactorError("keep_parameters belongs to fmu")
        if self.fmu is not None and (self.unit is not None or self.relative):
            raise FactorError("an FMU has neither unit nor relative")
        if self.distribution == "seed" and (self.unit is not None or self.relative):
            raise FactorError("a seed has neither unit nor relative")
        if self.relative and self.unit is not None:
            raise FactorError("relative values are multiples of the scenario's own, without a unit")
        self._check_numbers()

    def _check_values(self) -> None:
        values = self.values or []
        if not values:
            raise FactorError("values is empty")
        if len(set(map(repr, values))) < len(values):
            raise FactorError("a value appears twice in `values`; use `weights` to make it more frequent")
        kinds = {"text" if isinstance(v, str) else "switch" if isinstance(v, bool) else "number" for v in values}
        if len(kinds) > 1:
            raise FactorError("values has numbers and others, expected one kind")
        if self.weights is not None and (
            len(self.weights) != len(values) or min(self.weights) < 0.0 or sum(self.weights) <= 0.0
        ):
            raise FactorError(f"expected {len(values)} weights of at least 0, one above it")

    def _check_numbers(self) -> None:
        for key in ("min", "max", "mean", "deviation", "median", "mode"):
            value = getattr(self, key)
            if value is not None and not math.isfinite(value):
                raise FactorError(f"{key} is {value}, expected a finite number")
        low, high = self.min, self.max
        if low is not None and high is not None and not low < high:
            raise FactorError(f"min is {low:g}, expected less than max, {high:g}")
        if self.deviation is not None and not self.deviation > 0.0:
            raise FactorError(f"deviation is {self.deviation:g}, expected more than 0")
        if self.median is not None and not self.median > 0.0:
            raise FactorError(f"median is {self.median:g}, expected more than 0")
        if self.mode is not None and low is not None and high is not None and not low <= self.mode <= high:
            raise FactorError(f"mode is {self.mode:g}, expected {low:g} to {high:g}")
        if self.count is not None and self.count < 2:
            raise FactorError(f"count is {self.count}, expected at least 2")
        is_log = self.distribution == "log_uniform" or self.scale == "log"
        if is_log and (low is None or low <= 0.0):
            raise FactorError("min must be above 0 for a logarithmic scale")
        if self.distribution == "lognormal" and low is not None and low < 0.0:
            raise FactorError(f"min is {low:g}, but a lognormal value is above 0")

    @property
    def levels(self) -> list[Value] | None:
        """Return the values of a list or a grid; None of a continuous factor or a seed."""
        if self.values is not None:
            return list(self.values)
        if self.distribution == "grid" and self.min is not None and self.max is not None:
            space = np.geomspace if self.scale == "log" else np.linspace
            return [float(v) for v in space(self.min, self.max, self.count or 2)]
        return None

    @property
    def ends(self) -> Array:
        """Return the shares at which the levels end."""
        weights = np.ones(len(self.levels or ())) if self.weights is None else np.array(self.weights)
        return np.cumsum(weights / weights.sum())

    @property
    def reach(self) -> tuple[float, float]:
        """Return the shares that a search looks at: to the limits, and on a side without one to 1 or 99 %."""
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
            # The last end may be less than 1 by rounding.
            rows = np.minimum(np.searchsorted(self.ends, u, side="right"), len(levels) - 1)
            return [levels[row] for row in rows]
        if self.distribution == "seed":
            return [1 + min(int(share * SEEDS), SEEDS - 1) for share in u]
        return [float(v) for v in self._continuous().ppf(u)]

    def _continuous(self) -> Any:
        low, high = self.min, self.max
        if self.distribution == "uniform" and low is not None and high is not None:
            return scipy.stats.uniform(low, high - low)
        if self.distribution == "log_uniform":
            return scipy.stats.loguniform(low, high)
        if self.distribution == "triangular" and None not in (low, high, self.mode):
            span = high - low  # type: ignore[operator]
            return scipy.stats.triang((self.mode - low) / span, low, span)  # type: ignore[operator]
        if self.distribution == "normal" and self.mean is not None and self.deviation is not None:
            return _Truncated(scipy.stats.norm(self.mean, self.deviation), low, high)
        if self.distribution == "lognormal" and self.median is not None and self.deviation is not None:
            return _Truncated(scipy.stats.lognorm(self.deviation, scale=self.median), low, high)
        raise AssertionError(f"{self.distribution} is checked")

    def text(self, unit: str) -> str:
        """Describe the distribution in words, with values in a unit; empty for none."""
        unit = " times the scenario's own value" if self.relative else f" {unit}" if unit else ""
        levels = self.levels
        if self.values is not None:
            shares = "" if self.weights is None else f" with weights {', '.join(f'{w:g}' for w in self.weights)}"
            return f"{', '.join(v if isinstance(v, str) else scientific(v) for v in self.values)}{unit}{shares}"
        if levels is not None:
            return f"{self.count} values from {scientific(self.min or 0.0)} to {scientific(self.max or 0.0)}{unit}"
        if self.distribution == "seed":
            return "a seed for each sample"
        needed, allowed = KEYS[self.distribution or ""]
        known = [(key, getattr(self, key)) for key in (*needed, *allowed)]
        numbers = ", ".join(f"{key} {scientific(value)}" for key, value in known if value is not None)
        return f"{(self.distribution or '').replace('_', '-')}, {numbers}{unit}"


class _Truncated:
    """A distribution between two limits: of the part of it that lies there."""

    def __init__(self, whole: Any, low: float | None, high: float | None) -> None:
        self._whole = whole
        self._low = 0.0 if low is None else float(whole.cdf(low))
        self._high = 1.0 if high is None else float(whole.cdf(high))
        if not self._high - self._low > 1e-9:
            raise FactorError("min and max leave next to nothing of the distribution")
        self._limits = (-math.inf if low is None else low, math.inf if high is None else high)

    def ppf(self, u: Array) -> Array:
        found = self._whole.ppf(self._low + u * (self._high - self._low))
        return np.asarray(np.clip(found, *self._limits), np.float64)

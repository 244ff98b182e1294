"""Badges: how the numbers of the runs compare with those of a paper, computed and never typed.

The definition is in scenarios/README.md. A change is compared by its sign and its size, and over several seeds the 95 %
interval of the mean paired difference (Student's t with one degree of freedom less than there are pairs) must not
contain zero.
"""

from __future__ import annotations

import enum
import math
import statistics
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import scipy.special

# A change may differ from the paper's by this share of it, or by this many percentage points.
CHANGE_SHARE = 0.25
CHANGE_POINTS = 5.0
# An absolute value may differ from the paper's by this share.
VALUE_SHARE = 0.05
CONFIDENCE = 0.95
# Differences this small against the values themselves are rounding.
ROUNDING = 1e-12
# A change smaller than this (percent) is called none.
NO_CHANGE = 0.5


class Status(enum.Enum):
    """A badge."""

    REPRODUCED = "reproduced"
    CALIBRATED = "calibrated"
    PARTLY = "partly"
    NOT_REPRODUCED = "not_reproduced"
    OWN_RESULT = "own_result"
    REFUTED = "refuted"
    OPEN = "open"
    PASSED = "passed"
    FAILED = "failed"

    @property
    def title(self) -> str:
        """Return the badge in words."""
        return TITLES.get(self, self.value.replace("_", " ").capitalize())


TITLES = {
    Status.PARTLY: "Partly reproduced",
    Status.REFUTED: "Own result, does not hold",
    Status.OPEN: "Not evaluated",
}

MEANINGS = {
    Status.REPRODUCED: f"a change has the same sign as the paper's and is within {100 * CHANGE_SHARE:g} % of it or "
    f"{CHANGE_POINTS:g} percentage points, and over several seeds the {100 * CONFIDENCE:g} % interval of the paired "
    f"difference excludes zero; an absolute value is within {100 * VALUE_SHARE:g} %",
    Status.CALIBRATED: "a parameter was fitted to the paper's number",
    Status.PARTLY: "a change has the same sign as the paper's, but is further away or lost in the scatter",
    Status.NOT_REPRODUCED: f"a change has the other sign, or is none: below {NO_CHANGE:g} % and lost in the scatter, "
    "or below it where the paper's is not; an absolute value is further away",
    Status.OWN_RESULT: "no paper makes the claim; the runs confirm it",
    Status.REFUTED: "no paper makes the claim; the runs do not confirm it",
    Status.OPEN: "a run that it needs failed, was ended by an FMU, or was cut short",
}

# From the best to the worst of several checks. What was not evaluated decides before everything else.
_ORDER = (Status.REPRODUCED, Status.CALIBRATED, Status.PARTLY, Status.NOT_REPRODUCED, Status.OPEN)


@dataclass(frozen=True)
class Interval:
    """Mean of some differences and the half width of its 95 % interval."""

    mean: float
    half: float

    @property
    def sign(self) -> int:
        """Return the sign of the mean, 0 for 0."""
        return (self.mean > 0.0) - (self.mean < 0.0)

    @property
    def is_clear(self) -> bool:
        """Return whether the interval does not contain zero."""
        return abs(self.mean) > self.half

    @staticmethod
    def of(differences: Sequence[float]) -> Interval:
        """Return mean and interval. A single difference has no scatter: its interval is itself.

        Raises ValueError without any.
        """
        if not differences:
            raise ValueError("no differences")
        mean, count = statistics.fmean(differences), len(differences)
        if count == 1:
            return Interval(mean, 0.0)
        quantile = float(scipy.special.stdtrit(count - 1, 0.5 + CONFIDENCE / 2.0))
        return Interval(mean, quantile * statistics.stdev(differences) / math.sqrt(count))


def paired(pairs: Iterable[tuple[float, float]]) -> Interval:
    """Return the interval of the differences, first less second; what rounding leaves of equal numbers is zero."""
    return Interval.of([0.0 if abs(a - b) <= ROUNDING * max(abs(a), abs(b)) else a - b for a, b in pairs])


def of_sign(difference: Interval, expected: int, percent: float | None = None) -> Status:
    """Decide on a claim without a number: more (1) or less (-1); `percent` is the change, where there is one."""
    if difference.sign != expected:
        return Status.NOT_REPRODUCED
    if not difference.is_clear and percent is not None and abs(percent) < NO_CHANGE:
        # No effect, and no sign of one.
        return Status.NOT_REPRODUCED
    return Status.REPRODUCED if difference.is_clear else Status.PARTLY


def of_change(difference: Interval, percent: float | None, paper: float) -> Status:
    """Grade a change in percent (None: of a negligible baseline) against the paper's."""
    if paper == 0.0:
        return Status.NOT_REPRODUCED if percent is None else of_no_change(difference, percent)
    if percent is not None and percent * paper <= 0.0:
        # The mean of the changes and the mean difference may disagree where both are lost in the scatter.
        return Status.NOT_REPRODUCED
    status = of_sign(difference, 1 if paper > 0.0 else -1, percent)
    if status is not Status.REPRODUCED:
        return status
    if percent is None:
        return Status.PARTLY
    difference_of_changes = abs(percent - paper)
    if abs(percent) < NO_CHANGE <= abs(paper) and difference_of_changes > CHANGE_SHARE * abs(paper):
        return Status.NOT_REPRODUCED
    near = difference_of_changes <= max(CHANGE_SHARE * abs(paper), CHANGE_POINTS)
    return Status.REPRODUCED if near else Status.PARTLY


def of_value(value: float, paper: float) -> Status:
    """Grade an absolute value. "Partly" does not occur: the sign of a magnitude carries no information."""
    return Status.REPRODUCED if abs(value - paper) <= VALUE_SHARE * abs(paper) else Status.NOT_REPRODUCED


def of_no_change(difference: Interval, percent: float) -> Status:
    """Grade the claim that nothing changes: within the percentage points that a change of zero allows.

    A larger change within the scatter does not refute it.
    """
    if abs(percent) <= CHANGE_POINTS:
        return Status.REPRODUCED
    return Status.NOT_REPRODUCED if difference.is_clear else Status.PARTLY


def worst(statuses: Iterable[Status]) -> Status:
    """Return the badge of a finding with several checks: that of the worst."""
    return max(statuses, key=_ORDER.index)

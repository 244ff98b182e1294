"""Badges: how the results of the runs compare with the numbers of a paper.

scenarios/README.md contains the definition. A change is compared by sign and size. With several seeds, the 95 %
interval of the mean paired difference (Student's t, one degree of freedom less than pairs) must not contain zero.
"""

from __future__ import annotations

import enum
import math
import statistics
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import scipy.special

# Allowed difference from the paper's change: this share of it or this many percentage points, whichever is larger.
CHANGE_SHARE = 0.25
CHANGE_POINTS = 5.0
# Allowed relative difference from the paper's value, for an absolute value.
VALUE_SHARE = 0.05
CONFIDENCE = 0.95
# Smaller differences, relative to the values, are rounding errors.
ROUNDING = 1e-12
# A smaller change (percent) is treated as no change.
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
        """Return the text of the badge."""
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
    Status.PARTLY: "a change has the same sign as the paper's, but differs by more, or its interval contains zero",
    Status.NOT_REPRODUCED: f"a change has the opposite sign, or is below {NO_CHANGE:g} % and its interval contains "
    "zero or the paper's change is larger; an absolute value differs by more",
    Status.OWN_RESULT: "no paper makes the claim; the runs confirm it",
    Status.REFUTED: "no paper makes the claim; the runs do not confirm it",
    Status.OPEN: "a required run failed, was ended by an FMU, or was shortened",
}

# From best to worst, to combine several checks. A check that was not evaluated (OPEN) outweighs all others.
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
        """True if the interval does not contain zero."""
        return abs(self.mean) > self.half

    @staticmethod
    def of(differences: Sequence[float]) -> Interval:
        """Return mean and interval. The interval of a single difference has width 0.

        Raises ValueError if there are no differences.
        """
        if not differences:
            raise ValueError("no differences")
        mean, count = statistics.fmean(differences), len(differences)
        if count == 1:
            return Interval(mean, 0.0)
        quantile = float(scipy.special.stdtrit(count - 1, 0.5 + CONFIDENCE / 2.0))
        return Interval(mean, quantile * statistics.stdev(differences) / math.sqrt(count))


def paired(pairs: Iterable[tuple[float, float]]) -> Interval:
    """Return the interval of the differences, first minus second; differences within rounding are zero."""
    return Interval.of([0.0 if abs(a - b) <= ROUNDING * max(abs(a), abs(b)) else a - b for a, b in pairs])


def of_sign(difference: Interval, expected: int, percent: float | None = None) -> Status:
    """Grade a claim without a number: more (1) or less (-1). `percent` is the change, if known."""
    if difference.sign != expected:
        return Status.NOT_REPRODUCED
    if not difference.is_clear and percent is not None and abs(percent) < NO_CHANGE:
        return Status.NOT_REPRODUCED
    return Status.REPRODUCED if difference.is_clear else Status.PARTLY


def of_change(difference: Interval, percent: float | None, paper: float) -> Status:
    """Grade a change in percent (None if the baseline is negligible) against the paper's change."""
    if paper == 0.0:
        return Status.NOT_REPRODUCED if percent is None else of_no_change(difference, percent)
    if percent is not None and percent * paper <= 0.0:
        # The mean of the changes can have another sign than the mean difference if both are small compared with the
        # scatter.
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
    """Grade an absolute value. It is never "partly" reproduced: an equal sign is no evidence for it."""
    return Status.REPRODUCED if abs(value - paper) <= VALUE_SHARE * abs(paper) else Status.NOT_REPRODUCED


def of_no_change(difference: Interval, percent: float) -> Status:
    """Grade the claim that nothing changes: reproduced if the change is within CHANGE_POINTS.

    A larger change does not refute the claim if its interval contains zero.
    """
    if abs(percent) <= CHANGE_POINTS:
        return Status.REPRODUCED
    return Status.NOT_REPRODUCED if difference.is_clear else Status.PARTLY


def worst(statuses: Iterable[Status]) -> Status:
    """Return the worst badge, which is the badge of a finding with several checks."""
    return max(statuses, key=_ORDER.index)

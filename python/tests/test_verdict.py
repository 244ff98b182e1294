"""Badges: intervals computed by hand, and the rules for each badge."""

import math

import pytest

from chassis_fmu.evaluation import grading
from chassis_fmu.evaluation.grading import Interval, Status


def test_an_interval_by_hand() -> None:
    # The differences -1, -2, -3 and -6 have the mean -3, a sum of squares of 14 about the mean, and the standard
    # deviation sqrt(14/3). The half width is 3.1824 times half the standard deviation.
    found = grading.paired([(1.0, 2.0), (2.0, 4.0), (3.0, 6.0), (1.0, 7.0)])
    assert found.mean == -3.0
    assert found.half == pytest.approx(3.1824463053 * math.sqrt(14.0 / 3.0) / 2.0, rel=1e-10)
    assert (found.sign, found.is_clear) == (-1, False)
    assert grading.paired([(1.0, 2.0)]) == Interval(-1.0, 0.0)
    # Rounding errors are no difference.
    assert grading.paired([(0.1 + 0.2, 0.3), (0.3, 0.3)]) == Interval(0.0, 0.0)
    with pytest.raises(ValueError, match="no differences"):
        grading.paired([])


@pytest.mark.parametrize(
    ("mean", "half", "percent", "paper", "status"),
    [
        (-1.0, 0.5, -30.0, -40.0, Status.REPRODUCED),
        (-1.0, 0.5, -29.9, -40.0, Status.PARTLY),
        # For a small change, five percentage points are more than 25 %.
        (-1.0, 0.5, -7.0, -2.0, Status.REPRODUCED),
        (-1.0, 0.5, -7.1, -2.0, Status.PARTLY),
        (-1.0, 1.0, -30.0, -40.0, Status.PARTLY),
        (1.0, 0.5, 1.0, -2.0, Status.NOT_REPRODUCED),
        (0.0, 0.0, 0.0, -2.0, Status.NOT_REPRODUCED),
        (-1.0, 1.5, 0.1, -2.0, Status.NOT_REPRODUCED),
        (-1.0, 0.5, None, -2.0, Status.PARTLY),
        # No effect: less than 0.5 %, with or without zero in the interval, while the paper's change is larger.
        (-0.008, 0.015, -0.008, -4.0, Status.NOT_REPRODUCED),
        (-0.008, 0.0, -0.008, -4.0, Status.NOT_REPRODUCED),
        (-0.4, 0.0, -0.4, -0.5, Status.REPRODUCED),
        (-0.3, 0.0, -0.3, -0.4, Status.REPRODUCED),
        # The paper reports no change.
        (1.0, 0.5, 4.9, 0.0, Status.REPRODUCED),
        (1.0, 0.5, 5.1, 0.0, Status.NOT_REPRODUCED),
        (1.0, 1.5, 5.1, 0.0, Status.PARTLY),
    ],
)
def test_changes(mean: float, half: float, percent: float | None, paper: float, status: Status) -> None:
    assert grading.of_change(Interval(mean, half), percent, paper) is status


def test_values_and_the_worst_of_several() -> None:
    assert grading.of_value(0.951, 1.0) is Status.REPRODUCED
    assert grading.of_value(-1.06, -1.0) is Status.NOT_REPRODUCED
    assert grading.worst([Status.REPRODUCED, Status.CALIBRATED]) is Status.CALIBRATED
    assert grading.worst([Status.CALIBRATED, Status.PARTLY]) is Status.PARTLY
    assert grading.worst([Status.NOT_REPRODUCED, Status.REPRODUCED]) is Status.NOT_REPRODUCED
    assert grading.worst([Status.NOT_REPRODUCED, Status.OPEN]) is Status.OPEN

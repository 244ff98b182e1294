"""Badges: intervals by hand, decisions by their rules."""

import math

import pytest

from chassis_fmu.evaluation import grading
from chassis_fmu.evaluation.grading import Interval, Status


def test_an_interval_by_hand() -> None:
    # Differences -1, -2, -3, -6: mean -3, sum of squares 14, standard deviation sqrt(14/3), half width 3.1824 times
    # half of that.
    found = grading.paired([(1.0, 2.0), (2.0, 4.0), (3.0, 6.0), (1.0, 7.0)])
    assert found.mean == -3.0
    assert found.half == pytest.approx(3.1824463053 * math.sqrt(14.0 / 3.0) / 2.0, rel=1e-10)
    assert (found.sign, found.is_clear) == (-1, False)
    assert grading.paired([(1.0, 2.0)]) == Interval(-1.0, 0.0)
    # what rounding leaves is nothing
    assert grading.paired([(0.1 + 0.2, 0.3), (0.3, 0.3)]) == Interval(0.0, 0.0)
    with pytest.raises(ValueError, match="no differences"):
        grading.paired([])


@pytest.mark.parametrize(
    ("mean", "half", "percent", "paper", "status"),
    [
        (-1.0, 0.5, -30.0, -40.0, Status.REPRODUCED),
        (-1.0, 0.5, -29.9, -40.0, Status.PARTLY),
        # five points are more than a quarter of a small change
        (-1.0, 0.5, -7.0, -2.0, Status.REPRODUCED),
        (-1.0, 0.5, -7.1, -2.0, Status.PARTLY),
        (-1.0, 1.0, -30.0, -40.0, Status.PARTLY),
        (1.0, 0.5, 1.0, -2.0, Status.NOT_REPRODUCED),
        (0.0, 0.0, 0.0, -2.0, Status.NOT_REPRODUCED),
        (-1.0, 1.5, 0.1, -2.0, Status.NOT_REPRODUCED),
        (-1.0, 0.5, None, -2.0, Status.PARTLY),
        # no effect: less than 0.5 %, in the scatter or not, where the paper has more
        (-0.008, 0.015, -0.008, -4.0, Status.NOT_REPRODUCED),
        (-0.008, 0.0, -0.008, -4.0, Status.NOT_REPRODUCED),
        (-0.4, 0.0, -0.4, -0.5, Status.REPRODUCED),
        (-0.3, 0.0, -0.3, -0.4, Status.REPRODUCED),
        # the paper says that nothing changes
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

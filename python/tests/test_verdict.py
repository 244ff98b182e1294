"""Badges: Student's t against tables, intervals by hand."""

import math

import pytest

from chassis_fmu import verdict
from chassis_fmu.verdict import Interval, Status


@pytest.mark.parametrize(
    ("degrees", "quantile"),
    [
        # scipy.stats.t.ppf(0.975, degrees) of scipy 1.14.1, ten digits
        (1, 12.7062047362),
        (2, 4.3026527297),
        (3, 3.1824463053),
        (4, 2.7764451052),
        (7, 2.3646242516),
        (15, 2.1314495456),
        (30, 2.0422724563),
        (121, 1.9797637626),
    ],
)
def test_quantiles_are_those_of_scipy(degrees: int, quantile: float) -> None:
    assert verdict.t_quantile(degrees) == pytest.approx(quantile, rel=1e-10)


def test_the_distribution_has_its_closed_forms() -> None:
    # One degree: Cauchy's, 2 atan(t)/pi; two: t/sqrt(2 + t^2).
    for t in (0.1, 1.0, 12.7):
        assert verdict.t_distribution(t, 1) == pytest.approx(2.0 * math.atan(t) / math.pi, rel=1e-14)
        assert verdict.t_distribution(t, 2) == pytest.approx(t / math.sqrt(2.0 + t * t), rel=1e-14)
    # Many degrees: the normal distribution, which differs by about t (1 + t^2)/(2 degrees) of its density.
    assert verdict.t_distribution(1.0, 10000) == pytest.approx(math.erf(1.0 / math.sqrt(2.0)), abs=1e-4)
    assert verdict.t_quantile(2, 0.5) == pytest.approx(math.sqrt(2.0 / 3.0), rel=1e-14)


def test_an_interval_by_hand() -> None:
    # Differences -1, -2, -3, -6: mean -3, sum of squares 14, standard deviation sqrt(14/3), half width 3.1824 times
    # half of that.
    found = verdict.paired([(1.0, 2.0), (2.0, 4.0), (3.0, 6.0), (1.0, 7.0)])
    assert found.mean == -3.0
    assert found.half == pytest.approx(3.1824463053 * math.sqrt(14.0 / 3.0) / 2.0, rel=1e-10)
    assert (found.sign, found.is_clear) == (-1, False)
    assert verdict.paired([(1.0, 2.0)]) == Interval(-1.0, 0.0)
    # what rounding leaves is nothing
    assert verdict.paired([(0.1 + 0.2, 0.3), (0.3, 0.3)]) == Interval(0.0, 0.0)
    with pytest.raises(ValueError, match="no differences"):
        verdict.paired([])


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
    assert verdict.of_change(Interval(mean, half), percent, paper) is status


def test_values_and_the_worst_of_several() -> None:
    assert verdict.of_value(0.951, 1.0) is Status.REPRODUCED
    assert verdict.of_value(-1.06, -1.0) is Status.NOT_REPRODUCED
    assert verdict.worst([Status.REPRODUCED, Status.CALIBRATED]) is Status.CALIBRATED
    assert verdict.worst([Status.CALIBRATED, Status.PARTLY]) is Status.PARTLY
    assert verdict.worst([Status.NOT_REPRODUCED, Status.REPRODUCED]) is Status.NOT_REPRODUCED
    assert verdict.worst([Status.NOT_REPRODUCED, Status.OPEN]) is Status.OPEN

"""Metrics against closed forms, and the arithmetic of the table."""

import dataclasses
import math

import numpy as np
import pytest

from chassis_fmu import metrics
from chassis_fmu.metrics import Statistic
from chassis_fmu.plan import Conversion, Metric, Plan, Point, Until
from chassis_fmu.results import Recording

STEP = 0.001
TIMES = np.arange(2001) * STEP


def metric(
    kind: str,
    window: tuple[float, float] | None = None,
    unit: Conversion | None = None,
    threshold: float | None = None,
) -> Metric:
    return Metric("m", "M", 0, kind, threshold, window, None, None, unit or Conversion("rad"), None, None)


@pytest.mark.parametrize(
    ("kind", "expected"),
    [
        # 3 sin(2 pi t) - 1 over two whole periods without the double end point: the sums are exact but for rounding
        ("rms", math.sqrt(3.0**2 / 2.0 + 1.0)),
        ("mean", -1.0),
        ("peak", 4.0),
        ("max", 2.0),
        ("min", -4.0),
        ("peak_to_peak", 6.0),
        ("final", 3.0 * math.sin(2.0 * math.pi * 1.999) - 1.0),
    ],
)
def test_sine(kind: str, expected: float) -> None:
    values = 3.0 * np.sin(2.0 * np.pi * TIMES) - 1.0
    got = metrics.evaluate(metric(kind, (0.0, 1.999)), TIMES, values, STEP)
    assert got == pytest.approx(expected, rel=1e-13)


def test_both_ends_of_a_window_count_although_times_are_rounded() -> None:
    times = np.arange(11) * 0.1
    assert times[3] > 0.3
    assert metrics.evaluate(metric("max", (0.2, 0.3)), times, times, 0.1) == times[3]
    assert metrics.evaluate(metric("min", (0.3, 0.7)), times, times, 0.1) == times[3]
    assert metrics.window_mask(times, (0.3, 0.7), 0.1).sum() == 5


def test_the_unit_is_applied_before_the_metric() -> None:
    celsius = metric("rms", unit=Conversion("degC", 1.0, -273.15))
    assert metrics.evaluate(celsius, TIMES, np.full(len(TIMES), 283.15), STEP) == pytest.approx(10.0, rel=1e-12)


def test_a_window_without_rows_is_an_error() -> None:
    with pytest.raises(metrics.MetricError, match="no recorded row"):
        metrics.evaluate(metric("rms", (3.0, 4.0)), TIMES, TIMES, STEP)


def test_an_unknown_kind_is_an_error() -> None:
    with pytest.raises(metrics.MetricError, match="unknown kind median"):
        metrics.evaluate(metric("median"), TIMES, TIMES, STEP)


def test_a_crossing_is_the_time_of_the_first_row_above() -> None:
    saw = np.array([0.0, 1.0, 0.5, 2.0, -3.0])
    times = np.arange(5) * 0.1
    assert metrics.evaluate(metric("crossing", threshold=0.9), times, saw, 0.1) == 0.1
    # not above: the threshold itself
    assert metrics.evaluate(metric("crossing", threshold=1.0), times, saw, 0.1) == times[3]
    assert metrics.evaluate(metric("crossing", (0.2, 0.4), threshold=0.9), times, saw, 0.1) == times[3]
    assert metrics.evaluate(metric("crossing", threshold=2.5), times, saw, 0.1) is None
    assert metrics.evaluate(metric("magnitude_crossing", threshold=2.5), times, saw, 0.1) == times[4]
    # the threshold is in the unit of the metric
    percent = Conversion("%", 100.0, 0.0)
    assert metrics.evaluate(metric("crossing", unit=percent, threshold=90.0), times, saw, 0.1) == 0.1


def test_shares_and_changes() -> None:
    saw = np.array([0.0, 1.0, 0.5, 2.0, -3.0])
    times = np.arange(5) * 0.1
    assert metrics.evaluate(metric("share", threshold=0.5), times, saw, 0.1) == 0.4
    assert metrics.evaluate(metric("magnitude_share", threshold=0.5), times, saw, 0.1) == pytest.approx(0.6, rel=1e-15)
    assert metrics.evaluate(metric("changes"), times, np.array([0.0, 0.0, 1.0, 0.0, 0.0]), 0.1) == 2.0
    assert metrics.evaluate(metric("changes"), times, np.ones(5), 0.1) == 0.0


def test_overshoot_rise_and_settling_refer_to_the_last_value() -> None:
    # Second-order step response, damping ratio z = 0.5, w = 10 rad/s: overshoot exp(-pi z/sqrt(1 - z^2)) (closed form;
    # 1e-3 covers the peak between two rows and what the last value lacks). The envelope of the error falls below 5 %
    # when exp(-z w t) = 0.05 sqrt(1 - z^2); 0.01 s covers the last value again.
    z, w, start = 0.5, 10.0, 0.2
    t = TIMES - start
    root = math.sqrt(1.0 - z * z)
    step = np.where(t > 0.0, 1.0 - np.exp(-z * w * t) * (np.cos(w * root * t) + z / root * np.sin(w * root * t)), 0.0)
    for values in (3.0 * step, -3.0 * step):
        overshoot = metrics.evaluate(metric("overshoot", (start, 2.0)), TIMES, values, STEP)
        assert overshoot == pytest.approx(math.exp(-math.pi * z / root), abs=1e-3)
        rise = metrics.evaluate(metric("rise_time", (start, 2.0), threshold=0.9), TIMES, values, STEP)
        assert rise is not None
        assert (
            abs(values[200 + round(rise / STEP)] / values[-1])
            >= 0.9
            > abs(values[199 + round(rise / STEP)] / values[-1])
        )
        settling = metrics.evaluate(metric("settling_time", (start, 2.0), threshold=0.05), TIMES, values, STEP)
        assert settling is not None
        assert rise < settling < -math.log(0.05 * root) / (z * w) + 0.01
        after = np.abs(values[200 + round(settling / STEP) :] / values[-1] - 1.0)
        assert after.max() <= 0.05


def test_without_an_end_value_there_is_no_overshoot() -> None:
    returns = np.array([0.0, 2.0, -1.0, 0.0])
    times = np.arange(4) * 0.1
    assert metrics.evaluate(metric("overshoot"), times, returns, 0.1) is None
    assert metrics.evaluate(metric("rise_time", threshold=0.9), times, returns, 0.1) is None
    assert metrics.evaluate(metric("settling_time", threshold=0.05), times, returns, 0.1) is None
    # a share that is never reached, and a value that is there from the first row on
    assert metrics.evaluate(metric("rise_time", threshold=1.5), times, np.ones(4), 0.1) is None
    assert metrics.evaluate(metric("settling_time", threshold=0.05), times, np.ones(4), 0.1) == 0.0
    assert metrics.evaluate(metric("overshoot"), times, np.ones(4), 0.1) == 0.0


@pytest.mark.parametrize(("until", "expected"), [(Until(1, True, 1.5), 3.0), (Until(1, False, 0.5), 1.0)])
def test_a_window_ends_where_a_signal_says(until: Until, expected: float) -> None:
    times = np.arange(6) * 0.1
    signal = np.array([9.0, 1.0, 1.0, 1.0, 5.0, 5.0])
    # below 0.5 or above 1.5 also before the window, which does not count, and again after the end
    ends = np.array([0.0, 1.0, 0.4 if not until.above else 1.5, 1.0, 2.0, 0.0])
    windowed = dataclasses.replace(metric("final", (0.1, 0.5)), until=until)
    values = np.cumsum(signal) - 9.0
    assert metrics.evaluate(windowed, times, values, 0.1, ends) == expected
    # without such a row there is no number; one outside the window does not count
    assert metrics.evaluate(windowed, times, values, 0.1, np.ones(6)) is None
    outside = np.where(np.arange(6) == 0, 9.0 if until.above else 0.0, 1.0)
    assert metrics.evaluate(windowed, times, values, 0.1, outside) is None
    with pytest.raises(metrics.MetricError, match="no recorded row"):
        metrics.evaluate(windowed, times, values, 0.1, np.full(6, 9.0 if until.above else 0.0))


def test_a_metric_of_a_difference(scenario: Plan) -> None:
    times = np.arange(3) * 0.1
    recording = Recording(times, {"source.count": np.array([1.0, 2.0, 3.0]), "body.roll": np.array([1.0, 1.0, 1.0])})
    difference = dataclasses.replace(metric("max"), minus=1)
    assert metrics.columns_of(difference) == {0, 1}
    assert metrics.of_recording(difference, scenario, recording) == 2.0
    until = dataclasses.replace(difference, until=Until(0, True, 2.5))
    assert metrics.of_recording(until, scenario, recording) == 1.0
    # a case without the unit that it is compared with
    assert metrics.of_recording(difference, scenario, Recording(times, {"source.count": times})) is None


def test_origins_are_those_the_scenario_says(scenario: Plan) -> None:
    first = scenario.metrics[0]
    assert first.paper is not None
    assert {c.origin for c in metrics.table(scenario, {})} == {""}
    paper = dataclasses.replace(first.paper, calibrated=frozenset(["passive"]))
    said = dataclasses.replace(scenario, metrics=(dataclasses.replace(first, paper=paper), scenario.metrics[1]))
    assert [c.origin for c in metrics.table(said, {})] == ["calibrated", "predicted", "", ""]


@pytest.mark.parametrize(
    "kind", ["crossing", "magnitude_crossing", "share", "magnitude_share", "rise_time", "settling_time"]
)
def test_a_threshold_that_is_missing_is_an_error(kind: str) -> None:
    with pytest.raises(metrics.MetricError, match="without a threshold"):
        metrics.evaluate(metric(kind), TIMES, TIMES, STEP)


def test_the_spectrum_of_white_noise_is_flat() -> None:
    # Variance s^2 at interval dt spreads over 0 to 1/(2 dt): one-sided density 2 s^2 dt. A density of Welch's method
    # with eight half overlapping segments scatters by about 1/sqrt(5); the mean of its 1000 scatters by 1 to 2 %.
    values = np.random.default_rng(1).normal(0.0, 3.0, 9001)
    frequencies, densities = metrics.spectrum(np.arange(9001) * STEP, values)
    assert len(frequencies) == 1000
    assert (frequencies[0], frequencies[-1]) == pytest.approx((0.5, 500.0), rel=1e-12)
    assert densities.mean() == pytest.approx(2.0 * 9.0 * STEP, rel=0.05)


@pytest.mark.parametrize("rows", [9000, 9005])
def test_the_spectrum_of_a_sine_has_its_power(rows: int) -> None:
    # The window has its zeros at the whole cycles of a segment beyond the next one: the power is in three lines.
    # Even and odd numbers of rows per segment; a sine between the lines leaks little.
    values = 7.0 + 2.0 * np.sin(2.0 * np.pi * 40.0 * np.arange(rows) * STEP)
    frequencies, densities = metrics.spectrum(np.arange(rows) * STEP, values)
    assert frequencies[densities.argmax()] == pytest.approx(40.0, abs=0.26)
    assert densities.sum() * frequencies[0] == pytest.approx(2.0, rel=1e-3)


def test_a_short_spectrum_is_an_error() -> None:
    with pytest.raises(metrics.MetricError, match="17 rows are too few"):
        metrics.spectrum(np.arange(17.0), np.arange(17.0))


def test_statistics() -> None:
    assert Statistic.of([]) is None
    assert Statistic.of([2.0]) == Statistic(2.0, None, 1)
    # sample standard deviation of 1, 2, 3, 4: sqrt(5/3)
    four = Statistic.of([1.0, 2.0, 3.0, 4.0])
    assert four is not None
    assert four.mean == 2.5
    assert four.deviation == pytest.approx(math.sqrt(5.0 / 3.0), rel=1e-15)


def test_change() -> None:
    assert metrics.change(3.0, 4.0) == -25.0
    assert metrics.change(-3.0, -4.0) == 25.0
    assert metrics.change(1.0, 0.0) is None


def values(scenario: Plan) -> dict[tuple[str, str, str | None, int | None], float]:
    assert scenario.seeds == (1, 2)
    return {
        ("roll_rms", "passive", None, 1): 4.0,
        ("roll_rms", "passive", None, 2): 8.0,
        ("roll_rms", "active", None, 1): 3.0,
        ("roll_rms", "active", None, 2): 7.0,
        ("count_final", "passive", None, 1): 3.0,
    }


def test_changes_are_paired_by_seed(scenario: Plan) -> None:
    passive, active, count_passive, count_active = metrics.table(scenario, values(scenario))
    assert passive.ours is not None
    assert (passive.ours.mean, passive.ours.count) == (6.0, 2)
    # sample standard deviation of 4 and 8
    assert passive.ours.deviation == pytest.approx(math.sqrt(8.0), rel=1e-15)
    assert passive.change is None
    assert passive.paper == 4.0
    assert passive.difference == 50.0
    # -25 % and -12.5 %, not 5/6 - 1 = -16.7 %
    assert active.change is not None
    assert active.change.mean == -18.75
    assert active.paper_change == -25.0
    assert count_passive.ours == Statistic(3.0, None, 1)
    assert count_active.ours is None
    assert count_active.change is None


def test_a_seed_without_its_baseline_has_no_change(scenario: Plan) -> None:
    some = values(scenario)
    del some["roll_rms", "passive", None, 2]
    active = metrics.table(scenario, some)[1]
    assert active.ours is not None
    assert active.ours.count == 2
    assert active.change == Statistic(-25.0, None, 1)


def test_the_paper_is_looked_up_by_case_and_point(scenario: Plan) -> None:
    first = scenario.metrics[0]
    assert first.paper is not None
    paper = dataclasses.replace(first.paper, values={"passive@slow": 2.0, "active@slow": 1.0, "active@fast": 5.0})
    swept = dataclasses.replace(
        scenario,
        points=(Point("slow", "5 km/h", 5.0), Point("fast", "35 km/h", 35.0)),
        metrics=(dataclasses.replace(first, paper=paper),),
    )
    cells = metrics.table(swept, {})
    assert [(c.point, c.case, c.paper, c.paper_change) for c in cells] == [
        ("slow", "passive", 2.0, None),
        ("slow", "active", 1.0, -50.0),
        ("fast", "passive", None, None),
        ("fast", "active", 5.0, None),
    ]

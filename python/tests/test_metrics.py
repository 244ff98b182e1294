"""Metrics against closed forms, and against numpy and scipy."""

import math
from typing import Any, Literal

import msgspec
import numpy as np
import pytest
import scipy.signal
from msgspec.structs import replace
from numpy.typing import NDArray

from chassis_fmu import _native
from chassis_fmu.evaluation import metrics
from chassis_fmu.files.plan import Conversion, Metric, Plan, Until
from chassis_fmu.files.results import Recording

STEP = 0.001
TIMES = np.arange(2001) * STEP


def metric(
    kind: str,
    window: tuple[float, float] | None = None,
    unit: Conversion | None = None,
    threshold: float | None = None,
) -> Metric:
    conversion = unit or Conversion("rad")
    fields = {
        **dict.fromkeys(("combine", "until", "minus", "band", "digits", "paper", "requirement")),
        "name": "m",
        "title": "M",
        "columns": (0,),
        "weights": (),
        "kind": kind,
        "window": window,
        "from_baseline": False,
        "threshold": threshold,
        "factor": conversion.factor,
        "offset": conversion.offset,
        "unit": conversion.unit,
    }
    return Metric(**fields)  # type: ignore[arg-type]


Array = NDArray[np.float64]
Signal = NDArray[np.floating[Any]]


def evaluate(metric: Metric, times: Signal, values: Signal, step: float, until: Signal | None = None) -> float | None:
    columns = {0: values} if until is None else {0: values, 1: until}
    doubles = {index: column.astype(np.float64) for index, column in columns.items()}
    return _native.value(msgspec.json.encode(metric, enc_hook=float), times.astype(np.float64), doubles, None, step)


def of_recording(metric: Metric, plan: Plan, recording: Recording, baseline: Recording | None = None) -> float | None:
    def columns(of: Recording) -> dict[int, Array]:
        return {i: of.values[c.name].astype(np.float64) for i, c in enumerate(plan.columns) if c.name in of.values}

    base = None if baseline is None else columns(baseline)
    times = recording.times.astype(np.float64)
    return _native.value(
        msgspec.json.encode(metric, enc_hook=float), times, columns(recording), base, plan.simulation.step
    )


@pytest.mark.parametrize(
    ("kind", "expected"),
    [
        # 3 sin(2 pi t) - 1 over two whole periods, without the repeated end point: the sums are exact up to rounding.
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
    got = evaluate(metric(kind, (0.0, 1.999)), TIMES, values, STEP)
    assert got == pytest.approx(expected, rel=1e-13)


def test_both_ends_of_a_window_count_although_times_are_rounded() -> None:
    times = np.arange(11) * 0.1
    assert times[3] > 0.3
    assert evaluate(metric("max", (0.2, 0.3)), times, times, 0.1) == times[3]
    assert evaluate(metric("min", (0.3, 0.7)), times, times, 0.1) == times[3]
    assert metrics.window(times, (0.3, 0.7), 0.1) == slice(3, 8)
    assert metrics.window(times, None, 0.1) == slice(0, 11)


def test_the_unit_is_applied_before_the_metric() -> None:
    celsius = metric("rms", unit=Conversion("degC", 1.0, -273.15))
    assert evaluate(celsius, TIMES, np.full(len(TIMES), 283.15), STEP) == pytest.approx(10.0, rel=1e-12)


def test_a_window_without_rows_is_an_error() -> None:
    with pytest.raises(metrics.MetricError, match="contains no recorded row"):
        evaluate(metric("rms", (3.0, 4.0)), TIMES, TIMES, STEP)


def test_an_unknown_kind_is_an_error() -> None:
    with pytest.raises(metrics.MetricError, match="metric m: unknown variant `median`"):
        evaluate(metric("median"), TIMES, TIMES, STEP)


def test_a_crossing_is_the_time_of_the_first_row_above() -> None:
    saw = np.array([0.0, 1.0, 0.5, 2.0, -3.0])
    times = np.arange(5) * 0.1
    assert evaluate(metric("crossing", threshold=0.9), times, saw, 0.1) == 0.1
    # The threshold itself does not count as above.
    assert evaluate(metric("crossing", threshold=1.0), times, saw, 0.1) == times[3]
    assert evaluate(metric("crossing", (0.2, 0.4), threshold=0.9), times, saw, 0.1) == times[3]
    assert evaluate(metric("crossing", threshold=2.5), times, saw, 0.1) is None
    assert evaluate(metric("magnitude_crossing", threshold=2.5), times, saw, 0.1) == times[4]
    # The threshold is in the unit of the metric.
    percent = Conversion("%", 100.0, 0.0)
    assert evaluate(metric("crossing", unit=percent, threshold=90.0), times, saw, 0.1) == 0.1


def test_shares_and_changes() -> None:
    saw = np.array([0.0, 1.0, 0.5, 2.0, -3.0])
    times = np.arange(5) * 0.1
    assert evaluate(metric("share", threshold=0.5), times, saw, 0.1) == 0.4
    assert evaluate(metric("magnitude_share", threshold=0.5), times, saw, 0.1) == pytest.approx(0.6, rel=1e-15)
    assert evaluate(metric("changes"), times, np.array([0.0, 0.0, 1.0, 0.0, 0.0]), 0.1) == 2.0
    assert evaluate(metric("changes"), times, np.ones(5), 0.1) == 0.0


def test_overshoot_rise_and_settling_refer_to_the_last_value() -> None:
    # Step response of a second-order system with the damping ratio z = 0.5 and the natural frequency w = 10 rad/s. In
    # closed form, the overshoot is exp(-pi z/sqrt(1 - z^2)); the tolerance 1e-3 covers a peak between two rows and the
    # remaining error of the last value. The envelope of the error falls below 5 % when exp(-z w t) = 0.05 sqrt(1 -
    # z^2); the tolerance 0.01 s covers the error of the last value.
    z, w, start = 0.5, 10.0, 0.2
    t = TIMES - start
    root = math.sqrt(1.0 - z * z)
    step = np.where(t > 0.0, 1.0 - np.exp(-z * w * t) * (np.cos(w * root * t) + z / root * np.sin(w * root * t)), 0.0)
    for values in (3.0 * step, -3.0 * step):
        overshoot = evaluate(metric("overshoot", (start, 2.0)), TIMES, values, STEP)
        assert overshoot == pytest.approx(math.exp(-math.pi * z / root), abs=1e-3)
        rise = evaluate(metric("rise_time", (start, 2.0), threshold=0.9), TIMES, values, STEP)
        assert rise is not None
        assert (
            abs(values[200 + round(rise / STEP)] / values[-1])
            >= 0.9
            > abs(values[199 + round(rise / STEP)] / values[-1])
        )
        settling = evaluate(metric("settling_time", (start, 2.0), threshold=0.05), TIMES, values, STEP)
        assert settling is not None
        assert rise < settling < -math.log(0.05 * root) / (z * w) + 0.01
        after = np.abs(values[200 + round(settling / STEP) :] / values[-1] - 1.0)
        assert after.max() <= 0.05


def test_without_an_end_value_there_is_no_overshoot() -> None:
    returns = np.array([0.0, 2.0, -1.0, 0.0])
    times = np.arange(4) * 0.1
    assert evaluate(metric("overshoot"), times, returns, 0.1) is None
    assert evaluate(metric("rise_time", threshold=0.9), times, returns, 0.1) is None
    assert evaluate(metric("settling_time", threshold=0.05), times, returns, 0.1) is None
    # A share that is never reached, and a value that is reached in the first row.
    assert evaluate(metric("rise_time", threshold=1.5), times, np.ones(4), 0.1) is None
    assert evaluate(metric("settling_time", threshold=0.05), times, np.ones(4), 0.1) == 0.0
    assert evaluate(metric("overshoot"), times, np.ones(4), 0.1) == 0.0


@pytest.mark.parametrize(("until", "expected"), [(Until(1, True, 1.5), 3.0), (Until(1, False, 0.5), 1.0)])
def test_a_window_ends_where_a_signal_says(until: Until, expected: float) -> None:
    times = np.arange(6) * 0.1
    signal = np.array([9.0, 1.0, 1.0, 1.0, 5.0, 5.0])
    # The condition also holds before the window, which does not count, and again after it.
    ends = np.array([0.0, 1.0, 0.4 if not until.above else 1.5, 1.0, 2.0, 0.0])
    windowed = replace(metric("final", (0.1, 0.5)), until=until)
    values = np.cumsum(signal) - 9.0
    assert evaluate(windowed, times, values, 0.1, ends) == expected
    # The metric is undefined without such a row; a row outside the window does not count.
    assert evaluate(windowed, times, values, 0.1, np.ones(6)) is None
    outside = np.where(np.arange(6) == 0, 9.0 if until.above else 0.0, 1.0)
    assert evaluate(windowed, times, values, 0.1, outside) is None
    with pytest.raises(metrics.MetricError, match="contains no recorded row"):
        evaluate(windowed, times, values, 0.1, np.full(6, 9.0 if until.above else 0.0))


def test_a_metric_of_a_difference(scenario: Plan) -> None:
    times = np.arange(3) * 0.1
    recording = Recording(times, {"source.count": np.array([1.0, 2.0, 3.0]), "body.roll": np.array([1.0, 1.0, 1.0])})
    difference = replace(metric("max"), minus=1)
    assert metrics.columns_of(difference) == {0, 1}
    assert of_recording(difference, scenario, recording) == 2.0
    until = replace(difference, until=Until(0, True, 2.5))
    assert of_recording(until, scenario, recording) == 1.0
    # A case without the component to compare with.
    assert of_recording(difference, scenario, Recording(times, {"source.count": times})) is None


@pytest.mark.parametrize(
    "kind", ["crossing", "magnitude_crossing", "share", "share_below", "magnitude_share", "rise_time", "settling_time"]
)
def test_a_threshold_that_is_missing_is_an_error(kind: str) -> None:
    with pytest.raises(metrics.MetricError, match="metric m: this kind needs a threshold"):
        evaluate(metric(kind), TIMES, TIMES, STEP)


def test_the_spectrum_of_white_noise_is_flat() -> None:
    # White noise with variance s^2 at interval dt has the one-sided density 2 s^2 dt from 0 to 1/(2 dt). With eight
    # half-overlapping segments, Welch's estimate scatters by about 1/sqrt(5); the mean of 1000 values scatters by 1 to
    # 2 %.
    values = np.random.default_rng(1).normal(0.0, 3.0, 9001)
    frequencies, densities = metrics.spectrum(np.arange(9001) * STEP, values)
    assert len(frequencies) == 1000
    assert (frequencies[0], frequencies[-1]) == pytest.approx((0.5, 500.0), rel=1e-12)
    assert densities.mean() == pytest.approx(2.0 * 9.0 * STEP, rel=0.05)


def signals(rows: int) -> list[Signal]:
    """Return noise with a large mean, rounded steps with many equal rows, and a decay by many orders of magnitude."""
    random = np.random.default_rng(rows)
    return [
        1e3 + random.normal(0.0, 3.0, rows),
        np.round(random.normal(0.0, 1.5, rows)),
        np.exp(-np.linspace(0.0, 40.0, rows)) * random.normal(-1.0, 1.0, rows),
    ]


def by_numpy(kind: str, x: Signal, t: Signal, threshold: float) -> float | None:
    """Return the metric of a kind, computed by numpy with sums that are rounded once."""
    above, far = x > threshold, np.abs(x) > threshold
    mean = math.fsum(x) / len(x)
    if kind in ("overshoot", "rise_time", "settling_time"):
        if x[-1] == 0.0:
            return None
        shares = x / x[-1]
        reached = shares >= threshold
        outside = np.abs(shares - 1.0) > threshold
        after = np.flatnonzero(np.concatenate([[True], outside[:-1]]))
        relative: dict[str, float | None] = {
            "overshoot": np.max(shares) - 1.0,
            "rise_time": t[reached.argmax()] - t[0] if reached.any() else None,
            "settling_time": t[after[-1]] - t[0],
        }
        return relative[kind]
    numbers: dict[str, float | None] = {
        "mean_square": math.fsum(x**2) / len(x),
        "rms": math.sqrt(math.fsum(x**2) / len(x)),
        "peak": np.abs(x).max(),
        "max": x.max(),
        "min": x.min(),
        "mean": mean,
        "final": x[-1],
        "peak_to_peak": float(np.ptp(x)),
        "deviation": math.sqrt(math.fsum((x - mean) ** 2) / len(x)),
        "changes": np.count_nonzero(np.diff(x)),
        "integral": math.fsum(x) * ((t[-1] - t[0]) / max(len(t) - 1, 1)),
        "crossing": t[above.argmax()] if above.any() else None,
        "magnitude_crossing": t[far.argmax()] if far.any() else None,
        "share": float(np.mean(above)),
        "share_below": float(np.mean(x < threshold)),
        "magnitude_share": float(np.mean(far)),
    }
    return numbers[kind]


@pytest.mark.parametrize(
    "kind",
    [
        *("mean_square", "rms", "peak", "max", "min", "mean", "final", "peak_to_peak", "deviation", "changes"),
        *("integral", "crossing", "magnitude_crossing", "share", "share_below", "magnitude_share"),
        *("overshoot", "rise_time", "settling_time"),
    ],
)
def test_every_kind_is_that_of_numpy(kind: str) -> None:
    # Bit-identical: the elements are computed as in numpy, and both round sums once.
    for rows in (1, 2, 17, 1000):
        if rows == 1 and kind == "integral":
            continue
        times = 0.25 + np.arange(rows) * 0.01
        for values in signals(rows):
            for threshold in (0.0, 0.5, 2.0, abs(float(values[0])) / 3.0):
                got = evaluate(metric(kind, threshold=threshold), times, values, 0.01)
                assert got == by_numpy(kind, values, times, threshold), (rows, threshold)


def test_sums_are_rounded_once() -> None:
    # Numbers over 200 orders of magnitude, which cancel except for the last digits of the smallest.
    random = np.random.default_rng(3)
    large = random.normal(0.0, 1.0, 300) * 10.0 ** random.integers(-100, 100, 300)
    values = np.concatenate([large, random.normal(0.0, 1.0, 300), -large])
    random.shuffle(values)
    assert evaluate(metric("integral"), np.arange(900.0), values, 1.0) == math.fsum(values) != np.sum(values)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_a_value_that_is_not_finite_gives_no_number(value: float) -> None:
    values = np.array([1.0, 0.0, value, 2.0])
    kinds = ("mean_square", "peak", "mean", "changes", "integral", "crossing", "share", "share_below", "settling_time")
    for kind in kinds:
        with pytest.raises(metrics.MetricError, match=rf"a signal is {str(value).replace('nan', 'NaN')} at 2 s"):
            evaluate(metric(kind, threshold=0.5), np.arange(4.0), values, 1.0)


@pytest.mark.parametrize("rows", [18, 23, 100, 901, 4547, 9005])
def test_the_spectrum_is_that_of_scipy(rows: int) -> None:
    # Segments of 4, 5, 22, 200, 1010 and 2001 rows. A transform of N rows has an error of about log2(N) units in the
    # last place of its largest line, which gives the absolute tolerance. scipy's mean of values near 1e3 has an error
    # of 1e-13. This error appears in the first line of the spectrum, together with noise of deviation 3: it is at most
    # N/4 1e-13/(3 sqrt(3 N/8)) = 1e-12 of the amplitude of the line.
    times = 3.0 + np.arange(rows) * 0.004
    size = rows * 2 // 9
    for values in signals(rows):
        frequencies, densities = metrics.spectrum(times, values)
        expected = scipy.signal.welch(
            values, 250.0, window="hann", nperseg=size, noverlap=size - size // 2, detrend="constant"
        )
        assert frequencies == pytest.approx(expected[0][1:], rel=1e-12)
        np.testing.assert_allclose(densities, expected[1][1:], rtol=1e-11, atol=1e-13 * expected[1].max())
        band = (0.1234 * frequencies[-1], 0.7321 * frequencies[-1])
        inside = (expected[0] >= band[0]) & (expected[0] < band[1])
        power = evaluate(replace(metric("band_power"), band=band), times, values, 0.004)
        assert power == pytest.approx(expected[1][inside].sum() * expected[0][1], rel=1e-11)


@pytest.mark.parametrize("rows", [18, 901, 4547])
def test_transfer_functions_are_those_of_scipy(rows: int) -> None:
    # Segments and errors of the lines are as in the test of the spectrum. The error of a quotient of two lines is
    # several times as large, if the lines are not small.
    times = 3.0 + np.arange(rows) * 0.004
    rng = np.random.default_rng(7)
    given = rng.normal(size=rows)
    # The output is delayed by three rows and has noise.
    found = np.roll(given, 3) + 0.1 * rng.normal(size=rows)
    size = rows * 2 // 9
    options = {"fs": 250.0, "window": "hann", "nperseg": size, "noverlap": size - size // 2, "detrend": "constant"}
    cross = scipy.signal.csd(given, found, **options)[1][1:]
    power = scipy.signal.welch(given, **options)[1][1:]
    measured = metrics.cross(times, given, found)
    gain, phase, coherence = metrics.transfer(measured)
    assert measured[0] == pytest.approx(scipy.signal.welch(given, **options)[0][1:], rel=1e-12)
    # In numpy and here, the highest frequency of an even segment is its own mirror image.
    np.testing.assert_allclose(gain, np.abs(cross) / power, rtol=1e-9)
    np.testing.assert_allclose(phase, np.unwrap(np.angle(cross)), atol=1e-9)
    np.testing.assert_allclose(coherence, scipy.signal.coherence(given, found, **options)[1][1:], atol=1e-9)


def test_a_signal_passed_on_has_gain_one_and_full_coherence() -> None:
    times = np.arange(900) * 0.01
    given = np.random.default_rng(3).normal(size=900)
    gain, phase, coherence = metrics.transfer(metrics.cross(times, given, -2.0 * given))
    np.testing.assert_allclose(gain, 2.0, rtol=1e-12)
    np.testing.assert_allclose(np.abs(phase), np.pi, rtol=1e-12)
    np.testing.assert_allclose(coherence, 1.0, rtol=1e-12)
    with pytest.raises(metrics.MetricError, match="at least 18 rows, got 17"):
        metrics.cross(times[:17], given[:17], given[:17])


@pytest.mark.parametrize("combine", ["min", "max", "norm", "squares"])
def test_signals_are_combined_as_by_numpy(combine: Literal["min", "max", "norm", "squares"]) -> None:
    columns = np.random.default_rng(5).normal(0.0, 2.0, (3, 50))
    weights = (2.0, -1.0, 0.5)
    expected = {
        "min": np.minimum.reduce(columns),
        "max": np.maximum.reduce(columns),
        "norm": np.linalg.norm(columns, axis=0),
        "squares": np.einsum("i,ij,ij->j", weights, columns, columns),
    }[combine]
    combined = replace(metric("final"), columns=(0, 1, 2), combine=combine, weights=weights)
    rows = np.arange(50, dtype=np.float64)
    for row in range(50):
        limited = replace(combined, window=(0.0, float(row)))
        got = _native.value(msgspec.json.encode(limited, enc_hook=float), rows, dict(enumerate(columns)), None, 1.0)
        # Sums of three products in different orders, which can cancel.
        assert got == pytest.approx(expected[row], rel=1e-15, abs=1e-14)


def test_running_values_are_those_of_numpy(scenario: Plan) -> None:
    # Sums in row order, as in numpy, are bit-identical.
    values = np.random.default_rng(6).normal(1.0, 1.0, len(TIMES))
    counts = np.arange(1, len(TIMES) + 1)
    for kind, expected in (
        ("mean", np.cumsum(values) / counts),
        ("rms", np.sqrt(np.cumsum(values**2) / counts)),
        ("integral", np.cumsum(values) * (TIMES[-1] / (len(TIMES) - 1))),
    ):
        got = metrics.running(metric(kind), scenario, Recording(TIMES, {"source.count": values}))
        assert got is not None
        assert (got[1] == expected).all()


def test_arrays_of_different_lengths_are_an_error() -> None:
    with pytest.raises(metrics.MetricError, match="metric m: a column has 3 rows, the times have 4"):
        evaluate(metric("mean"), np.arange(4.0), np.arange(3.0), 1.0)


@pytest.mark.parametrize("rows", [9000, 9005])
def test_the_spectrum_of_a_sine_has_its_power(rows: int) -> None:
    # With a Hann window, the power of a sine on a line is in this line and its two neighbors; the window is zero at all
    # other lines. A sine between lines leaks little. Segments have even and odd numbers of rows.
    values = 7.0 + 2.0 * np.sin(2.0 * np.pi * 40.0 * np.arange(rows) * STEP)
    frequencies, densities = metrics.spectrum(np.arange(rows) * STEP, values)
    assert frequencies[densities.argmax()] == pytest.approx(40.0, abs=0.26)
    assert densities.sum() * frequencies[0] == pytest.approx(2.0, rel=1e-3)


def test_a_short_spectrum_is_an_error() -> None:
    with pytest.raises(metrics.MetricError, match="at least 18 rows, got 17"):
        metrics.spectrum(np.arange(17.0), np.arange(17.0))


def test_the_power_of_a_band_is_that_of_its_sines() -> None:
    # A sine of amplitude A has the power A^2/2. With Hann windows of 2 s, it is within three lines of 0.5 Hz; the
    # tolerance 1e-3 covers leakage from sines between two lines.
    times = np.arange(9001) * STEP
    values = 5.0 + 2.0 * np.sin(2.0 * np.pi * 4.0 * times) + 0.5 * np.sin(2.0 * np.pi * 20.0 * times)

    def power(low: float, high: float) -> float:
        banded = replace(metric("band_power"), band=(low, high))
        got = evaluate(banded, times, values, STEP)
        assert got is not None
        return got

    assert power(2.0, 8.0) == pytest.approx(2.0, rel=1e-3)
    assert power(8.0, 50.0) == pytest.approx(0.125, rel=1e-3)
    assert power(0.0, 500.1) == pytest.approx(2.125, rel=1e-3)
    with pytest.raises(metrics.MetricError, match="needs a band"):
        evaluate(metric("band_power"), times, values, STEP)


def test_deviation_integral_and_share_below() -> None:
    values = 3.0 * np.sin(2.0 * np.pi * TIMES) - 1.0
    # Two whole periods without the repeated end point: 3/sqrt(2), independent of the mean.
    assert evaluate(metric("deviation", (0.0, 1.999)), TIMES, values, STEP) == pytest.approx(
        3.0 / math.sqrt(2.0), rel=1e-12
    )
    assert evaluate(metric("integral", (0.0, 1.999)), TIMES, values, STEP) == pytest.approx(-2.0, rel=1e-12)
    # Every second row: the integral uses the interval of the rows, not the step of the simulation.
    assert evaluate(metric("integral", (0.0, 1.998)), TIMES[::2], values[::2], STEP) == pytest.approx(-2.0, rel=1e-12)
    saw = np.array([0.0, 1.0, 0.5, 2.0])
    assert evaluate(metric("share_below", threshold=1.0), np.arange(4) * 0.1, saw, 0.1) == 0.5
    with pytest.raises(metrics.MetricError, match="no extent in time"):
        evaluate(metric("integral", (0.0, 0.0)), TIMES, values, STEP)


def test_several_signals_are_combined_row_by_row(scenario: Plan) -> None:
    # A circle of radius 7 m in 2 s: both components of the velocity change, and the path is the circumference.
    speed = 7.0 * math.pi
    recording = Recording(
        TIMES, {"source.count": speed * np.cos(3.0 * TIMES), "body.roll": speed * np.sin(3.0 * TIMES)}
    )
    two = replace(metric("integral", (0.0, 1.999)), columns=(0, 1), combine="norm")
    assert metrics.columns_of(two) == {0, 1}
    assert of_recording(two, scenario, recording) == pytest.approx(14.0 * math.pi, rel=1e-12)
    lifted = Recording(
        TIMES[:4], {"source.count": np.array([5.0, 0.0, 3.0, 0.0]), "body.roll": np.array([0, 2.0, 2, 0])}
    )

    def of(kind: str, combine: Literal["min", "max", "squares"], **more: Any) -> float | None:
        return of_recording(replace(metric(kind), columns=(0, 1), combine=combine, **more), scenario, lifted)

    assert of("share_below", "min", threshold=1.0) == 0.75
    assert of("share_below", "max", threshold=1.0) == 0.25
    # 2 x^2 - y^2 is 50, -4, 14 and 0.
    assert of("mean", "squares", weights=(2.0, -1.0)) == 15.0
    assert of_recording(two, scenario, Recording(TIMES, {"body.roll": TIMES})) is None


def test_a_metric_of_what_differs_from_the_baseline(scenario: Plan) -> None:
    shifted = replace(metric("peak", (0.0, 1.0)), from_baseline=True)
    recording = Recording(TIMES, {"source.count": np.sin(TIMES) - 0.25})
    baseline = Recording(TIMES, {"source.count": np.sin(TIMES)})
    assert of_recording(shifted, scenario, recording, baseline) == pytest.approx(0.25, rel=1e-12)
    assert of_recording(shifted, scenario, recording) is None


def test_a_metric_over_a_growing_window_ends_at_its_value(scenario: Plan) -> None:
    recording = Recording(TIMES, {"source.count": 3.0 * np.sin(2.0 * np.pi * TIMES) - 1.0})
    for kind in ("mean", "rms", "integral"):
        of = metric(kind, (0.5, 1.5))
        got = metrics.running(of, scenario, recording)
        assert got is not None
        times, values = got
        assert (times[0], times[-1]) == (0.5, 1.5)
        assert values[-1] == pytest.approx(of_recording(of, scenario, recording), rel=1e-12)
        # Halfway, the running value is the metric of the first half.
        half = of_recording(metric(kind, (0.5, 1.0)), scenario, recording)
        assert half is not None
        # Up to rounding, because the integral uses the mean row interval of the whole window.
        assert values[500] == pytest.approx(half, rel=1e-9)
    with pytest.raises(metrics.MetricError, match="no running values"):
        metrics.running(metric("peak"), scenario, recording)

"""Statistics of studies against SciPy, closed forms and values computed by hand."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import scipy.stats

from chassis_fmu.study import charts, design, statistics
from chassis_fmu.study.factors import Factor
from chassis_fmu.study.file import Study
from chassis_fmu.study.job import Done
from chassis_fmu.study.statistics import Distribution, Numbers

RNG = np.random.default_rng(1)
NAN = math.nan


def factor(name: str, **keys: Any) -> Factor:
    return Factor(name=name, variable=f"f:{name}", **keys)


def uniform(name: str) -> Factor:
    return factor(name, distribution="uniform", min=0.0, max=1.0)


def numbers(study: Study, values: list[list[Any]], *cells: list[float]) -> Numbers:
    """Return the numbers of a study with one metric, whose second cell has the first one as its baseline."""
    runs = [SimpleNamespace(case=f"case {i}", point=None) for i in range(len(cells))]
    job: Any = SimpleNamespace(study=study, metrics=[0], cells=runs, baseline=lambda cell: 0 if cell == 1 else None)
    rows = {
        (n, cell): Done(n, cell, () if math.isnan(y) else (y,), "ok", None, None, None, None, 0.0)
        for cell, of in enumerate(cells)
        for n, y in enumerate(of)
    }
    return Numbers(job, values, rows)


def study(*factors: Factor, **keys: Any) -> Study:
    return Study(title="", scenario="", vary=list(factors), **{"method": "sample", **keys})


@pytest.mark.parametrize("count", [2, 5, 200])
def test_the_interval_of_a_mean_is_that_of_scipy(count: int) -> None:
    values = RNG.normal(3.0, 2.0, count)
    mean, interval = statistics.student(values)
    expected = scipy.stats.ttest_1samp(values, 0.0).confidence_interval(0.95)
    assert mean == pytest.approx(values.mean(), rel=1e-14)
    assert interval == pytest.approx((expected.low, expected.high), rel=1e-12)


@pytest.mark.parametrize(("first", "second"), [(4, 9), (50, 50)])
def test_the_interval_of_a_difference_is_that_of_scipy(first: int, second: int) -> None:
    groups = RNG.normal(1.0, 1.0, first), RNG.normal(2.0, 3.0, second)
    difference, interval = statistics.welch(*groups)
    expected = scipy.stats.ttest_ind(groups[1], groups[0], equal_var=False).confidence_interval(0.95)
    assert difference == pytest.approx(groups[1].mean() - groups[0].mean(), rel=1e-14)
    assert interval == pytest.approx((expected.low, expected.high), rel=1e-12)


def test_the_difference_of_constants_is_certain() -> None:
    assert statistics.welch(np.full(3, 1.0), np.full(4, 3.0)) == (2.0, (2.0, 2.0))


def test_a_distribution_is_that_of_the_numbers_that_are_there() -> None:
    found = Distribution.of(np.array([4.0, NAN, 1.0, 2.0, 3.0, 5.0]))
    assert found is not None
    # The numbers 1 to 5; percentiles by linear interpolation between ranks.
    assert (found.count, found.mean, found.min, found.max) == (5, 3.0, 1.0, 5.0)
    assert found.deviation == pytest.approx(math.sqrt(2.5), rel=1e-15)
    assert found.percentiles == pytest.approx((1.2, 2.0, 3.0, 4.0, 4.8), rel=1e-15)
    assert Distribution.of(np.array([NAN])) is None


def test_a_case_is_compared_with_its_baseline_in_pairs() -> None:
    of = numbers(study(uniform("a")), [[0.0] * 5], [1.0, 2.0, 3.0, NAN, 5.0], [0.0, 0.0, 4.0, 7.0, NAN])
    (found,) = statistics.compared(of, 0)
    # By hand: the pairs differ by -1, -2 and 1, with the deviation sqrt(7/3). The quantile is from the t distribution
    # with two degrees of freedom. SciPy's quantile has an error below 1e-10.
    half = 0.95 * math.sqrt(2.0 / (1.0 - 0.95**2)) * math.sqrt(7.0 / 3.0) / math.sqrt(3.0)
    assert (found.count, found.lower) == (3, 2)
    assert found.mean == pytest.approx(-2.0 / 3.0, rel=1e-15)
    assert found.interval == pytest.approx((-2.0 / 3.0 - half, -2.0 / 3.0 + half), rel=1e-9)
    assert not found.is_clear


def test_rank_correlations_are_those_of_scipy_with_the_interval_of_fisher() -> None:
    x, y = RNG.random(40), RNG.random(40)
    y[:20] += 3.0 * x[:20]
    (found,) = statistics.effects(numbers(study(uniform("a")), [list(x)], list(y)), 0, 0)
    rho = scipy.stats.spearmanr(x, y).statistic
    assert found.value == pytest.approx(rho, rel=1e-14)
    assert found.interval is not None
    # Fisher's interval is defined for a Pearson correlation, here of the ranks.
    ranks = scipy.stats.pearsonr(scipy.stats.rankdata(x), scipy.stats.rankdata(y)).confidence_interval(0.95)
    assert found.interval == pytest.approx((ranks.low, ranks.high), rel=1e-12)


LAW = Factor(name="law", fmu="f", values=["A", "B"])


def test_fmus_are_compared_in_pairs_of_the_same_values() -> None:
    values: list[list[Any]] = [["A", "B", "A", "B", "A", "B"], [0.1, 0.1, 0.2, 0.2, 0.3, 0.3]]
    of = numbers(study(LAW, uniform("a")), values, [1.0, 2.0, 5.0, 8.0, 9.0, NAN])
    first, second = statistics.choices(of, 0, 0)
    assert (first.level, first.count, first.mean, first.against) == ("A", 3, 5.0, None)
    # By hand: two pairs differ by 1 and 3, with the mean 2 and the deviation sqrt(2). The quantile is from the t
    # distribution with one degree of freedom.
    assert (second.level, second.count, second.mean) == ("B", 2, 5.0)
    assert (second.against, second.pairs, second.difference, second.lower) == ("A", 2, 2.0, 0)
    half = math.tan(0.475 * math.pi)
    assert second.difference_interval == pytest.approx((2.0 - half, 2.0 + half), rel=1e-9)


def test_choices_without_pairs_are_independent_groups() -> None:
    values: list[list[Any]] = [["A", "A", "A", "B", "B", "B"], [0.1, 0.2, 0.3, 0.4, 0.5, 0.6]]
    y = [1.0, 2.0, 4.0, 8.0, 9.0, 11.0]
    _, second = statistics.choices(numbers(study(LAW, uniform("a")), values, y), 0, 0)
    assert second.pairs == 0
    expected = statistics.welch(np.array(y[:3]), np.array(y[3:]))
    assert (second.difference, second.difference_interval) == expected


def test_samples_are_crossed_with_fmus() -> None:
    crossed = study(LAW, uniform("a"), uniform("b"), runs=7)
    law, a, b = design.values(crossed, design.shares(crossed))
    alone = study(uniform("a"), uniform("b"), runs=7)
    assert [a[::2], b[::2]] == design.values(alone, design.shares(alone))
    assert (a[1::2], b[1::2]) == (a[::2], b[::2])
    assert law == ["A", "B"] * 7
    weighted = study(Factor(name="law", fmu="f", values=["A", "B"], weights=[1.0, 3.0]), uniform("a"), runs=8)
    # In a Latin hypercube, the number of samples with each choice is exactly its share.
    assert sorted(design.values(weighted, design.shares(weighted))[0]) == ["A"] * 2 + ["B"] * 6


SWEPT = [factor("a", values=[1.0, 2.0, 4.0]), factor("b", values=[10.0, 20.0])]


def test_a_tornado_of_one_at_a_time_has_the_others_in_the_middle() -> None:
    swept = study(*SWEPT, method="sweep", design="one_at_a_time")
    a, b = design.values(swept, design.shares(swept))
    y = [3.0 * u + 100.0 * v for u, v in zip(a, b, strict=True)]
    # The middle value of b is 20.
    second, first = statistics.swings(numbers(swept, [a, b], y), 0, 0)[::-1]
    assert (first.factor, first.low, first.high, first.at_low, first.at_high) == ("b", 10.0, 20.0, 1006.0, 2006.0)
    assert (second.factor, second.at_low, second.at_high, second.difference) == ("a", 2003.0, 2012.0, 9.0)
    assert first.interval is None


def test_a_tornado_of_all_combinations_has_the_means_over_the_others() -> None:
    swept = study(*SWEPT, method="sweep")
    a, b = design.values(swept, design.shares(swept))
    y = [u * v for u, v in zip(a, b, strict=True)]
    found = {s.factor: s for s in statistics.swings(numbers(swept, [a, b], y), 0, 0)}
    # The mean of a is 7/3, the mean of b is 15.
    assert (found["a"].at_low, found["a"].at_high) == (15.0, 60.0)
    assert (found["b"].at_low, found["b"].at_high) == pytest.approx((70.0 / 3.0, 140.0 / 3.0), rel=1e-15)


def test_a_heat_map_has_the_means_over_the_other_factors() -> None:
    swept = study(SWEPT[0], factor("c", values=[0.0, 1.0, 2.0]), factor("b", values=[10.0, 20.0]), method="sweep")
    a, c, b = design.values(swept, design.shares(swept))
    made = numbers(swept, [a, c, b], [u + 10.0 * v + 0.1 * w for u, v, w in zip(a, c, b, strict=True)])
    metric = SimpleNamespace(title="Roll", unit="deg")
    case = SimpleNamespace(name="case 0", title="Plain")
    plan = SimpleNamespace(metrics=[metric], cases=[case], points=[], point_titles={None: ""})
    made.job.plan = plan  # type: ignore[assignment]
    made.job.unit = lambda factor: "kg" if factor.name == "a" else ""  # type: ignore[method-assign]
    # `b` has too few values for a map.
    (panel,) = charts.over_two_factors(made, 0)
    assert (panel.title, panel.kind, panel.x.title, panel.y.title) == ("Roll over a and c", "heat", "a", "c")
    assert panel.x.units[0].unit == "kg"
    (line,) = panel.lines
    assert line.z is not None
    # The mean of b is 15.
    expected = [(u, v, u + 10.0 * v + 1.5) for u in (1.0, 2.0, 4.0) for v in (0.0, 1.0, 2.0)]
    cells = [*zip(line.x, line.y, line.z, strict=True)]
    assert np.ravel(cells).tolist() == pytest.approx(np.ravel(expected).tolist(), rel=1e-14)
    assert panel.z is not None
    assert panel.z.range == pytest.approx((2.5, 25.5), rel=1e-14)


def test_a_tornado_of_samples_has_the_outer_fifths() -> None:
    sampled = study(uniform("a"), runs=10)
    x = [v / 10.0 for v in range(10)]
    short = numbers(sampled, [x], [10.0 * v for v in x])
    assert statistics.swings(short, 0, 0) == []
    x = [v / 20.0 for v in range(20)]
    y = [10.0 * v for v in x]
    (found,) = statistics.swings(numbers(sampled, [x], y), 0, 0)
    # By hand: the four lowest and the four highest of twenty values.
    assert (found.low, found.high) == pytest.approx((0.075, 0.875), rel=1e-14)
    assert (found.at_low, found.at_high) == pytest.approx((0.75, 8.75), rel=1e-14)
    assert found.interval == pytest.approx(statistics.welch(np.array(y[:4]), np.array(y[16:]))[1], rel=1e-14)


@pytest.mark.parametrize("analysis", ["morris", "sobol"])
def test_sensitivities_leave_out_groups_with_a_run_that_failed(analysis: str) -> None:
    wanted = study(uniform("a"), uniform("b"), uniform("c"), method="sensitivity", analysis=analysis, runs=64)
    shares = design.shares(wanted)
    a, b, c = (np.array(v) for v in design.values(wanted, shares))
    y = a + 2.0 * b + 4.0 * c
    size = 4 if analysis == "morris" else 5
    whole = statistics.sensitivities(wanted, shares, y)
    assert (whole.missing, whole.left_out, whole.groups) == ([], 0, 64)
    # The indices from the remaining groups agree with a study without the missing groups.
    y[[1, 2, 3 * size]] = NAN
    found = statistics.sensitivities(wanted, shares, y)
    assert (found.missing, found.left_out, found.groups) == ([1, 2, 3 * size], 2, 64)
    rows = [i for i in range(64 * size) if i // size not in (0, 3)]
    assert found.effects == statistics.sensitivities(wanted, shares[rows], y[rows]).effects
    assert [e.factor for e in found.effects] == ["c", "b", "a"]
    y[: 61 * size] = NAN
    few = statistics.sensitivities(wanted, shares, y)
    assert few.effects == []
    assert few.left_out == 61


def test_morris_tells_factors_that_act_together() -> None:
    # y = a + b c: the elementary effects of a are all 1; the effects of b are c, so they have a deviation.
    wanted = study(uniform("a"), uniform("b"), uniform("c"), method="sensitivity", analysis="morris", runs=50)
    shares = design.shares(wanted)
    a, b, c = (np.array(v) for v in design.values(wanted, shares))
    found = {e.factor: e for e in statistics.sensitivities(wanted, shares, a + b * c).effects}
    # The clipped ends of the shares give an error of 1e-6.
    assert found["a"].value == pytest.approx(1.0, rel=1e-5)
    assert found["a"].sigma == pytest.approx(0.0, abs=1e-5)
    # Levels 0, 1/3, 2/3 and 1 of c have a deviation of sqrt(5)/6 = 0.37; five standard errors of 50 values are 0.19.
    assert found["b"].sigma == pytest.approx(math.sqrt(5.0) / 6.0, abs=0.19)


def test_the_pareto_front_has_what_nothing_beats_in_both() -> None:
    points = np.array([[1.0, 5.0], [2.0, 3.0], [3.0, 4.0], [4.0, 1.0], [2.0, 6.0]])
    assert charts.pareto(points, [1.0, 1.0]).tolist() == [[1.0, 5.0], [2.0, 3.0], [4.0, 1.0]]
    assert charts.pareto(points, [1.0, -1.0]).tolist() == [[1.0, 5.0], [2.0, 6.0]]

"""Designs and distributions of studies, against theory."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
import scipy.stats
from numpy.typing import NDArray

from chassis_fmu.study import design, file
from chassis_fmu.study.factors import Factor
from chassis_fmu.study.file import Study, StudyError
from chassis_fmu.study.statistics import wilson

N = 4096


def study(*factors: Factor, **keys: object) -> Study:
    """Return a study with method "sample" and these factors."""
    given = {"title": "", "scenario": "", "method": "sample", "vary": list(factors), **keys}
    return Study(**given)  # type: ignore[arg-type]


def lognormal_moment(order: int, low: float, high: float) -> float:
    """Return a moment of a lognormal distribution (median 3, deviation 0.5) that is truncated to two limits.

    Johnson, Kotz: Continuous univariate distributions, section 14.3: the moment without truncation, times a ratio of
    shares of normal distributions, one of them shifted by `order` deviations.
    """
    of, deviation = scipy.stats.norm, 0.5
    ends = [(math.log(v / 3.0) / deviation if v < math.inf else math.inf) for v in (low, high)]
    moved = of.cdf(ends[1] - order * deviation) - of.cdf(ends[0] - order * deviation)
    whole = 3.0**order * math.exp(0.5 * (order * deviation) ** 2)
    return float(whole * moved / (of.cdf(ends[1]) - of.cdf(ends[0])))


FACTORS = [
    (Factor(name="x", variable="f:a", distribution="uniform", min=2.0, max=6.0), 4.0, 16.0 / 12.0),
    (
        Factor(name="x", variable="f:a", distribution="log_uniform", min=1.0, max=math.e),
        math.e - 1.0,
        (math.e**2 - 1.0) / 2.0 - (math.e - 1.0) ** 2,
    ),
    (Factor(name="x", variable="f:a", distribution="normal", mean=5.0, deviation=2.0), 5.0, 4.0),
    (
        Factor(name="x", variable="f:a", distribution="lognormal", median=3.0, deviation=0.5),
        3.0 * math.exp(0.125),
        9.0 * math.exp(0.25) * (math.exp(0.25) - 1.0),
    ),
    (
        Factor(name="x", variable="f:a", distribution="triangular", min=0.0, mode=1.0, max=5.0),
        2.0,
        (25.0 + 1.0 - 5.0) / 18.0,
    ),
    (Factor(name="x", variable="f:a", values=[1.0, 3.0], weights=[1.0, 3.0]), 2.5, 0.75),
    # A normal distribution truncated symmetrically at one deviation keeps its mean; for the variance, see Johnson,
    # Kotz: Continuous univariate distributions, section 13.10.1.
    (
        Factor(name="x", variable="f:a", distribution="normal", mean=5.0, deviation=2.0, min=3.0, max=7.0),
        5.0,
        4.0 * (1.0 - 2.0 * scipy.stats.norm.pdf(1.0) / (2.0 * scipy.stats.norm.cdf(1.0) - 1.0)),
    ),
    # Truncated at its mean: half a normal distribution, on either side (section 13.10.2).
    (
        Factor(name="x", variable="f:a", distribution="normal", mean=5.0, deviation=2.0, min=5.0),
        5.0 + 2.0 * math.sqrt(2.0 / math.pi),
        4.0 * (1.0 - 2.0 / math.pi),
    ),
    (
        Factor(name="x", variable="f:a", distribution="normal", mean=5.0, deviation=2.0, max=5.0),
        5.0 - 2.0 * math.sqrt(2.0 / math.pi),
        4.0 * (1.0 - 2.0 / math.pi),
    ),
    (
        Factor(name="x", variable="f:a", distribution="lognormal", median=3.0, deviation=0.5, min=2.0, max=5.0),
        lognormal_moment(1, 2.0, 5.0),
        lognormal_moment(2, 2.0, 5.0) - lognormal_moment(1, 2.0, 5.0) ** 2,
    ),
    (
        Factor(name="x", variable="f:a", distribution="lognormal", median=3.0, deviation=0.5, min=3.0),
        lognormal_moment(1, 3.0, math.inf),
        lognormal_moment(2, 3.0, math.inf) - lognormal_moment(1, 3.0, math.inf) ** 2,
    ),
]


@pytest.mark.parametrize("chosen", ["random", "latin_hypercube", "sobol"])
@pytest.mark.parametrize(("factor", "mean", "variance"), FACTORS)
def test_moments_are_those_of_the_distribution(factor: Factor, mean: float, variance: float, chosen: str) -> None:
    of = study(factor, runs=N, design=chosen)
    (values,) = design.values(of, design.shares(of))
    # Five standard errors of random samples; the errors of the other designs are smaller.
    fourth = float(np.mean((np.array(values) - mean) ** 4))
    assert abs(np.mean(values) - mean) < 5.0 * math.sqrt(variance / N)
    assert abs(np.var(values) - variance) < 5.0 * math.sqrt(max(fourth - variance**2, 1e-9) / N)


def test_a_stratified_design_has_one_sample_in_each_stratum() -> None:
    factors = [Factor(name=n, variable=f"f:{n}", distribution="uniform", min=0.0, max=1.0) for n in "abc"]
    shares = design.shares(study(*factors, runs=100))
    assert np.array_equal(np.sort(np.floor(100 * shares), axis=0), np.tile(np.arange(100.0)[:, None], 3))


@pytest.mark.parametrize("factor", [f for f, _, _ in FACTORS if f.min is not None or f.max is not None])
@pytest.mark.parametrize("chosen", ["random", "latin_hypercube", "sobol"])
def test_no_value_passes_a_limit(factor: Factor, chosen: str) -> None:
    of = study(factor, runs=N, design=chosen)
    (values,) = design.values(of, design.shares(of))
    assert min(values) >= (-math.inf if factor.min is None else factor.min)
    assert max(values) <= (math.inf if factor.max is None else factor.max)


@pytest.mark.parametrize("chosen", ["random", "latin_hypercube", "sobol"])
def test_correlations_are_those_of_the_study(chosen: str) -> None:
    factors = [
        Factor(name=n, variable=f"f:{n}", distribution="normal", mean=1.0, deviation=d)
        for n, d in zip("abc", (1.0, 2.0, 3.0), strict=True)
    ]
    wanted = [
        file.Correlation(between=("a", "c"), coefficient=0.8),
        file.Correlation(between=("b", "c"), coefficient=-0.3),
    ]
    of = study(*factors, runs=N, correlation=wanted, design=chosen)
    values = design.values(of, design.shares(of))
    found = np.corrcoef(values)
    # Five standard errors of a correlation coefficient, (1 - r^2)/sqrt(n).
    for (i, j), r in {(0, 2): 0.8, (1, 2): -0.3, (0, 1): 0.0}.items():
        assert abs(found[i, j] - r) < 5.0 * (1.0 - r * r) / math.sqrt(N)
    # Each factor keeps its own distribution, correlated or not; the sample's distribution function differs from it by
    # at most `most`. In a stratified sample, each of N equal parts has one value, so the limit is 1/N. The correlation
    # keeps this property for the independent factors `a` and `b`, but not for `c`. For random samples, the
    # Dvoretzky-Kiefer-Wolfowitz inequality gives a larger difference in one of 1,000 studies: 2 exp(-2 N most^2) =
    # 0.001 (Massart 1990). The limit is 0.030, which detects an error of 0.076 deviations in the mean or of 13 % in the
    # deviation.
    random = math.sqrt(math.log(2.0 / 0.001) / (2.0 * N))
    for name, of_one, deviation in zip("abc", values, (1.0, 2.0, 3.0), strict=True):
        most = random if chosen == "random" or name == "c" else 1.0 / N
        distance = scipy.stats.kstest(of_one, scipy.stats.norm(1.0, deviation).cdf).statistic
        assert distance <= most + 1e-12, name


@pytest.mark.parametrize("analysis", ["morris", "sobol"])
def test_a_seed_decides_about_a_design_of_sensitivities(analysis: str) -> None:
    factors = [Factor(name=n, variable=f"f:{n}", distribution="uniform", min=0.0, max=1.0) for n in "abc"]

    def of(seed: int) -> NDArray[np.float64]:
        return design.shares(study(*factors, runs=16, seed=seed, method="sensitivity", analysis=analysis))

    first = of(1)
    assert first.shape == (16 * (4 if analysis == "morris" else 5), 3)
    assert np.array_equal(first, of(1))
    assert not np.array_equal(first, of(2))
    # The design does not depend on the state of other random number generators.
    np.random.seed(5)
    assert np.array_equal(first, of(1))


@pytest.mark.parametrize("chosen", ["random", "latin_hypercube", "sobol"])
def test_a_seed_decides_about_a_design(chosen: str) -> None:
    factors = [Factor(name=n, variable=f"f:{n}", distribution="uniform", min=0.0, max=1.0) for n in "ab"]
    first, again, other = (design.shares(study(*factors, runs=33, seed=s, design=chosen)) for s in (1, 1, 2))
    assert np.array_equal(first, again)
    assert not np.any(first == other)
    assert np.all((first > 0.0) & (first < 1.0))


def test_the_first_samples_of_a_sobol_sequence_stay_when_more_are_taken() -> None:
    factors = [Factor(name=n, variable=f"f:{n}", distribution="uniform", min=0.0, max=1.0) for n in "ab"]
    few, many = (design.shares(study(*factors, runs=n, design="sobol")) for n in (10, 64))
    assert np.array_equal(few, many[:10])


def test_sweeps_take_the_levels() -> None:
    factors = [
        Factor(name="a", variable="f:a", values=[1.0, 2.0, 4.0]),
        Factor(name="b", variable="f:b", distribution="grid", min=1.0, max=100.0, count=3, scale="log"),
    ]
    whole = study(*factors, method="sweep")
    a, b = design.values(whole, design.shares(whole))
    assert list(zip(a, b, strict=True)) == [(x, y) for x in (1.0, 2.0, 4.0) for y in (1.0, 10.0, 100.0)]
    pairs = study(*factors, method="sweep", design="list")
    assert design.values(pairs, design.shares(pairs)) == [[1.0, 2.0, 4.0], [1.0, 10.0, 100.0]]
    single = study(*factors, method="sweep", design="one_at_a_time")
    assert design.values(single, design.shares(single)) == [[2.0, 1.0, 4.0, 2.0, 2.0], [10.0, 10.0, 10.0, 1.0, 100.0]]


def test_seeds_are_whole_numbers() -> None:
    of = study(Factor(name="s", variable="f:seed", distribution="seed"), runs=50)
    (values,) = design.values(of, design.shares(of))
    assert all(isinstance(v, int) and 1 <= v < 2**31 for v in values)
    assert len(set(values)) == 50


@pytest.mark.parametrize(("met", "of"), [(0, 10), (3, 10), (10, 10), (950, 1000)])
def test_the_interval_is_that_of_scipy(met: int, of: int) -> None:
    expected = scipy.stats.binomtest(met, of).proportion_ci(0.95, "wilson")
    assert wilson(met, of) == pytest.approx((expected.low, expected.high), abs=1e-12)


@pytest.mark.parametrize(
    ("keys", "expected"),
    [
        ('distribution = "uniform"\nmin = 1.0', "distribution uniform needs the key `max`"),
        ('distribution = "uniform"\nmin = 2.0\nmax = 1.0', "9:7: max is 1, expected more than min, 2"),
        ('distribution = "normal"\nmean = 1.0\ndeviation = 0.0', "deviation is 0, expected more than 0"),
        ('distribution = "uniform"\nmin = 1.0\nmax = 2.0\nmode = 1.0', "distribution uniform has no key `mode`"),
        (
            'distribution = "log_uniform"\nmin = 0.0\nmax = 1.0',
            "min is 0, expected more than 0 for a logarithmic scale",
        ),
        ('distribution = "triangular"\nmin = 0.0\nmode = 3.0\nmax = 2.0', "mode is 3, expected 0 to 2"),
        ('distribution = "grid"\nmin = 0.0\nmax = 3.0\ncount = 1', "count is 1, expected at least 2"),
        ('distribution = "normal"\nmean = 0.0\ndeviation = 1.0\nmin = 7.0', "7:16: min and max leave next to nothing"),
        ("values = []", "values is empty"),
        ("values = [1.0, 1.0]", "7:16: this value appears twice"),
        ('values = [1.0, "x"]', "7:16: values must be all numbers, all strings"),
        ("values = [1.0, nan]", "7:16: expected a finite number"),
        ("values = [1.0, [2.0]]", "7:10: `values` must be a number, true, false or a string"),
        ("values = [1.0, 2.0]\nweights = [1.0]", "expected 2 weights"),
        ("values = [1.0, 2.0]\nmin = 1.0", "a list of values has no key `min`"),
        ('values = [1.0]\nrelative = true\nunit = "m"', "5:8: relative values are multiples"),
        ("", "expected either values or a distribution"),
    ],
)
def test_a_wrong_factor_is_explained(tmp_path: Path, keys: str, expected: str) -> None:
    path = tmp_path / "study.toml"
    factor = f'[[vary]]\nname = "x"\nvariable = "f:a"\n{keys}\n'
    path.write_text(f'title = "T"\nscenario = "s.toml"\nmethod = "sample"\n{factor}')
    with pytest.raises(StudyError, match=expected):
        file.read(path, [])


UNIFORM = '[[vary]]\nname = "x"\nvariable = "f:a"\ndistribution = "uniform"\nmin = 0.0\nmax = 1.0\n'
NORMAL = '[[vary]]\nname = "{}"\nvariable = "f:a"\ndistribution = "normal"\nmean = 0.0\ndeviation = 1.0\n'


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ('method = "sample"', "missing key `vary`"),
        ('method = "sample"\nvary = []', "nothing varies"),
        (
            'method = "samples"\n' + UNIFORM,
            "3:10: `method`: unknown word `samples`, expected one .*; did you mean `sample`",
        ),
        (
            'method = "sample"\nrans = 3\n' + UNIFORM,
            "4:1: unknown key `rans`, expected one of .*; did you mean `runs`",
        ),
        (
            'method = "sample"\n' + UNIFORM + UNIFORM.replace("uniform", "gauss").replace('"x"', '"z"'),
            "13:16: `distribution`: unknown word `gauss`, expected one of `uniform`, `log_uniform`",
        ),
        (
            'method = "sample"\n' + UNIFORM.replace("uniform", "unifrom"),
            r"`distribution`: .*; did you mean `uniform`\?",
        ),
        ('method = "sample"\n' + UNIFORM.replace("0.0", '"0"'), '`min` must be a number, got the string "0"'),
        ('method = "sample"\n' + UNIFORM + "mim = 1.0", r"unknown key `mim`, .*; did you mean `min`\?"),
        ('method = "sample"\ncases = ["a", 1]\n' + UNIFORM, "4:15: `cases` must be a string, got 1"),
        ('method = "sample"\nvary = 3', "`vary` must be a list, got 3"),
        (
            'method = "sample"\n' + UNIFORM + "[[requirement]]\nmax = 1.0",
            "10:1: missing key `metric`",
        ),
        ('method = "sample"\nruns = 0\n' + UNIFORM, "runs is 0, expected at least 1"),
        ('method = "sample"\ndesign = "list"\n' + UNIFORM, "expected one of latin_hypercube, random, sobol"),
        ('method = "sweep"\n' + UNIFORM, "a sweep needs values or distribution grid"),
        ('method = "sample"\n' + UNIFORM + UNIFORM, "two factors are named `x`"),
        ('method = "sample"\n' + UNIFORM.replace('"x"', '"case"'), "the tables have a column `case` already"),
        ('method = "sensitivity"\n' + UNIFORM, "method sensitivity needs analysis"),
        ('method = "worst_case"\n' + UNIFORM, r"method worst_case needs a table \[search\]"),
        ('method = "sample"\n' + UNIFORM + '[[requirement]]\nmetric = "y"', "a requirement needs `min`, `max` or both"),
        ('method = "sample"\n' + UNIFORM + '[[requirement]]\nmetric = "y"\nmax = 1.0\nshare = 95.0', "share is 95"),
        (
            'method = "sample"\n' + UNIFORM + '[[correlation]]\nbetween = ["x", "z"]\ncoefficient = 0.5',
            "no factor is named `z`",
        ),
        (
            'method = "sample"\n'
            + "".join(NORMAL.format(n) for n in "pqr")
            + "".join(
                f'[[correlation]]\nbetween = ["{a}", "{b}"]\ncoefficient = {r}\n'
                for a, b, r in (("p", "q", 0.9), ("q", "r", 0.9), ("p", "r", -0.9))
            ),
            "the correlations contradict each other",
        ),
        ("title", "study.toml:3:6: key with no value"),
    ],
)
def test_a_wrong_study_is_explained(tmp_path: Path, text: str, expected: str) -> None:
    path = tmp_path / "study.toml"
    path.write_text(f'title = "T"\nscenario = "s.toml"\n{text}\n')
    with pytest.raises(StudyError, match=expected):
        file.read(path, [])

"""Studies with a small FMU, written in C, whose output is a known function of its parameters."""

from __future__ import annotations

import importlib.util
import io
import json
import re
import zipfile
from pathlib import Path

import numpy as np
import pyarrow.parquet
import pytest
import scipy.stats
from numpy.typing import NDArray

from chassis_fmu.scenario import Scenario
from chassis_fmu.study import bundle, report, search
from chassis_fmu.study.engines import Local
from chassis_fmu.study.file import StudyError
from chassis_fmu.study.file import read as load_study
from chassis_fmu.study.job import Done, Job
from tests import study_system
from tests.study_system import SCENARIO, build, vary, write

ROOT = Path(__file__).parents[2]
UNIFORM = 'distribution = "uniform"\nmin = 0.0\nmax = 1.0'
SAMPLE = 'method = "sample"\nruns = 20\n'
TWO = vary("p", "f:a", UNIFORM) + vary("q", "f:c", 'distribution = "normal"\nmean = 3.0\ndeviation = 0.1')


def run(folder: Path, study: Path, *options: str, page: bool = False) -> int:
    """Run a study with the FMUs in a folder, without its page unless a test reads it."""
    if not page and "--report-only" not in options:
        options = ("--no-page", *options)
    return study_system.carry_out([str(study), "--fmus", str(folder / "fmus"), "--out", str(folder / "out"), *options])


def rows(folder: Path, name: str = "runs") -> list[dict[str, object]]:
    found: list[dict[str, object]] = pyarrow.parquet.read_table(
        folder / "out" / "study" / f"{name}.parquet"
    ).to_pylist()
    return found


def table(folder: Path, out: str = "out") -> bytes:
    return (folder / out / "study" / "runs.parquet").read_bytes()


def test_every_run_is_a_row_with_its_values_and_metrics(tmp_path: Path) -> None:
    build(tmp_path)
    assert run(tmp_path, write(tmp_path, SAMPLE + TWO), page=True) == 0
    found = rows(tmp_path)
    assert [(r["sample"], r["case"]) for r in found] == [(n, c) for n in range(20) for c in ("plain", "shifted")]
    for row in found:
        p, q = row["p"], row["q"]
        assert isinstance(p, float)
        assert isinstance(q, float)
        # The sum has the order of the C expression, so it is bit-identical.
        y = p + 10.0 * (2.0 if row["case"] == "plain" else 3.0) + 100.0 * q
        assert (row["y"], row["twice"], row["status"], row["time"]) == (y, 2.0 * y, "ok", None)
    designed = rows(tmp_path, "design")
    assert [(r["sample"], r["p"], r["q"]) for r in designed] == [(r["sample"], r["p"], r["q"]) for r in found[::2]]
    schema = pyarrow.parquet.read_schema(tmp_path / "out" / "study" / "timing.parquet")
    assert schema.names == ["sample", "case", "point", "seconds"]
    page = (tmp_path / "out" / "study" / "index.html").read_text()
    assert "A study" in page
    assert "20</b> samples" in page
    # Runs that only provide metrics write no CSV files.
    assert not list((tmp_path / "out").rglob("*.csv"))
    assert not (tmp_path / "out" / "study" / "series").exists()


def test_units_and_multiples_reach_the_variable(tmp_path: Path) -> None:
    build(tmp_path)
    study = 'method = "sweep"\ndesign = "list"\ncases = ["plain"]\n'
    study += vary("a", "f:a", 'values = [50.0, 100.0]\nunit = "cm"') + vary(
        "c", "f:c", "values = [1.0, 2.0]\nrelative = true"
    )
    assert run(tmp_path, write(tmp_path, study)) == 0
    assert [r["y"] for r in rows(tmp_path)] == [0.5 + 20.0 + 300.0, 1.0 + 20.0 + 600.0]


def test_fmus_are_factors(tmp_path: Path) -> None:
    build(tmp_path)
    build(tmp_path, "-a", name="Other")
    study = 'method = "sweep"\ncases = ["plain"]\n[[vary]]\nname = "law"\nfmu = "f"\nvalues = ["Function", "Other"]\n'
    study += vary("p", "f:a", "values = [1.0, 4.0]")
    assert run(tmp_path, write(tmp_path, study)) == 0
    assert [(r["law"], r["p"], r["y"]) for r in rows(tmp_path)] == [
        ("Function", 1.0, 321.0),
        ("Function", 4.0, 324.0),
        ("Other", 1.0, -1.0),
        ("Other", 4.0, -4.0),
    ]


def test_the_communication_step_is_a_factor(tmp_path: Path) -> None:
    """The output counts its evaluations: at the start, and in each step of a run of 0.2 s."""
    build(tmp_path, "i->v.real[1] + 1")
    study = 'method = "sweep"\ncases = ["plain"]\n' + vary("h", "simulation:step", "values = [0.1, 0.05, 0.02]")
    assert run(tmp_path, write(tmp_path, study)) == 0
    found = {r["h"]: float(str(r["y"])) for r in rows(tmp_path)}
    assert [found[h] - found[0.1] for h in (0.1, 0.05, 0.02)] == [0.0, 2.0, 8.0]


@pytest.mark.parametrize(("keep", "plain", "shifted"), [("true", -321.0, -331.0), ("false", -10.0, -30.0)])
def test_an_fmu_keeps_parameters_if_the_study_says_so(tmp_path: Path, keep: str, plain: float, shifted: float) -> None:
    """a, b, c are 1, 2, 3 in the scenario and 0, 1, 0 in the FMU; in the second case, b is always 3."""
    build(tmp_path)
    build(tmp_path, "-(a + 10 * b + 100 * c)", name="Other")
    law = 'method = "sweep"\n[[vary]]\nname = "law"\nfmu = "f"\nvalues = ["Function", "Other"]\n'
    assert run(tmp_path, write(tmp_path, f"{law}keep_parameters = {keep}\n")) == 0
    assert [(r["law"], r["case"], r["y"]) for r in rows(tmp_path)] == [
        ("Function", "plain", 321.0),
        ("Function", "shifted", 331.0),
        ("Other", "plain", plain),
        ("Other", "shifted", shifted),
    ]


def test_a_seed_reaches_the_variable(tmp_path: Path) -> None:
    # A double represents every seed below 2^31 exactly.
    build(tmp_path, "seed")
    assert run(tmp_path, write(tmp_path, SAMPLE + vary("s", "f:seed", 'distribution = "seed"'))) == 0
    found = rows(tmp_path)
    assert [r["y"] for r in found] == [r["s"] for r in found]
    # Each sample has a different seed, which is the same for both cases.
    assert [r["s"] for r in found[::2]] == [r["s"] for r in found[1::2]]
    assert len({r["s"] for r in found}) == 20
    assert pyarrow.parquet.read_schema(tmp_path / "out" / "study" / "runs.parquet").field("s").type == pyarrow.int64()


def test_correlated_factors_are_correlated_in_the_runs(tmp_path: Path) -> None:
    build(tmp_path)
    normal = 'distribution = "normal"\nmean = {}\ndeviation = {}'
    study = 'method = "sample"\nruns = 400\ncases = ["plain"]\n'
    study += vary("p", "f:a", normal.format(1.0, 0.5)) + vary("q", "f:c", normal.format(3.0, 0.1))
    study += vary("r", "f:b", normal.format(2.0, 0.1))
    study += '[[correlation]]\nbetween = ["p", "q"]\ncoefficient = 0.8\n'
    assert run(tmp_path, write(tmp_path, study), page=True) == 0
    p, q, r, y = (np.array([float(str(row[name])) for row in rows(tmp_path)]) for name in ("p", "q", "r", "y"))
    # Five standard errors of a coefficient of correlation, (1 - r^2)/sqrt(n).
    found = np.corrcoef((p, q, r))
    assert abs(found[0, 1] - 0.8) < 5.0 * (1.0 - 0.8**2) / np.sqrt(400)
    assert np.abs(found[:2, 2]).max() < 5.0 / np.sqrt(400)
    # The FMU got exactly these values; the sum is in the order of the C expression.
    assert np.array_equal(y, p + 10.0 * r + 100.0 * q)
    page = (tmp_path / "out" / "study" / "index.html").read_text()
    assert "p and q are correlated with a coefficient of 0.8." in page


def test_inputs_and_start_values_are_factors(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An input keeps the value of the sample in both steps; y begins with its start value."""
    parameter = 'causality="parameter" variability="fixed" initial="exact"'
    text = study_system.DESCRIPTION
    for name, instead in (
        ('name="a" valueReference="0"', 'causality="input" variability="continuous"'),
        ('name="c" valueReference="3"', 'causality="local" variability="continuous" initial="exact"'),
    ):
        assert f"{name} {parameter}" in text
        text = text.replace(f"{name} {parameter}", f"{name} {instead}")
    monkeypatch.setattr(study_system, "DESCRIPTION", text)
    # y is the sum over both steps, which reveals an input that is set in one step only.
    build(tmp_path, "(t < 0.05 ? 0.0 : i->v.real[1]) + a + 100 * c")
    scenario = SCENARIO.replace("parameters = { a = 1.0, b = 2.0, c = 3.0 }", "inputs = { a = 7.0 }")
    scenario += '[[metric]]\nname = "first"\ntitle = "First"\nsignal = "f:y"\nkind = "min"\n'
    study = 'method = "sweep"\ncases = ["plain"]\n'
    study += vary("u", "f:a", "values = [0.5, 2.0]") + vary("s", "f:c", "values = [1.0, 4.0]")
    assert run(tmp_path, write(tmp_path, study, scenario)) == 0
    assert [(r["u"], r["s"], r["y"], r["first"]) for r in rows(tmp_path)] == [
        (u, s, 2.0 * (u + 100.0 * s), s) for u in (0.5, 2.0) for s in (1.0, 4.0)
    ]


def test_the_command_line_sets_the_number_of_samples(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    build(tmp_path)
    study = write(tmp_path, SAMPLE + TWO)
    assert run(tmp_path, study, "--runs", "7", page=True) == 0
    seven = table(tmp_path)
    assert [r["sample"] for r in rows(tmp_path)] == [n for n in range(7) for _ in range(2)]
    assert len(rows(tmp_path, "design")) == 7
    assert "--runs 7" in (tmp_path / "out" / "study" / "index.html").read_text()
    # The same samples as if the study file had this number; a Latin hypercube of 7 is not a part of one of 20.
    assert run(tmp_path, write(tmp_path, SAMPLE.replace("runs = 20", "runs = 7") + TWO), "--overwrite") == 0
    assert table(tmp_path) == seven
    sweep = write(tmp_path, 'method = "sweep"\n' + vary("p", "f:a", "values = [1.0, 2.0]"))
    assert run(tmp_path, sweep, "--overwrite", "--runs", "7") == 2
    assert "remove --runs" in capsys.readouterr().err


def test_one_process_or_several_the_rows_are_the_same(tmp_path: Path) -> None:
    build(tmp_path)
    study = write(tmp_path, SAMPLE + TWO)
    for out, jobs in (("one", "1"), ("three", "3")):
        options = ["--fmus", str(tmp_path / "fmus"), "--out", str(tmp_path / out), "--jobs", jobs]
        assert study_system.carry_out([str(study), *options]) == 0
    assert table(tmp_path, "one") == table(tmp_path, "three")


def test_an_interrupted_study_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    build(tmp_path)
    study = write(tmp_path, SAMPLE + TWO)
    assert run(tmp_path, study) == 0
    whole = table(tmp_path)
    assert run(tmp_path, study) == 2
    assert "--resume continues it, --overwrite starts over" in capsys.readouterr().err

    execute = Local.execute

    def interrupted(self: Local, tasks: object, take: object) -> None:
        count = 0

        def few(done: Done) -> None:
            nonlocal count
            count += 1
            if count > 7:
                raise KeyboardInterrupt
            take(done)  # type: ignore[operator]

        execute(self, tasks, few)  # type: ignore[arg-type]

    with monkeypatch.context() as patch:
        patch.setattr(Local, "execute", interrupted)
        assert run(tmp_path, study, "--overwrite") == 130
    journal = tmp_path / "out" / "study" / "rows.jsonl"
    lines = journal.read_text().splitlines()
    assert len(lines) == 8
    capsys.readouterr()
    assert run(tmp_path, study, "--report-only") == 2
    assert "samples are missing: --resume runs them" in capsys.readouterr().err
    assert not (tmp_path / "out" / "study" / "runs.parquet").exists()
    # A killed process can leave a truncated line.
    journal.write_text("\n".join(lines) + "\n[12, 0, [3.")
    assert run(tmp_path, study, "--resume") == 0
    assert table(tmp_path) == whole
    assert len(journal.read_text().splitlines()) == 41

    study.write_text(study.read_text().replace("max = 1.0", "max = 2.0"))
    assert run(tmp_path, study, "--resume") == 2
    assert "belongs to another version of the study" in capsys.readouterr().err


def test_shards_make_the_same_table(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    build(tmp_path)
    study = write(tmp_path, SAMPLE + TWO)
    assert run(tmp_path, study) == 0
    whole = table(tmp_path)
    (tmp_path / "out" / "study" / "runs.parquet").unlink()
    merge = [str(study), "--merge", "--fmus", str(tmp_path / "fmus"), "--out", str(tmp_path / "out")]
    assert study_system.carry_out(merge) == 2
    assert run(tmp_path, study, "--shard", "1/3") == 0
    assert run(tmp_path, study, "--shard", "3/3") == 0
    capsys.readouterr()
    assert study_system.carry_out(merge) == 2
    assert "7 of 20 samples are missing (1, 4, 7, 10, 13, …)" in capsys.readouterr().err
    assert run(tmp_path, study, "--shard", "2/3") == 0
    assert study_system.carry_out(merge) == 0
    assert table(tmp_path) == whole


@pytest.mark.parametrize(
    ("statement", "status", "time", "message"),
    [
        ("if (a > 0.5) abort()", "crashed", 0.1, "the process ended (signal 6, SIGABRT) during fmi2DoStep"),
        ("if (a > 0.5) for (;;) sleep(1)", "timed_out", 0.1, "not done after 1 s (--timeout), stopped"),
        ("if (a > 0.5) return 3", "diverged", 0.1, "fmi2DoStep"),
        ("if (a > 0.5) { i->v.real[1] = 0.0 / 0.0; break; }", "diverged", 0.2, "`y` is NaN"),
    ],
)
def test_a_run_that_fails_is_a_row(tmp_path: Path, statement: str, status: str, time: float, message: str) -> None:
    build(tmp_path, before=f"if (t > 0.05) {{ {statement}; }}".replace("{ if", "{if"))
    study = 'method = "sweep"\ncases = ["plain"]\n' + vary("p", "f:a", "values = [0.0, 1.0, 0.25]")
    study += '[[requirement]]\nmetric = "y"\nmax = 1000.0\nshare = 0.6\n'
    # Two of three runs meet the requirement, which is enough.
    assert run(tmp_path, write(tmp_path, study), "--timeout", "1", page=True) == 0
    found = rows(tmp_path)
    assert [r["status"] for r in found] == ["ok", status, "ok"]
    assert [r["meets:y"] for r in found] == [True, False, True]
    assert found[1]["y"] is None
    assert found[1]["time"] == pytest.approx(time)
    assert message in str(found[1]["message"])
    assert "1 of 3 runs failed" in (tmp_path / "out" / "study" / "index.html").read_text()


@pytest.mark.parametrize(
    ("limits", "code"),
    [
        ("max = 325.0\nshare = 0.75", 0),
        ("max = 325.0\nshare = 0.76", 1),
        ("max = 325.0", 1),
        ("min = 321.0\nmax = 330.0", 0),
        ("min = 321.1\nmax = 330.0", 1),
    ],
)
def test_a_requirement_decides_about_the_exit_code(tmp_path: Path, limits: str, code: int) -> None:
    build(tmp_path)
    study = 'method = "sweep"\ncases = ["plain"]\n' + vary("p", "f:a", "values = [1.0, 2.0, 5.0, 6.0]")
    path = write(tmp_path, f'{study}[[requirement]]\nmetric = "y"\n{limits}\n')
    assert run(tmp_path, path) == code
    assert run(tmp_path, path, "--overwrite", "--no-fail") == 0


def test_requirements_of_the_scenario_count(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    build(tmp_path)
    scenario = SCENARIO.replace('kind = "final"', 'kind = "final"\nmax = 325.0\nshare = 0.5\nrequired_of = ["plain"]')
    study = 'method = "sweep"\n' + vary("p", "f:a", "values = [5.0, 6.0]")
    assert run(tmp_path, write(tmp_path, study, scenario), page=True) == 0
    # A sweep has no confidence interval.
    assert "Passed  Value, Plain: at most 325 in 50.0 % of the runs, required 50.0 %" in capsys.readouterr().out
    page = (tmp_path / "out" / "study" / "index.html").read_text()
    assert 'Runs that keep them</th><th class="number">Required</th>' in page
    assert [r["meets:y"] for r in rows(tmp_path)] == [True, None, False, None]


@pytest.mark.parametrize(
    ("study", "expected"),
    [
        (SAMPLE + vary("p", "g:a", UNIFORM), "unknown component `g`"),
        (SAMPLE + vary("p", "f:aa", UNIFORM), "Function has no parameter `aa`"),
        (SAMPLE + vary("p", "fa", UNIFORM), 'expected "component:variable"'),
        (SAMPLE + vary("p", "f:y", UNIFORM), "`y` of Function is not a parameter but an output"),
        (SAMPLE + vary("p", "f:a", UNIFORM + '\nunit = "kg"'), "cannot be given in kg, expected one of m, cm"),
        (SAMPLE + vary("p", "f:a", UNIFORM.replace("1.0", "11.0")), "`f:a` would be 11 m, expected at most 10"),
        (SAMPLE + vary("p", "f:seed", UNIFORM), "`f:seed` is Integer and cannot have a distribution"),
        (SAMPLE + vary("p", "f:a", 'distribution = "seed"'), "`f:a` is Real; a seed must be an Integer"),
        (SAMPLE + vary("y", "f:a", UNIFORM), "the scenario has a metric of that name"),
        (SAMPLE + 'cases = ["plan"]\n' + TWO, "unknown case `plan`, expected one of plain, shifted"),
        (SAMPLE + 'metrics = ["z"]\n' + TWO, "unknown metric `z`"),
        (SAMPLE + 'cases = ["shiftd"]\n' + TWO, "expected one of plain, shifted"),
        (SAMPLE + TWO + '[[requirement]]\nmetric = "z"\nmax = 1.0\n', "unknown metric `z`, expected one of y, twice"),
        ('method = "sweep"\n[[vary]]\nname = "law"\nfmu = "f"\nvalues = ["None"]\n', "there is no None.fmu"),
        ('method = "sweep"\n' + vary("h", "simulation:step", "values = [0.1, 0.03]"), "must be a whole number"),
        ('method = "sweep"\n' + vary("h", "simulation:step", "values = [0.1, 0.0]"), "must be a number above 0 s"),
        (SAMPLE + vary("h", "simulation:step", UNIFORM), "the communication step needs `values` in s"),
        ('method = "sweep"\n[[vary]]\nname = "law"\nfmu = "g"\nvalues = ["Function"]\n', "no component `g`"),
    ],
)
def test_a_study_that_does_not_fit_its_scenario_is_explained(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], study: str, expected: str
) -> None:
    build(tmp_path)
    assert run(tmp_path, write(tmp_path, study)) == 2
    assert expected in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_series_are_those_of_the_worst_and_of_some_others(tmp_path: Path) -> None:
    build(tmp_path)
    study = SAMPLE + 'cases = ["plain"]\n' + TWO + '[series]\nmetric = "y"\nworst = 2\nrandom = 1\n'
    assert run(tmp_path, write(tmp_path, study)) == 0
    order = sorted(rows(tmp_path), key=lambda r: -float(str(r["y"])))
    files = sorted((tmp_path / "out" / "study" / "series").glob("*.parquet"))
    assert len(files) == 3
    for row in order[:2]:
        series = pyarrow.parquet.read_table(tmp_path / "out" / "study" / "series" / f"{row['sample']}_plain.parquet")
        assert series["time"].to_pylist() == [0.0, 0.1, 0.2]
        assert series["y"].to_pylist()[-1] == row["y"]


def ishigami(runs: int, analysis: str) -> str:
    angle = f'distribution = "uniform"\nmin = {-np.pi}\nmax = {np.pi}'
    study = f'method = "sensitivity"\nanalysis = "{analysis}"\nruns = {runs}\ncases = ["plain"]\nmetrics = ["y"]\n'
    return study + "".join(vary(f"x{i}", f"f:{name}", angle) for i, name in enumerate("abc", 1))


def ishigami_errors(samples: int) -> dict[str, tuple[float, float]]:
    """Return the standard errors of first-order and total indices of the Ishigami function, by number of base samples.

    Estimators of Saltelli et al. (2010): first-order mean(B (A_i - A)) / V, total mean((A - A_i)^2) / 2 V. The delta
    method gives the error: the deviation of a sample's term, minus the index times the sample's contribution to the
    variance V, divided by the root of the number of samples. 2^18 random samples give the deviations within 1 %.
    """
    random = np.random.default_rng(1)
    one, other = (random.uniform(-np.pi, np.pi, (3, 2**18)) for _ in range(2))

    def function(x: NDArray[np.float64]) -> NDArray[np.float64]:
        # Its mean is 7/2.
        found: NDArray[np.float64] = np.sin(x[0]) + 7 * np.sin(x[1]) ** 2 + 0.1 * x[2] ** 4 * np.sin(x[0]) - 3.5
        return found

    a, b = function(one), function(other)
    spread = 0.5 * (a**2 + b**2)
    whole = float(spread.mean())
    errors = {}
    for i in range(3):
        mixed = one.copy()
        mixed[i] = other[i]
        exchanged = function(mixed)
        terms = (b * (exchanged - a), 0.5 * (a - exchanged) ** 2)
        first, total = (float(np.std(t - t.mean() / whole * spread)) / whole / np.sqrt(samples) for t in terms)
        errors[f"x{i + 1}"] = (first, total)
    return errors


def test_sobol_indices_of_the_ishigami_function(tmp_path: Path) -> None:
    """Reference: the indices in closed form for a = 7, b = 0.1 (T. Ishigami, T. Homma, 1990), within the intervals."""
    build(tmp_path, "sin(a) + 7 * sin(b) * sin(b) + 0.1 * pow(c, 4) * sin(a)")
    assert run(tmp_path, write(tmp_path, ishigami(1024, "sobol"))) == 0
    a, b = 7.0, 0.1
    whole = a**2 / 8 + b * np.pi**4 / 5 + b**2 * np.pi**8 / 18 + 0.5
    first = [0.5 * (1 + b * np.pi**4 / 5) ** 2 / whole, a**2 / 8 / whole, 0.0]
    joint = b**2 * np.pi**8 * (1 / 18 - 1 / 50) / whole
    total = [first[0] + joint, first[1], joint]

    from chassis_fmu.study import design, file, statistics

    study = file.read(tmp_path / "study.toml", [tmp_path / "fmus"])
    y = np.array([float(str(r["y"])) for r in rows(tmp_path)])
    assert len(y) == 1024 * 5
    found = {e.factor: e for e in statistics.sensitivities(study, design.shares(study), y).effects}
    errors = ishigami_errors(1024)
    for i, name in enumerate(("x1", "x2", "x3")):
        effect = found[name]
        assert effect.interval is not None
        assert effect.total_interval is not None
        assert effect.interval[0] <= first[i] <= effect.interval[1], name
        assert effect.total_interval[0] <= total[i] <= effect.total_interval[1], name
        # The intervals must be 1.96 standard errors wide to each side. Tolerance: four deviations of a bootstrap with
        # 100 resamples, each 1/sqrt(2 * 99) = 7 %, and 10 % for the 1,024 samples.
        for (low, high), error in zip((effect.interval, effect.total_interval), errors[name], strict=True):
            assert 0.5 * (high - low) == pytest.approx(1.96 * error, rel=0.38), name


def test_morris_finds_the_effects_of_a_linear_function(tmp_path: Path) -> None:
    # y = a + 10 b + 100 c over ranges of 2 pi: every elementary effect is the slope times the range, up to rounding and
    # the clipped ends of the shares (1e-6).
    build(tmp_path)
    assert run(tmp_path, write(tmp_path, ishigami(8, "morris"))) == 0

    from chassis_fmu.study import design, file, statistics

    study = file.read(tmp_path / "study.toml", [tmp_path / "fmus"])
    y = np.array([float(str(r["y"])) for r in rows(tmp_path)])
    effects = statistics.sensitivities(study, design.shares(study), y).effects
    assert {e.factor: e.value for e in effects} == pytest.approx(
        {"x1": 2 * np.pi, "x2": 20 * np.pi, "x3": 200 * np.pi}, rel=1e-5
    )


# The TPE sampler draws its first ten samples at random; with batches of eight, the first two batches are random.
STARTUP = 16


def chance(hits: int, of: int, share: float) -> float:
    """Return the probability (binomial) that `hits` or more of `of` random samples are in a `share` of the range."""
    return float(scipy.stats.binom.sf(hits - 1, of, share))


# Limit for `chance`: one in 100,000 studies.
BY_CHANCE = 1e-5


@pytest.mark.parametrize(
    ("method", "direction", "settings"),
    [
        ("worst_case", "maximize", ""),
        ("optimize", "minimize", ""),
        ("optimize", "minimize", 'sampler = "CmaEsSampler"'),
    ],
)
def test_a_search_finds_the_extreme(tmp_path: Path, method: str, direction: str, settings: str) -> None:
    # -(a - 0.3)^2 has its maximum at 0.3, (a - 0.3)^2 its minimum.
    sign = "-" if direction == "maximize" else ""
    build(tmp_path, f"{sign}(a - 0.3) * (a - 0.3)")
    study = f'method = "{method}"\nruns = 60\ncases = ["plain"]\n' + vary("p", "f:a", UNIFORM)
    study += f'[search]\nmetric = "y"\ndirection = "{direction}"\n{settings}\n'
    path = write(tmp_path, study)
    assert run(tmp_path, path, "--jobs", "1") == 0
    found = rows(tmp_path)
    assert len(found) == 60
    best = (max if direction == "maximize" else min)(found, key=lambda r: float(str(r["y"])))
    distances = [abs(float(str(r["p"])) - 0.3) for r in found]
    # The search reports the sample closest to the extreme.
    assert abs(float(str(best["p"])) - 0.3) == min(distances)
    # In 11 % of studies, the best of 60 random samples is also within 0.001 of the extreme, so that alone is weak
    # evidence that the search learns. A search that learns puts most samples near the extreme; a fifth of the range is
    # within 0.1 of it.
    assert min(distances) < 0.001
    assert chance(sum(d < 0.1 for d in distances[STARTUP:]), 60 - STARTUP, 0.2) < BY_CHANCE
    first = table(tmp_path)
    assert run(tmp_path, path, "--overwrite", "--jobs", "3") == 0
    assert table(tmp_path) == first
    journal = tmp_path / "out" / "study" / "rows.jsonl"
    journal.write_text("".join(journal.read_text().splitlines(keepends=True)[:30]))
    assert run(tmp_path, path, "--resume") == 0
    assert table(tmp_path) == first


def test_a_random_search_does_not_look_like_one_that_learns(tmp_path: Path) -> None:
    """The criterion of the test above rejects a search that ignores its results."""
    build(tmp_path, "(a - 0.3) * (a - 0.3)")
    study = f'method = "optimize"\nruns = 60\ncases = ["plain"]\n{vary("p", "f:a", UNIFORM)}'
    study += '[search]\nmetric = "y"\ndirection = "minimize"\nsampler = "RandomSampler"\n'
    assert run(tmp_path, write(tmp_path, study)) == 0
    near = sum(abs(float(str(r["p"])) - 0.3) < 0.1 for r in rows(tmp_path)[STARTUP:])
    assert chance(near, 60 - STARTUP, 0.2) > 0.01


SEARCH = '[search]\nmetric = "y"\ndirection = "minimize"\nbatch = 4\n'
LEVELS = vary("level", "f:b", "values = [1.0, 2.0, 3.0]")


@pytest.mark.parametrize("sampler", sorted(set(search.SAMPLERS) - {"GPSampler"}))
def test_every_sampler_searches_the_same_for_any_number_of_processes(tmp_path: Path, sampler: str) -> None:
    # About every fifth run fails, which samplers must accept.
    build(tmp_path, "(a - 0.3) * (a - 0.3) + b", before="if (a > 0.8) return 3")
    study = f'method = "optimize"\nruns = 24\ncases = ["plain"]\n{vary("p", "f:a", UNIFORM)}{LEVELS}'
    path = write(tmp_path, f'{study}{SEARCH}sampler = "{sampler}"\n')
    tables = []
    for jobs in ("1", "3"):
        assert run(tmp_path, path, "--jobs", jobs, "--overwrite") == 0
        tables.append(table(tmp_path))
    assert tables[0] == tables[1]
    found = rows(tmp_path)
    assert len(found) == 24
    assert len({r["p"] for r in found}) > 20


@pytest.mark.parametrize(
    ("settings", "expected"),
    [
        ('sampler = "Magic"', "unknown sampler `Magic`, expected one of TPESampler, CmaEsSampler"),
        ('sampler = "BaseSampler"', "unknown sampler `BaseSampler`"),
        ('sampler = "PartialFixedSampler"', "unknown sampler `PartialFixedSampler`"),
        ('sampler = "BruteForceSampler"', 'tries all combinations of values; method = "sweep" does that'),
        ('sampler = "GridSampler"', 'tries all combinations of values; method = "sweep" does that'),
        ("options = { wrong = 1 }", "TPESampler cannot be made with the options {'wrong': 1}: TypeError"),
        ("options = { n_ei_candidates = -1, n_startup_trials = 4 }", "TPESampler cannot propose samples: "),
    ],
)
def test_a_sampler_that_cannot_work_is_explained(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], settings: str, expected: str
) -> None:
    build(tmp_path)
    study = f'method = "optimize"\nruns = 12\ncases = ["plain"]\n{vary("p", "f:a", UNIFORM)}{SEARCH}{settings}\n'
    assert run(tmp_path, write(tmp_path, study)) == 2
    assert expected in capsys.readouterr().err


@pytest.mark.parametrize(
    ("package", "study", "options", "expected"),
    [
        (
            "torch",
            'method = "optimize"\n{}[search]\nmetric = "y"\ndirection = "minimize"\nsampler = "GPSampler"\n',
            (),
            "GPSampler needs the Python package torch",
        ),
        (
            "cmaes",
            'method = "optimize"\n{}[search]\nmetric = "y"\ndirection = "minimize"\nsampler = "CmaEsSampler"\n',
            (),
            "CmaEsSampler needs the Python package cmaes",
        ),
        (
            "optuna",
            'method = "worst_case"\n{}[search]\nmetric = "y"\ndirection = "minimize"\n',
            (),
            "method worst_case with [search] needs the Python package optuna",
        ),
        (
            "SALib",
            'method = "sensitivity"\nanalysis = "morris"\nruns = 4\n{}',
            (),
            "method sensitivity needs the Python package SALib",
        ),
        (
            "distributed",
            'method = "sample"\n{}',
            ("--dask",),
            "--dask needs the Python package distributed",
        ),
    ],
)
def test_a_package_that_is_missing_is_explained(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    package: str,
    study: str,
    options: tuple[str, ...],
    expected: str,
) -> None:
    build(tmp_path)
    find = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name, *more: None if name == package else find(name, *more))
    path = write(tmp_path, study.format(vary("p", "f:a", UNIFORM)))
    install = f"-m pip install {package}"
    # In the repository, whose lockfile contains all packages except torch, and for users of the wheel.
    for root, remedy in [(ROOT, install if package == "torch" else "scripts/setup --all"), (tmp_path, install)]:
        monkeypatch.setattr("chassis_fmu.study.file.ROOT", root)
        assert run(tmp_path, path, "--overwrite", *options) == 2
        error = capsys.readouterr().err
        assert expected in error
        assert remedy in error


@pytest.mark.parametrize(("direction", "sign"), [("maximize", 1.0), ("minimize", -1.0)])
def test_a_run_that_fails_is_the_worst_case(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], direction: str, sign: float
) -> None:
    # The metric leads away from the range where runs fail.
    build(tmp_path, f"{-sign} * a", before="if (a > 0.7) return 3")
    study = f'method = "worst_case"\nruns = 40\ncases = ["plain"]\n{vary("p", "f:a", UNIFORM)}'
    assert run(tmp_path, write(tmp_path, f'{study}[search]\nmetric = "y"\ndirection = "{direction}"\n'), page=True) == 0
    failed = [r for r in rows(tmp_path) if r["status"] == "diverged"]
    # Runs fail in 30 % of the range; a search that looks for failures has a larger share of failed samples.
    assert chance(sum(int(str(r["sample"])) >= STARTUP for r in failed), 40 - STARTUP, 0.3) < BY_CHANCE
    assert all(float(str(r["p"])) > 0.7 for r in failed)
    assert (
        f"Found in sample {failed[0]['sample']}: a run that fails (Plain: diverged at 0 s: " in capsys.readouterr().out
    )
    page = (tmp_path / "out" / "study" / "index.html").read_text()
    assert "A run that fails</b>, which is worse than any value of y" in page
    assert f"{len(failed)} samples have runs that fail" in page


def test_an_optimum_is_a_run_that_does_not_fail(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    build(tmp_path, "-a", before="if (a > 0.7) return 3")
    study = f'method = "optimize"\nruns = 20\ncases = ["plain"]\n{vary("p", "f:a", UNIFORM)}{SEARCH}'
    assert run(tmp_path, write(tmp_path, study)) == 0
    best = max(float(str(r["p"])) for r in rows(tmp_path) if r["status"] == "ok")
    assert best <= 0.7
    assert f"Value {-best:g} at p {best:g} m\n" in capsys.readouterr().out


def test_the_design_that_was_written_is_what_is_run(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    build(tmp_path)
    study = write(tmp_path, SAMPLE + vary("p", "f:a", UNIFORM))
    assert run(tmp_path, study, "--shard", "1/2") == 0
    path = tmp_path / "out" / "study" / "design.parquet"
    sampled = pyarrow.parquet.read_table(path)
    # Another shard does not sample again: it uses the file, and reports existing rows from another design.
    moved = [v / 2.0 for v in sampled["p"].to_pylist()]
    changed = sampled.set_column(1, sampled.schema.field(1), pyarrow.array(moved))
    pyarrow.parquet.write_table(changed, path)
    assert run(tmp_path, study, "--shard", "2/2") == 2
    assert "has rows for another design.parquet" in capsys.readouterr().err
    assert run(tmp_path, study, "--shard", "1/2", "--resume") == 2
    (tmp_path / "out" / "study" / "rows-1-of-2.jsonl").unlink()
    assert run(tmp_path, study, "--shard", "1/2") == 0
    assert run(tmp_path, study, "--shard", "2/2") == 0
    merge = [str(study), "--merge", "--fmus", str(tmp_path / "fmus"), "--out", str(tmp_path / "out")]
    assert study_system.carry_out(merge) == 0
    assert [r["p"] for r in rows(tmp_path)[::2]] == moved
    assert [r["y"] for r in rows(tmp_path)[::2]] == [v + 320.0 for v in moved]
    pyarrow.parquet.write_table(sampled, path)
    assert study_system.carry_out(merge) == 2
    assert "has rows for another design.parquet" in capsys.readouterr().err


def test_resuming_reads_the_design(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    build(tmp_path)
    study = write(tmp_path, SAMPLE + vary("p", "f:a", UNIFORM))
    assert run(tmp_path, study) == 0
    path = tmp_path / "out" / "study" / "design.parquet"
    whole = path.read_bytes()
    # A missing design is sampled again, a changed one is reported, and a file that is not Parquet is replaced.
    path.unlink()
    assert run(tmp_path, study, "--resume") == 0
    assert path.read_bytes() == whole
    pyarrow.parquet.write_table(pyarrow.parquet.read_table(path).slice(0, 19), path)
    assert run(tmp_path, study, "--resume") == 2
    assert "rows.jsonl belongs to another design.parquet" in capsys.readouterr().err
    path.write_bytes(b"damaged")
    assert run(tmp_path, study, "--report-only") == 0
    assert path.read_bytes() == whole


def test_a_failure_names_component_and_variable(tmp_path: Path) -> None:
    build(
        tmp_path,
        before="if (a > 2.5) abort(); if (a > 1.5) return 3; if (a > 0.5) { i->v.real[1] = 0.0 / 0.0; break; }",
    )
    study = 'method = "sweep"\ncases = ["plain"]\n' + vary("p", "f:a", "values = [0.0, 1.0, 2.0, 3.0]")
    assert run(tmp_path, write(tmp_path, study)) == 0
    assert [(r["status"], r["time"], r["component"], r["variable"]) for r in rows(tmp_path)] == [
        ("ok", None, None, None),
        ("diverged", 0.1, "f", "y"),
        ("diverged", 0.0, "f", None),
        ("crashed", 0.0, "f", None),
    ]


def test_the_seed_of_the_scenario_is_a_column(tmp_path: Path) -> None:
    build(tmp_path)
    scenario = SCENARIO + '[seeds]\nparameter = "f:seed"\nvalues = [7, 8]\n'
    assert run(tmp_path, write(tmp_path, SAMPLE + vary("p", "f:a", UNIFORM), scenario)) == 0
    assert {r["seed"] for r in rows(tmp_path)} == {7}


def test_a_mistake_of_the_program_is_no_requirement_that_is_missed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    build(tmp_path)

    def broken(*_: object) -> None:
        raise ZeroDivisionError("broken")

    monkeypatch.setattr(report, "write", broken)
    assert run(tmp_path, write(tmp_path, SAMPLE + TWO), page=True) == 2
    assert "ZeroDivisionError: broken" in capsys.readouterr().err


def test_the_page_shows_the_worst_runs_without_being_asked(tmp_path: Path) -> None:
    build(tmp_path)
    path = write(tmp_path, SAMPLE + 'cases = ["plain"]\n' + TWO)
    assert run(tmp_path, path, page=True) == 0
    page = (tmp_path / "out" / "study" / "index.html").read_text()
    worst = sorted(rows(tmp_path), key=lambda r: -float(str(r["y"])))[:3]
    assert "Time histories" in page
    for row in worst:
        assert f"Plain, sample {row['sample']}" in page
    path.write_text(path.read_text() + "[series]\nworst = 0\n")
    assert run(tmp_path, path, "--resume", page=True) == 0
    assert "Time histories" not in (tmp_path / "out" / "study" / "index.html").read_text()


def test_a_journal_reads_back_the_same_numbers(tmp_path: Path) -> None:
    build(tmp_path, "1.0 / 3.0 * a")
    assert run(tmp_path, write(tmp_path, SAMPLE + vary("p", "f:a", UNIFORM))) == 0
    first = table(tmp_path)
    lines = (tmp_path / "out" / "study" / "rows.jsonl").read_text().splitlines()
    assert len(json.loads(lines[0])["study"]) == 64
    assert run(tmp_path, tmp_path / "study.toml", "--report-only") == 0
    assert table(tmp_path) == first


def test_a_wrong_scenario_names_the_study_and_its_key(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    build(tmp_path)
    study = write(tmp_path, SAMPLE + TWO)
    (tmp_path / "wrong.toml").write_text("titles = 3\n")
    for name, expected, place in (
        ("none.toml", "there is no file", "study.toml:2:12"),
        ("wrong.toml", "unknown key `titles`", "wrong.toml:1:1"),
    ):
        study.write_text(re.sub('scenario = ".*"', f'scenario = "{name}"', study.read_text()))
        assert run(tmp_path, study) == 2
        found = capsys.readouterr().err
        assert place in found
        assert expected in found


def test_a_study_without_its_page_has_the_same_tables(tmp_path: Path) -> None:
    build(tmp_path)
    path = write(tmp_path, SAMPLE + TWO)
    page = tmp_path / "out" / "study" / "index.html"
    assert run(tmp_path, path, page=True) == 0
    expected = table(tmp_path)
    assert page.exists()
    assert run(tmp_path, path, "--resume") == 0
    assert not page.exists(), "the page of the call before is left"
    assert table(tmp_path) == expected
    assert run(tmp_path, path, "--overwrite") == 0
    assert not page.exists()
    assert table(tmp_path) == expected


def test_the_interval_of_a_share_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    build(tmp_path)
    path = write(tmp_path, SAMPLE + TWO + '[[requirement]]\nmetric = "y"\nmin = -1e9\n')
    assert run(tmp_path, path, page=True) == 0
    assert "in 100.0 % of the runs (95 % interval 83.9 % to 100.0 %), required 100.0 %" in capsys.readouterr().out
    page = (tmp_path / "out" / "study" / "index.html").read_text()
    assert 'Runs that keep them</th><th class="number">95 % interval</th>' in page


def test_the_page_says_what_the_colors_of_effects_mean(tmp_path: Path) -> None:
    """The output rises with `a` and falls with `c`; the factors are in the unit of their variables."""
    build(tmp_path, "a - c")
    study = 'method = "sample"\nruns = 20\ncases = ["plain"]\n'
    factors = vary("rising", "f:a", UNIFORM) + vary("falling", "f:c", UNIFORM) + vary("share", "f:b", UNIFORM)
    assert run(tmp_path, write(tmp_path, study + factors), page=True) == 0
    page = (tmp_path / "out" / "study" / "index.html").read_text()
    meaning = '<i class="first swatch"></i> The metric rises with the factor, <i class="total swatch"></i> it falls.'
    # The page explains the colors for the outer fifths and for the rank correlations, for each of the two metrics.
    assert page.count(meaning) == 4
    (rank,) = re.findall(r"<h3>Rank correlation.*?</table>", page.partition("<h2>Twice")[0], re.DOTALL)
    rows = dict(re.findall(r'<tr><th>(\w+)</th>.*?<i class="(first|total)"', rank))
    assert (rows["rising"], rows["falling"]) == ("first", "total")
    assert "uniform, min 0, max 1 m</td>" in page
    assert "<tr><th>rising (m)</th>" in page
    data = json.loads(re.findall(r'id="page-data">(.*?)</script>', page, re.DOTALL)[0])
    axes = [panel["x"] for figure in data["figures"] for panel in figure["panels"]]
    units = {axis["title"]: axis["units"][0]["name"] for axis in axes}
    assert (units["rising"], units["share"]) == ("m", "")


def job(folder: Path, study: str, scenario: str) -> Job:
    path = write(folder, study, scenario)
    return Job(load_study(path, [folder / "fmus"]), path, [folder / "fmus"])


def naming(path: str, place: str) -> tuple[str, str]:
    """Return a scenario and a study in which a parameter or a level of a factor is the path of a file."""
    if place == "parameter":
        return SCENARIO.replace("c = 3.0 }", f'c = 3.0, file = "{path}" }}'), SAMPLE + TWO
    return SCENARIO, SAMPLE + TWO + vary("road", "f:file", f'values = ["{path}", "other"]')


@pytest.mark.parametrize("place", ["parameter", "level"])
def test_files_that_fmus_read_are_part_of_the_study(tmp_path: Path, place: str) -> None:
    build(tmp_path)
    data = tmp_path / "data" / "road.csv"
    data.parent.mkdir()
    data.write_text("first")
    scenario, study = naming("data/road.csv", place)
    first = job(tmp_path, study, scenario)
    assert first.data_files() == [data]
    # A path that is a parameter is absolute, so the study can be executed in any folder.
    settings = [s for unit in first.plan.runs[0].components for s in unit.parameters if s.type == "String"]
    assert [s.value for s in settings] == ([str(data)] if place == "parameter" else [])
    before = first.fingerprint()
    assert job(tmp_path, study, scenario).fingerprint() == before
    with zipfile.ZipFile(io.BytesIO(bundle.archive(first))) as file:
        assert file.read("scenario/l0/l1/l2/l3/data/road.csv") == b"first"
    data.write_text("other")
    assert job(tmp_path, study, scenario).fingerprint() != before


@pytest.mark.parametrize("place", ["parameter", "level"])
def test_a_file_in_a_folder_above_the_scenario_is_found_on_other_machines(tmp_path: Path, place: str) -> None:
    folder = tmp_path / "scenarios"
    folder.mkdir()
    build(folder)
    data = tmp_path / "data" / "road.csv"
    data.parent.mkdir()
    data.write_text("first")
    scenario, study = naming("../data/road.csv", place)
    first = job(folder, study, scenario)
    before = first.fingerprint()
    unpacked = tmp_path / "worker"
    with zipfile.ZipFile(io.BytesIO(bundle.archive(first))) as file:
        file.extractall(unpacked)
    deep = unpacked.joinpath("scenario", "l0", "l1", "l2", "l3")
    assert (deep / "../data/road.csv").read_text() == "first"
    opened = Scenario(deep / first.scenarios[0].file.name, **first.sources[0].keywords)
    settings = [s for unit in opened.plan.runs[0].components for s in unit.parameters if s.type == "String"]
    assert [Path(str(s.value)).read_text() for s in settings] == ["first"] * (place == "parameter")
    data.write_text("other")
    assert job(folder, study, scenario).fingerprint() != before


@pytest.mark.parametrize("place", ["parameter", "level"])
def test_a_folder_that_a_string_names_is_a_warning(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], place: str
) -> None:
    build(tmp_path)
    (tmp_path / "tables").mkdir()
    scenario, study = SCENARIO, SAMPLE + TWO
    if place == "parameter":
        scenario = SCENARIO.replace("c = 3.0 }", 'c = 3.0, file = "tables" }')
    else:
        # A separator, or a String that is too long for a path, is not a folder.
        study += vary("road", "f:file", f'values = ["tables", ".", "{"long" * 100}"]')
    what = "`file` of `f`" if place == "parameter" else "a value of `road`"
    expected = (
        f"{what} names the folder tables: `--resume` does not detect changes in its files, and they are not sent "
        "to other machines; use Strings that name files"
    )
    assert job(tmp_path, study, scenario).warnings() == [expected]
    assert run(tmp_path, write(tmp_path, study, scenario)) == 0
    assert capsys.readouterr().err.count(f"warning: {expected}\n") == 1


def test_a_file_with_an_absolute_path_does_not_travel(tmp_path: Path) -> None:
    build(tmp_path)
    data = tmp_path / "road.csv"
    data.write_text("first")
    scenario = SCENARIO.replace("c = 3.0 }", f'c = 3.0, file = "{data}" }}')
    with pytest.raises(StudyError, match="an absolute path does not exist on other machines"):
        bundle.archive(job(tmp_path, SAMPLE + TWO, scenario))

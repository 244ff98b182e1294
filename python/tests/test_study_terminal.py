"""Terminal output of a study: numbers by FMU, undefined metrics, indices, results of a search, advice."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests import study_system
from tests.study_system import SCENARIO, build, vary, write

UNIFORM = 'distribution = "uniform"\nmin = 0.0\nmax = 1.0'


def shown(folder: Path, study: str, capsys: pytest.CaptureFixture[str], *options: str, code: int = 0) -> str:
    path = write(folder, study, SCENARIO) if study else folder / "study.toml"
    given = [str(path), "--fmus", str(folder / "fmus"), "--out", str(folder / "out"), "--overwrite", *options]
    assert study_system.carry_out(given) == code
    said = capsys.readouterr()
    return said.out + said.err


def row(text: str, *first: str) -> list[str]:
    """Return the cells of the row that begins with the texts `first`."""
    for line in text.splitlines():
        if all(cell in line for cell in first):
            return line.split()
    raise AssertionError(f"{first} in\n{text}")


def test_every_choice_of_fmus_has_a_row(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    build(tmp_path, "5.0")
    build(tmp_path, "7.0", name="Other")
    choice = '[[vary]]\nname = "law"\nfmu = "f"\nvalues = ["Function", "Other"]\n'
    text = shown(
        tmp_path, 'method = "sample"\nruns = 3\ncases = ["plain"]\n' + choice + vary("p", "f:a", UNIFORM), capsys
    )
    # Each FMU has three runs, with the constant of the FMU.
    assert row(text, "Value ", "Plain, Function")[-7:] == ["3", *["5.000"] * 6]
    assert row(text, "Value ", "Plain, Other")[-7:] == ["3", *["7.000"] * 6]


def test_metrics_without_a_number_are_counted(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    build(tmp_path, "a > 0.5 ? 1.0 : 0.0")
    undefined = '[[metric]]\nname = "inverse"\ntitle = "Inverse"\nvalue = "1 / y"\n'
    study = write(tmp_path, 'method = "sweep"\n' + vary("p", "f:a", "values = [0.1, 0.2, 0.9]"), SCENARIO + undefined)
    assert study_system.carry_out([str(study), "--fmus", str(tmp_path / "fmus"), "--out", str(tmp_path / "out")]) == 0
    # Two of the three values make the metric undefined, in both cases.
    assert "Inverse: undefined in 4 of 6 runs, which fail all its requirements\n" in capsys.readouterr().out


def test_sensitivities_have_a_table(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    build(tmp_path, "3 * a + b")
    factors = vary("p", "f:a", UNIFORM) + vary("q", "f:b", UNIFORM)
    method = 'method = "sensitivity"\nanalysis = "sobol"\nruns = 256\ncases = ["plain"]\nmetrics = ["y"]\n'
    text = shown(tmp_path, method + factors, capsys)
    # The variances are 9/12 and 1/12. The estimate of 256 base samples is within 0.1 of the shares 0.9 and 0.1.
    for name, share in (("p", 0.9), ("q", 0.1)):
        assert float(row(text, f"{name} ", " to ")[1]) == pytest.approx(share, abs=0.1)
    morris = 'method = "sensitivity"\nanalysis = "morris"\nruns = 8\ncases = ["plain"]\nmetrics = ["y"]\n'
    text = shown(tmp_path, morris + factors, capsys)
    # Elementary effects of a linear function are its slopes, without deviation.
    assert row(text, "p ", " to ")[1] == "3"
    assert row(text, "q ", " to ")[1] == "1"


def test_a_search_names_metric_and_units(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    build(tmp_path, "(a - 2) * (a - 2)")
    search = '[search]\nmetric = "y"\ndirection = "minimize"\nsampler = "RandomSampler"\n'
    factor = vary("p", "f:a", 'distribution = "uniform"\nmin = 0.0\nmax = 400.0\nunit = "cm"')
    text = shown(tmp_path, 'method = "optimize"\nruns = 4\n' + factor + search, capsys)
    found = next(line for line in text.splitlines() if line.startswith("Found in sample"))
    assert ": Value " in found
    assert found.endswith(" cm")
    wrong = (tmp_path / "study.toml").read_text().replace("RandomSampler", "RandomSamler")
    (tmp_path / "study.toml").write_text(wrong)
    assert "; did you mean `RandomSampler`?" in shown(tmp_path, "", capsys, code=2)


def test_advice_repeats_the_options(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    build(tmp_path)
    text = shown(tmp_path, 'method = "sample"\n' + vary("p", "f:a", UNIFORM), capsys, "--runs", "4", "--shard", "1/2")
    advice = next(line for line in text.splitlines() if "makes the tables" in line)
    given = f"{tmp_path / 'study.toml'} --runs 4 --out {tmp_path / 'out'} --fmus {tmp_path / 'fmus'}"
    assert f"`chassis study {given} --merge`" in advice


def test_sobol_indices_need_a_power_of_two(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    build(tmp_path)
    study = 'method = "sensitivity"\nanalysis = "sobol"\n' + vary("p", "f:a", UNIFORM)
    wanted = "{}, expected a power of two for Sobol indices, such as 64 or 128"
    assert wanted.format("runs is missing") in shown(tmp_path, study, capsys, code=2)
    assert wanted.format("runs is 100") in shown(tmp_path, study, capsys, "--runs", "100", code=2)


def test_the_worst_runs_are_those_of_the_requirement(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    build(tmp_path)
    # `square` has its minimum where y, the first metric, is in the middle of its range.
    middle = '[[metric]]\nname = "square"\ntitle = "Square"\nvalue = "(y - 323) * (y - 323)"\n'
    values = vary("p", "f:a", "values = [1.0, 2.0, 3.0, 4.0, 5.0]")
    required = '[[requirement]]\nmetric = "square"\nmin = 1.0\n[series]\nworst = 1\n'
    study = write(tmp_path, f'method = "sweep"\ncases = ["plain"]\n{values}{required}', SCENARIO + middle)
    given = ["--fmus", str(tmp_path / "fmus"), "--out", str(tmp_path / "out"), "--no-fail"]
    assert study_system.carry_out([str(study), *given]) == 0
    # For a requirement with `min`, the smallest value is the worst: a = 3, the sample in the middle.
    assert [path.name for path in (tmp_path / "out" / "study" / "series").iterdir()] == ["2_plain.parquet"]
    assert capsys.readouterr().err == ""

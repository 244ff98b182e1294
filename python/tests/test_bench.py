"""The commands and output of `scripts/bench exporters`, `masters` and `workers`; no times are tested."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

import bench_exporters
import bench_masters
import bench_workers
import measuring
from chassis_fmu.program import ROOT


def test_commands_differ_in_the_master_only() -> None:
    timed = bench_masters.commands(Path("a.toml"), Path("out"), ["--stop", "8"])
    native, page, fmpy = timed.values()
    shared = [sys.executable, "-m", "chassis_fmu", "run", "a.toml", "--stop", "8"]
    assert native == [*shared, "--no-page", "--out", "out/native"]
    assert page == [*shared, "--out", "out/native-page"]
    assert fmpy == [*shared, "--engine", "fmpy", "--out", "out/fmpy-page"]


def test_table_has_the_ratio_of_medians() -> None:
    lines = bench_masters.table({"native": [2.0, 9.0, 1.0], "fmpy": [20.0, 19.0, 30.0]}).splitlines()
    assert lines[0].split() == ["median", "fastest", "slowest", "ratio"]
    assert lines[1].split() == ["native", "2.0", "s", "1.0", "s", "9.0", "s", "1.0"]
    assert lines[2].split() == ["fmpy", "20.0", "s", "19.0", "s", "30.0", "s", "10.0"]


def test_programs_get_the_same_commands() -> None:
    first, second = (bench_workers.commands(Path(p), Path("out")) for p in ("first", "second"))
    assert first.keys() == second.keys()
    for name in first:
        assert [word for word in first[name] if word != "first"] == [word for word in second[name] if word != "second"]


def test_programs_may_have_fmus_of_their_own() -> None:
    command = bench_workers.commands(Path("first"), Path("out"), Path("baseline"))["run"]
    assert command[command.index("--fmus") + 1] == "baseline"


def test_ratio_is_the_median_of_the_pairs() -> None:
    # The ratios of the pairs are 1.1, 0.9 and 1.0; the ratio of the means would be different.
    cells = bench_workers.line("run", [(10.0, 11.0), (20.0, 18.0), (1.0, 1.0)]).split()
    assert cells == ["run", "3", "10.00", "s", "11.00", "s", "1.000", "(0.950", "to", "1.050)"]


def test_files_that_differ_are_listed(tmp_path: Path) -> None:
    for folder, files in {"a": {"x": "1", "y": "1", "z/z": "1"}, "b": {"x": "1", "y": "2"}}.items():
        for name, text in files.items():
            path = tmp_path / folder / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text)
    assert bench_workers.differing(tmp_path / "a", tmp_path / "b") == ["y", "z/z"]


def test_processes_of_a_process_count() -> None:
    spin = f"{sys.executable} -c 'import time\nwhile time.process_time() < 0.3: pass'; exit 0"
    times = measuring.run(["sh", "-c", spin])
    assert times.cpu >= 0.3
    assert times.seconds >= 0.3


def test_a_command_that_fails_ends_the_benchmark() -> None:
    assert measuring.run(["true"]).seconds > 0.0
    with pytest.raises(SystemExit, match=r"mine\nerror: sh -c .*: exit code 3"):
        measuring.run(["sh", "-c", "echo mine >&2; exit 3"])


@pytest.mark.parametrize(
    ("suffix", "text", "lines"),
    [
        (".rs", "//! A model.\n\n/// Height (m)\nh: f64, // start\n", 1),
        (".c", "/* A\n * model. */\n#define H 1\n\nint x; /* height */\n// end\n", 2),
        (".py", '"""A\n\nmodel."""\n\n# comment\nx = 1  # start\n', 1),
        (".xml", "<a>\n<!-- two\nlines -->\n</a>\n", 2),
    ],
)
def test_comments_and_empty_lines_do_not_count(suffix: str, text: str, lines: int) -> None:
    assert bench_exporters.lines_of_code(text, suffix) == lines


def test_each_reference_fmu_of_the_examples_is_counted(tmp_path: Path) -> None:
    sources = sorted((ROOT / "examples" / "reference-fmus").glob("*/src/lib.rs"))
    models = ["".join(word.capitalize() for word in source.parents[1].name.split("-")) for source in sources]
    for model in models:
        (tmp_path / model).mkdir()
        for name in ("config.h", "model.c"):
            (tmp_path / model / name).write_text("#define H 1\n\n// end\nint x;\n")
        (tmp_path / model / "FMI3.xml").write_text("<a/>\n")
    _, _, *rows = bench_exporters.reference_fmus(tmp_path).splitlines()
    assert "Dahlquist" in models
    assert [row.split(" | ")[0] for row in rows] == [f"| {model}" for model in models]
    assert {row.split(" | ")[2] for row in rows} == {"5"}


def test_first_error_is_the_reason() -> None:
    assert bench_exporters.reason("building\nerror: no linker\nerror: 1 error\n") == "error: no linker"
    assert bench_exporters.reason("one\n\ntwo\n\n") == "two"
    assert bench_exporters.reason("") == "no output"


def test_findings_of_the_check_are_found() -> None:
    report = "a.fmu: 1 error, 1 warning\n  description: 3 elements\n  error: x: y\n  warning: z\n"
    assert bench_exporters.findings(report) == ["error: x: y", "warning: z"]


def test_missing_program_is_an_error() -> None:
    with pytest.raises(bench_exporters.ProgramError, match="no-such-program"):
        bench_exporters.run(["no-such-program"])

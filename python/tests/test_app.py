"""The command from end to end, with a stand-in for `chassis` that prints the plan of the tests."""

from __future__ import annotations

import stat
from pathlib import Path

import numpy as np
import pyarrow.parquet
import pytest

from chassis_fmu import app, plan, results, shell
from chassis_fmu import scenario as scenario_module
from chassis_fmu.plan import Plan

HERE = Path(__file__).parent


@pytest.fixture
def chassis(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Replace `chassis` by a program that notes its arguments and prints the plan, or fails like a scenario error."""
    folder = tmp_path / "bin"
    folder.mkdir()
    script = folder / "chassis"
    script.write_text(
        f"""#!/bin/sh
printf '%s\\n' "$*" >> '{folder}/log'
case "$*" in
*broken*) echo 'scenario.toml:3:7: unknown component `rod`, did you mean `road`?' >&2; exit 3 ;;
'plan --json '*) cat '{HERE}/plan.json' ;;
'run '*)
    mkdir -p '{tmp_path}/out/trial/runs'
    cp '{tmp_path}'/recorded/*.csv '{tmp_path}/out/trial/runs'
    test ! -e '{tmp_path}/failing' ;;
esac
"""
    )
    script.chmod(script.stat().st_mode | stat.S_IXUSR)
    monkeypatch.setattr(shell, "worker_program", lambda: script)
    return folder / "log"


@pytest.fixture
def recorded(tmp_path: Path, scenario: Plan) -> Path:
    folder = tmp_path / "recorded"
    times = np.arange(4) * 0.1
    for i, run in enumerate(scenario.runs):
        columns = [c.name for c, slot in zip(scenario.columns, run.columns, strict=True) if slot is not None]
        rows = np.column_stack([times * (i + j + 1.0) for j in range(len(columns))])
        results.write_csv(folder / f"{run.stem}.csv", columns, times, rows)
    return folder


def contents(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


def test_the_scenario_is_optional(capsys: pytest.CaptureFixture[str]) -> None:
    assert app.arguments(["--stop", "8"]).scenario.name == "rescue_vehicle_step_steer.toml"
    with pytest.raises(SystemExit):
        app.arguments(["--help"])
    assert "[SCENARIO]" in capsys.readouterr().out


def test_a_stop_before_the_start_reaches_the_command_that_reports_it(chassis: Path, tmp_path: Path) -> None:
    app.main(["broken.toml", "--stop", "-3", "--out", str(tmp_path)])
    assert chassis.read_text().rstrip().endswith("--stop -3.0")


def test_outputs_repeat_to_the_byte(
    chassis: Path, recorded: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for out in ("one", "two"):
        assert app.main(["trial.toml", "--from-csv", str(recorded), "--out", str(tmp_path / out)]) == 0
    one = contents(tmp_path / "one")
    assert one == contents(tmp_path / "two")
    assert set(one) == {
        "index.html",
        "trial/index.html",
        "trial/page.json",
        "trial/table.csv",
        "trial/table.md",
        "trial/figures/roll.svg",
        "trial/figures/roll.png",
        "trial/runs/status.json",
        *(f"trial/runs/{r}.csv" for r in ("passive_1", "passive_2", "active_1", "active_2")),
    }
    assert one["trial/runs/active_1.csv"] == (recorded / "active_1.csv").read_bytes()
    out = capsys.readouterr().out
    assert "Roll angle <RMS> (°)" in out
    # Values are 1 to 4 rad at the end of the four runs, growing with their number: no reduction by a quarter.
    assert "Not reproduced  Less <roll>, by 25.0 %" in out
    assert b'href="trial/index.html"' in one["index.html"]
    assert b"runs/active_1.csv" in one["trial/index.html"]
    assert chassis.read_text().splitlines()[0].startswith("plan --json ")


def test_parquet_is_written_when_asked_for_and_goes_with_the_next_call(
    chassis: Path, recorded: Path, tmp_path: Path
) -> None:
    runs = tmp_path / "out" / "trial" / "runs"
    options = ["trial.toml", "--from-csv", str(recorded), "--out", str(tmp_path / "out")]
    assert app.main([*options, "--parquet"]) == 0
    assert sorted(p.suffix for p in runs.iterdir()) == [".csv"] * 4 + [".json"] + [".parquet"] * 4
    schema = pyarrow.parquet.read_schema(runs / "passive_1.parquet")
    assert schema.names == ["time", "source.count", "body.roll"]
    assert schema.field("body.roll").metadata == {b"unit": b"rad"}
    table = pyarrow.parquet.read_table(runs / "passive_1.parquet")
    assert table["body.roll"].to_pylist() == list(results.read_csv(runs / "passive_1.csv").values["body.roll"])
    assert app.main(options) == 0
    assert sorted(p.suffix for p in runs.iterdir()) == [".csv"] * 4 + [".json"]
    assert chassis.exists()


def test_options_are_passed_on(chassis: Path, recorded: Path, tmp_path: Path) -> None:
    options = ["--stop", "0.3", "--seeds", "2", "--order", "jacobi", "--fmus", str(tmp_path)]
    code = app.main(["trial.toml", *options, "--from-csv", str(recorded), "--out", str(tmp_path / "out")])
    assert code == 0
    assert chassis.read_text().strip().endswith(f"--fmus {tmp_path} --stop 0.3 --seeds 2 --order jacobi")


def test_a_scenario_error_is_shown_as_it_is(chassis: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert app.main(["broken.toml", "--out", str(tmp_path / "out")]) == 3
    assert capfd.readouterr().err == "scenario.toml:3:7: unknown component `rod`, did you mean `road`?\n"
    assert not (tmp_path / "out").exists()
    assert chassis.exists()


def test_a_missing_run_is_reported_and_the_others_are_kept(
    chassis: Path, recorded: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (recorded / "active_2.csv").unlink()
    assert app.main(["trial.toml", "--from-csv", str(recorded), "--out", str(tmp_path / "out")]) == 1
    assert "error: run active#2:" in capsys.readouterr().err
    assert (tmp_path / "out" / "trial" / "runs" / "active_1.csv").exists()
    assert "1 of 4 runs failed" in (tmp_path / "out" / "trial" / "index.html").read_text(encoding="utf-8")
    assert chassis.exists()


def test_native_runs_are_reported(chassis: Path, recorded: Path, tmp_path: Path) -> None:
    options = ["trial.toml", "--native", "--jobs", "2", "--out", str(tmp_path / "out")]
    assert app.main(options) == 0
    assert (
        chassis.read_text().splitlines()[1].partition(" --timeout 60")[0].endswith(f"--out {tmp_path / 'out'} --jobs 2")
    )
    page = (tmp_path / "out" / "trial" / "index.html").read_text(encoding="utf-8")
    assert "native (chassis run)" in page
    # a run that fails there has no file
    (recorded / "active_2.csv").unlink()
    (tmp_path / "out" / "trial" / "runs" / "active_2.csv").unlink()
    (tmp_path / "failing").touch()
    assert app.main(options) == 1
    assert "1 of 4 runs failed" in (tmp_path / "out" / "trial" / "index.html").read_text(encoding="utf-8")


def test_a_native_failure_without_a_failed_run_is_passed_on(chassis: Path, recorded: Path, tmp_path: Path) -> None:
    (tmp_path / "failing").touch()
    assert app.main(["trial.toml", "--native", "--out", str(tmp_path / "out")]) == 1
    assert not (tmp_path / "out" / "trial" / "index.html").exists()
    assert chassis.exists()
    assert recorded.exists()


def test_a_page_is_not_replaced_when_all_runs_fail(chassis: Path, recorded: Path, tmp_path: Path) -> None:
    options = ["trial.toml", "--native", "--out", str(tmp_path / "out")]
    assert app.main(options) == 0
    page = (tmp_path / "out" / "trial" / "index.html").read_bytes()
    for folder in (recorded, tmp_path / "out" / "trial" / "runs"):
        for path in folder.glob("*.csv"):
            path.unlink()
    (recorded / "other.csv").touch()
    (tmp_path / "failing").touch()
    assert app.main([*options, "--junit", str(tmp_path / "trial.xml")]) == 1
    assert (tmp_path / "out" / "trial" / "index.html").read_bytes() == page
    # The report of tests is of this call: four runs failed, and nothing is known about the requirement.
    assert 'tests="5" failures="0" errors="4" skipped="1"' in (tmp_path / "trial.xml").read_text(encoding="utf-8")
    assert chassis.exists()


def test_a_csv_of_other_rows_or_columns_is_rejected(
    chassis: Path, recorded: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (recorded / "active_2.csv").write_text("time,body.roll\n0.0,1.0\n")
    (recorded / "active_1.csv").write_text("time,body.roll\n0.0,1.0\n")
    assert app.main(["trial.toml", "--from-csv", str(recorded), "--out", str(tmp_path / "out")]) == 1
    errors = capsys.readouterr().err
    assert "active_2.csv has 1 rows, expected 4" in errors
    assert "active_1.csv has no column source.count" in errors
    assert chassis.exists()


def test_an_fmu_that_cannot_be_opened_fails_its_runs(
    chassis: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    old = tmp_path / "out" / "trial" / "runs" / "passive_1.csv"
    results.write_text(old, "stale")
    assert app.main(["trial.toml", "--out", str(tmp_path / "out")]) == 1
    assert "error: run passive#1: component source, loading:" in capsys.readouterr().err
    assert not old.exists()
    assert chassis.exists()


def test_the_program_is_asked_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(scenario_module, "ROOT", tmp_path)
    monkeypatch.setattr(scenario_module, "PACKAGE", tmp_path)
    monkeypatch.setenv("PATH", str(tmp_path))
    assert app.main(["trial.toml"]) == 1
    assert "there is no program chassis" in capsys.readouterr().err


@pytest.mark.usefixtures("chassis")
def test_a_requirement_that_is_not_met_is_an_error_unless_asked_otherwise(
    recorded: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    junit = tmp_path / "reports" / "trial.xml"
    options = ["trial.toml", "--from-csv", str(recorded), "--out", str(tmp_path / "out")]
    assert app.main([*options, "--junit", str(junit)]) == 0
    assert "Requirements\nPassed  Roll angle <RMS>, Active <fast>: " in capsys.readouterr().out
    assert 'failures="0"' in junit.read_text()
    parse = plan.parse

    def strict(text: str, root: Path) -> Plan:
        return parse(text.replace('"max": 400.0', '"max": 1.0'), root)

    monkeypatch.setattr(plan, "parse", strict)
    assert app.main([*options, "--junit", str(junit)]) == 1
    printed = capsys.readouterr()
    assert "Failed  Roll angle <RMS>" in printed.out
    assert "1 of 1 requirements not met" in printed.err
    assert 'failures="1"' in junit.read_text()
    assert app.main([*options, "--no-fail"]) == 0

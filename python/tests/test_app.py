"""Tables and page of a scenario, as `chassis run` asks for them, with the plan of the tests."""

from __future__ import annotations

import io
import json
import sys
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import pyarrow.parquet
import pytest

from chassis_fmu import app
from chassis_fmu.files import plan, results
from chassis_fmu.files.plan import Plan

HERE = Path(__file__).parent


class Ask(Protocol):
    """Passes a request on; returns the exit code."""

    def __call__(self, engine: str = "csv", out: str = "out", **more: Any) -> int: ...


@pytest.fixture
def ask(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Ask:
    def ask(engine: str = "csv", out: str = "out", **more: Any) -> int:
        if engine == "csv":
            more["csv"] = str(tmp_path / "recorded")
        request = {
            "plan": json.loads((HERE / "plan.json").read_text(encoding="utf-8")),
            "folder": str(tmp_path / out / "trial"),
            "engine": engine,
            "command": "chassis run trial.toml",
            **more,
        }
        monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(json.dumps(request).encode())))
        return app.main()

    return ask


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


def test_outputs_repeat_to_the_byte(
    ask: Ask, recorded: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for out in ("one", "two"):
        assert ask(out=out) == 0
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
    assert b"chassis run trial.toml" in one["trial/index.html"]


@pytest.mark.usefixtures("recorded")
def test_parquet_is_written_when_asked_for_and_goes_with_the_next_call(ask: Ask, tmp_path: Path) -> None:
    runs = tmp_path / "out" / "trial" / "runs"
    assert ask(parquet=True) == 0
    assert sorted(p.suffix for p in runs.iterdir()) == [".csv"] * 4 + [".json"] + [".parquet"] * 4
    schema = pyarrow.parquet.read_schema(runs / "passive_1.parquet")
    assert schema.names == ["time", "source.count", "body.roll"]
    assert schema.field("body.roll").metadata == {b"unit": b"rad"}
    table = pyarrow.parquet.read_table(runs / "passive_1.parquet")
    assert table["body.roll"].to_pylist() == list(results.read_csv(runs / "passive_1.csv").values["body.roll"])
    assert ask() == 0
    assert sorted(p.suffix for p in runs.iterdir()) == [".csv"] * 4 + [".json"]


def test_a_missing_run_is_reported_and_the_others_are_kept(
    ask: Ask, recorded: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (recorded / "active_2.csv").unlink()
    assert ask() == 1
    assert "error: run active#2:" in capsys.readouterr().err
    assert (tmp_path / "out" / "trial" / "runs" / "active_1.csv").exists()
    assert "1 of 4 runs failed" in (tmp_path / "out" / "trial" / "index.html").read_text(encoding="utf-8")


def placed(recorded: Path, tmp_path: Path) -> Path:
    """Put the recorded runs where the native master writes them."""
    runs = tmp_path / "out" / "trial" / "runs"
    runs.mkdir(parents=True)
    for path in recorded.glob("*.csv"):
        (runs / path.name).write_bytes(path.read_bytes())
    return runs


def test_native_runs_are_reported(ask: Ask, recorded: Path, tmp_path: Path) -> None:
    runs = placed(recorded, tmp_path)
    assert ask("native") == 0
    page = (tmp_path / "out" / "trial" / "index.html").read_text(encoding="utf-8")
    assert "native (chassis run)" in page
    # A run that fails there has no file.
    (runs / "active_2.csv").unlink()
    assert ask("native") == 1
    assert "1 of 4 runs failed" in (tmp_path / "out" / "trial" / "index.html").read_text(encoding="utf-8")


def test_a_page_is_not_replaced_when_all_runs_fail(ask: Ask, recorded: Path, tmp_path: Path) -> None:
    runs = placed(recorded, tmp_path)
    assert ask("native") == 0
    page = (tmp_path / "out" / "trial" / "index.html").read_bytes()
    for path in runs.glob("*.csv"):
        path.unlink()
    assert ask("native", junit=str(tmp_path / "trial.xml")) == 1
    assert (tmp_path / "out" / "trial" / "index.html").read_bytes() == page
    # The report of tests is of this call: four runs failed, and nothing is known about the requirement.
    assert 'tests="5" failures="0" errors="4" skipped="1"' in (tmp_path / "trial.xml").read_text(encoding="utf-8")


def test_a_csv_of_other_rows_or_columns_is_rejected(
    ask: Ask, recorded: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (recorded / "active_2.csv").write_text("time,body.roll\n0.0,1.0\n")
    (recorded / "active_1.csv").write_text("time,body.roll\n0.0,1.0\n")
    assert ask() == 1
    errors = capsys.readouterr().err
    assert "active_2.csv has 1 rows, expected 4" in errors
    assert "active_1.csv has no column source.count" in errors


def test_an_fmu_that_cannot_be_opened_fails_its_runs(
    ask: Ask, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    old = tmp_path / "out" / "trial" / "runs" / "passive_1.csv"
    results.write_text(old, "stale")
    assert ask("fmpy") == 1
    assert "error: run passive#1: component source, loading:" in capsys.readouterr().err
    assert not old.exists()


@pytest.mark.usefixtures("recorded")
def test_a_requirement_that_is_not_met_is_an_error_unless_asked_otherwise(
    ask: Ask, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    junit = tmp_path / "reports" / "trial.xml"
    assert ask(junit=str(junit)) == 0
    assert "Requirements\nPassed  Roll angle <RMS>, Active <fast>: " in capsys.readouterr().out
    assert 'failures="0"' in junit.read_text()
    parse = plan.parse

    def strict(text: str, root: Path) -> Plan:
        return parse(text.replace('"max": 400.0', '"max": 1.0'), root)

    monkeypatch.setattr(plan, "parse", strict)
    assert ask(junit=str(junit)) == 1
    printed = capsys.readouterr()
    assert "Failed  Roll angle <RMS>" in printed.out
    assert "1 of 1 requirements not met" in printed.err
    assert 'failures="1"' in junit.read_text()
    assert ask(no_fail=True) == 0

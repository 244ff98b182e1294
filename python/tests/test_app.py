"""What `chassis run` asks Python for, with the plan of the tests: rows of runs, then tables and page."""

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
from chassis_fmu.execution import __main__ as execution
from chassis_fmu.files import results
from chassis_fmu.files.plan import Plan

HERE = Path(__file__).parent

# Metrics of the runs, by hand.
NUMBERS = {"passive#1": (40.0, 0.3), "passive#2": (80.0, 0.6), "active#1": (120.0, 0.9), "active#2": (160.0, None)}


class Ask(Protocol):
    """Passes a request on; returns the exit code."""

    def __call__(self, out: str = "out", **more: Any) -> int: ...


@pytest.fixture
def rows(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Ask:
    def ask(out: str = "out", **more: Any) -> int:
        request = {
            "plan": json.loads((HERE / "plan.json").read_text(encoding="utf-8")),
            "runs": str(tmp_path / out / "trial" / "runs"),
            "csv": str(tmp_path / "recorded"),
            **more,
        }
        monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(json.dumps(request).encode())))
        return execution.main()

    return ask


@pytest.fixture
def page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Ask:
    def ask(out: str = "out", **more: Any) -> int:
        request = {
            "plan": json.loads((HERE / "plan.json").read_text(encoding="utf-8")),
            "folder": str(tmp_path / out / "trial"),
            "engine": "csv",
            "command": "chassis run trial.toml",
            "numbers": NUMBERS,
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


def reasons(tmp_path: Path) -> dict[str, str | None]:
    """Return why runs are not complete, by run; None for the others."""
    found = json.loads((tmp_path / "out" / "trial" / "runs" / "status.json").read_text(encoding="utf-8"))
    return {run["run"]: run["message"] for run in found["runs"]}


def test_outputs_repeat_to_the_byte(
    rows: Ask, page: Ask, recorded: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for out in ("one", "two"):
        assert rows(out) == 0
        assert page(out) == 0
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
    # The numbers grow from run to run: no reduction by a quarter.
    assert "Not reproduced  Less <roll>, by 25.0 %" in out
    assert b'href="trial/index.html"' in one["index.html"]
    assert b"runs/active_1.csv" in one["trial/index.html"]
    assert b"chassis run trial.toml" in one["trial/index.html"]


@pytest.mark.usefixtures("recorded")
def test_parquet_is_written_when_asked_for_and_goes_with_the_next_call(rows: Ask, page: Ask, tmp_path: Path) -> None:
    runs = tmp_path / "out" / "trial" / "runs"
    assert rows() == 0
    assert page(parquet=True) == 0
    assert sorted(p.suffix for p in runs.iterdir()) == [".csv"] * 4 + [".json"] + [".parquet"] * 4
    schema = pyarrow.parquet.read_schema(runs / "passive_1.parquet")
    assert schema.names == ["time", "source.count", "body.roll"]
    assert schema.field("body.roll").metadata == {b"unit": b"rad"}
    table = pyarrow.parquet.read_table(runs / "passive_1.parquet")
    assert table["body.roll"].to_pylist() == list(results.read_csv(runs / "passive_1.csv").values["body.roll"])
    assert page() == 0
    assert sorted(p.suffix for p in runs.iterdir()) == [".csv"] * 4 + [".json"]


def test_a_missing_run_is_reported_and_the_others_are_kept(
    rows: Ask, page: Ask, recorded: Path, tmp_path: Path
) -> None:
    (recorded / "active_2.csv").unlink()
    assert rows() == 0
    found = reasons(tmp_path)
    assert [run for run, reason in found.items() if reason is not None] == ["active#2"]
    assert (tmp_path / "out" / "trial" / "runs" / "active_1.csv").exists()
    complete = {run: numbers for run, numbers in NUMBERS.items() if run != "active#2"}
    assert page(engine="native", numbers=complete, incomplete={"active#2": found["active#2"]}) == 0
    text = (tmp_path / "out" / "trial" / "index.html").read_text(encoding="utf-8")
    assert "1 of 4 runs failed" in text
    assert "native (chassis run)" in text


def test_a_folder_without_any_run_is_an_error(rows: Ask, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "recorded").mkdir()
    assert rows() == 1
    assert "recorded has no results of trial: " in capsys.readouterr().err


def test_a_csv_of_other_rows_or_columns_is_rejected(rows: Ask, recorded: Path, tmp_path: Path) -> None:
    (recorded / "active_2.csv").write_text("time,body.roll\n0.0,1.0\n")
    (recorded / "active_1.csv").write_text("time,body.roll\n0.0,1.0\n")
    assert rows() == 0
    found = reasons(tmp_path)
    assert found["active#2"] == "active_2.csv has 1 rows, expected 4"
    assert found["active#1"] == "active_1.csv has no column source.count"


def test_an_fmu_that_cannot_be_opened_fails_its_runs(rows: Ask, tmp_path: Path) -> None:
    old = tmp_path / "out" / "trial" / "runs" / "passive_1.csv"
    results.write_text(old, "stale")
    assert rows(csv=None) == 0
    assert str(reasons(tmp_path)["passive#1"]).startswith("component source, loading:")
    assert not old.exists()


@pytest.mark.usefixtures("recorded")
def test_verdicts_are_on_the_page(rows: Ask, page: Ask, tmp_path: Path) -> None:
    assert rows() == 0
    assert page(verdicts=[{"status": "failed", "text": "Roll angle <RMS>: 160 °"}]) == 0
    text = (tmp_path / "out" / "trial" / "index.html").read_text(encoding="utf-8")
    assert "Roll angle &lt;RMS&gt;: 160 °" in text

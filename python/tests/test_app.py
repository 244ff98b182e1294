"""Tables and page of a scenario, from requests like those of `chassis run`."""

from __future__ import annotations

import io
import json
import shutil
import sys
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import pyarrow.parquet
import pytest

from chassis_fmu import app
from chassis_fmu.files import results
from chassis_fmu.files.plan import Plan

HERE = Path(__file__).parent

# Metrics of the runs, computed by hand.
NUMBERS = {"passive#1": (40.0, 0.3), "passive#2": (80.0, 0.6), "active#1": (120.0, 0.9), "active#2": (160.0, None)}


class Ask(Protocol):
    """Executes a request; returns the exit code."""

    def __call__(self, out: str = "out", **more: Any) -> int: ...


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


def placed(recorded: Path, out: Path) -> Path:
    """Put the recorded runs where a master writes them."""
    return Path(shutil.copytree(recorded, out / "trial" / "runs"))


def contents(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


def test_outputs_repeat_to_the_byte(
    page: Ask, recorded: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for out in ("one", "two"):
        placed(recorded, tmp_path / out)
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
        *(f"trial/runs/{r}.csv" for r in ("passive_1", "passive_2", "active_1", "active_2")),
    }
    assert one["trial/runs/active_1.csv"] == (recorded / "active_1.csv").read_bytes()
    out = capsys.readouterr().out
    assert "Roll angle <RMS> (°)" in out
    # The values rise from run to run, so there is no reduction by 25 %.
    assert "Not reproduced  Less <roll>, by 25.0 %" in out
    assert b'href="trial/index.html"' in one["index.html"]
    assert b"runs/active_1.csv" in one["trial/index.html"]
    assert b"chassis run trial.toml" in one["trial/index.html"]


def test_parquet_is_written_when_asked_for_and_goes_with_the_next_call(
    page: Ask, recorded: Path, tmp_path: Path
) -> None:
    runs = placed(recorded, tmp_path / "out")
    assert page(parquet=True) == 0
    assert sorted(p.suffix for p in runs.iterdir()) == [".csv"] * 4 + [".parquet"] * 4
    schema = pyarrow.parquet.read_schema(runs / "passive_1.parquet")
    assert schema.names == ["time", "source.count", "body.roll"]
    assert schema.field("body.roll").metadata == {b"unit": b"rad"}
    table = pyarrow.parquet.read_table(runs / "passive_1.parquet")
    assert table["body.roll"].to_pylist() == list(results.read_csv(runs / "passive_1.csv").values["body.roll"])
    assert page() == 0
    assert sorted(p.suffix for p in runs.iterdir()) == [".csv"] * 4


def test_an_incomplete_run_is_on_the_page(page: Ask, recorded: Path, tmp_path: Path) -> None:
    placed(recorded, tmp_path / "out")
    complete = {run: numbers for run, numbers in NUMBERS.items() if run != "active#2"}
    assert page(engine="native", numbers=complete, incomplete={"active#2": "it <failed>"}) == 0
    text = (tmp_path / "out" / "trial" / "index.html").read_text(encoding="utf-8")
    assert "1 of 4 runs failed" in text
    assert "it &lt;failed&gt;" in text
    assert "native (chassis run)" in text


def test_verdicts_are_on_the_page(page: Ask, recorded: Path, tmp_path: Path) -> None:
    placed(recorded, tmp_path / "out")
    assert page(verdicts=[{"status": "failed", "text": "Roll angle <RMS>: 160 °"}]) == 0
    text = (tmp_path / "out" / "trial" / "index.html").read_text(encoding="utf-8")
    assert "Roll angle &lt;RMS&gt;: 160 °" in text

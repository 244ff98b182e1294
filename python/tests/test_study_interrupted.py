"""Studies that are interrupted and continued, and processes that use the same folder."""

from __future__ import annotations

import functools
import io
import signal
import subprocess
from pathlib import Path

import pytest
from tqdm import tqdm

from chassis_fmu.study.execute import WHOLE, Folder, Progress, Shard
from chassis_fmu.study.job import Done
from tests import study_system
from tests.commands import patience, until
from tests.study_system import build, vary, write

STUDY = 'method = "sample"\nruns = 60\n' + vary("p", "f:a", 'distribution = "uniform"\nmin = 0.0\nmax = 1.0')


def arguments(folder: Path, out: str, *options: str) -> list[str]:
    return [str(folder / "study.toml"), "--fmus", str(folder / "fmus"), "--out", str(folder / out), *options]


def row(number: int, status: str = "ok") -> Done:
    return Done(number, 0, (1.0,), status, None, None, None, None, 0.1)


def test_an_interrupt_from_the_keyboard_keeps_the_rows(tmp_path: Path) -> None:
    # Each of the 120 runs takes 0.04 s, enough time to interrupt the study.
    build(tmp_path, before="usleep(20000)")
    write(tmp_path, STUDY)
    rows = tmp_path / "stopped" / "study" / "rows.jsonl"
    # Tests that run in the background can inherit an ignored signal.
    options = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    default = functools.partial(signal.signal, signal.SIGINT, signal.default_int_handler)
    with study_system.start(arguments(tmp_path, "stopped"), tmp_path, preexec_fn=default, **options) as study:
        until(lambda: rows.exists() and rows.read_text().count("\n") >= 10, "some rows")
        assert study.poll() is None, "it goes on"
        study.send_signal(signal.SIGINT)
        _, said = study.communicate(timeout=patience(60))
    assert study.returncode == 130
    assert said == "interrupted; --resume continues\n"
    kept = rows.read_text().splitlines()
    assert 10 <= len(kept) < 121
    assert not (tmp_path / "stopped" / "study" / "runs.parquet").exists()

    assert study_system.carry_out(arguments(tmp_path, "stopped", "--resume")) == 0
    assert rows.read_text().splitlines()[: len(kept)] == kept
    assert study_system.carry_out(arguments(tmp_path, "whole")) == 0
    for name in ("design.parquet", "runs.parquet"):
        found, expected = ((tmp_path / out / "study" / name).read_bytes() for out in ("stopped", "whole"))
        assert found == expected, name


def test_two_processes_do_not_write_to_one_folder(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    build(tmp_path)
    write(tmp_path, STUDY)
    assert study_system.carry_out(arguments(tmp_path, "out")) == 0
    folder = Folder(tmp_path / "out" / "study")
    tables = [folder.design, folder.runs, folder.journal(WHOLE)]
    before = [path.read_bytes() for path in tables]
    with folder.locked(WHOLE):
        for option in ("--resume", "--overwrite", "--report-only"):
            capsys.readouterr()
            assert study_system.carry_out(arguments(tmp_path, "out", option)) == 2
            assert f"another process is writing to {folder.path}: wait for it" in capsys.readouterr().err
        # Each shard has its own journal.
        with folder.locked(Shard(1, 3)), folder.locked(Shard(2, 3)):
            pass
    assert [path.read_bytes() for path in tables] == before
    assert study_system.carry_out(arguments(tmp_path, "out", "--resume")) == 0


def test_the_bar_begins_with_the_rows_that_are_there() -> None:
    with tqdm(total=10, file=io.StringIO()) as bar:
        progress = Progress(bar)
        progress.begin([row(0), row(1), row(2, "crashed")])
        # tqdm computes rate and remaining time from the rows after `initial`.
        assert (bar.n, bar.initial, bar.postfix) == (3, 3, "failed=1")
        progress.add(row(3, "diverged"))
        assert (bar.n, bar.initial, bar.postfix) == (4, 3, "failed=2")

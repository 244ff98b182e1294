"""Fixtures: a hand-made plan, and a run by both masters."""

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from chassis_fmu.files import plan

HERE = Path(__file__).parent
ROOT = HERE.parents[1]


@pytest.fixture
def scenario() -> plan.Plan:
    return plan.Plan.parse((HERE / "plan.json").read_text(encoding="utf-8"), HERE)


@pytest.fixture
def run_by_both_masters(tmp_path: Path) -> Callable[[Path, Path], Path]:
    """Return a function that runs the case `only` in both masters, which must write the same bytes."""

    def run(scenario: Path, fmus: Path) -> Path:
        files: list[Path] = []
        for name in ("fmpy", "native"):
            out = tmp_path / name
            done = subprocess.run(
                [sys.executable, "-m", "chassis_fmu", "run", scenario, "--engine", name, "--fmus", fmus, "--out", out],
                cwd=ROOT,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                encoding="utf-8",
                check=False,
            )
            assert done.returncode == 0, done.stdout
            files.append(out / scenario.stem / "runs" / "only.csv")
        assert files[0].read_bytes() == files[1].read_bytes()
        return files[0]

    return run

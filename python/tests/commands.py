"""Commands that tests call."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path

ROOT = Path(__file__).parents[2]
CARGO_FMU = (str(ROOT / "target" / "debug" / "cargo-fmu"), "fmu")
"""The command `cargo fmu` as `scripts/test` builds it: with its dependencies compiled for all packages."""


def patience(seconds: float) -> float:
    """Return a limit of wall-clock time, s; CHASSIS_TEST_PATIENCE is the factor of all limits on a slow machine."""
    return seconds * float(os.environ.get("CHASSIS_TEST_PATIENCE", "1"))


def until(is_so: Callable[[], bool], what: str) -> None:
    """Wait for something that another process does."""
    end = time.monotonic() + patience(90.0)
    while not is_so():
        assert time.monotonic() < end, what
        time.sleep(0.01)


def _call(command: Sequence[str | Path]) -> tuple[int, str]:
    done = subprocess.run(command, cwd=ROOT, stdout=subprocess.PIPE, encoding="utf-8", check=False)
    return done.returncode, done.stdout


def cargo_fmu(*arguments: str | Path) -> tuple[int, str]:
    """Run a command of `cargo fmu`; its messages go to the terminal. Returns its exit code and output."""
    return _call([*CARGO_FMU, *arguments])


def chassis(*arguments: str | Path) -> tuple[int, str]:
    """Run a command of `chassis`, as `cargo_fmu` does."""
    return _call([sys.executable, "-m", "chassis_fmu", *arguments])

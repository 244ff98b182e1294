"""Runs the commands of the project for tests."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path

ROOT = Path(__file__).parents[2]
CARGO_FMU = (str(ROOT / "target" / "debug" / "cargo-fmu"), "fmu")
"""The command `cargo fmu`, which `scripts/test` builds. `cargo run` would compile it again, with other features."""
CHASSIS = str(ROOT / "target" / "debug" / "chassis")
"""The command `chassis`, likewise."""


def patience(seconds: float) -> float:
    """Return a time limit (s), multiplied by CHASSIS_TEST_PATIENCE, which slow machines set."""
    return seconds * float(os.environ.get("CHASSIS_TEST_PATIENCE", "1"))


def until(is_so: Callable[[], bool], what: str) -> None:
    """Wait for a condition that another process fulfills."""
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
    """Run a command of `chassis`, like `cargo_fmu`."""
    return _call([sys.executable, "-m", "chassis_fmu", *arguments])


def unwrapped(message: str) -> str:
    """Return an error in one line: its lines, with a bar at their left, depend on the lengths of paths in it."""
    return " ".join(message.replace("│", " ").split())

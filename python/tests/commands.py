"""Commands that tests call."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

ROOT = Path(__file__).parents[2]


def _call(command: Sequence[str | Path]) -> tuple[int, str]:
    done = subprocess.run(command, cwd=ROOT, stdout=subprocess.PIPE, encoding="utf-8", check=False)
    return done.returncode, done.stdout


def cargo_fmu(*arguments: str | Path) -> tuple[int, str]:
    """Run a command of `cargo fmu`; its messages go to the terminal. Returns its exit code and output."""
    return _call(["cargo", "fmu", *arguments])


def chassis(*arguments: str | Path) -> tuple[int, str]:
    """Run a command of `chassis`, as `cargo_fmu` does."""
    return _call([sys.executable, "-m", "chassis_fmu", *arguments])

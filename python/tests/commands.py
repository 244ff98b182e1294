"""Commands that tests call."""

from __future__ import annotations

import subprocess
from collections.abc import Sequence
from pathlib import Path

ROOT = Path(__file__).parents[2]


def cargo_fmu(arguments: Sequence[str]) -> tuple[int, str]:
    """Run a command of `cargo fmu`; its messages go to the terminal. Returns its exit code and output."""
    done = subprocess.run(["cargo", "fmu", *arguments], cwd=ROOT, stdout=subprocess.PIPE, encoding="utf-8", check=False)
    return done.returncode, done.stdout

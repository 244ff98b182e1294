"""Measure time, CPU time and memory of commands, for the benchmarks."""

from __future__ import annotations

import argparse
import os
import subprocess
import time
from collections.abc import Sequence
from typing import NamedTuple

from chassis_fmu.program import ROOT


def positive(text: str) -> int:
    """Parse an integer of at least 1."""
    value = int(text)
    if value < 1:
        raise argparse.ArgumentTypeError(f"must be at least 1, got {text}")
    return value


class Measured(NamedTuple):
    """Wall time of a command (s), CPU time of all its processes (s), and memory of its largest process (bytes)."""

    seconds: float
    cpu: float
    memory: int


def run(command: Sequence[str]) -> Measured:
    """Run a command and measure it; exit with its message if it fails."""
    begin = time.perf_counter()
    with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE) as process:
        assert process.stderr is not None
        message = process.stderr.read()
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode != 0:
        text = message.decode(errors="replace")
        raise SystemExit(f"{text}error: {' '.join(command)}: exit code {process.returncode}")
    return Measured(time.perf_counter() - begin, usage.ru_utime + usage.ru_stime, 1024 * usage.ru_maxrss)

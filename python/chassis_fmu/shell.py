"""What the command lines of scenarios and studies share."""

from __future__ import annotations

import argparse
import importlib.metadata
import math
import os
import platform
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from . import libpython
from .scenario import worker_program

ROOT = Path(__file__).resolve().parents[2]
"""The top folder of the repository."""


def program(launcher: str) -> str:
    """Return the name of this program in usage messages: its launcher, or how Python runs the module."""
    called = Path(sys.argv[0])
    if called.name == "__main__.py" and called.resolve().is_relative_to(Path(__file__).parent):
        return f"python -m chassis_fmu.{called.parent.name}"
    return launcher


def positive(text: str) -> int:
    """Read a whole number of at least 1."""
    value = int(text)
    if value < 1:
        raise argparse.ArgumentTypeError(f"{text} is not a number of at least 1")
    return value


def seconds(text: str) -> float:
    """Read a time above 0 (s)."""
    value = float(text)
    if not 0.0 < value < math.inf:
        raise argparse.ArgumentTypeError(f"{text} is not a number above 0")
    return value


def add_timeout(parser: argparse.ArgumentParser) -> None:
    """Add the longest time for a step."""
    parser.add_argument(
        "--timeout",
        type=seconds,
        default=60.0,
        metavar="SECONDS",
        help="time limit for a step, in seconds; an FMU that takes longer is stopped (default: 60)",
    )


RESULTS = ROOT / "results"


def add_out(parser: argparse.ArgumentParser) -> None:
    """Add the folder of the results."""
    parser.add_argument(
        "--out", type=Path, default=RESULTS, metavar="DIR", help="folder for results (default: results)"
    )


def add_fmus(parser: argparse.ArgumentParser) -> None:
    """Add the folders of FMUs."""
    parser.add_argument(
        "--fmus",
        type=Path,
        action="append",
        metavar="DIR",
        help="folder with the FMUs; may be repeated, the first folder that contains an FMU wins (default: target/fmu)",
    )


def set_options(options: argparse.Namespace, names: Sequence[str]) -> list[str]:
    """Return those of the options that were given, as arguments."""
    given = [(name, getattr(options, name)) for name in names]
    return [text for name, value in given if value is not None for text in (f"--{name}", str(value))]


def from_root(arguments: Sequence[str]) -> list[str]:
    """Name files as seen from the project, where they lie in it, as messages and pages do."""
    prefix = f"{ROOT}{os.sep}"
    return [a.removeprefix(prefix) for a in arguments]


def workers(options: argparse.Namespace) -> list[str]:
    """Return the arguments about the processes that execute FMUs."""
    library = libpython.find()
    python = [] if library is None else ["--libpython", str(library)]
    return ["--timeout", f"{options.timeout:g}", *python]


def chassis(arguments: Sequence[str], capture: bool = False) -> tuple[int, str]:
    """Run a subcommand of `chassis`; its messages go to the terminal. Returns its exit code and captured output.

    FMUs made with Python use the Python that this is.
    """
    done = subprocess.run(
        [worker_program(), *arguments],
        cwd=ROOT,
        env={"PYTHONHOME": sys.base_prefix, **os.environ},
        stdout=subprocess.PIPE if capture else None,
        check=False,
    )
    return done.returncode, done.stdout.decode() if capture else ""


def versions() -> tuple[tuple[str, str], ...]:
    """Return the programs that make a page, with their versions."""
    python = f"{platform.python_version()} on {platform.system()} {platform.machine()}"
    return (("Chassis FMU", importlib.metadata.version("chassis-fmu")), ("Python", python))

"""What the command lines of scenarios and studies share."""

from __future__ import annotations

import argparse
import importlib.metadata
import math
import os
import platform
from collections.abc import Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
"""The top folder of the repository."""


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


def versions() -> tuple[tuple[str, str], ...]:
    """Return the programs that make a page, with their versions."""
    python = f"{platform.python_version()} on {platform.system()} {platform.machine()}"
    return (("Chassis FMU", importlib.metadata.version("chassis-fmu")), ("Python", python))

"""Arguments of commands: reading them, repeating them on pages; versions."""

from __future__ import annotations

import argparse
import importlib.metadata
import os
import platform
from collections.abc import Sequence

from .program import ROOT


def positive(text: str) -> int:
    """Read a whole number of at least 1."""
    value = int(text)
    if value < 1:
        raise argparse.ArgumentTypeError(f"{text} is not a number of at least 1")
    return value


def set_options(options: argparse.Namespace, names: Sequence[str]) -> list[str]:
    """Return those of the options that were given, as arguments."""
    given = [(name, getattr(options, name)) for name in names]
    return [text for name, value in given if value is not None for text in (f"--{name}", str(value))]


def from_root(arguments: Sequence[str]) -> list[str]:
    """Return the arguments with files of the project relative to its folder."""
    prefix = f"{ROOT}{os.sep}"
    return [a.removeprefix(prefix) for a in arguments]


def versions() -> tuple[tuple[str, str], ...]:
    """Return the programs that make a page, with their versions."""
    python = f"{platform.python_version()} on {platform.system()} {platform.machine()}"
    return (("Chassis FMU", importlib.metadata.version("chassis-fmu")), ("Python", python))

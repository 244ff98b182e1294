"""Requests of commands, and versions."""

from __future__ import annotations

import importlib.metadata
import platform
from pathlib import Path


def path(kind: type, value: object) -> object:
    """Make a path of a text, in the requests of commands."""
    return Path(str(value)) if kind is Path else value


def versions() -> tuple[tuple[str, str], ...]:
    """Return the programs that make a page, with their versions."""
    python = f"{platform.python_version()} on {platform.system()} {platform.machine()}"
    return (("Chassis FMU", importlib.metadata.version("chassis-fmu")), ("Python", python))

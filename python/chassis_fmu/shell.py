"""Functions that several commands share."""

from __future__ import annotations

import importlib.metadata
import platform
from pathlib import Path


def path(kind: type, value: object) -> object:
    """Convert a string to a path while msgspec decodes a request (`dec_hook`)."""
    return Path(str(value)) if kind is Path else value


def versions() -> tuple[tuple[str, str], ...]:
    """Return the names and versions of the programs that make a page."""
    python = f"{platform.python_version()} on {platform.system()} {platform.machine()}"
    return (("Chassis FMU", importlib.metadata.version("chassis-fmu")), ("Python", python))

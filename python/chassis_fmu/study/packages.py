"""Python packages that only some studies need."""

from __future__ import annotations

import importlib.util
import sys

from .file import StudyError


def needed(package: str, what: str) -> None:
    """Raise StudyError if a package is not installed that something needs."""
    if importlib.util.find_spec(package) is None:
        raise StudyError(
            f"{what} needs the Python package {package}, which is not installed: "
            f"`{sys.executable} -m pip install {package}`"
        )

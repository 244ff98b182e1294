"""Python packages that only some studies need."""

from __future__ import annotations

import importlib.util
import sys

from .file import StudyError


def needed(what: str, *packages: str, otherwise: str = "") -> None:
    """Raise StudyError if a package is not installed that something needs; `otherwise` is another way out."""
    missing = [package for package in packages if importlib.util.find_spec(package) is None]
    if missing:
        raise StudyError(
            f"{what} needs the Python package {' and '.join(missing)}, which is not installed: "
            f"`{sys.executable} -m pip install {' '.join(missing)}`{otherwise}"
        )

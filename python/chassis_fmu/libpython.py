"""The shared library of this Python, which FMUs made with Python need in a process that is not Python."""

from __future__ import annotations

import sysconfig
from pathlib import Path


def find() -> Path | None:
    """Return the library; None if this Python has none."""
    name = sysconfig.get_config_var("INSTSONAME") or ""
    folder = Path(sysconfig.get_config_var("LIBDIR") or "/")
    candidates = [folder / name, folder / (sysconfig.get_config_var("MULTIARCH") or "") / name]
    return next((c for c in candidates if ".so" in name and c.is_file()), None)

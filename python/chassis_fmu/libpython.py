"""The shared library of this Python. FMUs made with Python need it in processes that do not run Python."""

from __future__ import annotations

import sysconfig
from pathlib import Path


def find() -> Path | None:
    """Return the path of the library; None if this Python is linked statically."""
    name = sysconfig.get_config_var("INSTSONAME") or ""
    folder = Path(sysconfig.get_config_var("LIBDIR") or "/")
    candidates = [folder / name, folder / (sysconfig.get_config_var("MULTIARCH") or "") / name]
    return next((c for c in candidates if ".so" in name and c.is_file()), None)

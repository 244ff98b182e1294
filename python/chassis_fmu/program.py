"""Finds the native program `chassis`, which executes FMUs in separate processes, and the library of this Python."""

from __future__ import annotations

import os
import shutil
import sys
import sysconfig
from pathlib import Path

PACKAGE = Path(__file__).resolve().parent
ROOT = PACKAGE.parents[1]


class ProgramError(Exception):
    """The program was not found."""


def find() -> Path:
    """Return the program from this package, from its repository (the latest build), or from the PATH."""
    name = "chassis.exe" if sys.platform == "win32" else "chassis"
    # The profile that scripts/build uses, if the user has chosen one.
    chosen = os.environ.get("CHASSIS_PROFILE")
    folders = ("debug" if chosen == "dev" else chosen,) if chosen else ("debug", "release")
    builds = [build for folder in folders if (build := ROOT / "target" / folder / name).is_file()]
    places = [PACKAGE / "bin" / name, *sorted(builds, key=lambda build: build.stat().st_mtime, reverse=True)]
    # The Python command `chassis` of this environment has the same name, and would call itself.
    own = Path(sys.executable).with_name(name)
    on_path = shutil.which(name)
    if on_path is not None and Path(on_path) != own:
        places.append(Path(on_path))
    found = next((place for place in places if place.is_file()), None)
    if found is None:
        raise ProgramError(
            f"cannot find the program {name}, which executes FMUs in separate processes: install the wheel, "
            "run `scripts/build` in the repository, or put the program on the PATH"
        )
    return found


def python_library() -> Path | None:
    """Return the shared library of this Python, which FMUs made with Python need in processes that do not run Python.

    None if this Python is linked statically.
    """
    name = sysconfig.get_config_var("INSTSONAME") or ""
    folder = Path(sysconfig.get_config_var("LIBDIR") or "/")
    candidates = [folder / name, folder / (sysconfig.get_config_var("MULTIARCH") or "") / name]
    return next((c for c in candidates if ".so" in name and c.is_file()), None)

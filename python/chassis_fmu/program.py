"""The program `chassis`, which executes FMUs in processes of its own."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

PACKAGE = Path(__file__).resolve().parent
ROOT = PACKAGE.parents[1]


class ProgramError(Exception):
    """The program is not there."""


def find() -> Path:
    """Return the program of this package, of the repository that it is installed from, or on the PATH."""
    name = "chassis.exe" if sys.platform == "win32" else "chassis"
    places = [PACKAGE / "bin" / name, ROOT / "target" / "release" / name]
    # The command of this environment, which calls the program, has its name.
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

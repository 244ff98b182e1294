"""The command `chassis` (also `python -m chassis_fmu`): starts the native program, which calls Python for pages."""

from __future__ import annotations

import os
import subprocess
import sys

from .program import ProgramError, find, python_library


def main() -> int:
    """Replace this process by the program, or run it where that is impossible; returns its exit code."""
    try:
        program = find()
    except ProgramError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    # FMUs made with Python use this Python.
    os.environ.setdefault("PYTHONHOME", sys.base_prefix)
    os.environ["CHASSIS_PYTHON"] = sys.executable
    library = python_library()
    if library is not None:
        os.environ.setdefault("CHASSIS_LIBPYTHON", str(library))
    if os.name == "posix":
        os.execv(program, ["chassis", *sys.argv[1:]])
    return subprocess.run([program, *sys.argv[1:]], check=False).returncode


if __name__ == "__main__":
    sys.exit(main())

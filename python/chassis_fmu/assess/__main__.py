"""`python -m chassis_fmu.assess FOLDER COMMAND`: the page of an assessment, for `chassis bench run`."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

from ..terminal import escaped
from . import report
from .assessment import AssessmentError, Folder


def main(argv: Sequence[str] | None = None) -> int:
    """Make the page of an assessment. `argv` is `FOLDER COMMAND`: its folder, and the command that repeats it."""
    folder, command = sys.argv[1:] if argv is None else argv
    place = Folder(Path(folder))
    try:
        print(report.write(place.read(), place, command))
    except (AssessmentError, OSError) as error:
        print(f"error: {escaped(error)}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())

"""Runs in another tool what `cargo fmu system` wrote: `scripts/run_system.py FOLDER --tool TOOL`, see `--help`.

Ecos reads the SSP file, libcosim OspSystemStructure.xml or, with `-ssp`, the SSP file; with `-calls` the same structure
is built by calls of their libraries.
The tool `container` runs nothing: it packs the system into one FMU.

Exit codes: 0 done, 1 the tool could not load or run the system, 2 wrong usage, 3 the tool's Python package or a library
of the system that it needs cannot be loaded.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Literal

import numpy as np

from chassis_fmu import systems
from chassis_fmu.master import RunError
from chassis_fmu.results import write_csv

# What libcosim makes its execution from.
LIBCOSIM: dict[str, Literal["osp", "ssp", "calls"]] = {
    "libcosim": "osp",
    "libcosim-ssp": "ssp",
    "libcosim-calls": "calls",
}
TOOLS = ("fmpy", "ecos", "ecos-calls", *LIBCOSIM, "container")


def main() -> int:
    """Run the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, help="what `cargo fmu system --out FOLDER` wrote")
    parser.add_argument("--tool", required=True, choices=TOOLS)
    parser.add_argument(
        "--order",
        choices=("sequential", "jacobi"),
        default="sequential",
        help="of the units within a step, fmpy and container only; the others step all at once (jacobi)",
    )
    parser.add_argument(
        "--out", type=Path, help="CSV file, or FMU [default: FOLDER-TOOL.csv or .fmu beside the folder]"
    )
    arguments = parser.parse_args()
    folder: Path = arguments.folder
    suffix = "fmu" if arguments.tool == "container" else "csv"
    out: Path = arguments.out or folder.with_name(f"{folder.name}-{arguments.tool}.{suffix}")
    try:
        if arguments.tool == "container":
            systems.container(folder, out, arguments.order)
            print(out)
            return 0
        if arguments.tool == "fmpy":
            recording = systems.with_fmpy(folder, arguments.order)
        elif arguments.tool.startswith("ecos"):
            recording = systems.with_ecos(folder, calls=arguments.tool == "ecos-calls")
        else:
            recording = systems.with_libcosim(folder, LIBCOSIM[arguments.tool])
    except systems.NotLoadedError as error:
        print(f"error: {error}", file=sys.stderr)
        return 3
    except (systems.StructureError, RunError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    signals = recording.values
    write_csv(out, list(signals), recording.times, np.column_stack(list(signals.values())))
    print(f"{len(recording.times)} rows of {len(signals)} signals: {out}")
    return 0


if __name__ == "__main__":
    sys.exit(main())

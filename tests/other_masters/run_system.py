"""Run a system from `chassis export` in another tool: `run_system.py FOLDER --tool TOOL`, see `--help`.

Ecos reads the SSP file. libcosim reads OspSystemStructure.xml or, with `-ssp`, the SSP file. With `-calls`, this script
builds the same structure with calls to the library of the tool. The tool `container` runs nothing: it packs the system
into one FMU.

Exit codes: 0 success, 1 the tool could not load or run the system, 2 wrong usage, 3 the tool's Python package or a
library that it needs cannot be loaded.

"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np

import exported_system
from chassis_fmu.execution.master import RunError
from chassis_fmu.files.results import Recording, write_csv
from chassis_fmu.terminal import escaped

# The tools that step all components at once.
JACOBI: dict[str, Callable[[Path], Recording]] = {
    "ecos": exported_system.with_ecos,
    "ecos-calls": partial(exported_system.with_ecos, calls=True),
    "libcosim": exported_system.with_libcosim,
    "libcosim-ssp": partial(exported_system.with_libcosim, source="ssp"),
    "libcosim-calls": partial(exported_system.with_libcosim, source="calls"),
}
TOOLS = ("fmpy", *JACOBI, "container")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, help="folder written by `chassis export --out FOLDER`")
    parser.add_argument("--tool", required=True, choices=TOOLS, help="tool to use")
    parser.add_argument(
        "--order",
        choices=("sequential", "jacobi"),
        help="order of the components within a step (default: sequential with fmpy and container, jacobi with others)",
    )
    parser.add_argument(
        "--out", type=Path, help="CSV file or FMU (default: FOLDER-TOOL.csv or FOLDER_container.fmu beside the folder)"
    )
    arguments = parser.parse_args()
    folder: Path = arguments.folder
    has_choice = arguments.tool not in JACOBI
    if arguments.order == "sequential" and not has_choice:
        parser.error(f"{arguments.tool} steps all components at once and supports only --order jacobi")
    order: exported_system.Order = arguments.order or ("sequential" if has_choice else "jacobi")
    # The file name of an FMU becomes an identifier, so it has no dash.
    name = f"{folder.name}_container.fmu" if arguments.tool == "container" else f"{folder.name}-{arguments.tool}.csv"
    out: Path = arguments.out or folder.with_name(name)
    try:
        if arguments.tool == "container":
            exported_system.container(folder, out, order)
            print(f"{order}: {out}")
            return 0
        recording = exported_system.with_fmpy(folder, order) if has_choice else JACOBI[arguments.tool](folder)
    except exported_system.NotLoadedError as error:
        print(f"error: {escaped(error)}", file=sys.stderr)
        return 3
    except (exported_system.StructureError, RunError, OSError) as error:
        print(f"error: {escaped(error)}", file=sys.stderr)
        return 1
    signals = recording.values
    write_csv(out, list(signals), recording.times, np.column_stack(list(signals.values())))
    print(f"{order}, {len(recording.times)} rows of {len(signals)} signals: {out}")
    return 0


if __name__ == "__main__":
    sys.exit(main())

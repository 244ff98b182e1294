"""Compare the time of a scenario in the native master and in FMPy: `scripts/bench masters`, see `--help`.

The commands run alternately, so that other load on the machine affects all of them. Compare the medians.
"""

from __future__ import annotations

import argparse
import statistics
import sys
from collections.abc import Sequence
from pathlib import Path

from chassis_fmu.program import ROOT
from measuring import positive, run


def commands(scenario: Path, out: Path, more: Sequence[str]) -> dict[str, list[str]]:
    """Return the timed commands: the native master alone, and each master with tables, figures and page."""
    run = [sys.executable, "-m", "chassis_fmu", "run", str(scenario), *more]
    return {
        "native master": [*run, "--no-page", "--out", str(out / "native")],
        "native master and page": [*run, "--out", str(out / "native-page")],
        "fmpy master and page": [*run, "--engine", "fmpy", "--out", str(out / "fmpy-page")],
    }


def table(times: dict[str, list[float]]) -> str:
    """Return a line for each command: median, fastest and slowest time, ratio of its median to the first command's."""
    first = statistics.median(next(iter(times.values())))
    lines = [f"{'':24}{'median':>10}{'fastest':>10}{'slowest':>10}{'ratio':>8}"]
    for name, seconds in times.items():
        median = statistics.median(seconds)
        cells = "".join(f"{value:>8.1f} s" for value in (median, min(seconds), max(seconds)))
        lines.append(f"{name:24}{cells}{median / first:>8.1f}")
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(prog="scripts/bench masters", description=__doc__.splitlines()[0])
    parser.add_argument(
        "scenario", type=Path, metavar="SCENARIO", help="scenario file (default: the step steer of the rescue vehicle)"
    )
    parser.add_argument("--rounds", type=positive, default=3, metavar="N", help="runs of each command (default: 3)")
    parser.add_argument("--stop", metavar="T", help="override the scenario's stop time, in seconds")
    parser.add_argument("--seeds", metavar="N", help="use only the first N seeds")
    options = parser.parse_args()
    more = [text for key in ("stop", "seeds") if (value := getattr(options, key)) for text in (f"--{key}", value)]
    timed = commands(options.scenario.resolve(), ROOT / "target" / "bench", more)
    times: dict[str, list[float]] = {name: [] for name in timed}
    for _ in range(options.rounds):
        for name, command in timed.items():
            times[name].append(run(command).seconds)
    print(table(times))


if __name__ == "__main__":
    main()

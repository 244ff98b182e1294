"""Compare the time of this `chassis` with that of another commit: `scripts/bench workers`, see `--help`.

Both programs run the same scenario and the same study with the same FMUs, alternately, so that other load on the
machine affects both. CPU time is the user and system time of all processes. The result files must be identical. With
`--other-fmus`, the other program uses other FMUs: the ratio then includes both changes, and results are not compared.
"""

from __future__ import annotations

import argparse
import filecmp
import statistics
from collections.abc import Sequence
from pathlib import Path

from chassis_fmu.program import ROOT
from measuring import Measured, positive, run

SCENARIO = ROOT / "scenarios" / "rescue_vehicle_step_steer.toml"
STUDY = ROOT / "studies" / "hydro_pneumatic_ride.toml"
FMUS = ROOT / "target" / "fmu"
OURS = ROOT / "target" / "release" / "chassis"


def commands(program: Path, out: Path, fmus: Path = FMUS) -> dict[str, list[str]]:
    """Return the timed commands of a program: a scenario and a study."""
    more = ["--jobs", "2", "--fmus", str(fmus), "--out", str(out)]
    return {
        "run": [str(program), "run", str(SCENARIO), *more],
        "study": [str(program), "study", str(STUDY), "--budget", "30", "--overwrite", *more],
    }


def differing(first: Path, second: Path) -> list[str]:
    """Return the files below the two folders that differ or exist in only one of them."""
    names = {p.relative_to(folder) for folder in (first, second) for p in folder.rglob("*") if p.is_file()}
    same = [n for n in names if (first / n).is_file() and (second / n).is_file()]
    equal = {n for n in same if filecmp.cmp(first / n, second / n, shallow=False)}
    return sorted(str(n) for n in names - equal)


def line(name: str, pairs: Sequence[tuple[float, float]]) -> str:
    """Return a line: number of pairs, median time of each program, median and quartiles of the ratios in the pairs."""
    other, ours = zip(*pairs, strict=True)
    ratios = [b / a for a, b in pairs]
    low, middle, high = statistics.quantiles(ratios, n=4, method="inclusive")
    medians = f"{statistics.median(other):>8.2f} s{statistics.median(ours):>8.2f} s"
    return f"{name:10}{len(pairs):>6}{medians}{middle:>8.3f}   ({low:.3f} to {high:.3f})"


def main() -> None:
    parser = argparse.ArgumentParser(prog="scripts/bench workers", description=__doc__.splitlines()[0])
    parser.add_argument("other", type=Path, metavar="PROGRAM", help="chassis of another commit")
    parser.add_argument(
        "--rounds", type=positive, default=20, metavar="N", help="pairs of runs of each command (default: 20)"
    )
    parser.add_argument("--other-fmus", type=Path, metavar="DIR", help="folder with FMUs of another commit for PROGRAM")
    parser.add_argument("--only", choices=["run", "study"], help="measure only this command")
    options = parser.parse_args()
    out = ROOT / "target" / "bench"
    fmus = FMUS if options.other_fmus is None else options.other_fmus.resolve()
    other, ours = commands(options.other.resolve(), out / "other", fmus), commands(OURS, out / "ours")
    print(f"{'':10}{'pairs':>6}{'other':>10}{'ours':>10}{'ratio':>8}   (quartiles)")
    for name in [options.only] if options.only else ours:
        pairs: list[tuple[Measured, Measured]] = []
        # The first pair is a warm-up. The programs take turns in running first.
        for turn in range(options.rounds + 1):
            order = [other[name], ours[name]] if turn % 2 else [ours[name], other[name]]
            times = {command[0]: run(command) for command in order}
            if turn:
                pairs.append((times[other[name][0]], times[ours[name][0]]))
        print(line(f"{name} CPU", [(a.cpu, b.cpu) for a, b in pairs]), flush=True)
        print(line(f"{name} wall", [(a.seconds, b.seconds) for a, b in pairs]), flush=True)
    if options.other_fmus is None and (files := differing(out / "other", out / "ours")):
        raise SystemExit(f"error: results differ: {', '.join(files)}")


if __name__ == "__main__":
    main()

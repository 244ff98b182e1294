"""Measure the overhead of a study: `scripts/bench studies`, see `--help`.

The runs are the step steer of the rescue vehicle (eight FMUs, steps of 1 ms): all 20 s in the part `closed_loop`, the
first seven seconds in the others, which take about 20 ms. Compared commands run alternately in pairs. The results are
medians of the ratios in these pairs, for wall time and for CPU time, on which other processes have less influence.
"""

from __future__ import annotations

import argparse
import os
import re
import sys
from collections.abc import Iterator, Sequence
from itertools import chain
from pathlib import Path
from typing import Any

import pyarrow.parquet

from chassis_fmu.program import ROOT
from measuring import Measured, positive, run

PROCESSORS = len(os.sched_getaffinity(0)) if sys.platform == "linux" else os.cpu_count() or 1
SCENARIO = ROOT / "scenarios" / "rescue_vehicle_step_steer.toml"
FOLDER = ROOT / "target" / "bench" / "studies"

# Number of runs in the compared calls. The difference between the two excludes the time that every call takes once.
MANY, FEW = 96, 16

# Makes runs of about 20 ms.
SHORT = 'stop = 7.0\ncases = ["coordination"]\n'

VARY = """
[[vary]]
name = "mass"
variable = "plant:vehicle.mass"
distribution = "uniform"
min = 28.0e3
max = 38.0e3

[[vary]]
name = "road"
variable = "road:seed"
distribution = "seed"
"""


def row(*cells: str) -> str:
    return f"| {' | '.join(cells)} |"


def ratios(pairs: Sequence[tuple[Measured, Measured]]) -> str:
    """Return median and range of the ratios of the first to the second time, for wall time and CPU time."""
    texts = []
    for name, of in (("wall", [a.seconds / b.seconds for a, b in pairs]), ("CPU", [a.cpu / b.cpu for a, b in pairs])):
        of.sort()
        texts.append(f"{name} time {of[len(of) // 2]:.3f} ({of[0]:.3f} to {of[-1]:.3f})")
    return ", ".join(texts)


def less(many: Measured, few: Measured) -> Measured:
    """Return the difference between two calls, which excludes the time that every call takes once."""
    return Measured(many.seconds - few.seconds, many.cpu - few.cpu, many.memory)


def write_study(name: str, lines: str) -> Path:
    path = FOLDER / f"{name}.toml"
    scenario = os.path.relpath(SCENARIO, FOLDER)
    head = f'title = "Benchmark"\nscenario = "{scenario}"\nmethod = "sample"\ndesign = "random"\n'
    path.write_text(head + lines + VARY, encoding="utf-8")
    return path


def study(path: Path, runs: int, *more: str) -> Measured:
    command = [sys.executable, "-m", "chassis_fmu", "study", str(path), "--runs", str(runs)]
    given = more if "--report-only" in more else ("--overwrite", *more)
    return run([*command, "--no-fail", "--out", str(FOLDER / "results"), *given])


def seconds_of_runs(path: Path) -> float:
    """Return the sum of the times of all runs of a study, as measured in the worker processes, s."""
    table = pyarrow.parquet.read_table(FOLDER / "results" / path.stem / "timing.parquet")
    return float(sum(table.column("seconds").to_pylist()))


def size(path: Path, name: str) -> int:
    """Return the size of a results file of a study, bytes."""
    return (FOLDER / "results" / path.stem / name).stat().st_size


def of_metrics() -> Path:
    """Write the scenario with enough seeds for `MANY` runs, recording only the signals of its metrics."""
    text = SCENARIO.read_text(encoding="utf-8").partition("[[figure]]")[0]
    seeds = ", ".join(str(seed) for seed in range(1, MANY // 2 + 1))
    signals = ", ".join(f'"{name}"' for name in re.findall(r'^signal = "(.*)"$', text, re.MULTILINE))
    text = re.sub(r"values = \[[\d, ]*\]", f"values = [{seeds}]", text, count=1)
    text = re.sub(r"signals = \[.*\]", f"signals = [{signals}]", text, count=1)
    path = FOLDER / "metrics_only.toml"
    path.write_text(text, encoding="utf-8")
    return path


def closed_loop(runs: int, rounds: int) -> Iterator[str]:
    """Compare a study with `chassis run`, which also writes the signals to files."""
    path = write_study("closed_loop", "")
    native = [str(ROOT / "target" / "release" / "chassis"), "run", str(of_metrics()), "--no-page", "--no-warnings"]
    native += ["--out", str(FOLDER / "results")]
    jobs = PROCESSORS
    pairs = []
    for _ in range(rounds):
        # Each sample has two cases, and so does each seed of `chassis run`.
        few, many = (study(path, count // 2) for count in (FEW, MANY))
        native_few, native_many = (run([*native, "--seeds", str(count // 2)]) for count in (FEW, MANY))
        pairs.append((less(native_many, native_few), less(many, few)))
    yield row("runs per second, study / `chassis run` with the signals of the metrics only", ratios(pairs))
    few, many = (study(path, count // 2) for count in (FEW, runs))
    inside = seconds_of_runs(path)
    took = f"{many.seconds:.1f} s, {runs / many.seconds:.2f} runs/s"
    memory = f"{few.memory / 1e6:.0f}, {many.memory / 1e6:.0f} MB"
    yield row(f"study of {runs} runs of 20 s, {jobs} processes", took)
    yield row("time of the runs themselves / time of the processes", f"{inside / (jobs * many.seconds):.3f}")
    yield row(f"memory of the largest process, {FEW} and {runs} runs", memory)
    yield row("`runs.parquet`, bytes per run", f"{size(path, 'runs.parquet') / runs:.0f}")


def growth(counts: Sequence[int]) -> Iterator[str]:
    """Show how time, memory and file sizes grow with the number of short runs."""
    path = write_study("short", SHORT)
    jobs = PROCESSORS
    header = ("time, s", "of a run, ms", "beyond the runs, ms per run", "tables and page, s", "memory, MB")
    yield row("short runs", *header, "journal, bytes per run", "`runs.parquet`, bytes per run")
    yield "|---|---|---|---|---|---|---|---|"
    for count in counts:
        done = study(path, count)
        inside = seconds_of_runs(path)
        page = study(path, count, "--report-only")
        beyond = (done.seconds - page.seconds - inside / jobs) / count
        yield row(
            str(count),
            f"{done.seconds:.1f}",
            f"{1e3 * inside / count:.1f}",
            f"{1e3 * beyond:.3f}",
            f"{page.seconds:.1f}",
            f"{max(done.memory, page.memory) / 1e6:.0f}",
            *(f"{size(path, name) / count:.0f}" for name in ("rows.jsonl", "runs.parquet")),
        )


def with_dask(runs: int, rounds: int) -> Iterator[str]:
    """Compare Dask with the processes of this machine."""
    path = write_study("short", SHORT)
    for jobs in dict.fromkeys((1, PROCESSORS)):
        pairs = []
        for _ in range(rounds):
            found = []
            for engine in ("dask", "local"):
                # Both calls include start-up, tables and page, so the difference excludes these.
                options = (*(("--dask",) if engine == "dask" else ()), "--jobs", str(jobs))
                few, many = (study(path, count, *options) for count in (runs // 10, runs))
                found.append(less(many, few))
            pairs.append((found[0], found[1]))
        each = 1e3 * seconds_of_runs(path) / runs
        workers = "one worker" if jobs == 1 else f"{jobs} workers"
        yield row(
            f"{runs - runs // 10} runs of {each:.0f} ms, Dask / processes of this machine, {workers}",
            ratios(pairs),
        )


PARTS = ("closed_loop", "growth", "dask")


def main() -> None:
    parser = argparse.ArgumentParser(
        prog="scripts/bench studies",
        description=(__doc__ or "").splitlines()[0],
        formatter_class=argparse.ArgumentDefaultsHelpFormatter,
    )
    counts: dict[str, Any] = {"type": positive, "metavar": "N"}
    parser.add_argument("--parts", choices=PARTS, nargs="+", default=PARTS, help="parts to measure")
    parser.add_argument("--runs", default=1000, help="number of runs of the closed loop", **counts)
    parser.add_argument("--growth", nargs="+", default=[1000, 10_000], help="numbers of short runs", **counts)
    parser.add_argument("--dask", default=1000, help="number of runs with Dask", **counts)
    parser.add_argument("--rounds", default=3, help="number of comparisons", **counts)
    options = parser.parse_args()
    FOLDER.mkdir(parents=True, exist_ok=True)
    tables = {
        "closed_loop": ("| closed loop | |\n|---|---|", closed_loop(options.runs, options.rounds)),
        "growth": ("", growth(options.growth)),
        "dask": ("| Dask | |\n|---|---|", with_dask(options.dask, options.rounds)),
    }
    for head, lines in (tables[part] for part in PARTS if part in options.parts):
        for line in chain([head], lines):
            print(line, flush=True)


if __name__ == "__main__":
    main()

"""Measures what a study costs beyond its runs: `scripts/bench studies`, see `--help`.

The runs are those of the step steer of the rescue vehicle (eight FMUs, steps of 1 ms): 20 s of it as the closed loop,
the first second as a short run of about 6 ms. A command that is compared with another one runs in turn with it.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import os
import pickle
import re
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import pyarrow.parquet

from chassis_fmu.scenario import Outcome, processors
from chassis_fmu.shell import ROOT, positive
from chassis_fmu.study import cluster, file
from chassis_fmu.study.job import Job
from chassis_fmu.study.journal import Journal

SCENARIO = ROOT / "scenarios" / "rescue_vehicle_step_steer.toml"
FOLDER = ROOT / "target" / "bench" / "studies"

# Runs of `cargo fmu run`, which writes 4 MB for each.
WRITTEN = 64

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
    """Return a row of a table."""
    return f"| {' | '.join(cells)} |"


class Measured(NamedTuple):
    """Time a command took (s), and the memory of its largest process (bytes)."""

    seconds: float
    memory: int


def run(command: Sequence[str]) -> Measured:
    """Run a command to its end."""
    begin = time.perf_counter()
    with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE) as process:
        assert process.stderr is not None
        message = process.stderr.read()
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode != 0:
        text = message.decode(errors="replace")
        raise SystemExit(f"{text}error: {' '.join(command)}: exit code {process.returncode}")
    return Measured(time.perf_counter() - begin, 1024 * usage.ru_maxrss)


def write_study(name: str, lines: str) -> Path:
    """Write a study of the step steer."""
    path = FOLDER / f"{name}.toml"
    scenario = os.path.relpath(SCENARIO, FOLDER)
    head = f'title = "Benchmark"\nscenario = "{scenario}"\nmethod = "sample"\ndesign = "random"\n'
    path.write_text(head + lines + VARY, encoding="utf-8")
    return path


def study(path: Path, runs: int, *more: str) -> Measured:
    """Carry out a study."""
    command = [sys.executable, str(ROOT / "scripts" / "study.py"), str(path), "--runs", str(runs)]
    given = more if "--report-only" in more else ("--overwrite", *more)
    return run([*command, "--no-fail", "--out", str(FOLDER / "results"), *given])


def seconds_of_runs(path: Path) -> float:
    """Return the time that the runs of a study took in their processes, s."""
    table = pyarrow.parquet.read_table(FOLDER / "results" / path.stem / "timing.parquet")
    return float(sum(table.column("seconds").to_pylist()))


def size(path: Path, name: str) -> int:
    """Return the size of a table of a study, bytes."""
    return (FOLDER / "results" / path.stem / name).stat().st_size


def closed_loop(runs: int) -> Iterator[str]:
    """Compare the rate of a study with that of `cargo fmu run`, which also writes the signals."""
    path = write_study("closed_loop", "")
    seeds = ", ".join(str(seed) for seed in range(1, WRITTEN // 2 + 1))
    text = SCENARIO.read_text(encoding="utf-8")
    scenario = FOLDER / "closed_loop_scenario.toml"
    scenario.write_text(re.sub(r"values = \[[\d, ]*\]", f"values = [{seeds}]", text, count=1), encoding="utf-8")
    jobs = processors()
    # Two cases each. The difference of two calls leaves out what every call takes once.
    few = study(path, WRITTEN // 4)
    native = ["cargo", "fmu", "run", str(scenario), "--no-warnings", "--out", str(FOLDER / "results")]
    native_few = run([*native, "--seeds", str(WRITTEN // 4)])
    native_all = run(native)
    many = study(path, runs // 2)
    inside = seconds_of_runs(path)
    rate = (runs - WRITTEN // 2) / (many.seconds - few.seconds)
    native_rate = (WRITTEN // 2) / (native_all.seconds - native_few.seconds)
    took = f"{many.seconds:.1f} s, {runs / many.seconds:.2f} runs/s"
    memory = f"{few.memory / 1e6:.0f}, {many.memory / 1e6:.0f} MB"
    yield row(f"study of {runs} runs of 20 s, {jobs} processes", took)
    yield row("time of the runs themselves, to time of the processes", f"{inside / (jobs * many.seconds):.3f}")
    yield row("runs per second without start-up, to `cargo fmu run`", f"{rate / native_rate:.2f}")
    yield row(f"memory of the largest process, {WRITTEN // 2} and {runs} runs", memory)
    yield row("`runs.parquet`, bytes per run", f"{size(path, 'runs.parquet') / runs:.0f}")


def growth(counts: Sequence[int]) -> Iterator[str]:
    """Show how the costs grow with the number of short runs."""
    path = write_study("short", 'stop = 1.0\ncases = ["coordination"]\n')
    jobs = processors()
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
    path = write_study("short", 'stop = 1.0\ncases = ["coordination"]\n')
    ratios = []
    for _ in range(rounds):
        times = {}
        for engine in ("local", "dask"):
            # Start-up, tables and page are in both.
            few, many = (study(path, count, "--engine", engine).seconds for count in (runs // 10, runs))
            times[engine] = many - few
        ratios.append(times["dask"] / times["local"])
    ratios.sort()
    middle = ratios[len(ratios) // 2]
    found = f"{middle:.3f} ({ratios[0]:.3f} to {ratios[-1]:.3f})"
    yield row(f"time of {runs - runs // 10} short runs with Dask, to processes of this machine", found)


def _echo(_content: bytes, samples: Sequence[object]) -> Sequence[object]:
    return samples


def overheads() -> Iterator[str]:
    """Measure the parts of a study that runs at other machines cost this one."""
    import distributed

    dask: Any = distributed
    path = write_study("short", 'stop = 1.0\ncases = ["coordination"]\n')
    job = Job(file.read(path), path, [ROOT / "target" / "fmu"])
    task = job.task(0, {"mass": 3e4, "road": 5})
    outcome = Outcome(0, task.sample.runs[0], (0.123456789012345,) * 5, "ok", None, None, None, None, 0.0205)
    content = cluster.bundle(job)
    with (
        dask.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as here,
        dask.Client(here) as client,
    ):
        begin = time.perf_counter()
        client.scatter(os.urandom(50_000_000), broadcast=True, hash=True)
        scattered = time.perf_counter() - begin
        data = client.submit(cluster.keep, content)
        batches = 2000
        for each in (1, 50):
            samples = [task.sample] * each
            begin = time.perf_counter()
            futures = [client.submit(_echo, data, samples, pure=False) for _ in range(batches)]
            client.gather(futures)
            taken = time.perf_counter() - begin
            of = f"an empty batch of {each} {'sample' if each == 1 else 'samples'}, two workers"
            yield row(of, f"{1e3 * taken / batches:.2f} ms")
            del futures
    sizes = f"{len(pickle.dumps(task.sample))}, {len(pickle.dumps(outcome))} bytes"
    yield row("50 MB to two workers", f"{scattered:.2f} s")
    yield row("bundle of scenario and FMUs", f"{len(content) / 1e6:.2f} MB")
    yield row("a sample, and a row, on their way", sizes)
    count = 100_000
    begin = time.perf_counter()
    tasks = [job.task(number, {"mass": 3e4, "road": number}) for number in range(count)]
    yield row("to make a sample", f"{1e6 * (time.perf_counter() - begin) / count:.1f} µs")
    del tasks
    target = FOLDER / "journal.jsonl"
    target.unlink(missing_ok=True)
    with Journal(target, "benchmark", None, resume=False) as journal:
        begin = time.perf_counter()
        for number in range(count):
            done = job.done(task, outcome)
            journal.add(dataclasses.replace(done, number=number))
        taken = time.perf_counter() - begin
    yield row("to take a row and write it down", f"{1e6 * taken / count:.1f} µs")
    lines = target.read_text(encoding="utf-8").splitlines()
    begin = time.perf_counter()
    json.loads("[" + ",".join(lines[1:]) + "]")
    yield row("to read a row again", f"{1e6 * (time.perf_counter() - begin) / count:.1f} µs")


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; returns its exit code."""
    parser = argparse.ArgumentParser(prog="scripts/bench studies", description=__doc__.splitlines()[0])
    parser.add_argument(
        "--runs", type=positive, default=1000, metavar="N", help="runs of the closed loop (default: 1000)"
    )
    parser.add_argument(
        "--growth",
        type=positive,
        nargs="+",
        default=[1000, 10_000],
        metavar="N",
        help="numbers of short runs (default: 1000 10000)",
    )
    parser.add_argument("--rounds", type=positive, default=3, metavar="N", help="comparisons with Dask (default: 3)")
    options = parser.parse_args(argv)
    if options.runs <= WRITTEN:
        parser.error(f"--runs has to be more than {WRITTEN}")
    FOLDER.mkdir(parents=True, exist_ok=True)
    for head, part in (
        ("| closed loop | |\n|---|---|", closed_loop(options.runs)),
        ("", growth(options.growth)),
        ("| Dask | |\n|---|---|", with_dask(10 * options.growth[0], options.rounds)),
        ("| part | |\n|---|---|", overheads()),
    ):
        print(head, flush=True)
        for line in part:
            print(line, flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())

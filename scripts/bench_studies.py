"""Measure the cost of a study beyond its runs: `scripts/bench studies`, see `--help`.

The runs are those of the step steer of the rescue vehicle (eight FMUs, steps of 1 ms): 20 s of it as the closed loop,
the first seven seconds as a short run of about 20 ms. Commands that are compared run in turn, and ratios are medians of
these pairs, of wall time and of CPU time, which other work on the machine disturbs less.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import os
import pickle
import re
import statistics
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import fmpy
import fmpy.fmi2
import pyarrow.parquet

from chassis_fmu.program import ROOT
from chassis_fmu.scenario import Outcome, Scenario, processors
from chassis_fmu.shell import positive
from chassis_fmu.study import bundle, file
from chassis_fmu.study.job import Job
from chassis_fmu.study.journal import Journal
from measuring import Measured, run

SCENARIO = ROOT / "scenarios" / "rescue_vehicle_step_steer.toml"
FOLDER = ROOT / "target" / "bench" / "studies"

# Runs of `chassis run` and of a study that are compared with each other, and those that show what a call takes once.
MANY, FEW = 96, 16

# Of about 20 ms each.
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
    """Return a row of a table."""
    return f"| {' | '.join(cells)} |"


def ratios(pairs: Sequence[tuple[Measured, Measured]]) -> str:
    """Return median and range of the first to the second time, of wall time and of CPU time."""
    texts = []
    for name, of in (("wall", [a.seconds / b.seconds for a, b in pairs]), ("CPU", [a.cpu / b.cpu for a, b in pairs])):
        of.sort()
        texts.append(f"{name} time {of[len(of) // 2]:.3f} ({of[0]:.3f} to {of[-1]:.3f})")
    return ", ".join(texts)


def less(many: Measured, few: Measured) -> Measured:
    """Return the difference of two calls, which leaves out what every call takes once."""
    return Measured(many.seconds - few.seconds, many.cpu - few.cpu, many.memory)


def write_study(name: str, lines: str) -> Path:
    """Write a study of the step steer."""
    path = FOLDER / f"{name}.toml"
    scenario = os.path.relpath(SCENARIO, FOLDER)
    head = f'title = "Benchmark"\nscenario = "{scenario}"\nmethod = "sample"\ndesign = "random"\n'
    path.write_text(head + lines + VARY, encoding="utf-8")
    return path


def study(path: Path, runs: int, *more: str) -> Measured:
    """Carry out a study."""
    command = [sys.executable, "-m", "chassis_fmu", "study", str(path), "--runs", str(runs)]
    given = more if "--report-only" in more else ("--overwrite", *more)
    return run([*command, "--no-fail", "--out", str(FOLDER / "results"), *given])


def seconds_of_runs(path: Path) -> float:
    """Return the time that the runs of a study took in their processes, s."""
    table = pyarrow.parquet.read_table(FOLDER / "results" / path.stem / "timing.parquet")
    return float(sum(table.column("seconds").to_pylist()))


def size(path: Path, name: str) -> int:
    """Return the size of a table of a study, bytes."""
    return (FOLDER / "results" / path.stem / name).stat().st_size


def of_metrics() -> Path:
    """Write the scenario with enough seeds, and the signals of its metrics only."""
    text = SCENARIO.read_text(encoding="utf-8").partition("[[figure]]")[0]
    seeds = ", ".join(str(seed) for seed in range(1, MANY // 2 + 1))
    signals = ", ".join(f'"{name}"' for name in re.findall(r'^signal = "(.*)"$', text, re.MULTILINE))
    text = re.sub(r"values = \[[\d, ]*\]", f"values = [{seeds}]", text, count=1)
    text = re.sub(r"signals = \[.*\]", f"signals = [{signals}]", text, count=1)
    path = FOLDER / "metrics_only.toml"
    path.write_text(text, encoding="utf-8")
    return path


def closed_loop(runs: int, rounds: int) -> Iterator[str]:
    """Compare a study with `chassis run`, which also writes the signals."""
    path = write_study("closed_loop", "")
    native = [str(ROOT / "target" / "release" / "chassis"), "run", str(of_metrics()), "--no-page", "--no-warnings"]
    native += ["--out", str(FOLDER / "results")]
    jobs = processors()
    pairs = []
    for _ in range(rounds):
        # Two cases each.
        few, many = (study(path, count // 2) for count in (FEW, MANY))
        native_few, native_many = (run([*native, "--seeds", str(count // 2)]) for count in (FEW, MANY))
        pairs.append((less(native_many, native_few), less(many, few)))
    yield row("rate of a study, to that of `chassis run` with the signals of the metrics only", ratios(pairs))
    few, many = (study(path, count // 2) for count in (FEW, runs))
    inside = seconds_of_runs(path)
    took = f"{many.seconds:.1f} s, {runs / many.seconds:.2f} runs/s"
    memory = f"{few.memory / 1e6:.0f}, {many.memory / 1e6:.0f} MB"
    yield row(f"study of {runs} runs of 20 s, {jobs} processes", took)
    yield row("time of the runs themselves, to time of the processes", f"{inside / (jobs * many.seconds):.3f}")
    yield row(f"memory of the largest process, {FEW} and {runs} runs", memory)
    yield row("`runs.parquet`, bytes per run", f"{size(path, 'runs.parquet') / runs:.0f}")


def growth(counts: Sequence[int]) -> Iterator[str]:
    """Show how the costs grow with the number of short runs."""
    path = write_study("short", SHORT)
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
    path = write_study("short", SHORT)
    for jobs in dict.fromkeys((1, processors())):
        pairs = []
        for _ in range(rounds):
            found = []
            for engine in ("dask", "local"):
                # Start-up, tables and page are in both.
                options = (*(("--dask",) if engine == "dask" else ()), "--jobs", str(jobs))
                few, many = (study(path, count, *options) for count in (runs // 10, runs))
                found.append(less(many, few))
            pairs.append((found[0], found[1]))
        each = 1e3 * seconds_of_runs(path) / runs
        workers = "one worker" if jobs == 1 else f"{jobs} workers"
        yield row(
            f"{runs - runs // 10} runs of {each:.0f} ms with Dask, to processes of this machine, {workers}",
            ratios(pairs),
        )


def _echo(samples: Sequence[object]) -> Sequence[object]:
    return samples


def overheads() -> Iterator[str]:
    """Measure the parts of a study that runs at other machines cost this one."""
    import distributed

    dask: Any = distributed
    path = write_study("short", SHORT)
    folders = [ROOT / "target" / "fmu"]
    job = Job(file.read(path, folders), path, folders)
    task = job.task(0, {"mass": 3e4, "road": 5})
    outcome = Outcome(0, task.sample.runs[0], (0.123456789012345,) * 5, "ok", None, None, None, None, 0.0205)
    content = bundle.archive(job)
    with (
        dask.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as here,
        dask.Client(here) as client,
    ):
        begin = time.perf_counter()
        client.register_plugin(bundle.Bundle(content))
        sent = time.perf_counter() - begin
        batches = 2000
        for each in (1, 50):
            samples = [task.sample] * each
            begin = time.perf_counter()
            futures = [client.submit(_echo, samples, pure=False) for _ in range(batches)]
            client.gather(futures)
            taken = time.perf_counter() - begin
            of = f"an empty batch of {each} {'sample' if each == 1 else 'samples'}, two workers"
            yield row(of, f"{1e3 * taken / batches:.2f} ms")
            del futures
    sizes = f"{len(pickle.dumps(task.sample))}, {len(pickle.dumps(outcome))} bytes"
    yield row(f"scenario and FMUs, {len(content) / 1e6:.2f} MB, to two workers", f"{sent:.2f} s")
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


# Number of instances that are timed through FMPy, and the calls that are timed.
TIMES = 200
INSTANCES = ("instantiate and free, µs", "reset, µs", "initialize, µs")


def instances() -> Iterator[str]:
    """Measure what runs would save if they used the instances of the run before again, after a reset."""
    components = Scenario(SCENARIO).plan.runs[-1].components
    saved = 0.0
    for path in dict.fromkeys(component.fmu for component in components):
        with tempfile.TemporaryDirectory() as folder:
            fmpy.extract(str(path), folder)
            about = fmpy.read_model_description(folder)
            identifier = about.coSimulation.modelIdentifier
            fmu = fmpy.fmi2.FMU2Slave(guid=about.guid, unzipDirectory=folder, modelIdentifier=identifier)
            times: dict[str, list[float]] = {"instance": [], "initialization": [], "reset": []}
            for _ in range(TIMES):
                begin = time.perf_counter()
                fmu.instantiate()
                made = time.perf_counter()
                fmu.setupExperiment(startTime=0.0)
                fmu.enterInitializationMode()
                fmu.exitInitializationMode()
                ready = time.perf_counter()
                fmu.reset()
                reset = time.perf_counter()
                # Not `freeInstance` of FMPy, which unloads the library, too.
                fmu.fmi2FreeInstance(fmu.component)
                freed = time.perf_counter()
                for name, of in zip(times, (made - begin + freed - reset, ready - made, reset - ready), strict=True):
                    times[name].append(1e6 * of)
            # The process that has loaded it ends soon.
            instance, initialization, reset = (statistics.median(of) for of in times.values())
            saved += sum(component.fmu == path for component in components) * (instance - reset)
            yield row(f"`{path.stem}`", f"{instance:.0f}", f"{reset:.0f}", f"{initialization:.0f}")
    yield row("all components of a run, instance less reset", f"{saved:.0f}", "", "")


PARTS = ("closed_loop", "growth", "dask", "overheads", "instances")


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; returns its exit code."""
    parser = argparse.ArgumentParser(prog="scripts/bench studies", description=(__doc__ or "").splitlines()[0])
    parser.add_argument(
        "--parts",
        choices=PARTS,
        nargs="+",
        default=PARTS,
        metavar="PART",
        help=f"parts to measure, of {', '.join(PARTS)} (default: all)",
    )
    parser.add_argument(
        "--runs", type=positive, default=1000, metavar="N", help="number of runs of the closed loop (default: 1000)"
    )
    parser.add_argument(
        "--growth",
        type=positive,
        nargs="+",
        default=[1000, 10_000],
        metavar="N",
        help="numbers of short runs (default: 1000 10000)",
    )
    parser.add_argument(
        "--dask", type=positive, default=1000, metavar="N", help="number of runs with Dask (default: 1000)"
    )
    parser.add_argument("--rounds", type=positive, default=3, metavar="N", help="number of comparisons (default: 3)")
    options = parser.parse_args(argv)
    FOLDER.mkdir(parents=True, exist_ok=True)
    for part, head, lines in (
        ("closed_loop", "| closed loop | |\n|---|---|", closed_loop(options.runs, options.rounds)),
        ("growth", "", growth(options.growth)),
        ("dask", "| Dask | |\n|---|---|", with_dask(options.dask, options.rounds)),
        ("overheads", "| part | |\n|---|---|", overheads()),
        ("instances", f"| FMU | {' | '.join(INSTANCES)} |\n|---|---|---|---|", instances()),
    ):
        if part not in options.parts:
            continue
        print(head, flush=True)
        for line in lines:
            print(line, flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())

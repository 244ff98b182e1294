"""Executes the runs of a plan in parallel processes, with a progress bar over all of their steps."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
import threading
import time
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from multiprocessing.connection import Connection, wait
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from . import calls, master, results, temporary
from .calls import Board
from .plan import Plan, Run, Simulation

# Seconds between two messages of a run about its progress.
REPORT_INTERVAL = 0.2
# Seconds between two looks at what the processes are doing.
LOOK_INTERVAL = 0.1
# Seconds that a process has until its run begins, whatever the timeout of a step.
START_TIMEOUT = 60.0


@dataclass(frozen=True)
class _Task:
    run: Run
    simulation: Simulation
    names: tuple[str, ...]
    folders: Mapping[Path, Path]
    out: Path
    board: Board


@dataclass(frozen=True)
class _Verdict:
    """The end of a run: what went wrong, or what the components logged although nothing did."""

    error: str | None
    warnings: tuple[str, ...] = ()


@dataclass(frozen=True)
class Outcome:
    """Error messages of the runs that failed and messages of the components of the others, by run id."""

    failures: dict[str, str]
    warnings: dict[str, tuple[str, ...]]


@dataclass
class _Running:
    """A run in execution: its process, the steps it has reported, and since when its board has not changed."""

    run: Run
    process: Any
    board: Board
    done: int = 0
    pulse: int = 0
    since: float = field(default_factory=time.monotonic)

    def is_late(self, timeout: float) -> bool:
        """Whether a step takes longer than the timeout (s), or the start of the process too long."""
        if self.board.pulse != self.pulse:
            self.pulse, self.since = self.board.pulse, time.monotonic()
        return time.monotonic() - self.since > (timeout if self.pulse > 0 else max(timeout, START_TIMEOUT))

    def ended(self, how: str) -> _Verdict:
        """Say how the process ended, and in which call."""
        where = self.board.where()
        if where is None:
            return _Verdict(f"{how} outside of the FMUs")
        component, function, at = where
        return _Verdict(str(master.RunError(self.run.components[component].name, function, at, how)))


def _end_with_parent() -> None:
    """End this process when the one that started it does, whatever an FMU is doing."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        wait([parent.sentinel])
        os._exit(1)


def _execute(task: _Task, pipe: Connection) -> None:
    """Body of a process: simulates one run, writes its files, sends numbers of steps and in the end a verdict."""
    threading.Thread(target=_end_with_parent, daemon=True).start()
    # An interrupt from the keyboard reaches all processes; the first one ends the others.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    pending = 0
    last = time.monotonic()

    def progress(steps: int) -> None:
        nonlocal pending, last
        pending += steps
        if time.monotonic() - last >= REPORT_INTERVAL:
            pipe.send(pending)
            pending, last = 0, time.monotonic()

    try:
        times, rows = master.simulate(
            task.run,
            task.simulation,
            lambda component: master.FmpyInstance(component, task.folders[component.fmu]),
            progress,
            board=task.board,
        )
        present = [i for i, slot in enumerate(task.run.columns) if slot is not None]
        names = [task.names[i] for i in present]
        results.write_csv(task.out / f"{task.run.stem}.csv", names, times, rows)
        pipe.send(_Verdict(None, tuple(f"component {component}: {text}" for component, text in master.messages())))
    except master.RunError as error:
        pipe.send(_Verdict(str(error)))
    except Exception as error:
        pipe.send(_Verdict(f"{type(error).__name__}: {error}"))
    finally:
        pipe.close()


def _extract(plan: Plan, folder: Path) -> tuple[dict[Path, Path], dict[Path, str]]:
    """Extract every FMU of the plan once. Returns the folders, and the FMUs that could not be extracted."""
    folders: dict[Path, Path] = {}
    broken: dict[Path, str] = {}
    for run in plan.runs:
        for component in run.components:
            if component.fmu in folders or component.fmu in broken:
                continue
            target = folder / str(len(folders))
            try:
                fmpy.extract(str(component.fmu), str(target))
                folders[component.fmu] = target
            except Exception as error:  # fmpy raises bare Exceptions for illegal archives
                broken[component.fmu] = f"{type(error).__name__}: {error}"
    return folders, broken


def execute(plan: Plan, out: Path, jobs: int, timeout: float) -> Outcome:
    """Execute all runs of the plan, at most `jobs` at a time; their files go to `out`.

    Every run has a process of its own: an FMU that crashes takes only its run with it, and so does one of whose steps
    takes longer than the timeout (s). Files of an earlier
    execution of the same runs are removed first. A run that fails does not stop the others.
    """
    # A method that does not copy the threads of this process; the server imports the modules only once.
    methods = multiprocessing.get_all_start_methods()
    context: Any = multiprocessing.get_context("forkserver" if "forkserver" in methods else "spawn")
    if "forkserver" in methods:
        context.set_forkserver_preload(["chassis_fmu.batch"])
    failures: dict[str, str] = {}
    warnings: dict[str, tuple[str, ...]] = {}
    names = tuple(c.name for c in plan.columns)
    for run in plan.runs:
        (out / f"{run.stem}.csv").unlink(missing_ok=True)
    running: dict[Connection, _Running] = {}
    with (
        temporary.folder() as folder,
        tqdm(total=plan.simulation.steps * len(plan.runs), unit="step", unit_scale=True, disable=None) as bar,
    ):
        folders, broken = _extract(plan, folder)
        waiting = []
        for run in plan.runs:
            bad = next((u for u in run.components if u.fmu in broken), None)
            if bad is None:
                waiting.append(run)
            else:
                failures[run.id] = f"component {bad.name}, loading: {bad.fmu}: {broken[bad.fmu]}"
        waiting.reverse()
        try:
            while waiting or running:
                while waiting and len(running) < max(jobs, 1):
                    run = waiting.pop()
                    ours, theirs = context.Pipe(duplex=False)
                    board: Board = context.RawValue(Board, calls.NONE)
                    task = _Task(run, plan.simulation, names, folders, out, board)
                    process = context.Process(target=_execute, args=(task, theirs), daemon=True)
                    process.start()
                    theirs.close()
                    running[ours] = _Running(run, process, board)
                ready = wait(list(running), LOOK_INTERVAL)
                for pipe, one in list(running.items()):
                    if pipe in ready:
                        try:
                            message = pipe.recv()
                        except EOFError:
                            one.process.join()
                            message = one.ended(f"the process ended ({_exit(one.process.exitcode)})")
                    elif one.is_late(timeout):
                        one.process.kill()
                        message = one.ended(f"not done after {timeout:g} s (--timeout), stopped")
                    else:
                        continue
                    if isinstance(message, int):
                        bar.update(message)
                        one.done += message
                        continue
                    if message.error is not None:
                        failures[one.run.id] = message.error
                    elif message.warnings:
                        warnings[one.run.id] = message.warnings
                    bar.update(plan.simulation.steps - one.done)
                    pipe.close()
                    one.process.join()
                    del running[pipe]
        finally:
            for pipe, one in running.items():
                one.process.kill()
                one.process.join()
                pipe.close()
            with contextlib.suppress(OSError):
                for part in out.glob(".*.part"):
                    part.unlink()
    return Outcome(failures, warnings)


def _exit(code: int | None) -> str:
    if code is not None and code < 0:
        with contextlib.suppress(ValueError):
            return f"signal {-code}, {signal.Signals(-code).name}"
    return f"exit code {code}"


def take(plan: Plan, source: Path, out: Path) -> dict[str, str]:
    """Check the CSV files of the runs in `source` and copy them to `out`, if they lie elsewhere.

    Returns the error message of every run whose file cannot be used, by run id.
    """
    failures: dict[str, str] = {}
    for run in plan.runs:
        names = _names(plan, run)
        try:
            recording = results.read_csv(source / f"{run.stem}.csv")
            absent = [n for n in names if n not in recording.values]
            if absent:
                raise results.ResultsError(f"{run.stem}.csv has no column {absent[0]}")
            if len(recording.times) != plan.simulation.rows:
                raise results.ResultsError(
                    f"{run.stem}.csv has {len(recording.times)} rows, expected {plan.simulation.rows}"
                )
            rows = _rows(recording, names)
            if not np.isfinite(rows).all():
                raise results.ResultsError(f"{run.stem}.csv holds a value that is not finite")
            if source != out:
                results.write_csv(out / f"{run.stem}.csv", names, recording.times, rows)
        except results.ResultsError as error:
            failures[run.id] = str(error)
    return failures


def convert(plan: Plan, runs: Path, failures: Collection[str]) -> None:
    """Write the CSV files of the runs as Parquet beside them, but for the runs that failed."""
    units = {c.name: c.unit or "" for c in plan.columns}
    for run in plan.runs:
        if run.id not in failures:
            names = _names(plan, run)
            recording = results.read_csv(runs / f"{run.stem}.csv", names)
            path = runs / f"{run.stem}.parquet"
            results.write_parquet(path, names, [units[n] for n in names], recording.times, _rows(recording, names))


def _names(plan: Plan, run: Run) -> list[str]:
    return [c.name for c, slot in zip(plan.columns, run.columns, strict=True) if slot is not None]


def _rows(recording: results.Recording, names: Sequence[str]) -> NDArray[np.floating[Any]]:
    return np.column_stack([recording.values[n] for n in names]) if names else np.empty((len(recording.times), 0))

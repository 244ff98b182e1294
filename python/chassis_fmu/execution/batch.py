"""Executes the runs of a plan in parallel processes, with a progress bar over all of their steps."""

from __future__ import annotations

import contextlib
import dataclasses
import json
import multiprocessing
import os
import shutil
import signal
import sys
import threading
import time
import zipfile
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from multiprocessing.connection import Connection, wait
from pathlib import Path
from typing import Any, Literal

import fmpy
import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from ..files import results
from ..files.plan import Plan, Run, Simulation
from . import calls, family, master
from .calls import Board

# Seconds between two messages of a run about its progress.
REPORT_INTERVAL = 0.2
# Seconds between two looks at what the processes are doing.
LOOK_INTERVAL = 0.1
# Seconds that a process has until its run begins, whatever the timeout of a step.
START_TIMEOUT = 60.0


# How the runs ended, beside their rows.
STATUS_FILE = "status.json"

Status = Literal["completed", "terminated", "discarded", "failed"]


@dataclass(frozen=True)
class _Task:
    run: Run
    simulation: Simulation
    names: tuple[str, ...]
    folders: Mapping[Path, Path]
    out: Path
    board: Board
    memory: Any


@dataclass(frozen=True)
class _Verdict:
    """The end of a run: the error, or the log messages of a run without one."""

    error: str | None
    warnings: tuple[str, ...] = ()
    status: Status = "failed"
    at: float | None = None
    component: str | None = None


@dataclass(frozen=True)
class _Left:
    """Programs that the FMUs of a run had started and that did not end with it."""

    programs: list[str]

    def __str__(self) -> str:
        count = len(self.programs)
        processes = "a process" if count == 1 else f"{count} processes"
        ended = "it was ended" if count == 1 else "they were ended"
        names = list(dict.fromkeys(self.programs))
        shown = ", ".join(names[:5]) + (", ..." if len(names) > 5 else "")
        return f"{processes} that an FMU had started ({shown}) did not end with the run; {ended}"


@dataclass(frozen=True)
class RunStatus:
    """How a run ended: an entry of `status.json`, which the native master writes, too."""

    run: str
    file: str | None
    status: Status
    end: float | None
    at: float | None
    component: str | None
    message: str | None


@dataclass
class Outcome:
    """What came of runs: messages by run id.

    `failures` are those of the runs that failed, `ended` those of the runs that an FMU has ended: both are not whole.
    `warnings` are messages of the components of the others.
    """

    failures: dict[str, str] = field(default_factory=dict)
    ended: dict[str, str] = field(default_factory=dict)
    warnings: dict[str, tuple[str, ...]] = field(default_factory=dict)
    statuses: dict[str, RunStatus] = field(default_factory=dict)

    def add(self, status: RunStatus) -> None:
        """Take how a run ended."""
        self.statuses[status.run] = status
        if status.status != "completed":
            of_kind = self.ended if status.status == "terminated" else self.failures
            of_kind[status.run] = status.message or status.status


def write_statuses(plan: Plan, folder: Path, outcome: Outcome) -> None:
    """Write the status of the runs, in the order of the plan, to the folder of their rows."""
    runs = [vars(outcome.statuses[run.id]) for run in plan.runs if run.id in outcome.statuses]
    results.write_text(folder / STATUS_FILE, json.dumps({"format": 1, "runs": runs}, indent=2) + "\n")


def read_statuses(folder: Path) -> dict[str, RunStatus]:
    """Read how runs ended, by run id; empty without the file, as for results of a master that writes none.

    Raises ResultsError for a file that is none.
    """
    path = folder / STATUS_FILE
    try:
        found = [RunStatus(**entry) for entry in json.loads(path.read_text(encoding="utf-8"))["runs"]]
    except FileNotFoundError:
        return {}
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise results.ResultsError(f"{path}: cannot read how the runs ended: {error}") from error
    return {status.run: status for status in found}


@dataclass
class _Running:
    """A run in execution: its process, the steps it has reported, and since when its board has not changed."""

    run: Run
    process: Any
    board: Board
    memory: Any
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
        name = self.run.components[component].name
        return _Verdict(str(master.RunError(name, function, at, how)), at=at, component=name)


def _end_with_parent() -> None:
    """End this process when the one that started it does, whatever an FMU is doing."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        wait([parent.sentinel])
        os._exit(1)


def _execute(task: _Task, pipe: Connection) -> None:
    """Body of a process: simulates one run, writes its files, and sends its progress and its outcome."""
    family.divide(lambda programs: pipe.send(_Left(programs)))
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
        master.simulate(
            task.run,
            task.simulation,
            lambda component: master.FmpyInstance(component, task.folders[component.fmu]),
            progress,
            board=task.board,
            memory=np.frombuffer(task.memory),
        )
        _write(task.run, task.simulation, task.names, task.out, task.memory)
        warnings = tuple(f"component {component}: {text}" for component, text in master.messages())
        pipe.send(_Verdict(None, warnings, "completed"))
    except master.RunError as error:
        status: Status = "terminated" if error.is_end else "discarded" if error.is_discarded else "failed"
        pipe.send(_Verdict(str(error), (), status, error.time, error.component))
    except Exception as error:
        pipe.send(_Verdict(f"{type(error).__name__}: {error}"))
    finally:
        pipe.close()


def _write(run: Run, simulation: Simulation, names: Sequence[str], out: Path, memory: Any) -> float | None:
    """Write the buffered rows of a run, if any; return the time of the last one."""
    times, rows = master.rows_in(np.frombuffer(memory), run, simulation)
    if not len(times):
        return None
    present = [names[i] for i, slot in enumerate(run.columns) if slot is not None]
    results.write_csv(out / f"{run.stem}.csv", present, times, rows)
    return float(times[-1])


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
                _unpack(component.fmu, target)
                folders[component.fmu] = target
            except Exception as error:  # fmpy raises bare Exceptions for illegal archives
                broken[component.fmu] = f"{type(error).__name__}: {error}"
    return folders, broken


def _unpack(fmu: Path, folder: Path) -> None:
    """Extract an archive, also of tools that separate folders by backslashes, which fmpy refuses."""
    with zipfile.ZipFile(fmu) as archive:
        if not any("\\" in entry.orig_filename for entry in archive.infolist()):
            fmpy.extract(str(fmu), str(folder))
            return
        for entry in archive.infolist():
            entry.filename = entry.orig_filename.replace("\\", "/")
            archive.extract(entry, folder)


def execute(plan: Plan, folder: Path, out: Path, jobs: int, timeout: float) -> Outcome:
    """Execute all runs of the plan, at most `jobs` at a time; their files go to `out`, the unpacked FMUs to `folder`.

    Every run has a process of its own: an FMU that crashes takes only its run with it, and so does one of whose steps
    takes longer than the timeout (s). A run that is not whole keeps its rows up to there; `status.json` says so. Files
    of an earlier execution of the same runs are removed first. A run that fails does not stop the others.
    """
    # A method that does not copy the threads of this process; the server imports the modules only once.
    methods = multiprocessing.get_all_start_methods()
    context: Any = multiprocessing.get_context("forkserver" if "forkserver" in methods else "spawn")
    if "forkserver" in methods:
        context.set_forkserver_preload(["chassis_fmu.execution.batch"])
    outcome = Outcome()
    names = tuple(c.name for c in plan.columns)
    _remove(plan, out)
    running: dict[Connection, _Running] = {}
    total = plan.simulation.steps * len(plan.runs)
    with tqdm(total=total, unit="step", unit_scale=True, disable=None) as bar:
        folders, broken = _extract(plan, folder)
        waiting = []
        for run in plan.runs:
            bad = next((u for u in run.components if u.fmu in broken), None)
            if bad is None:
                waiting.append(run)
            else:
                cause = f"component {bad.name}, loading: {bad.fmu}: {broken[bad.fmu]}"
                outcome.add(RunStatus(run.id, None, "failed", None, None, bad.name, cause))
        waiting.reverse()
        try:
            while waiting or running:
                while waiting and len(running) < max(jobs, 1):
                    run = waiting.pop()
                    ours, theirs = context.Pipe(duplex=False)
                    board: Board = context.RawValue(Board, calls.NONE)
                    # Shared, so that the rows outlive the process.
                    memory: Any = context.RawArray("d", master.room(run, plan.simulation))
                    np.frombuffer(memory)[:] = np.nan
                    task = _Task(run, plan.simulation, names, folders, out, board, memory)
                    process = context.Process(target=_execute, args=(task, theirs), daemon=True)
                    process.start()
                    theirs.close()
                    running[ours] = _Running(run, process, board, memory)
                ready = wait(list(running), LOOK_INTERVAL)
                for pipe, one in list(running.items()):
                    message: int | _Verdict
                    if pipe in ready:
                        try:
                            message = pipe.recv()
                        except EOFError:
                            one.process.join()
                            message = one.ended(f"the process ended ({_exit(one.process.exitcode)})")
                    elif one.is_late(timeout):
                        _end(one.process)
                        one.process.join()
                        message = one.ended(f"not done after {timeout:g} s (--timeout), stopped")
                    else:
                        continue
                    if isinstance(message, _Left):
                        outcome.warnings[one.run.id] = (*outcome.warnings.get(one.run.id, ()), str(message))
                        continue
                    if isinstance(message, int):
                        bar.update(message)
                        one.done += message
                        continue
                    end: float | None = float(plan.simulation.times[-1])
                    if message.status != "completed":
                        end = _write(one.run, plan.simulation, names, out, one.memory)
                    file = None if end is None else f"{one.run.stem}.csv"
                    at = end if message.error is None else message.at
                    outcome.add(RunStatus(one.run.id, file, message.status, end, at, message.component, message.error))
                    if message.warnings:
                        outcome.warnings[one.run.id] = (*message.warnings, *outcome.warnings.get(one.run.id, ()))
                    # The supervisor ends what is left before the connection ends.
                    with contextlib.suppress(EOFError, OSError):
                        while True:
                            if isinstance(more := pipe.recv(), _Left):
                                outcome.warnings[one.run.id] = (*outcome.warnings.get(one.run.id, ()), str(more))
                    bar.update(plan.simulation.steps - one.done)
                    pipe.close()
                    one.process.join()
                    del running[pipe]
        finally:
            for pipe, one in running.items():
                _end(one.process)
                one.process.join()
                pipe.close()
            with contextlib.suppress(OSError):
                for part in out.glob(".*.part"):
                    part.unlink()
    write_statuses(plan, out, outcome)
    return outcome


def _end(process: Any) -> None:
    """End a process of a run, and all that its FMUs have started."""
    if sys.platform == "linux":
        # Its supervisor ends the others first.
        process.terminate()
        process.join(family.PATIENCE + 1)
    process.kill()


def _exit(code: int | None) -> str:
    if code is not None and code < 0:
        with contextlib.suppress(ValueError):
            return f"signal {-code}, {signal.Signals(-code).name}"
    return f"exit code {code}"


def take(plan: Plan, source: Path, out: Path) -> Outcome:
    """Check the CSV files of the runs in `source` and copy them to `out`, if they lie elsewhere.

    Runs that are not whole, by `status.json` or their rows, are not used; the rows that they kept are copied. Files of
    an earlier execution of the same runs in `out` are removed first. Raises ResultsError if `status.json` is invalid.
    """
    outcome = Outcome()
    known = read_statuses(source)
    is_elsewhere = source.resolve() != out.resolve()
    if is_elsewhere:
        _remove(plan, out)
    for run in plan.runs:
        names = _names(plan, run)
        status = known.get(run.id)
        if status is not None and status.status != "completed":
            outcome.add(_copy_kept(status, run, source, out) if is_elsewhere else status)
            continue
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
            if is_elsewhere:
                results.write_csv(out / f"{run.stem}.csv", names, recording.times, rows)
            end = float(recording.times[-1])
            outcome.add(RunStatus(run.id, f"{run.stem}.csv", "completed", end, end, None, None))
        except results.ResultsError as error:
            outcome.add(RunStatus(run.id, None, "failed", None, None, None, str(error)))
    write_statuses(plan, out, outcome)
    return outcome


def _remove(plan: Plan, out: Path) -> None:
    """Remove what an earlier execution of the runs has written."""
    for name in (STATUS_FILE, *(f"{run.stem}.csv" for run in plan.runs)):
        (out / name).unlink(missing_ok=True)


def _copy_kept(status: RunStatus, run: Run, source: Path, out: Path) -> RunStatus:
    """Copy the rows that a run has kept; return its status, with a file only if there is one."""
    name = f"{run.stem}.csv"
    if status.file is None or not (source / name).is_file():
        return dataclasses.replace(status, file=None, end=None)
    shutil.copyfile(source / name, out / name)
    return dataclasses.replace(status, file=name)


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

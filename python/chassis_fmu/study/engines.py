"""Engines, which execute the tasks of a study: processes on this machine, or a Dask cluster.

In both, worker processes of this package execute the FMUs, so their rows are bit-identical. If an FMU crashes, only its
run fails.
"""

from __future__ import annotations

import functools
import queue
import threading
from collections.abc import Callable, Iterator, Sequence
from typing import Protocol

from ..scenario import Outcome, Recorded
from .file import StudyError
from .job import Done, Job, Task

Take = Callable[[Done], None]


class Engine(Protocol):
    """Executes tasks.

    The values of a task come from `design.parquet` or from a search.
    """

    def execute(self, tasks: Sequence[Task], take: Take) -> None:
        """Execute tasks. `take` gets every row once, in any order, in the thread of the caller."""

    def record(self, runs: Sequence[tuple[Task, int]]) -> list[Recorded | str]:
        """Execute a run of each task again; returns its signals, or how it failed."""

    def close(self) -> None:
        """End all processes."""


class Local:
    """Processes on this machine."""

    def __init__(self, job: Job, jobs: int, timeout: float) -> None:
        self._job = job
        self._jobs = jobs
        self._timeout = timeout
        self._started: set[int] = set()

    def execute(self, tasks: Sequence[Task], take: Take) -> None:
        """Execute the tasks, one variant after the other."""
        for variant in sorted({task.variant for task in tasks}):
            chosen = [task for task in tasks if task.variant == variant]
            scenario = self._job.scenarios[variant]
            self._start(variant)
            samples = [task.sample for task in chosen]
            for outcome in stream(functools.partial(scenario.execute, samples)):
                take(self._job.done(chosen[outcome.sample], outcome))

    def record(self, runs: Sequence[tuple[Task, int]]) -> list[Recorded | str]:
        """Execute a run of each task again, in processes on this machine."""
        found: dict[int, Recorded | str] = {}
        for variant in sorted({task.variant for task, _ in runs}):
            self._start(variant)
            chosen = [i for i, (task, _) in enumerate(runs) if task.variant == variant]
            of = [(runs[i][0].sample.values, runs[i][0].sample.runs[runs[i][1]]) for i in chosen]
            found |= dict(zip(chosen, self._job.scenarios[variant].record_many(of), strict=True))
        return [found[i] for i in range(len(runs))]

    def _start(self, variant: int) -> None:
        if variant not in self._started:
            self._job.scenarios[variant].start(self._jobs, self._timeout)
            self._started.add(variant)

    def close(self) -> None:
        """End all processes."""
        self._started.clear()


class Nothing(Local):
    """Executes no tasks, for a report from existing rows."""

    def execute(self, tasks: Sequence[Task], take: Take) -> None:  # noqa: ARG002, a method of the protocol
        """Raise StudyError if tasks are missing."""
        if tasks:
            raise StudyError(f"{len(tasks)} samples are missing: --resume runs them")


def stream(execute: Callable[[Callable[[Outcome], bool]], None]) -> Iterator[Outcome]:
    """Yield the outcomes of `execute` as they arrive. An interrupt can end this thread at any time.

    `execute` runs in another thread, which stops if this generator is closed early.
    """
    # The last item is None, or the error.
    outcomes: queue.SimpleQueue[Outcome | BaseException | None] = queue.SimpleQueue()
    stopped = threading.Event()

    def put(outcome: Outcome) -> bool:
        outcomes.put(outcome)
        return not stopped.is_set()

    def work() -> None:
        try:
            execute(put)
            outcomes.put(None)
        except BaseException as error:  # Raised in the caller's thread.
            outcomes.put(error)

    threading.Thread(target=work, daemon=True).start()
    try:
        while True:
            # Wait with a timeout: on some systems, an interrupt is noticed only after the call.
            try:
                found = outcomes.get(timeout=0.5)
            except queue.Empty:
                continue
            if found is None:
                return
            if isinstance(found, BaseException):
                raise found
            yield found
    finally:
        stopped.set()

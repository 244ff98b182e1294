"""What executes the tasks of a study: processes of this machine, or a Dask cluster.

Both let the worker program of this package execute the FMUs, so a row has the same bits wherever it comes from. An FMU
that crashes costs its run.
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

    All values of a task come from `design.parquet`, or from the search that proposes them.
    """

    def execute(self, tasks: Sequence[Task], take: Take) -> None:
        """Execute tasks; `take` gets every row once, in no order, in the thread of the caller."""

    def record(self, runs: Sequence[tuple[Task, int]]) -> list[Recorded | str]:
        """Execute a run of each task again; returns its signals, or how it failed."""

    def close(self) -> None:
        """End all processes."""


class Local:
    """Processes of this machine."""

    def __init__(self, job: Job, jobs: int, timeout: float) -> None:
        self._job = job
        self._jobs = jobs
        self._timeout = timeout
        self._started: set[int] = set()

    def execute(self, tasks: Sequence[Task], take: Take) -> None:
        """Execute the tasks, one variant behind the other."""
        for variant in sorted({task.variant for task in tasks}):
            chosen = [task for task in tasks if task.variant == variant]
            scenario = self._job.scenarios[variant]
            self._start(variant)
            samples = [task.sample for task in chosen]
            for outcome in stream(functools.partial(scenario.execute, samples)):
                take(self._job.done(chosen[outcome.sample], outcome))

    def record(self, runs: Sequence[tuple[Task, int]]) -> list[Recorded | str]:
        """Execute a run of each task again, in processes of this machine."""
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
    """Executes no tasks: for a report of the rows that are there."""

    def execute(self, tasks: Sequence[Task], take: Take) -> None:  # noqa: ARG002, a method of the protocol
        """Raise StudyError if there is something to do."""
        if tasks:
            raise StudyError(f"{len(tasks)} samples are missing: --resume runs them")


def stream(execute: Callable[[Callable[[Outcome], bool]], None]) -> Iterator[Outcome]:
    """Give the outcomes of `execute` as they come, in this thread, which an interrupt can end at any time.

    `execute` works in a thread of its own and is told to stop when this one ends early.
    """
    # At the end None, or the error.
    outcomes: queue.SimpleQueue[Outcome | BaseException | None] = queue.SimpleQueue()
    stopped = threading.Event()

    def put(outcome: Outcome) -> bool:
        outcomes.put(outcome)
        return not stopped.is_set()

    def work() -> None:
        try:
            execute(put)
            outcomes.put(None)
        except BaseException as error:  # The other thread raises it.
            outcomes.put(error)

    threading.Thread(target=work, daemon=True).start()
    try:
        while True:
            # With a limit, so that an interrupt is noticed on all systems.
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

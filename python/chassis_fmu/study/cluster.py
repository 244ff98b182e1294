"""The engine for a Dask cluster: one machine, several over SSH, SLURM, Kubernetes.

A worker receives scenario and FMUs once, as one bundle (`bundle.py`). Every thread of a worker has a process that
executes the FMUs. Tasks are batches of about a second, which keeps the load on the scheduler low. Failures:

- A worker is lost: Dask gives its batches to other workers.
- A batch ends its workers repeatedly (`KilledWorker`): it is halved until one sample is left. The rows of this sample
  get the status `crashed`, and the study continues.
- The scheduler is lost: existing rows are kept, and the other samples are submitted again when it is back.
- Workers do not have the package, have another version, or raise an exception: the study ends with an error, because
  repeating would not help. `--resume` uses the existing rows.
"""

from __future__ import annotations

import concurrent.futures
import contextlib
import functools
import hashlib
import importlib.metadata
import sys
import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from ..program import PACKAGE
from ..scenario import Outcome, Recorded, Sample, Scenario, Value
from .engines import Take
from .file import StudyError, needed
from .job import Done, Job, Task

# Intended duration of a batch (s), and its largest number of tasks.
BATCH = 1.0
LARGEST = 2000

# Number of batches submitted per thread of the cluster.
AHEAD = 3

# Longest wait for a lost scheduler to come back, s.
PATIENCE = 300.0

# Time after which a cluster without workers is reported, s.
NOTICE = 15.0

# On this machine, scheduler and workers do not monitor themselves. Monitoring would take 3 % of a processor for client,
# scheduler and one worker, and there is no dashboard to show the result.
QUIET = {
    "distributed.admin.tick.interval": "1s",
    "distributed.admin.system-monitor.interval": "10s",
    "distributed.worker.profile.enabled": False,
}

# Number of times that a batch is tried again, on any worker, after an exception.
RETRIES = 2

LOST = "the Dask worker that executed it ended each time, perhaps for lack of memory; see the log of the worker"


def _advice(what: str, error: BaseException, here: str) -> str:
    """Describe an error at a worker or the scheduler, and the remedy."""
    kind = type(error).__name__
    version = sys.version.partition(" ")[0]
    return (
        f"{what}: {kind}: {error}\nScheduler and workers need chassis_fmu {here} and Python {version}, like this "
        "client: install the same wheel on all machines, or start them from the same .venv; --resume continues"
    )


class OtherVersionError(Exception):
    """The package on a worker differs from the client's."""


@functools.cache
def identity() -> str:
    """Return the version of this package and the hash of its Python sources, which must agree for equal results."""
    content = hashlib.sha256()
    for path in sorted(PACKAGE.rglob("*.py")):
        content.update(path.relative_to(PACKAGE).as_posix().encode() + b"\0" + path.read_bytes())
    return f"{importlib.metadata.version('chassis-fmu')} ({content.hexdigest()[:12]})"


@dataclass(frozen=True)
class Work:
    """The data that all runs of a batch share."""

    identity: str
    key: str
    source: functools.partial[Scenario]
    variant: int
    timeout: float

    def scenario(self) -> Scenario:
        """Open the scenario in a worker."""
        from .bundle import opened

        if identity() != self.identity:
            raise OtherVersionError(f"this worker has chassis_fmu {identity()}, the client {self.identity}")
        return opened.scenario(self.key, self.source, self.variant, self.timeout)


def run_batch(work: Work, samples: Sequence[Sample]) -> tuple[list[Outcome], float]:
    """Execute samples in a worker; returns the outcomes and the elapsed time, s."""
    began = time.perf_counter()
    scenario = work.scenario()
    found: list[Outcome] = []

    def take(outcome: Outcome) -> bool:
        found.append(outcome)
        return True

    scenario.execute(samples, take)
    return found, time.perf_counter() - began


def record_run(work: Work, values: tuple[tuple[str, Value], ...], run: int) -> Recorded | str:
    """Execute a run in a worker; returns its signals, or how it failed."""
    return work.scenario().record_many([(values, run)])[0]


class Dask:
    """A Dask cluster, with a given scheduler or on this machine."""

    def __init__(self, job: Job, address: str | None, jobs: int, timeout: float) -> None:
        needed("--dask", "distributed")
        import dask
        import distributed

        from .bundle import Bundle

        self._distributed: Any = distributed
        self._job = job
        self._timeout = timeout
        self._address = address
        self._cluster: Any = None
        self._bundle = Bundle.of(job)
        try:
            if address is None:
                with dask.config.set(QUIET):
                    self._cluster = self._distributed.LocalCluster(
                        n_workers=jobs, threads_per_worker=1, dashboard_address=":0"
                    )
            self._client: Any = self._distributed.Client(self._cluster or address, timeout="10s")
        except (OSError, ValueError) as error:
            raise StudyError(f"no Dask scheduler at {address}: {error}") from error

    def execute(self, tasks: Sequence[Task], take: Take) -> None:
        """Execute the tasks, in batches whose size adapts to the intended duration."""
        missing = {task.number: task for task in tasks}

        def kept(done: Done) -> None:
            try:
                take(done)
            except OSError as error:
                # An error of this machine, such as a full disk; the scheduler is not lost.
                raise StudyError(f"cannot write a row to the journal: {error}") from error

        def turn() -> None:
            for batch in self._submit(missing, kept):
                self._find(batch, missing, kept)

        self._repeat(turn)

    def record(self, runs: Sequence[tuple[Task, int]]) -> list[Recorded | str]:
        """Execute a run of each task again, in the workers."""
        found: list[Recorded | str] = []

        def turn() -> None:
            self._share()
            parts = [(self._work(task.variant), task.sample.values, task.sample.runs[cell]) for task, cell in runs]
            futures = [self._client.submit(record_run, *part, pure=False, retries=RETRIES) for part in parts]
            found[:] = [self._result(future) for future in futures]

        self._repeat(turn)
        return found

    def _repeat(self, turn: Callable[[], None]) -> None:
        """Call `turn`, and call it again after reconnecting if the scheduler is lost."""
        while True:
            try:
                return turn()
            # Without a scheduler, a client raises OSError or RuntimeError, and a future raises CancelledError. Errors
            # from workers are already a StudyError.
            except (OSError, RuntimeError, concurrent.futures.CancelledError) as error:
                cause = str(error) or type(error).__name__
                if self._cluster is not None:
                    raise StudyError(
                        f"the Dask scheduler on this machine ended ({cause}); --resume continues"
                    ) from error
                self._reconnect(cause)

    def _share(self) -> None:
        """Wait for workers, compare their versions, and send scenario and FMUs to workers that do not have them."""
        began = time.monotonic()
        told = False
        while not self._client.nthreads():
            if not told and time.monotonic() - began > NOTICE:
                told = True
                print(f"the Dask scheduler at {self._address} has no workers; waiting for some", file=sys.stderr)
            time.sleep(0.2)
        self._compare()
        self._client.register_plugin(self._bundle)

    def _compare(self) -> None:
        here = identity()
        found = self._client.run(identity, on_error="return")
        for worker, answer in sorted(found.items()):
            if isinstance(answer, OSError):
                # The worker has left the cluster in the meantime.
                continue
            if isinstance(answer, BaseException):
                raise StudyError(_advice(f"the Dask worker {worker} cannot load this package", answer, here))
            if answer != here:
                raise StudyError(
                    f"the Dask worker {worker} has chassis_fmu {answer}, this client {here}: "
                    "install the same version on all machines"
                )

    def _work(self, variant: int) -> Work:
        source = functools.partial(self._job.sources[variant], fmus=())
        return Work(identity(), self._bundle.key, source, variant, self._timeout)

    def _result(self, future: Any, *, suspicious: bool = False) -> Any:
        """Return the result of a future. With `suspicious`, returns None if its workers ended repeatedly."""
        if future.cancelled():
            raise RuntimeError("it has lost a batch")
        # `result` would raise the worker's exception here, as if the client had failed.
        error = future.exception()
        if error is None:
            return future.result()
        if isinstance(error, self._distributed.scheduler.KilledWorker) and suspicious:
            return None
        raise StudyError(_advice("a Dask worker could not execute a batch", error, identity())) from error

    def _submit(self, missing: dict[int, Task], take: Take) -> list[list[Task]]:
        """Execute the missing tasks; returns the batches whose workers ended."""
        self._share()
        waiting = deque(sorted(missing.values(), key=lambda task: (task.variant, task.number)))
        size, threads = 1, max(1, sum(self._client.nthreads().values()))
        pending: dict[Any, list[Task]] = {}
        suspects: list[list[Task]] = []
        completed = self._distributed.as_completed(with_results=False)

        def submit() -> None:
            batch = [waiting.popleft()]
            while waiting and len(batch) < size and waiting[0].variant == batch[0].variant:
                batch.append(waiting.popleft())
            future = self._begin(batch)
            pending[future] = batch
            completed.add(future)

        while waiting and len(pending) < AHEAD * threads:
            submit()
        while pending:
            future = next(completed)
            batch = pending.pop(future)
            found = self._result(future, suspicious=True)
            if found is None:
                suspects.append(batch)
            else:
                seconds = self._take(batch, found, missing, take)
                # The next batches have as many tasks as take the intended time, but at most four times as many as
                # before.
                size = max(1, min(LARGEST, 4 * size, round(BATCH * len(batch) / max(seconds, 1e-3))))
            threads = max(1, sum(self._client.nthreads().values()))
            while waiting and len(pending) < AHEAD * threads:
                submit()
        return suspects

    def _find(self, batch: list[Task], missing: dict[int, Task], take: Take) -> None:
        """Execute a batch whose workers ended, while no other batch runs, and find the sample that ends the workers."""
        self._share()
        found = self._result(self._begin(batch), suspicious=True)
        if found is not None:
            self._take(batch, found, missing, take)
        elif len(batch) == 1:
            for done in self._job.lost(batch[0], LOST):
                take(done)
            missing.pop(batch[0].number)
        else:
            middle = len(batch) // 2
            for part in (batch[:middle], batch[middle:]):
                self._find(part, missing, take)

    def _begin(self, batch: Sequence[Task]) -> Any:
        samples = [task.sample for task in batch]
        work = self._work(batch[0].variant)
        return self._client.submit(run_batch, work, samples, pure=False, retries=RETRIES)

    def _take(
        self, batch: Sequence[Task], found: tuple[list[Outcome], float], missing: dict[int, Task], take: Take
    ) -> float:
        outcomes, seconds = found
        for outcome in outcomes:
            take(self._job.done(batch[outcome.sample], outcome))
        for task in batch:
            missing.pop(task.number, None)
        return seconds

    def _reconnect(self, cause: str) -> None:
        """Wait for a lost scheduler, and connect to it again."""
        print(f"the Dask scheduler is lost ({cause}); waiting for it", file=sys.stderr)
        with contextlib.suppress(Exception):
            self._client.close(timeout=1)
        until = time.monotonic() + PATIENCE
        while True:
            try:
                self._client = self._distributed.Client(self._address, timeout="5s")
            except (OSError, ValueError) as error:
                if time.monotonic() > until:
                    raise StudyError(
                        f"the Dask scheduler at {self._address} did not come back: {error}; --resume continues"
                    ) from error
                time.sleep(1.0)
            else:
                return

    def close(self) -> None:
        """Disconnect from the cluster; ends a cluster on this machine."""
        self._client.close(timeout=5)
        if self._cluster is not None:
            self._cluster.close()

"""The engine for a Dask cluster: one machine, several over SSH, SLURM, Kubernetes.

A worker gets scenario and FMUs once, as one bundle that is named by its content, and opens them in a folder of its own.
Every thread of a worker has a process that executes the FMUs. Tasks are batches of about a second, so that the
scheduler costs little. A worker that is lost costs nothing but time: Dask gives its batches to others. If the scheduler
is lost, the rows that are there stay, and the rest is submitted again when it is back.
"""

from __future__ import annotations

import atexit
import contextlib
import hashlib
import io
import shutil
import sys
import tempfile
import threading
import time
import zipfile
from collections import deque
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from ..scenario import Outcome, Sample, Scenario
from .engines import Take
from .file import StudyError, load
from .job import Job, Source, Task

# A batch takes about so long, s, and has at most so many tasks.
BATCH = 1.0
LARGEST = 2000

# Batches that wait for each thread of the cluster.
AHEAD = 3

# How long a scheduler that is lost may take to come back, s.
PATIENCE = 300.0


def bundle(job: Job) -> bytes:
    """Return scenario, the files that it names, and FMUs as an archive, the same bytes for the same content."""
    source = job.sources[0]
    files = {f"fmus/{path.name}": path for path in job.fmu_files()}
    top = source.file.parent
    for path in scenario_files(source.file):
        # Beside each other as they are here, also those in folders above.
        files[(Path("scenario") / _relative(path, top)).as_posix()] = path
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_STORED) as archive:
        for name in sorted(files):
            archive.writestr(zipfile.ZipInfo(name, (1980, 1, 1, 0, 0, 0)), files[name].read_bytes())
    return out.getvalue()


# Folders above that of the scenario, as far as a name may lead.
DEPTH = 4


def _relative(path: Path, top: Path) -> Path:
    """Return where a file lies in a bundle: the scenario's own folder is so many levels deep, so that `../` works."""
    tops = [top, *top.parents][: DEPTH + 1]
    for up, folder in enumerate(tops):
        if path.is_relative_to(folder):
            return Path(*(f"l{i}" for i in range(DEPTH - up))) / path.relative_to(folder)
    raise StudyError(f"{path} is too far from the scenario to be sent to other machines; put it beside the scenario")


def scenario_files(file: Path) -> list[Path]:
    """Return a scenario file and those that it names: included ones and parameter sets."""
    found = [file]
    table = load(file)
    tables = [table]
    for name in table.get("include", ()):
        path = (file.parent / name).resolve()
        found.append(path)
        tables.append(load(path))
    for part in tables:
        places = [part, *part.get("component", ()), *part.get("case", ())]
        found += [(file.parent / p["parameter_set"]).resolve() for p in places if "parameter_set" in p]
    return list(dict.fromkeys(found))


class _Opened:
    """Bundles and scenarios that a process of a worker has opened. Every thread has scenarios of its own."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._folders: dict[str, Path] = {}
        self._scenarios: dict[tuple[int, str, int], Scenario] = {}

    def scenario(self, key: str, content: bytes, source: Source, variant: int, timeout: float) -> Scenario:
        place = (threading.get_ident(), key, variant)
        with self._lock:
            known = self._scenarios.get(place)
            if known is not None:
                return known
            folder = self._folders.get(key)
            if folder is None:
                folder = Path(tempfile.mkdtemp(prefix="chassis-fmu-"))
                atexit.register(shutil.rmtree, folder, ignore_errors=True)
                with zipfile.ZipFile(io.BytesIO(content)) as archive:
                    archive.extractall(folder)
                self._folders[key] = folder
        deep = folder.joinpath("scenario", *(f"l{i}" for i in range(DEPTH)))
        here = replace(source, file=deep / source.file.name, folders=(folder / "fmus",))
        scenario = here.open()
        scenario.start(1, timeout)
        with self._lock:
            self._scenarios[place] = scenario
        return scenario


_opened = _Opened()


def run_batch(
    content: bytes, key: str, source: Source, variant: int, samples: Sequence[Sample], timeout: float
) -> tuple[list[Outcome], float]:
    """Execute samples in a worker; returns the outcomes and the time it took, s."""
    began = time.perf_counter()
    scenario = _opened.scenario(key, content, source, variant, timeout)
    found: list[Outcome] = []

    def take(outcome: Outcome) -> bool:
        found.append(outcome)
        return True

    scenario.execute(samples, take)
    return found, time.perf_counter() - began


class Dask:
    """A Dask cluster: that of a scheduler, or one of this machine."""

    def __init__(self, job: Job, address: str | None, jobs: int, timeout: float) -> None:
        import distributed

        self._distributed: Any = distributed
        self._job = job
        self._timeout = timeout
        self._address = address
        self._cluster: Any = None
        self._content = bundle(job)
        self._key = hashlib.sha256(self._content).hexdigest()
        try:
            if address is None:
                self._cluster = self._distributed.LocalCluster(
                    n_workers=jobs, threads_per_worker=1, dashboard_address=None
                )
            self._client: Any = self._distributed.Client(self._cluster or address, timeout="10s")
        except (OSError, ValueError) as error:
            raise StudyError(f"no Dask scheduler at {address}: {error}") from error

    def execute(self, tasks: Sequence[Task], take: Take) -> None:
        """Execute the tasks, in batches that become as long as they should."""
        missing = {task.number: task for task in tasks}
        while missing:
            try:
                self._submit(missing, take)
            except (OSError, RuntimeError) as error:
                if self._cluster is not None:
                    raise
                self._reconnect(error)

    def _submit(self, missing: dict[int, Task], take: Take) -> None:
        content = self._client.scatter(self._content, broadcast=True, hash=True)
        waiting = deque(sorted(missing.values(), key=lambda task: (task.variant, task.number)))
        size, threads = 1, max(1, sum(self._client.nthreads().values()))
        pending: dict[Any, list[Task]] = {}
        completed = self._distributed.as_completed(with_results=False)

        def submit() -> None:
            batch = [waiting.popleft()]
            while waiting and len(batch) < size and waiting[0].variant == batch[0].variant:
                batch.append(waiting.popleft())
            variant = batch[0].variant
            source = replace(self._job.sources[variant], folders=())
            samples = [task.sample for task in batch]
            future = self._client.submit(
                run_batch, content, self._key, source, variant, samples, self._timeout, pure=False, retries=5
            )
            pending[future] = batch
            completed.add(future)

        while waiting and len(pending) < AHEAD * threads:
            submit()
        while pending:
            future = next(completed)
            batch = pending.pop(future)
            if future.cancelled():
                raise OSError("the scheduler has lost a batch")
            outcomes, seconds = future.result()
            for outcome in outcomes:
                task = batch[outcome.sample]
                take(self._job.done(task, outcome))
            for task in batch:
                missing.pop(task.number, None)
            # As many tasks as fill the time of a batch, but no jump by more than four.
            size = max(1, min(LARGEST, 4 * size, round(BATCH * len(batch) / max(seconds, 1e-3))))
            threads = max(1, sum(self._client.nthreads().values()))
            while waiting and len(pending) < AHEAD * threads:
                submit()

    def _reconnect(self, cause: BaseException) -> None:
        """Wait for a scheduler that is gone."""
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
                        f"the Dask scheduler at {self._address} did not come back: {error}; --resume goes on"
                    ) from error
                time.sleep(1.0)
            else:
                return

    def close(self) -> None:
        """Leave the cluster, and end it if it is one of this machine."""
        self._client.close()
        if self._cluster is not None:
            self._cluster.close()

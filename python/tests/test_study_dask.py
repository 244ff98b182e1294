"""Studies on a Dask cluster of real processes, which are killed: the tables agree with the local engine."""

from __future__ import annotations

import contextlib
import hashlib
import os
import shutil
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import distributed
import pyarrow.parquet
import pytest

from chassis_fmu.program import PACKAGE
from chassis_fmu.study import bundle
from chassis_fmu.study import cluster as study_cluster
from chassis_fmu.study.job import Task
from tests import study_system
from tests.commands import patience, until
from tests.study_system import build, vary, write

pytestmark = pytest.mark.ci

DASK = Path(sys.executable).with_name("dask")
STUDY = 'method = "sample"\nruns = 60\n' + vary("p", "f:a", 'distribution = "uniform"\nmin = 0.0\nmax = 1.0')
TWELVE = 'method = "sample"\nruns = 12\ncases = ["plain"]\n' + STUDY.partition("runs = 60\n")[2]
# Makes the two steps of a run take 0.2 s, enough time to kill processes during the study.
SLOW = "usleep(100000)"


def free_port() -> int:
    with socket.socket() as found:
        found.bind(("127.0.0.1", 0))
        port: int = found.getsockname()[1]
        return port


class Cluster:
    """A scheduler and workers, each a process."""

    def __init__(self, folder: Path, stack: contextlib.ExitStack) -> None:
        self._folder = folder
        self._stack = stack
        self.port = free_port()
        self.address = f"tcp://127.0.0.1:{self.port}"
        self.scheduler = self._start("scheduler", "--host", "127.0.0.1", "--port", str(self.port), "--no-dashboard")

        def is_listening() -> bool:
            with socket.socket() as trial:
                return trial.connect_ex(("127.0.0.1", self.port)) == 0

        until(is_listening, "the scheduler listens")

    def restart_scheduler(self) -> None:
        """Kill the scheduler and start another one at the same address."""
        self.scheduler.kill()
        self.scheduler.wait()
        self.scheduler = self._start("scheduler", "--host", "127.0.0.1", "--port", str(self.port), "--no-dashboard")

    def worker(self, nanny: str = "--no-nanny", **environment: str) -> subprocess.Popen[bytes]:
        """Start a worker, by default without a nanny, which would restart the worker."""
        options = ["--nthreads", "1", nanny, "--no-dashboard", "--death-timeout", "60"]
        return self._start("worker", self.address, *options, **environment)

    def workers(self) -> int:
        dask: Any = distributed
        with dask.Client(self.address) as client:
            return len(client.nthreads())

    def is_busy(self) -> bool:
        """Return whether every worker is executing a batch."""
        dask: Any = distributed
        with dask.Client(self.address) as client:
            return all(client.processing().values())

    def _start(self, *arguments: str, **environment: str) -> subprocess.Popen[bytes]:
        log = (self._folder / f"{arguments[0]}.log").open("ab")
        self._stack.callback(log.close)
        process = subprocess.Popen(
            [DASK, *arguments],
            cwd=self._folder,
            env={**os.environ, **environment},
            stdout=log,
            stderr=subprocess.STDOUT,
        )

        def end() -> None:
            # A nanny that is terminated ends its worker.
            process.terminate()
            try:
                process.wait(10)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()

        self._stack.callback(end)
        return process


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[Cluster]:
    with contextlib.ExitStack() as stack:
        yield Cluster(tmp_path, stack)


def arguments(folder: Path, out: str, *options: str) -> list[str]:
    return [str(folder / "study.toml"), "--fmus", str(folder / "fmus"), "--out", str(folder / out), *options]


def start(folder: Path, cluster: Cluster, *options: str) -> subprocess.Popen[bytes]:
    return study_system.start(arguments(folder, "dask", f"--dask={cluster.address}", *options), folder, cwd=folder)


def rows(folder: Path) -> int:
    path = folder / "dask" / "study" / "rows.jsonl"
    return path.read_bytes().count(b"\n") - 1 if path.exists() else 0


# Runs of a study: 60 samples in two cases.
TOTAL = 120


def is_unfinished(folder: Path, study: subprocess.Popen[Any]) -> bool:
    """Return whether a study is in progress: its process is alive, and runs are missing."""
    return study.poll() is None and 0 < rows(folder) < TOTAL


def same_tables(folder: Path) -> None:
    assert study_system.carry_out(arguments(folder, "local")) == 0
    for name in ("design.parquet", "runs.parquet"):
        found, expected = ((folder / out / "study" / name).read_bytes() for out in ("dask", "local"))
        assert found == expected, name
    lines = (folder / "dask" / "study" / "rows.jsonl").read_text().splitlines()
    assert len(lines) == len(set(lines)) == 1 + TOTAL


def test_an_fmu_crashes_and_a_worker_is_killed(tmp_path: Path, cluster: Cluster) -> None:
    build(tmp_path, before=f"{SLOW}; if (a > 0.8) abort()")
    write(tmp_path, STUDY)
    first = cluster.worker()
    cluster.worker()
    with start(tmp_path, cluster) as study:
        until(lambda: rows(tmp_path) > 10 and cluster.is_busy(), "some rows, and batches at both workers")
        first.send_signal(signal.SIGKILL)
        # The worker was still busy, so the other worker has executed its batches.
        assert first.wait(10) == -signal.SIGKILL
        assert is_unfinished(tmp_path, study)
        assert study.wait(120) == 0
    same_tables(tmp_path)
    assert '"crashed"' in (tmp_path / "dask" / "study" / "rows.jsonl").read_text()


def test_the_client_is_killed_and_resumed_and_the_scheduler_is_restarted(tmp_path: Path, cluster: Cluster) -> None:
    build(tmp_path, before=SLOW)
    write(tmp_path, STUDY)
    cluster.worker()
    cluster.worker()
    with start(tmp_path, cluster) as study:
        until(lambda: rows(tmp_path) > 10, "some rows")
        assert is_unfinished(tmp_path, study)
        study.kill()
    assert study.returncode == -signal.SIGKILL
    before = rows(tmp_path)
    assert 10 < before < 100
    with begin(tmp_path, cluster.address, "--resume") as resumed:
        until(lambda: rows(tmp_path) > before, "more rows")
        cluster.restart_scheduler()
        # Without a scheduler, no rows arrive, so the study needs the restarted one.
        assert is_unfinished(tmp_path, resumed)
        # Workers exit when they lose their scheduler.
        cluster.worker()
        cluster.worker()
        code, text = text_of(resumed, 150.0)
    assert code == 0, text
    assert "the Dask scheduler is lost" in text
    same_tables(tmp_path)


def test_no_scheduler_is_explained(tmp_path: Path) -> None:
    build(tmp_path)
    write(tmp_path, STUDY)
    address = f"tcp://127.0.0.1:{free_port()}"
    with begin(tmp_path, address) as study:
        code, text = text_of(study)
    assert code == 2
    assert f"no Dask scheduler at {address}" in text


def text_of(study: subprocess.Popen[str], seconds: float = 120.0) -> tuple[int, str]:
    """Wait for a study; returns its exit code and its messages."""
    out, _ = study.communicate(timeout=patience(seconds))
    return study.returncode, out


def begin(folder: Path, address: str, *options: str) -> subprocess.Popen[str]:
    """Start the study in another process, to read its messages."""
    given = arguments(folder, "dask", f"--dask={address}", *options)
    said = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT, "encoding": "utf-8"}
    return study_system.start(given, folder, cwd=folder, **said)


def test_a_worker_without_the_package_is_explained(tmp_path: Path, cluster: Cluster) -> None:
    build(tmp_path)
    write(tmp_path, STUDY)
    empty = tmp_path / "empty" / "chassis_fmu"
    empty.mkdir(parents=True)
    (empty / "__init__.py").write_text('raise ModuleNotFoundError("No module named chassis_fmu")\n')
    cluster.worker(PYTHONPATH=str(empty.parent))
    with begin(tmp_path, cluster.address) as study:
        code, text = text_of(study)
    assert code == 2
    assert "cannot load this package: " in text
    assert "No module named chassis_fmu" in text
    assert "install the same wheel on all machines" in text
    assert "scheduler is lost" not in text


def test_a_worker_with_another_version_is_explained(tmp_path: Path, cluster: Cluster) -> None:
    build(tmp_path)
    write(tmp_path, STUDY)
    other = tmp_path / "other"
    shutil.copytree(PACKAGE, other / "chassis_fmu", ignore=shutil.ignore_patterns("__pycache__", "web"))
    changed = other / "chassis_fmu" / "study" / "table.py"
    changed.write_text(changed.read_text() + "\n# Another version.\n")
    cluster.worker()
    cluster.worker(PYTHONPATH=str(other))
    until(lambda: cluster.workers() == 2, "two workers")
    with begin(tmp_path, cluster.address) as study:
        code, text = text_of(study)
    assert code == 2
    assert "has chassis_fmu " in text
    assert "install the same version on all machines" in text
    assert rows(tmp_path) == 0


def test_a_worker_that_cannot_open_the_scenario_is_explained(tmp_path: Path, cluster: Cluster) -> None:
    # The worker has the package, but no space for the FMUs.
    build(tmp_path)
    write(tmp_path, STUDY)
    cluster.worker(TMPDIR="/proc")
    with begin(tmp_path, cluster.address) as study:
        code, text = text_of(study)
    assert code == 2
    assert "a Dask worker could not execute a batch: " in text
    assert "--resume continues" in text


def test_a_run_that_kills_its_worker_is_a_row(tmp_path: Path, cluster: Cluster) -> None:
    # The FMU kills the Dask worker, as the system does when it is out of memory. The Dask worker is the parent of the
    # supervisor, which is the parent of the FMU's process.
    supervisor = 'char path[64]; snprintf(path, sizeof path, "/proc/%d/stat", getppid()); FILE *f = fopen(path, "r");'
    parent = 'int worker; if (f && fscanf(f, "%*d (%*[^)]) %*c %d", &worker) == 1) kill(worker, SIGKILL);'
    build(tmp_path, before=f"if (a > 11.0 / 12.0) {{ {supervisor} {parent} sleep(30); }}")
    write(tmp_path, TWELVE)
    # The nanny restarts the worker.
    cluster.worker("--nanny")
    cluster.worker("--nanny")
    with begin(tmp_path, cluster.address) as study:
        code, text = text_of(study, 200.0)
    assert code == 0, text
    found = pyarrow.parquet.read_table(tmp_path / "dask" / "study" / "runs.parquet").to_pylist()
    assert len(found) == 12
    for row in found:
        assert row["status"] == ("crashed" if row["p"] > 11.0 / 12.0 else "ok")
    # In a Latin hypercube of twelve samples, exactly one is in the last twelfth of the range.
    (killed,) = [row for row in found if row["status"] == "crashed"]
    assert "the Dask worker that executed it ended each time" in killed["message"]


def test_a_cluster_without_workers_is_reported(tmp_path: Path, cluster: Cluster) -> None:
    build(tmp_path)
    write(tmp_path, TWELVE)
    with begin(tmp_path, cluster.address) as study:
        assert study.stdout is not None
        line = next(line for line in study.stdout if "no workers" in line)
        assert f"the Dask scheduler at {cluster.address} has no workers; waiting for some" in line
        cluster.worker()
        code, _ = text_of(study)
    assert code == 0


def test_a_cluster_of_this_machine_runs_choices_of_fmus(tmp_path: Path) -> None:
    build(tmp_path)
    build(tmp_path, "-a", name="Other")
    study = 'method = "sample"\nruns = 8\n[[vary]]\nname = "law"\nfmu = "f"\nvalues = ["Function", "Other"]\n'
    write(tmp_path, study + vary("p", "f:a", 'distribution = "uniform"\nmin = 0.0\nmax = 1.0'))
    assert study_system.carry_out(arguments(tmp_path, "dask", "--dask", "--jobs", "2")) == 0
    assert study_system.carry_out(arguments(tmp_path, "local")) == 0
    for name in ("design.parquet", "runs.parquet"):
        found, expected = ((tmp_path / out / "study" / name).read_bytes() for out in ("dask", "local"))
        assert found == expected, name
    # The page contains the signals that the workers recorded.
    assert "Time histories" in (tmp_path / "dask" / "study" / "index.html").read_text()


@pytest.mark.parametrize(("seconds", "largest"), [(0.0, 1), (1e9, 2000)])
def test_tables_do_not_depend_on_the_size_of_batches(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, seconds: float, largest: int
) -> None:
    """The tables agree with the local engine; each worker gets scenario and FMUs only once, for all calls."""
    build(tmp_path)
    # The engine is called twice: for the runs, and for the signals of the worst runs.
    write(tmp_path, STUDY)
    monkeypatch.setattr(study_cluster, "BATCH", seconds)
    monkeypatch.setattr(study_cluster, "LARGEST", largest)
    begin_batch, share, close = study_cluster.Dask._begin, study_cluster.Dask._share, study_cluster.Dask.close
    sizes: list[int] = []
    shared: list[str] = []
    arrived: list[int] = []

    def counted(self: study_cluster.Dask, batch: Sequence[Task]) -> Any:
        sizes.append(len(batch))
        return begin_batch(self, batch)

    def named(self: study_cluster.Dask) -> None:
        shared.append(self._bundle.name)
        share(self)

    def asked(self: study_cluster.Dask) -> None:
        begun = f"Starting Worker plugin {self._bundle.name}"
        for log in self._client.get_worker_logs().values():
            arrived.append(sum(begun in message for _, message in log))
        # The name is the hash of the content.
        assert self._bundle.name == f"chassis-fmu-{hashlib.sha256(bundle.archive(self._job)).hexdigest()}"
        close(self)

    monkeypatch.setattr(study_cluster.Dask, "_begin", counted)
    monkeypatch.setattr(study_cluster.Dask, "_share", named)
    monkeypatch.setattr(study_cluster.Dask, "close", asked)
    assert study_system.carry_out(arguments(tmp_path, "dask", "--dask", "--jobs", "2")) == 0
    same_tables(tmp_path)
    assert sum(sizes) == 60
    # Batch sizes start at 1 and grow at most fourfold: first six batches of 1, then 4, 16 and more.
    assert max(sizes) == 1 if largest == 1 else max(sizes) > 16
    assert len(shared) == 2
    assert len(set(shared)) == 1
    assert arrived == [1, 1]

"""Studies on a Dask cluster of real processes that are killed: the tables are those of the local engine."""

from __future__ import annotations

import contextlib
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from chassis_fmu.study import app
from tests.study_system import build, vary, write

pytestmark = pytest.mark.ci

DASK = Path(sys.executable).with_name("dask")
STUDY = 'method = "sample"\nruns = 60\n' + vary("p", "f:a", 'distribution = "uniform"\nmin = 0.0\nmax = 1.0')
# A fifth of a second for the two steps of a run, so that there is a middle in which something can be killed.
SLOW = "usleep(100000)"


def until(is_so: Callable[[], bool], what: str) -> None:
    """Wait for something that another process does."""
    begin = time.monotonic()
    while not is_so():
        assert time.monotonic() - begin < 90.0, what
        time.sleep(0.05)


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
        """Kill the scheduler and start another one at its place."""
        self.scheduler.kill()
        self.scheduler.wait()
        self.scheduler = self._start("scheduler", "--host", "127.0.0.1", "--port", str(self.port), "--no-dashboard")

    def worker(self) -> subprocess.Popen[bytes]:
        """Start a worker without a nanny, which would start it anew."""
        options = ["--nthreads", "1", "--no-nanny", "--no-dashboard", "--death-timeout", "60"]
        return self._start("worker", self.address, *options)

    def _start(self, *arguments: str) -> subprocess.Popen[bytes]:
        log = (self._folder / f"{arguments[0]}.log").open("ab")
        self._stack.callback(log.close)
        process = subprocess.Popen([DASK, *arguments], cwd=self._folder, stdout=log, stderr=subprocess.STDOUT)

        def end() -> None:
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
    """Start the study as a process."""
    program = [sys.executable, "-m", "chassis_fmu.study"]
    given = arguments(folder, "dask", "--engine", "dask", "--scheduler", cluster.address, *options)
    return subprocess.Popen([*program, *given], cwd=folder)


def rows(folder: Path) -> int:
    path = folder / "dask" / "study" / "rows.jsonl"
    return path.read_bytes().count(b"\n") - 1 if path.exists() else 0


def same_tables(folder: Path) -> None:
    assert app.main(arguments(folder, "local")) == 0
    for name in ("design.parquet", "runs.parquet"):
        found, expected = ((folder / out / "study" / name).read_bytes() for out in ("dask", "local"))
        assert found == expected, name
    lines = (folder / "dask" / "study" / "rows.jsonl").read_text().splitlines()
    assert len(lines) == len(set(lines)) == 1 + 2 * 60


def test_an_fmu_crashes_and_a_worker_is_killed(tmp_path: Path, cluster: Cluster) -> None:
    build(tmp_path, before=f"{SLOW}; if (a > 0.8) abort()")
    write(tmp_path, STUDY)
    first = cluster.worker()
    cluster.worker()
    with start(tmp_path, cluster) as study:
        until(lambda: rows(tmp_path) > 10, "some rows")
        first.send_signal(signal.SIGKILL)
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
        study.kill()
    before = rows(tmp_path)
    assert 10 < before < 100
    with start(tmp_path, cluster, "--resume") as study:
        until(lambda: rows(tmp_path) > before, "more rows")
        cluster.restart_scheduler()
        # Workers that have lost their scheduler end.
        cluster.worker()
        cluster.worker()
        assert study.wait(150) == 0
    same_tables(tmp_path)


def test_no_scheduler_is_explained(tmp_path: Path) -> None:
    build(tmp_path)
    write(tmp_path, STUDY)
    address = f"tcp://127.0.0.1:{free_port()}"
    program = [sys.executable, "-m", "chassis_fmu.study"]
    given = arguments(tmp_path, "dask", "--engine", "dask", "--scheduler", address)
    done = subprocess.run([*program, *given], capture_output=True, encoding="utf-8", env=os.environ, check=False)
    assert done.returncode == 2
    assert f"no Dask scheduler at {address}" in done.stderr

"""Ends all processes that an FMU has started, at the end of the run.

A process that executes a run divides itself: the first one supervises, the second one executes the FMUs. What these
start belongs to the supervisor when its own parent ends (`PR_SET_CHILD_SUBREAPER`), so none of it outlives the run.
Only Linux has supervisors. The workers of `cargo fmu` do the same.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import signal
import sys
import time
from collections.abc import Callable
from pathlib import Path
from types import FrameType

# From <sys/prctl.h>.
PR_SET_PDEATHSIG = 1
PR_SET_CHILD_SUBREAPER = 36
# Seconds that processes have to end by themselves when the run does.
GRACE = 0.05
# Seconds that killed processes have to end.
PATIENCE = 5.0


def divide(report: Callable[[list[str]], None]) -> None:
    """Return in the process that executes the run; the other one ends as that one does.

    `report` gets the names of the programs that the run has left behind, in the other process.
    """
    if sys.platform != "linux":
        return
    libc = ctypes.CDLL(None, use_errno=True)
    libc.prctl(PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0)
    supervisor = os.getpid()
    worker = os.fork()
    if worker == 0:
        libc.prctl(PR_SET_PDEATHSIG, int(signal.SIGKILL), 0, 0, 0)
        if os.getppid() != supervisor:
            os._exit(1)
        # A signal to the group of an FMU does not reach the supervisor.
        os.setpgid(0, 0)
        return
    status = _wait(worker)
    left = _end_all()
    if left:
        with contextlib.suppress(OSError):
            report(left)
    code = os.waitstatus_to_exitcode(status)
    if code < 0:
        import resource

        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        if -code not in (signal.SIGKILL, signal.SIGSTOP):
            signal.signal(-code, signal.SIG_DFL)
        os.kill(supervisor, -code)
    os._exit(code if code >= 0 else 128 - code)


def _wait(worker: int) -> int:
    """Wait until the worker ends, which SIGTERM brings about; returns its status."""

    def end(_number: int, _frame: FrameType | None) -> None:
        with contextlib.suppress(ProcessLookupError):
            os.kill(worker, signal.SIGKILL)

    signal.signal(signal.SIGTERM, end)
    # An interrupt from the keyboard reaches all processes; the first one ends the others.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    while True:
        process, status = os.wait()
        if process == worker:
            return status


def _end_all() -> list[str]:
    """End all processes that come from this one; returns the names of the programs."""
    programs: dict[int, str] = {}
    begin = time.monotonic()
    while time.monotonic() - begin < PATIENCE:
        try:
            while os.waitpid(-1, os.WNOHANG)[0]:
                pass
        except ChildProcessError:
            break
        if time.monotonic() - begin >= GRACE:
            for process, program in _children():
                programs.setdefault(process, program)
                with contextlib.suppress(OSError):
                    os.kill(process, signal.SIGKILL)
        time.sleep(0.001)
    return list(programs.values())


def _children() -> list[tuple[int, str]]:
    """Return the running children of this process, with the names of their programs.

    An FMU that forks without a program of its own leaves copies of this one.
    """
    found = []
    for entry in Path("/proc").iterdir():
        if not entry.name.isdigit():
            continue
        with contextlib.suppress(OSError, ValueError, IndexError):
            # The name, in parentheses, may hold anything.
            start, rest = (entry / "stat").read_text(errors="replace").rsplit(")", 1)
            state, parent = rest.split()[:2]
            if int(parent) == os.getpid() and state not in ("Z", "X"):
                program = start.split("(", 1)[1]
                found.append((int(entry.name), f"a copy of {program}" if _is_copy(entry) else program))
    return found


def _is_copy(entry: Path) -> bool:
    """Return whether a process executes the program of this one. False if the system does not tell."""
    try:
        return (entry / "exe").samefile("/proc/self/exe")
    except OSError:
        return False

"""A folder for temporary files: private to its user, and removed even if the process is killed.

The rules are those of `cargo fmu`: a folder `cargo-fmu-ID` beside a file `cargo-fmu-ID.lock` that the process keeps
locked. What a killed process leaves is removed by the next one of either kind.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import signal
import sys
import tempfile
import threading
from collections.abc import Iterator
from pathlib import Path
from types import FrameType

PREFIX = "cargo-fmu-"
LOCK = ".lock"


def _locked(file: int) -> bool:
    """Lock an open file until it is closed; False if another process has it."""
    if sys.platform == "win32":
        return False
    import fcntl

    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    return True


def _remove_stale(parent: Path) -> None:
    """Remove what processes of the same user have left that are no more."""
    if sys.platform == "win32":
        return
    for lock in parent.glob(f"{PREFIX}*{LOCK}"):
        # No link and no pipe, which opening would wait for.
        with contextlib.suppress(OSError):
            if lock.is_symlink() or not lock.is_file() or lock.stat().st_uid != os.getuid():
                continue
            with lock.open("r+b") as file:
                if _locked(file.fileno()):
                    shutil.rmtree(lock.with_suffix(""), ignore_errors=True)
                    lock.unlink()


def _end(number: int, _frame: FrameType | None) -> None:
    sys.exit(128 + number)


@contextlib.contextmanager
def _ended_by_signals() -> Iterator[None]:
    """Let signals that ask the process to end go through its `finally` blocks."""
    names = ("SIGTERM", "SIGHUP") if threading.current_thread() is threading.main_thread() else ()
    numbers = [getattr(signal, name) for name in names if hasattr(signal, name)]
    # `nohup` starts a command that shall outlive its terminal with SIGHUP ignored.
    numbers = [number for number in numbers if signal.getsignal(number) != signal.SIG_IGN]
    before = {number: signal.signal(number, _end) for number in numbers}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


@contextlib.contextmanager
def folder() -> Iterator[Path]:
    """Make a folder and remove it at the end of the block, also when SIGTERM or SIGHUP asks the process to end."""
    parent = Path(tempfile.gettempdir())
    with _ended_by_signals():
        _remove_stale(parent)
        handle, name = tempfile.mkstemp(prefix=PREFIX, suffix=LOCK, dir=parent)
        lock = Path(name)
        try:
            _locked(handle)
            path = lock.with_suffix("")
            path.mkdir(mode=0o700)
            try:
                yield path
            finally:
                shutil.rmtree(path, ignore_errors=True)
        finally:
            os.close(handle)
            lock.unlink(missing_ok=True)

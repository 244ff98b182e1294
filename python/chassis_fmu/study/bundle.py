"""What the workers of a Dask cluster need: scenario and FMUs, as one archive that is named by its content.

It is a plugin of the workers: Dask gives it to each of them once, also to those that come later, and every study with
the same content uses it, until the scheduler ends.
"""

from __future__ import annotations

import atexit
import hashlib
import io
import os
import shutil
import sys
import tempfile
import threading
import zipfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import distributed

from ..scenario import Scenario
from .file import StudyError
from .job import Job, Source

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib


def archive(job: Job) -> bytes:
    """Return scenario, the files that it names, and FMUs as an archive, the same bytes for the same content."""
    source = job.sources[0]
    files = {f"fmus/{path.name}": path for path in job.fmu_files()}
    top = source.file.parent
    texts = scenario_files(source.file)
    for path in (*texts, *_data_files(job, texts)):
        # Beside each other as they are here, also those in folders above.
        files[(Path("scenario") / _relative(path, top)).as_posix()] = path
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_STORED) as file:
        for name in sorted(files):
            file.writestr(zipfile.ZipInfo(name, (1980, 1, 1, 0, 0, 0)), files[name].read_bytes())
    return out.getvalue()


def _data_files(job: Job, texts: Sequence[Path]) -> list[Path]:
    """Return the files that FMUs read; raises StudyError for one that other machines would not find."""
    found = job.data_files()
    written = [path.read_text(encoding="utf-8", errors="replace") for path in texts]
    written += [str(level) for factor in job.study.vary for level in factor.levels or ()]
    for path in found:
        if any(str(path) in text for text in written):
            raise StudyError(
                f"{path}: an absolute path is another file on other machines; write it relative to the scenario, "
                "and put the file beside it"
            )
    return found


# Folders above that of the scenario, as far as a name may lead.
DEPTH = 4


def _relative(path: Path, top: Path) -> Path:
    """Return where a file lies in a bundle: the scenario's own folder is so many levels deep, so that `../` works."""
    # An archive drops `..` where it is unpacked.
    path = Path(os.path.normpath(path))
    tops = [top, *top.parents][: DEPTH + 1]
    for up, folder in enumerate(tops):
        if path.is_relative_to(folder):
            return Path(*(f"l{i}" for i in range(DEPTH - up))) / path.relative_to(folder)
    raise StudyError(f"{path} is too far from the scenario to be sent to other machines; put it beside the scenario")


def _load(path: Path) -> dict[str, Any]:
    table: dict[str, Any] = tomllib.loads(path.read_text(encoding="utf-8"))
    return table


def scenario_files(file: Path) -> list[Path]:
    """Return a scenario file and those that it names: included ones and parameter sets."""
    found = [file]
    table = _load(file)
    tables = [table]
    for name in table.get("include", ()):
        path = (file.parent / name).resolve()
        found.append(path)
        tables.append(_load(path))
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

    def unpack(self, key: str, content: bytes) -> None:
        """Unpack a bundle in a folder that is removed at the end of the process."""
        with self._lock:
            if key not in self._folders:
                folder = Path(tempfile.mkdtemp(prefix="chassis-fmu-"))
                atexit.register(shutil.rmtree, folder, ignore_errors=True)
                with zipfile.ZipFile(io.BytesIO(content)) as file:
                    file.extractall(folder)
                self._folders[key] = folder

    def scenario(self, key: str, source: Source, variant: int, timeout: float) -> Scenario:
        """Return the scenario of a bundle, opened for this thread."""
        place = (threading.get_ident(), key, variant)
        with self._lock:
            known = self._scenarios.get(place)
            folder = self._folders.get(key)
        if known is not None:
            return known
        if folder is None:
            raise RuntimeError("scenario and FMUs did not arrive; the log of the worker says why")
        deep = folder.joinpath("scenario", *(f"l{i}" for i in range(DEPTH)))
        here = replace(source, file=deep / source.file.name, folders=(folder / "fmus",))
        scenario = here.open()
        scenario.start(1, timeout)
        with self._lock:
            self._scenarios[place] = scenario
        return scenario


opened = _Opened()


class Bundle(distributed.WorkerPlugin):
    """Scenario and FMUs on their way to the workers."""

    # A scheduler that has a plugin of this name keeps it.
    idempotent = True

    def __init__(self, content: bytes) -> None:
        self.key = hashlib.sha256(content).hexdigest()
        self.name = f"chassis-fmu-{self.key}"
        self.content = content

    @classmethod
    def of(cls, job: Job) -> Bundle:
        """Pack scenario and FMUs of a study."""
        return cls(archive(job))

    def setup(self, worker: Any) -> None:  # noqa: ARG002, a method of plugins
        """Unpack the archive, in a worker."""
        opened.unpack(self.key, self.content)
        # The folder has it.
        self.content = b""

"""Sends scenario and FMUs to the workers of a Dask cluster, as one archive that is named by its hash.

The archive is a worker plugin, so Dask sends it to each worker once, including workers that join later. Studies with
the same content reuse it until the scheduler ends.
"""

from __future__ import annotations

import atexit
import functools
import hashlib
import io
import os
import shutil
import sys
import tempfile
import threading
import zipfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import distributed

from ..scenario import Scenario
from .file import StudyError
from .job import Job

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib


def archive(job: Job) -> bytes:
    """Return an archive of the scenario, its files and the FMUs; the same content always gives the same bytes."""
    scenario = job.scenarios[0].file
    files = {f"fmus/{path.name}": path for path in job.fmu_files()}
    texts = scenario_files(scenario)
    for path in (*texts, *_data_files(job, texts)):
        # Files keep their relative positions, including files in parent folders.
        files[(Path("scenario") / _relative(path, scenario.parent)).as_posix()] = path
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_STORED) as file:
        for name in sorted(files):
            file.writestr(zipfile.ZipInfo(name, (1980, 1, 1, 0, 0, 0)), files[name].read_bytes())
    return out.getvalue()


def _data_files(job: Job, texts: Sequence[Path]) -> list[Path]:
    """Return the files that FMUs read; raises StudyError for an absolute path, which other machines would not find."""
    found = job.data_files()
    written = [path.read_text(encoding="utf-8", errors="replace") for path in texts]
    written += [str(level) for factor in job.study.vary for level in factor.levels or ()]
    for path in found:
        if any(str(path) in text for text in written):
            raise StudyError(
                f"{path}: an absolute path does not exist on other machines; put the file beside the scenario and "
                "make the path relative to it"
            )
    return found


# Number of levels above the scenario's folder that a path can reach.
DEPTH = 4


def _relative(path: Path, top: Path) -> Path:
    """Return the path of a file in a bundle. The scenario's folder is DEPTH levels deep there, so `../` works."""
    # zipfile drops `..` when it extracts a file.
    path = Path(os.path.normpath(path))
    tops = [top, *top.parents][: DEPTH + 1]
    for up, folder in enumerate(tops):
        if path.is_relative_to(folder):
            return Path(*(f"l{i}" for i in range(DEPTH - up))) / path.relative_to(folder)
    raise StudyError(f"{path} is more than {DEPTH} folders above the scenario; put it beside the scenario")


def _load(path: Path) -> dict[str, Any]:
    table: dict[str, Any] = tomllib.loads(path.read_text(encoding="utf-8"))
    return table


def scenario_files(file: Path) -> list[Path]:
    """Return a scenario file and the files that it includes, and their parameter sets."""
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
    """The bundles and scenarios that a worker process has opened. Each thread has its own scenarios."""

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

    def scenario(self, key: str, source: functools.partial[Scenario], variant: int, timeout: float) -> Scenario:
        """Return the scenario of a bundle, opened for this thread."""
        place = (threading.get_ident(), key, variant)
        with self._lock:
            known = self._scenarios.get(place)
            folder = self._folders.get(key)
        if known is not None:
            return known
        if folder is None:
            raise RuntimeError("this worker did not receive scenario and FMUs; its log contains the reason")
        deep = folder.joinpath("scenario", *(f"l{i}" for i in range(DEPTH)))
        scenario = Scenario(deep / source.args[0].name, **source.keywords | {"fmus": (folder / "fmus",)})
        scenario.start(1, timeout)
        with self._lock:
            self._scenarios[place] = scenario
        return scenario


opened = _Opened()


class Bundle(distributed.WorkerPlugin):
    """The worker plugin that unpacks scenario and FMUs."""

    # A scheduler ignores a second plugin with the same name.
    idempotent = True

    def __init__(self, content: bytes) -> None:
        self.key = hashlib.sha256(content).hexdigest()
        self.name = f"chassis-fmu-{self.key}"
        self.content = content

    @classmethod
    def of(cls, job: Job) -> Bundle:
        """Pack the scenario and the FMUs of a study."""
        return cls(archive(job))

    def setup(self, worker: Any) -> None:  # noqa: ARG002, a method of plugins
        """Unpack the archive, in a worker."""
        opened.unpack(self.key, self.content)
        # Frees memory: the content has been unpacked.
        self.content = b""

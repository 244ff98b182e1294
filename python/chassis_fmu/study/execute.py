"""Executes a study: design, runs, shards."""

from __future__ import annotations

import contextlib
import json
import sys
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..files import results
from ..scenario import Value
from . import design, search
from .engines import Engine
from .file import StudyError
from .job import Done, Job, Task
from .journal import Journal, parse


class Progress:
    """Shows the progress of a study in a bar of tqdm. Existing rows count as progress, but not for the rate."""

    def __init__(self, bar: Any) -> None:
        self._bar = bar
        self._failed = 0

    def begin(self, rows: Collection[Done]) -> None:
        """Start with the existing rows, before the first run."""
        self._bar.initial = self._bar.n = self._bar.last_print_n = len(rows)
        for done in rows:
            self._count(done)
        self._bar.refresh()

    def add(self, done: Done) -> None:
        """Add a new row."""
        self._count(done)
        self._bar.update()

    def _count(self, done: Done) -> None:
        if done.status != "ok":
            self._failed += 1
            self._bar.set_postfix(failed=self._failed, refresh=False)


@dataclass(frozen=True)
class Shard:
    """A part of the samples: every `of`-th sample, starting with sample `number` - 1."""

    number: int
    of: int


WHOLE = Shard(1, 1)


class Folder:
    """The folder of a study's results."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.design = path / "design.parquet"
        self.runs = path / "runs.parquet"
        self.timing = path / "timing.parquet"

    def journal(self, shard: Shard) -> Path:
        """Return the path of a shard's journal."""
        return self.path / ("rows.jsonl" if shard == WHOLE else f"rows-{shard.number}-of-{shard.of}.jsonl")

    def journals(self) -> list[Path]:
        """Return the journals of all shards in the folder."""
        return sorted(self.path.glob("rows-*-of-*.jsonl"))

    @contextlib.contextmanager
    def locked(self, shard: Shard) -> Iterator[None]:
        """Lock the results for this process; raises StudyError if another process has locked them."""
        self.path.mkdir(parents=True, exist_ok=True)
        with (self.path / f".{self.journal(shard).name}.lock").open("wb") as file:
            if sys.platform != "win32":
                import fcntl

                # The system releases the lock when the process ends, even after a crash.
                try:
                    fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                except BlockingIOError as error:
                    raise StudyError(
                        f"another process is writing to {self.path}: wait for it, or choose another folder with --out"
                    ) from error
                except OSError:
                    # The file system does not support locks.
                    pass
            yield

    def prepare(self, shard: Shard, *, resume: bool, overwrite: bool) -> None:
        """Prepare the folder; raises StudyError if it contains results and neither `resume` nor `overwrite` is set."""
        if overwrite:
            for path in (self.journal(shard), self.runs, self.timing):
                path.unlink(missing_ok=True)
            if shard == WHOLE and not self.journals():
                self.design.unlink(missing_ok=True)
        elif not resume and self.journal(shard).exists():
            raise StudyError(f"{self.journal(shard)} already exists: --resume continues it, --overwrite starts over")


@dataclass
class Result:
    """Values of all samples by factor, and the completed rows."""

    values: list[list[Any]]
    rows: dict[tuple[int, int], Done]


def _header(path: Path) -> dict[str, Any]:
    try:
        with path.open(encoding="utf-8") as file:
            found = json.loads(file.readline())
    except (OSError, ValueError) as error:
        raise StudyError(f"cannot read {path}: {error}") from error
    return found if isinstance(found, dict) else {}


def designed(job: Job, folder: Folder) -> tuple[list[list[Any]], str]:
    """Return the values in `design.parquet` and its hash; samples and writes the file if it does not exist."""
    design.store(job.study, folder.design)
    values, found = design.read(job.study, folder.design)
    design.check(job.study, values, folder.design)
    for path in folder.journals():
        header = _header(path)
        if header.get("study") == job.fingerprint() and header.get("design") != found:
            raise StudyError(f"{path} has rows for another {folder.design.name}: run its shard again with --overwrite")
    return values, found


def run(job: Job, folder: Folder, engine: Engine, shard: Shard, progress: Progress, *, resume: bool) -> Result:
    """Execute all missing runs. After an exception, completed rows remain in the journal."""
    cells = len(job.cells)

    def wanted(journal: Journal, tasks: Sequence[Task]) -> list[Task]:
        return [t for t in tasks if any((t.number, cell) not in journal.rows for cell in range(cells))]

    known = None if job.study.is_adaptive else designed(job, folder)
    journal = Journal(folder.journal(shard), job.fingerprint(), known[1] if known else None, resume=resume)
    with contextlib.closing(journal):
        progress.begin(journal.rows.values())

        def take(done: Done) -> None:
            is_new = (done.number, done.cell) not in journal.rows
            journal.add(done)
            if is_new:
                progress.add(done)

        if known is None:

            def evaluate(first: int, values: Sequence[dict[str, Value]]) -> list[list[Done]]:
                tasks = [job.task(first + i, v) for i, v in enumerate(values)]
                engine.execute(wanted(journal, tasks), take)
                return [[journal.rows[t.number, cell] for cell in range(cells)] for t in tasks]

            values = search.run(job.study, job, evaluate)
            results.write_table(folder.design, design.table(job.study, values))
            return Result(values, dict(journal.rows))
        values, _ = known
        names = [f.name for f in job.study.vary]
        rows = [dict(zip(names, row, strict=True)) for row in zip(*values, strict=True)]
        tasks = [job.task(number, row) for number, row in enumerate(rows) if number % shard.of == shard.number - 1]
        engine.execute(wanted(journal, tasks), take)
        return Result(values, dict(journal.rows))


def merge(job: Job, folder: Folder) -> Result:
    """Combine the shards of a study."""
    journals = folder.journals()
    if not journals:
        raise StudyError(f"{folder.path} has no shards: `--shard 1/20` makes the first of twenty")
    for path in journals:
        if _header(path).get("study") != job.fingerprint():
            raise StudyError(
                f"{path} belongs to another version of the study, its scenario or its FMUs, or to another number of "
                "samples: if its shard was run with `--runs N`, call `--merge` with the same option"
            )
    values, _ = designed(job, folder)
    rows: dict[tuple[int, int], Done] = {}
    for path in journals:
        _, *lines = path.read_bytes().decode("utf-8").rpartition("\n")[0].splitlines()
        rows |= {(done.number, done.cell): done for done in parse(lines)}
    count, cells = len(values[0]), len(job.cells)
    missing = sorted({n for n in range(count) if any((n, cell) not in rows for cell in range(cells))})
    if missing:
        some = ", ".join(map(str, missing[:5])) + (", …" if len(missing) > 5 else "")
        raise StudyError(
            f"{len(missing)} of {count} samples are missing ({some}): run their shards, or continue interrupted "
            "shards with `--resume`"
        )
    return Result(values, rows)


@contextlib.contextmanager
def closing(engine: Engine) -> Any:
    """Close an engine at the end of the block, even after an exception."""
    try:
        yield engine
    finally:
        try:
            engine.close()
        except Exception as error:  # An error in closing must not discard the results.
            print(f"warning: cannot end the engine properly: {error}", file=sys.stderr)

"""The journal: a file with all completed rows of a study, from which an interrupted study continues.

It has a line of JSON for each run. Numbers are written such that reading gives the same doubles. A truncated line is
ignored.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import astuple
from pathlib import Path
from typing import IO

from .file import StudyError
from .job import Done

FORMAT = 2


class Journal:
    """The rows of a study or of one of its shards."""

    def __init__(self, path: Path, fingerprint: str, design: str | None, *, resume: bool) -> None:
        """Open the journal; without `resume`, it must not exist. `design` is the design's hash, None for a search."""
        self.path = path
        self.rows: dict[tuple[int, int], Done] = {}
        header = json.dumps({"format": FORMAT, "study": fingerprint, "design": design})
        kept = 0
        if path.exists() and resume:
            kept = self._read(header)
        path.parent.mkdir(parents=True, exist_ok=True)
        self._file: IO[str] = path.open("r+" if kept else "w", encoding="utf-8", newline="\n")
        if kept:
            # Drops a truncated last line.
            self._file.truncate(kept)
            self._file.seek(kept)
        else:
            self._file.write(header + "\n")
            self._file.flush()

    def _read(self, header: str) -> int:
        content = self.path.read_bytes()
        end = content.rfind(b"\n") + 1
        lines = content[:end].decode("utf-8").splitlines()
        if not lines:
            return 0
        check(self.path, lines[0], header)
        for done in parse(lines[1:]):
            self.rows[done.number, done.cell] = done
        return end

    def add(self, done: Done) -> None:
        """Write a row, unless the journal already contains it."""
        if (done.number, done.cell) in self.rows:
            return
        self.rows[done.number, done.cell] = done
        self._file.write(json.dumps(astuple(done)) + "\n")
        self._file.flush()

    def close(self) -> None:
        """Close the file."""
        self._file.close()


def check(path: Path, found: str, expected: str) -> None:
    """Raise StudyError if the header of a journal belongs to another study."""
    if found == expected:
        return
    try:
        of, wanted = json.loads(found), json.loads(expected)
        is_other_design = {**of, "design": None} == {**wanted, "design": None}
    except (ValueError, TypeError):
        is_other_design = False
    what = "another design.parquet" if is_other_design else "another version of the study, its scenario or its FMUs"
    raise StudyError(f"{path} belongs to {what}: --overwrite starts over, another folder (--out) keeps both")


def parse(lines: list[str]) -> Iterator[Done]:
    """Read the rows of a journal."""
    for line in lines:
        number, cell, numbers, *rest = json.loads(line)
        yield Done(number, cell, tuple(numbers), *rest)

"""The page that links all result pages in a folder. It is rewritten whenever one of them is written."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path

from ..evaluation.grading import Status
from ..files import results
from . import rendering

NOTE = "page.json"


@dataclass(frozen=True)
class Entry:
    """Entry of a page in the index: title, reference of the experiment, and number of each badge."""

    title: str
    reference: str = ""
    badges: Mapping[str, int] = field(default_factory=dict)


def _read(folder: Path) -> Entry:
    """Return the entry that is stored beside a page; if there is none, an entry with the folder's name."""
    try:
        data = json.loads((folder / NOTE).read_text(encoding="utf-8"))
        known = {status.value for status in Status}
        badges = {str(k): int(v) for k, v in data["badges"].items() if k in known}
        return Entry(str(data["title"]), str(data["reference"]), badges)
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return Entry(folder.name)


def write(folder: Path, page: str, entry: Entry) -> Path:
    """Write a page and its entry to a folder, and rewrite the index in the parent folder; returns the page's path."""
    path = folder / "index.html"
    results.write_text(path, page)
    results.write_text(folder / NOTE, json.dumps(asdict(entry), ensure_ascii=False, indent=2) + "\n")
    pages = sorted(p.parent for p in folder.parent.glob("*/index.html"))
    entries = [(p.name, _read(p)) for p in pages]
    results.write_text(folder.parent / "index.html", rendering.render("index.html.j2", entries=entries, status=Status))
    return path

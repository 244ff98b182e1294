"""Write the table of docs/coupling.md: `python docs/coupling.py [--check] DIR`.

DIR has the results of `chassis run --converge` for every scenario of the library, see docs/coupling.md. With --check, a
table that differs is an error instead.
"""

from __future__ import annotations

import difflib
import json
import sys
from pathlib import Path
from typing import Any

PAGE = Path(__file__).with_name("coupling.md")
HEAD = "| scenario |"


def percent(share: float) -> str:
    """Return a share in percent, with three digits."""
    if 0.0 < abs(share) < 1e-6:
        return "< 0.0001 %"
    value = 100.0 * share
    text = f"{value:,.0f}" if abs(value) >= 1000.0 else f"{float(f'{value:.3g}'):.10f}".rstrip("0").rstrip(".")
    return text.replace("-", "−") + (" %" if share else "")


def row(folder: Path) -> tuple[list[str], list[int]]:
    """Return the cells of a scenario and its numbers: runs, metrics, independent ones, ones above the limit."""
    runs = json.loads((folder / "converge.json").read_text())["runs"]
    found = [(run["run"], metric) for run in runs for metric in run["metrics"] if metric["class"] != "undefined"]
    counts = [
        len(runs),
        len(found),
        sum(metric["class"] == "independent" for _, metric in found),
        sum(metric["above_limit"] for _, metric in found),
    ]

    def largest(key: str) -> str:
        def size(item: tuple[str, Any]) -> float:
            return abs(float(item[1][key] or 0.0))

        run, metric = max(found, key=size)
        text = percent(metric[key] or 0.0)
        return text if size((run, metric)) < 1e-6 else f"{text} `{metric['metric']}`, `{run}`"

    return [f"`{folder.name}`", *map(str, counts), largest("relative"), largest("order_change")], counts


def main(arguments: list[str]) -> None:
    is_check = arguments[:1] == ["--check"]
    (place,) = arguments[1:] if is_check else arguments
    rows = [row(file.parent) for file in sorted(Path(place).glob("*/converge.json"))]
    sums = [sum(counts) for counts in zip(*(counts for _, counts in rows), strict=True)]
    all_of = [f"{len(rows)} scenarios", *(f"{total:,}" for total in sums), "", ""]
    text = PAGE.read_text()
    start = text.index(HEAD)
    end = text.index("\n\n", start)
    head = text[start:].split("\n")[:2]
    lines = [f"| {' | '.join(cells)} |" for cells in [*(cells for cells, _ in rows), all_of]]
    # Empty cells; neighbors share a bar.
    table = "\n".join([*head, *lines]).replace("|  |", "| |").replace("|  |", "| |")
    if not is_check:
        PAGE.write_text(text[:start] + table + text[end:])
    elif table != text[start:end]:
        changes = difflib.unified_diff(
            text[start:end].split("\n"), table.split("\n"), "docs/coupling.md", place, lineterm="", n=0
        )
        sys.exit("\n".join([*changes, "error: the table differs; `python docs/coupling.py DIR` writes it"]))
    print(
        f"coupling errors of {all_of[0]}: {all_of[4]} of {all_of[2]} metrics above the limit, {all_of[3]} independent"
    )


if __name__ == "__main__":
    main(sys.argv[1:])

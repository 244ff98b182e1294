"""Results as text: numbers, units of measure, and the table that compares our numbers with the paper's."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Callable, Sequence

from tabulate import tabulate

from .. import _native
from ..evaluation.grading import NO_CHANGE
from ..evaluation.results_table import Row, Statistic
from ..files.plan import Plan

# Numbers below this are shown with a power of ten.
SMALL = 1e-4

# Two changes are called similar if their ratio is between this and its inverse.
SIMILAR = 0.75


def remark(cell: Row) -> str:
    """Describe how our numbers compare with those of the paper."""
    if cell.ours is None:
        return ""
    parts = []
    if cell.difference is not None:
        parts.append(f"{signed(cell.difference)} from the paper's value")
    if cell.change is not None and cell.paper_change is not None:
        parts.append(_direction(cell.change, cell.paper_change))
    return "; ".join(parts)


def _direction(ours: Statistic, paper: float) -> str:
    none_here = abs(ours.mean) < max(NO_CHANGE, ours.deviation or 0.0)
    none_there = abs(paper) < NO_CHANGE
    if none_here or none_there:
        return "no change " + ("in both" if none_here and none_there else "here" if none_here else "in the paper")
    ratio = ours.mean / paper
    if ratio < 0.0:
        return "opposite direction"
    size = "smaller" if ratio < SIMILAR else "larger" if ratio * SIMILAR > 1.0 else "similar"
    return f"same direction, {size} change"


def number(value: float | None, digits: int | None) -> str:
    """Format a number with `digits` decimals, or four significant digits; a dash for None."""
    return "–" if value is None else _native.number(value, digits)


def printed(value: float | None, digits: int | None) -> str:
    """Format a number from the paper; without `digits`, as in the scenario file."""
    return number(value, digits) if value is None or digits is not None else scientific(value)


def scientific(value: float, digits: int = 6) -> str:
    """Format a number with up to `digits` significant digits, as a power of ten where that is shorter."""
    return _native.scientific(float(f"{value:.{digits}g}"))


def significant(value: float, digits: int) -> str:
    """Format a number with exactly `digits` significant digits, including trailing zeros."""
    rounded = float(f"{value:.{digits}g}")
    if rounded == 0.0 or not 1e-4 <= abs(rounded) < 1e7:
        return scientific(rounded)
    return _minus(f"{rounded:.{max(0, digits - 1 - math.floor(math.log10(abs(rounded))))}f}")


def _percent_decimals(percent: float) -> int:
    """Return the number of decimals for a change in percent: one below 100 %, otherwise none."""
    return 1 if abs(percent) < 99.95 else 0


# Larger changes (percent) are not stated exactly: the baseline is close to zero.
FAR = 1_000.0


def signed(percent: float | None) -> str:
    """Format a change in percent with its sign, and with one decimal if it is below 100 %; a dash for None."""
    if percent is None:
        return "–"
    if abs(percent) >= FAR:
        return f"over {'−' if percent < 0.0 else '+'}{FAR:.0f} %"
    text = f"{percent:+.{_percent_decimals(percent)}f}"
    if float(text) == 0.0:
        text = "0.0"
    return _minus(text) + " %"


def _minus(text: str) -> str:
    """Replace the hyphen by a minus sign, or remove it from a negative zero."""
    if text.startswith("-") and float(text) == 0.0:
        text = text[1:]
    return text.replace("-", "−")


def spread(statistic: Statistic | None, digits: int | None, seeds: int = 1) -> str:
    """Format a mean, with its standard deviation if the seeds matter, and the number of seeds if some are missing."""
    if statistic is None:
        return "–"
    text = number(statistic.mean, digits)
    if statistic.deviation:
        # The deviation gets as many decimals as the mean, which has four significant digits.
        size = abs(statistic.mean)
        if digits is None and size >= SMALL:
            digits = max(0, 3 - math.floor(math.log10(size)))
        text += f" ± {number(statistic.deviation, digits)}"
    if statistic.count < seeds:
        text += f" ({statistic.count} of {seeds})"
    return text


def spread_percent(statistic: Statistic | None) -> str:
    """Format a mean change in percent with its standard deviation, if the seeds matter."""
    if statistic is None:
        return "–"
    text = signed(statistic.mean)
    if statistic.deviation and abs(statistic.mean) < FAR:
        text = f"{text.removesuffix(' %')} ± {statistic.deviation:.{_percent_decimals(statistic.mean)}f} %"
    return text


def pretty_unit(unit: str | None) -> str:
    """Format a unit for display: rad/s2 becomes rad/s², N.m becomes N·m; "" for 1 and None."""
    return _native.unit(unit or "")


def with_unit(title: str, unit: str | None) -> str:
    """Append a unit in parentheses, if there is one."""
    pretty = pretty_unit(unit)
    return f"{title} ({pretty})" if pretty else title


# Columns of `table.csv`.
MACHINE: dict[str, Callable[[Row], object]] = {
    "metric": lambda row: row.metric.name,
    "title": lambda row: row.metric.title,
    "kind": lambda row: row.metric.kind or row.metric.value,
    "unit": lambda row: row.metric.unit or "",
    "case": lambda row: row.case,
    "point": lambda row: row.point,
    "seeds": lambda row: row.ours.count if row.ours else 0,
    "ours": lambda row: row.ours and row.ours.mean,
    "ours_deviation": lambda row: row.ours and row.ours.deviation,
    "change_percent": lambda row: row.change and row.change.mean,
    "change_percent_deviation": lambda row: row.change and row.change.deviation,
    "paper": lambda row: row.paper,
    "paper_change_percent": lambda row: row.paper_change,
    "difference_percent": lambda row: row.difference,
    "paper_table": lambda row: row.metric.paper and row.metric.paper.table,
    "origin": lambda row: row.origin,
    "badge": lambda row: row.status and row.status.value,
}
HEADER = ("Metric", "Point", "Case", "Paper", "Ours", "Change, paper", "Change, ours", "Badge")
# The first right-aligned column.
FIRST_NUMBER = HEADER.index("Paper")

# Note below a table that contains a dash for a change.
NEGLIGIBLE = "A dash instead of a change: the baseline is negligible compared with the other values of the metric."


def _text_rows(plan: Plan, cells: Sequence[Row]) -> tuple[list[str], list[list[str]], int]:
    """Return header and rows without empty columns, and the number of left-aligned columns."""
    rows = [
        [
            with_unit(c.metric.title, c.metric.unit),
            plan.point_titles[c.point],
            plan.case_titles[c.case],
            printed(c.paper, c.metric.digits),
            spread(c.ours, c.metric.digits, len(plan.seeds)),
            signed(c.paper_change),
            spread_percent(c.change),
            c.status.title if c.status else "",
        ]
        for c in cells
    ]
    keep = [i for i in range(len(HEADER)) if any(row[i] not in ("", "–") for row in rows) or HEADER[i] == "Ours"]
    left = sum(i < FIRST_NUMBER for i in keep)
    return [HEADER[i] for i in keep], [[row[i] for i in keep] for row in rows], left


def markdown(plan: Plan, cells: Sequence[Row]) -> str:
    """Return the table as Markdown."""
    header, rows, left = _text_rows(plan, cells)
    escaped = [[cell.replace("|", "\\|") for cell in row] for row in rows]
    return f"# {plan.title}\n\n" + text(header, escaped, left, "pipe") + _notes(cells)


def console(plan: Plan, cells: Sequence[Row]) -> str:
    """Return the table for a terminal."""
    header, rows, left = _text_rows(plan, cells)
    shown = [list(row) for row in rows]
    for i in range(len(shown) - 1, 0, -1):
        if rows[i][0] == rows[i - 1][0]:
            shown[i][0] = ""
    return text(header, shown, left, "simple") + _notes(cells)


def text(header: Sequence[str], rows: Sequence[Sequence[str]], left: int, style: str) -> str:
    """Return the table in a style of tabulate, its first columns aligned to the left."""
    align = ["left" if i < left else "right" for i in range(len(header))]
    # The cells are already formatted; tabulate must not parse them as numbers.
    text = tabulate(rows, header, style, colalign=align, headersalign=align, disable_numparse=True)
    return "\n".join(line.rstrip() for line in text.splitlines()) + "\n"


def _notes(cells: Sequence[Row]) -> str:
    return f"\n{NEGLIGIBLE}\n" if any(c.negligible for c in cells) else ""


def machine(cells: Sequence[Row]) -> str:
    """Return the table as CSV with all digits; missing values are empty."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(MACHINE)
    writer.writerows([of(row) for of in MACHINE.values()] for row in cells)
    return out.getvalue()

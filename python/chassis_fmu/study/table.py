"""The tables of a study: a row for each run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import pyarrow as pa

from . import design
from .job import Done, Job

Rows = Mapping[tuple[int, int], Done]
"""Rows by sample number and cell index."""


def runs(job: Job, values: Sequence[Sequence[Any]], rows: Rows) -> pa.Table:
    """Return a row for each completed run, by sample, case and point: values, metrics, requirements, status."""
    keys = sorted(rows)
    done = [rows[key] for key in keys]
    cells = [job.cells[cell] for _, cell in keys]
    columns = [*_places(job, rows), (pa.field("seed", pa.int64()), [cell.seed for cell in cells])]
    columns += [
        design.column(factor, [of[number] for number, _ in keys])
        for factor, of in zip(job.study.vary, values, strict=True)
    ]
    for at, index in enumerate(job.metrics):
        metric = job.plan.metrics[index]
        field = pa.field(metric.name, pa.float64(), metadata={"unit": metric.unit or "1"})
        columns.append((field, [row.numbers[at] if row.numbers else None for row in done]))
    for limits in job.requirements:
        held = [
            limits.holds(job.judged(limits, rows, *key)) if cell.case in limits.cases else None
            for key, cell in zip(keys, cells, strict=True)
        ]
        name = job.plan.metrics[limits.metric].name
        columns.append((pa.field(f"meets:{name}:change" if limits.of_change else f"meets:{name}", pa.bool_()), held))
    for name in ("status", "time", "component", "variable", "message"):
        is_time = name == "time"
        field = pa.field(name, pa.float64() if is_time else pa.string(), metadata={"unit": "s"} if is_time else None)
        columns.append((field, [getattr(row, name) for row in done]))
    return design.of_columns(columns)


def timing(job: Job, rows: Rows) -> pa.Table:
    """Return the duration of each run (s), in a separate table because it differs between executions."""
    seconds = [rows[key].seconds for key in sorted(rows)]
    return design.of_columns(
        [*_places(job, rows), (pa.field("seconds", pa.float64(), metadata={"unit": "s"}), seconds)]
    )


def _places(job: Job, rows: Rows) -> list[tuple[pa.Field, Any]]:
    return [
        (pa.field("sample", pa.int64()), [number for number, _ in sorted(rows)]),
        (pa.field("case", pa.string()), [job.cells[cell].case for _, cell in sorted(rows)]),
        (pa.field("point", pa.string()), [job.cells[cell].point for _, cell in sorted(rows)]),
    ]

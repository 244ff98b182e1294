"""The tables of a study: a row for each run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import pyarrow as pa

from . import design
from .job import Done, Job

Rows = Mapping[tuple[int, int], Done]
"""By number of the sample and index of the cell."""


def runs(job: Job, values: Sequence[Sequence[Any]], rows: Rows) -> pa.Table:
    """Return a row for each run that is done, by sample, case and point: values, metrics, requirements, status."""
    keys = sorted(rows)
    done = [rows[key] for key in keys]
    cells = [job.cells[cell] for _, cell in keys]
    columns = [
        (pa.field("sample", pa.int64()), [number for number, _ in keys]),
        (pa.field("case", pa.string()), [cell.case for cell in cells]),
        (pa.field("point", pa.string()), [cell.point for cell in cells]),
        (pa.field("seed", pa.int64()), [cell.seed for cell in cells]),
    ]
    columns += [
        design.column(job.study, factor.name, [of[number] for number, _ in keys])
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
    columns += [
        (pa.field("status", pa.string()), [row.status for row in done]),
        (pa.field("time", pa.float64(), metadata={"unit": "s"}), [row.time for row in done]),
        (pa.field("component", pa.string()), [row.component for row in done]),
        (pa.field("variable", pa.string()), [row.variable for row in done]),
        (pa.field("message", pa.string()), [row.message for row in done]),
    ]
    return _table(columns)


def timing(job: Job, rows: Rows) -> pa.Table:
    """Return how long each run took (s), which no two executions agree on."""
    keys = sorted(rows)
    cells = [job.cells[cell] for _, cell in keys]
    return _table(
        [
            (pa.field("sample", pa.int64()), [number for number, _ in keys]),
            (pa.field("case", pa.string()), [cell.case for cell in cells]),
            (pa.field("point", pa.string()), [cell.point for cell in cells]),
            (pa.field("seconds", pa.float64(), metadata={"unit": "s"}), [rows[key].seconds for key in keys]),
        ]
    )


def _table(columns: Sequence[tuple[pa.Field, Any]]) -> pa.Table:
    """Return a table of fields and their values."""
    schema = pa.schema([field for field, _ in columns])
    return pa.table([pa.array(of, field.type) for field, of in columns], schema=schema)

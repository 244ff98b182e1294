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
    fields = [pa.field("sample", pa.int64()), pa.field("case", pa.string()), pa.field("point", pa.string())]
    fields.append(pa.field("seed", pa.int64()))
    arrays = [
        pa.array([number for number, _ in keys], pa.int64()),
        pa.array([cell.case for cell in cells], pa.string()),
        pa.array([cell.point for cell in cells], pa.string()),
        pa.array([cell.seed for cell in cells], pa.int64()),
    ]
    for factor, of in zip(job.study.vary, values, strict=True):
        field, array = design.column(job.study, factor.name, [of[number] for number, _ in keys])
        fields.append(field)
        arrays.append(array)
    for at, index in enumerate(job.metrics):
        metric = job.plan.metrics[index]
        fields.append(pa.field(metric.name, pa.float64(), metadata={"unit": metric.unit or "1"}))
        arrays.append(pa.array([row.numbers[at] if row.numbers else None for row in done], pa.float64()))
    for limits in job.requirements:
        held = [
            limits.holds(job.judged(limits, rows, *key)) if cell.case in limits.cases else None
            for key, cell in zip(keys, cells, strict=True)
        ]
        name = job.plan.metrics[limits.metric].name
        fields.append(pa.field(f"meets:{name}:change" if limits.of_change else f"meets:{name}", pa.bool_()))
        arrays.append(pa.array(held, pa.bool_()))
    fields += [pa.field("status", pa.string()), pa.field("time", pa.float64(), metadata={"unit": "s"})]
    fields += [pa.field(name, pa.string()) for name in ("component", "variable", "message")]
    arrays += [
        pa.array([row.status for row in done], pa.string()),
        pa.array([row.time for row in done], pa.float64()),
        pa.array([row.component for row in done], pa.string()),
        pa.array([row.variable for row in done], pa.string()),
        pa.array([row.message for row in done], pa.string()),
    ]
    return pa.table(arrays, schema=pa.schema(fields))


def timing(job: Job, rows: Rows) -> pa.Table:
    """Return how long each run took (s), which no two executions agree on."""
    keys = sorted(rows)
    schema = pa.schema(
        [
            pa.field("sample", pa.int64()),
            pa.field("case", pa.string()),
            pa.field("point", pa.string()),
            pa.field("seconds", pa.float64(), metadata={"unit": "s"}),
        ]
    )
    columns = [
        [number for number, _ in keys],
        [job.cells[cell].case for _, cell in keys],
        [job.cells[cell].point for _, cell in keys],
        [rows[key].seconds for key in keys],
    ]
    return pa.table([pa.array(c, f.type) for c, f in zip(columns, schema, strict=True)], schema=schema)

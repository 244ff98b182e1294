"""Designs: the values of all samples of a study, chosen before the first run.

A design is a table with a row for each sample and a column for each factor. It depends only on the study, including its
seed and number of samples, and is bit-identical for every machine, engine and execution order. It is sampled once and
written as `design.parquet`, which all engines, `--resume`, shards and `merge` read.
"""

from __future__ import annotations

import hashlib
import itertools
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pyarrow as pa
import pyarrow.parquet
import scipy.stats
from numpy.typing import NDArray
from scipy.stats import qmc

from ..files import results
from .factors import Factor
from .file import SAMPLES, Study, StudyError, needed

Array = NDArray[np.float64]


def shares(study: Study) -> Array:
    """Return the shares (arguments of the inverse distribution functions), a row per sample and a column per factor.

    With method "sample", every choice of FMUs gets the same values of all other factors, so choices can be compared in
    pairs. With weights, the choice of an FMU is random instead.
    """
    if study.method == "sensitivity":
        return sensitivity(study)
    if study.method == "sweep":
        return by_levels(study)
    crossed = [i for i, factor in enumerate(study.vary) if factor.fmu is not None and factor.weights is None]
    others = [i for i in range(len(study.vary)) if i not in crossed]
    own = samples(study, len(others)) if others else np.empty((1, 0))
    choices = list(itertools.product(*(middles(study.vary[i]) for i in crossed)))
    found = np.empty((len(own) * len(choices), len(study.vary)))
    found[:, others] = np.repeat(own, len(choices), axis=0)
    found[:, crossed] = np.tile(np.array(choices).reshape(len(choices), len(crossed)), (len(own), 1))
    return found


def samples(study: Study, factors: int) -> Array:
    """Return random or low-discrepancy shares for the given number of factors."""
    count = study.runs or SAMPLES
    design = study.chosen_design
    if design == "random":
        # Excludes 0, for which a normal value would be infinite.
        return np.maximum(np.random.default_rng(study.seed).random((count, factors)), 2.0**-54)
    if design == "latin_hypercube":
        sampler: Any = qmc.LatinHypercube(factors, rng=np.random.default_rng(study.seed))
        return np.asarray(sampler.random(count))
    sampler = qmc.Sobol(factors, rng=np.random.default_rng(study.seed))
    # Sobol points are generated up to the next power of two; the first `count` are used.
    return np.asarray(sampler.random_base2(max(0, (count - 1).bit_length()))[:count])


def middles(factor: Factor) -> list[float]:
    """Return a share in the middle of each level of a factor."""
    ends = factor.ends
    return [float(v) for v in 0.5 * (ends + np.concatenate([[0.0], ends[:-1]]))]


def by_levels(study: Study) -> Array:
    """Return the shares of a design in which every factor takes its levels only."""
    levels = [middles(factor) for factor in study.vary]
    if study.chosen_design == "full_factorial":
        return np.array(list(itertools.product(*levels)), np.float64)
    if study.chosen_design == "list":
        return np.array(list(zip(*levels, strict=True)), np.float64)
    # One at a time: all factors at their middle level, then each factor at its other levels.
    center = [values[len(values) // 2] for values in levels]
    rows = [center]
    for at, values in enumerate(levels):
        rows += [[*center[:at], value, *center[at + 1 :]] for value in values if value != center[at]]
    return np.array(rows, np.float64)


def problem(study: Study) -> dict[str, Any]:
    """Return a SALib problem: names and ranges of the shares."""
    count = len(study.vary)
    return {"num_vars": count, "names": [f.name for f in study.vary], "bounds": [[0.0, 1.0]] * count}


def sensitivity(study: Study) -> Array:
    """Return the shares for a sensitivity analysis."""
    needed("method sensitivity", "SALib")
    import SALib.sample.morris
    import SALib.sample.sobol

    count = study.runs or SAMPLES
    if study.analysis == "morris":
        found = SALib.sample.morris.sample(problem(study), count, num_levels=4, seed=study.seed)
    else:
        found = SALib.sample.sobol.sample(problem(study), count, calc_second_order=False, seed=study.seed)
    # Shares of 0 or 1 would give infinite values for a distribution without limits.
    return np.clip(np.asarray(found, np.float64), 1e-6, 1.0 - 1e-6)


def values(study: Study, of: Array) -> list[list[Any]]:
    """Return the values of each factor, with the correlations of the study."""
    if study.correlation:
        of = _correlated(study, of)
    return [factor.column(of[:, i]) for i, factor in enumerate(study.vary)]


def _correlated(study: Study, of: Array) -> Array:
    """Correlate the shares of the normal factors, with the Cholesky factor of the correlation matrix."""
    names = [factor.name for factor in study.vary]
    used = sorted({names.index(n) for c in study.correlation for n in c.between})
    factor = np.linalg.cholesky(study.correlations[np.ix_(used, used)])
    normal = scipy.stats.norm.ppf(of[:, used])
    # Multiply in a fixed order of operations: the rounding of linear algebra libraries depends on the machine.
    mixed = np.zeros_like(normal)
    for row in range(len(used)):
        for column in range(row + 1):
            mixed[:, row] += factor[row, column] * normal[:, column]
    out = of.copy()
    out[:, used] = scipy.stats.norm.cdf(mixed)
    return out


def column(factor: Factor, of: list[Any]) -> tuple[pa.Field, list[Any]]:
    """Return a column of a table with the values of a factor."""
    first = of[0] if of else 0.0
    if isinstance(first, str):
        kind: pa.DataType = pa.string()
    elif isinstance(first, bool):
        kind = pa.bool_()
    elif factor.distribution == "seed":
        kind = pa.int64()
    else:
        kind, of = pa.float64(), [float(v) for v in of]
    unit = "1" if factor.unit is None else factor.unit
    metadata = {} if kind in (pa.string(), pa.bool_()) else {"unit": unit}
    return pa.field(factor.name, kind, metadata=metadata), of


def of_columns(columns: Sequence[tuple[pa.Field, Any]]) -> pa.Table:
    """Return a table from fields and their values."""
    schema = pa.schema([field for field, _ in columns])
    return pa.table([pa.array(of, field.type) for field, of in columns], schema=schema)


def table(study: Study, columns: list[list[Any]]) -> pa.Table:
    """Return the design as a table: `sample`, then a column for each factor."""
    sample = pa.field("sample", pa.int64()), range(len(columns[0]))
    return of_columns([sample, *(column(factor, of) for factor, of in zip(study.vary, columns, strict=True))])


def key(study: Study) -> str:
    """Return a hash of everything that determines the samples."""
    raw = msgspec.to_builtins(study)
    parts = {name: raw[name] for name in ("method", "design", "analysis", "runs", "seed", "vary", "correlation")}
    return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()


def store(study: Study, path: Path) -> None:
    """Sample the design of a study and write it, unless the file already contains it."""
    try:
        is_there = (pyarrow.parquet.read_schema(path).metadata or {}).get(b"study") == key(study).encode()
    except (OSError, pa.ArrowException):
        is_there = False
    if not is_there:
        found = table(study, values(study, shares(study)))
        results.write_table(path, found.replace_schema_metadata({"study": key(study)}))


def read(study: Study, path: Path) -> tuple[list[list[Any]], str]:
    """Return the values of each factor from the file that `store` has written, and the hash of the file."""
    try:
        content = path.read_bytes()
        # Read without threads: pyarrow's threads free the buffer later, which aborts a process that is exiting
        # (SIGABRT).
        found = pyarrow.parquet.ParquetFile(pa.BufferReader(content), pre_buffer=False).read(use_threads=False)
    except (OSError, pa.ArrowException) as error:
        raise StudyError(f"cannot read {path}: {error}; --overwrite samples it again") from error
    names = ["sample", *(factor.name for factor in study.vary)]
    if found.column_names != names or not found.num_rows:
        raise StudyError(f"{path} is not the design of this study; --overwrite samples it again")
    return [found[name].to_pylist() for name in names[1:]], hashlib.sha256(content).hexdigest()


def check(study: Study, found: Sequence[Sequence[Any]], path: Path) -> None:
    """Raise StudyError if sensitivity indices cannot be computed from the design."""
    if study.method == "sensitivity" and values(study, shares(study)) != [list(column) for column in found]:
        raise StudyError(
            f"{path} was sampled by another version of SALib or SciPy, so the indices would be wrong: continue with "
            "that version, or use --overwrite"
        )

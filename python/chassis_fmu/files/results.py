"""Recorded signals as CSV and Parquet files, written completely or not at all."""

from __future__ import annotations

import base64
import contextlib
import csv
import functools
import os
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet
from numpy.typing import NDArray

from .plan import BinaryText

Array = NDArray[np.floating[Any]]


class ResultsError(Exception):
    """A results file cannot be read."""


@dataclass(frozen=True)
class Recording:
    """Recorded signals of a run: times (s) and, per signal, values in the unit of the variable."""

    times: Array
    values: dict[str, Array]


@contextlib.contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Yield a temporary path in the same folder, and rename it to `path` if the block ends without an error."""
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(prefix=f".{path.name}.", suffix=".part", dir=path.parent)
    os.close(handle)
    temporary = Path(name)
    try:
        yield temporary
        temporary.chmod(0o644)
        temporary.replace(path)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise


def write_text(path: Path, text: str) -> None:
    """Write a text file (UTF-8, line feeds)."""
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8", newline="\n")


def write_csv(
    path: Path, names: Sequence[str], times: Array, rows: Array, texts: Mapping[int, Sequence[str]] | None = None
) -> None:
    """Write `time` and the columns, every number with the fewest digits that identify the double.

    `texts` has the texts of the columns with values that a double cannot represent, by their position in `names`.
    The file is byte-identical to the one from the native master.
    """
    with replacing(path) as temporary, temporary.open("w", encoding="utf-8", newline="") as file:
        csv.writer(file, lineterminator="\n").writerow(["time", *names])
        for index, (time, row) in enumerate(zip(times.tolist(), rows.tolist(), strict=True)):
            # Exponents as in Rust: neither padded nor with a plus sign.
            line = ",".join(map(repr, (time, *row))).replace("e-0", "e-").replace("e+", "e")
            if texts:
                cells = line.split(",")
                for column, values in texts.items():
                    cells[column + 1] = values[index]
                line = ",".join(cells)
            file.write(line + "\n")


def read_csv(path: Path, names: Sequence[str] | None = None) -> Recording:
    """Read a file from `write_csv` or the native master: all signals, or those of `names` that it contains."""
    try:
        with path.open(encoding="utf-8", newline="") as file:
            present = next(csv.reader(file), [])
        wanted = present if names is None else ["time", *(n for n in names if n in present)]
        options = pyarrow.csv.ConvertOptions(include_columns=list(dict.fromkeys(wanted)))
        table = pyarrow.csv.read_csv(path, convert_options=options)
        values = {name: np.ascontiguousarray(table[name].to_numpy().astype(np.float64)) for name in table.column_names}
        return Recording(values.pop("time"), values)
    except (OSError, ValueError, KeyError, csv.Error, pa.ArrowException) as error:
        raise ResultsError(f"{path}: cannot read the results: {error}") from error


def read_binaries(path: Path, names: Sequence[str], encoding: BinaryText | None) -> dict[str, list[bytes]]:
    """Read the columns of `names` that a file contains, which are texts of Binaries."""
    decode = bytes.fromhex if encoding == "hex" else functools.partial(base64.b64decode, validate=True)
    try:
        with path.open(encoding="utf-8", newline="") as file:
            rows = list(csv.DictReader(file)) if names else []
        return {name: [decode(row[name]) for row in rows] for name in names if rows and name in rows[0]}
    except (OSError, ValueError, csv.Error) as error:
        raise ResultsError(f"{path}: cannot read the results: {error}") from error


def write_table(path: Path, table: pa.Table, **options: Any) -> None:
    """Write a table as Parquet; the same table always gives the same bytes."""
    with replacing(path) as temporary:
        pyarrow.parquet.write_table(table, temporary, compression="zstd", **options)


def write_parquet(
    path: Path, recording: Recording, units: Mapping[str, str], binaries: Mapping[str, Sequence[bytes]] | None = None
) -> None:
    """Write a recording as Parquet, with units of measure as field metadata, and the columns of Binaries.

    Byte stream split with zstd compresses series of doubles well.
    """
    signals, units = {"time": recording.times, **recording.values}, {"time": "s", **units}
    fields = [pa.field(name, pa.float64(), nullable=False, metadata={"unit": units[name]}) for name in signals]
    columns = [pa.array(values) for values in signals.values()]
    for name, values in (binaries or {}).items():
        fields.append(pa.field(name, pa.binary(), nullable=False))
        columns.append(pa.array(values, pa.binary()))
    table = pa.Table.from_arrays(columns, schema=pa.schema(fields))
    # Only numbers can be split by bytes.
    split = list(signals) if binaries else True
    write_table(path, table, use_dictionary=False, use_byte_stream_split=split)

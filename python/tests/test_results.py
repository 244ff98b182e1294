"""Results files: exact round trips, and files that are complete or absent."""

from pathlib import Path

import numpy as np
import pyarrow.parquet
import pytest

from chassis_fmu.files import results

# The last number is halfway between two equally short decimal representations.
NASTY = [0.1 + 0.2, -0.0, 5e-324, 1.7976931348623157e308, 1e-5, 1e16, 123456789.12345679, 1.0, -2.5e-8, 2.0**-25]


def bits(values: results.Array) -> list[int]:
    return [int(b) for b in np.ascontiguousarray(values).view(np.uint64)]


@pytest.fixture
def table() -> tuple[list[str], results.Array, results.Array]:
    times = np.arange(len(NASTY)) * 0.001
    return ["body.roll", "plant:body.pitch"], times, np.column_stack([NASTY, NASTY[::-1]])


def test_csv_gives_the_same_doubles_back(tmp_path: Path, table: tuple[list[str], results.Array, results.Array]) -> None:
    names, times, rows = table
    results.write_csv(tmp_path / "a.csv", names, times, rows)
    back = results.read_csv(tmp_path / "a.csv")
    assert list(back.values) == names
    assert bits(back.times) == bits(times)
    for i, name in enumerate(names):
        assert bits(back.values[name]) == bits(rows[:, i])
    some = results.read_csv(tmp_path / "a.csv", ["plant:body.pitch", "absent"])
    assert list(some.values) == ["plant:body.pitch"]


def test_csv_is_written_as_the_native_master_does(tmp_path: Path) -> None:
    # The test in crates/fmu-system/src/results/number.rs expects the same line.
    expected = (
        "0.30000000000000004,-0.0,5e-324,1.7976931348623157e308,1e-5,1e16,123456789.12345679,1.0,-2.5e-8,"
        "2.9802322387695312e-8"
    )
    results.write_csv(tmp_path / "a.csv", [*"abcdefgh", 'i,"j"'], np.array(NASTY[:1]), np.array([NASTY[1:]]))
    assert (tmp_path / "a.csv").read_bytes() == f'time,a,b,c,d,e,f,g,h,"i,""j"""\n{expected}\n'.encode()
    assert list(results.read_csv(tmp_path / "a.csv").values) == [*"abcdefgh", 'i,"j"']


def test_a_csv_of_whole_numbers_is_read_as_doubles(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("time,switch.mode\n0,1\n1,0\n")
    assert results.read_csv(tmp_path / "a.csv").values["switch.mode"].tolist() == [1.0, 0.0]


def test_parquet_gives_the_same_doubles_back(
    tmp_path: Path, table: tuple[list[str], results.Array, results.Array]
) -> None:
    names, times, rows = table
    recording = results.Recording(times, dict(zip(names, rows.T, strict=True)))
    results.write_parquet(tmp_path / "a.parquet", recording, dict.fromkeys(names, "rad"))
    back = pyarrow.parquet.read_table(tmp_path / "a.parquet")
    assert bits(back["time"].to_numpy()) == bits(times)
    for i, name in enumerate(names):
        assert bits(back[name].to_numpy()) == bits(rows[:, i])


def test_parquet_is_a_function_of_its_content(
    tmp_path: Path, table: tuple[list[str], results.Array, results.Array]
) -> None:
    names, times, rows = table
    for file in ("a.parquet", "b.parquet"):
        recording = results.Recording(times, dict(zip(names, rows.T, strict=True)))
        results.write_parquet(tmp_path / file, recording, dict.fromkeys(names, "rad"))
    assert (tmp_path / "a.parquet").read_bytes() == (tmp_path / "b.parquet").read_bytes()


def test_an_error_leaves_the_old_file_and_nothing_else(tmp_path: Path) -> None:
    path = tmp_path / "table.md"
    results.write_text(path, "old")

    def write_half() -> None:
        with results.replacing(path) as temporary:
            temporary.write_text("half")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_half()
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("text", ["", "time,a\n0.0\n", "t,a\n0.0,1.0\n", "time,a\n0.0,x\n"])
def test_a_broken_csv_is_named(tmp_path: Path, text: str) -> None:
    (tmp_path / "a.csv").write_text(text)
    with pytest.raises(results.ResultsError, match=r"a\.csv"):
        results.read_csv(tmp_path / "a.csv")

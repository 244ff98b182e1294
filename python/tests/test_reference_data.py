"""The reference data of the drivers, Road, Sensor, Actuator and SuspensionMixer agree with `reference_runs.py`.

The random numbers and road harmonics of `reference_runs.py` are compared with published numbers.
"""

from __future__ import annotations

import gzip
import importlib.util
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

ROOT = Path(__file__).parents[2]

_spec = importlib.util.spec_from_file_location("reference_runs", Path(__file__).with_name("reference_runs.py"))
assert _spec is not None
assert _spec.loader is not None
runs = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(runs)


def numbers(table: str) -> NDArray[np.float64]:
    names, *rows = table.splitlines()
    cells = [[float(cell) if cell else np.nan for cell in row.split(",")] for row in rows]
    return np.array(cells).reshape(-1, names.count(",") + 1)


def test_generator_is_chacha8() -> None:
    # First block of ChaCha8 with a zero key, stream 0: test vector TC1 of draft-strombergson-chacha-test-vectors-01.
    words = runs.chacha8(0, 0, 1)
    assert words.astype("<u4").tobytes()[:16].hex() == "3e00ef2f895f40d67f5bb8e81f09a5a1"


def test_harmonics_give_the_published_numbers() -> None:
    # Heavy vehicle's road: q(25 m) and q(100 m) for seed 1, class B, printed to 1e-8 m.
    found = runs.cosines(np.array([25.0, 100.0]), 64e-6, 1)
    assert found == pytest.approx([-0.00187993, 0.00424432], abs=5e-9)


def test_committed_files_are_those_of_the_program() -> None:
    # Ten digits are printed. Elementary functions in other versions of numpy can differ in the last bit, which can
    # change the last printed digit.
    for name, expected in runs.files().items():
        path = ROOT / name
        data = path.read_bytes()
        found = (gzip.decompress(data) if path.suffix == ".gz" else data).decode()
        assert found.splitlines()[0] == expected.splitlines()[0], name
        a, b = numbers(found), numbers(expected)
        assert a.shape == b.shape, name
        np.testing.assert_array_equal(np.isnan(a), np.isnan(b), err_msg=name)
        np.testing.assert_allclose(a, b, rtol=2e-9, atol=1e-12, err_msg=name)

"""The files from `cargo fmu linearize`. References: numpy and scipy. `test_page_data` tests the page."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.io

from tests import commands

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("linear")
    outputs = [argument for name in ("json", "csv", "mat") for argument in ("--out", f"{folder}/car.{name}")]
    fmu = str(ROOT / "target/fmu/EspCar.fmu")
    code, text = commands.cargo_fmu("linearize", fmu, *outputs)
    assert code == 0
    assert text.startswith("EspCar at its start values\n")
    return folder


@pytest.fixture(scope="module")
def linear(files: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((files / "car.json").read_text(encoding="utf-8"))
    return found


def test_all_files_have_the_same_numbers(files: Path, linear: dict[str, Any]) -> None:
    matlab = scipy.io.loadmat(files / "car.mat")
    for name in "ABCD":
        np.testing.assert_array_equal(matlab[name], np.array(linear[name]).reshape(matlab[name].shape))
    for name in ("states", "inputs", "outputs"):
        assert [str(cell[0][0]) for cell in matlab[name]] == linear[name]
    with (files / "car.csv").open(encoding="utf-8", newline="") as file:
        head, *rows = csv.reader(file)
    assert head == ["", *linear["states"], *linear["inputs"]]
    assert [row[0] for row in rows] == [*(f"der({name})" for name in linear["states"]), *linear["outputs"]]
    whole = np.block([[np.array(linear["A"]), np.array(linear["B"])], [np.array(linear["C"]), np.array(linear["D"])]])
    np.testing.assert_array_equal([[float(cell) for cell in row[1:]] for row in rows], whole)


def test_modes_are_the_eigenvalues(linear: dict[str, Any]) -> None:
    expected = np.linalg.eigvals(np.array(linear["A"]))
    scale = np.abs(expected).max()
    # Poles at 0 belong to non-diagonalizable blocks, where rounding moves them by the root of the rounding error.
    for mode in linear["modes"]:
        pole = complex(mode["real"], mode["imaginary"])
        assert np.abs(expected - pole).min() < 1e-6 * scale
        if mode["damping"] is None:
            assert pole == 0
        else:
            assert mode["damping"] == pytest.approx(-pole.real / abs(pole), rel=1e-12)
            assert mode["frequency"] == pytest.approx(abs(pole) / (2.0 * np.pi), rel=1e-12)


def test_mistakes_are_named(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    fmu = str(ROOT / "target/fmu/EspCar.fmu")
    for options, expected in (
        (["--out", str(tmp_path / "car.txt")], "expected a name that ends in .json, .csv, .mat or .html"),
        (["--out", str(tmp_path / "car.html"), "--bode", "steer.frnt:vehicle.yaw_rate"], "no input `steer.frnt`"),
    ):
        code, _ = commands.cargo_fmu("linearize", fmu, *options)
        assert code == 1
        assert expected in commands.unwrapped(capfd.readouterr().err)
    assert not list(tmp_path.iterdir())

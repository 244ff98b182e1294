"""An FMU written in Python replaces the car's yaw control, in both masters.

PythonFMU builds it from python_yaw_control.py. Such an FMU needs the Python library in the process that loads it. With
fmpy, this process is Python; the native master gets the path of the library.
"""

from __future__ import annotations

import csv
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from chassis_fmu.program import python_library
from tests.commands import CARGO_FMU, CHASSIS

ROOT = Path(__file__).parents[2]
FOLDER = Path(os.environ.get("CHASSIS_FMU_DIR") or ROOT / "target" / "fmu")
SOURCE = Path(__file__).with_name("python_yaw_control.py")
SCENARIO = ROOT / "scenarios" / "swap_esp_car_yaw_control.toml"

# The lines that a user adds to the scenario.
CASE = """
[[case]]
name = "python"
title = "Written in Python"
baseline = "left_out"
fmu.yaw_control = "PythonYawControl"
"""

# Time from which the turn is steady (s), and the data for its yaw rate: front-wheel angle (rad), wheelbase (m),
# stability factor (s2/m2).
SETTLED = 1.5
STEER, WHEELBASE, STABILITY_FACTOR = 0.046, 2.34, 7.99903e-4


def call(*command: str, code: int = 0) -> str:
    done = subprocess.run(
        command,
        cwd=ROOT,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        encoding="utf-8",
        check=False,
    )
    assert done.returncode == code, done.stdout
    return done.stdout


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with the FMU, the scenario and its results by fmpy."""
    folder = tmp_path_factory.mktemp("pythonfmu")
    call(sys.executable, "-m", "pythonfmu", "build", "-f", str(SOURCE), "-d", str(folder))
    scenario = folder / "swapped.toml"
    scenario.write_text(SCENARIO.read_text(encoding="utf-8") + CASE, encoding="utf-8")
    call(
        sys.executable, "-m", "chassis_fmu", "run", "--engine", "fmpy", *options(folder), "--out", str(folder / "fmpy")
    )
    return folder


def options(folder: Path) -> list[str]:
    return [str(folder / "swapped.toml"), "--fmus", str(folder), "--fmus", str(FOLDER)]


def columns(folder: Path, case: str) -> dict[str, NDArray[np.float64]]:
    with (folder / "fmpy" / "swapped" / "runs" / f"{case}.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    return {name: np.array([float(row[name]) for row in rows if row[name]]) for name in rows[0]}


def yaw_rate_error(folder: Path, case: str) -> float:
    """Return the RMS difference from the yaw rate of a steady turn at the current speed (rad/s)."""
    values = columns(folder, case)
    speed = values["vehicle.speed"]
    target = speed * STEER / (WHEELBASE * (1.0 + STABILITY_FACTOR * speed**2))
    error = (values["vehicle.yaw_rate"] - target)[values["time"] >= SETTLED]
    return float(np.sqrt(np.mean(error**2)))


def test_it_controls_the_yaw_rate(folder: Path) -> None:
    # Proportional control leaves an error of less than a tenth of the error without control. A control without effect
    # would leave all of it.
    assert yaw_rate_error(folder, "python") < 0.25 * yaw_rate_error(folder, "left_out")


def test_it_is_another_law(folder: Path) -> None:
    moments = [columns(folder, case)["demand.yaw_moment"] for case in ("python", "coordination")]
    # The limit is in N.m; both yaw moments are some hundred N.m.
    assert np.abs(moments[0] - moments[1]).max() > 10.0


@pytest.fixture(scope="module")
def python() -> list[str]:
    """Return the arguments that pass the Python library to a native program."""
    path = python_library()
    if path is None:
        pytest.skip("this Python has no shared library, which a master that is not Python needs for FMUs in Python")
    return ["--libpython", str(path)]


def test_the_check_validates_description_and_binary(folder: Path, python: list[str]) -> None:
    """References: FMI 2.0.4, section 2.2.8 (initial unknowns), and PythonFMU, which does not compare the GUID."""
    check = (*CARGO_FMU, "check", str(folder / "PythonYawControl.fmu"))
    report = call(*check, *python, code=1)
    errors = [line for line in report.splitlines() if line.startswith("  error: ")]
    assert len(errors) == 7
    assert all("is not listed in ModelStructure/InitialUnknowns" in line for line in errors), report
    assert "a wrong GUID is accepted" in report
    # Without the Python library, it is also a finding that the binary cannot be loaded, with the remedy.
    without = call(*check, code=1)
    assert "needs the Python library" in without
    assert "--libpython FILE" in without


def test_the_bench_assesses_it(folder: Path, python: list[str]) -> None:
    """Reference: with proportional control, the yaw rate responds faster to a step, by at least 10 %."""
    out = folder / "assessed"
    controller = str(folder / "PythonYawControl.fmu")
    # The antilock brakes add the pressures that the controller requests to the pedal's pressure.
    base = ["--base", "AntilockBraking", "--base", "BrakeAndDriveActuators"]
    more = ["--suite", "handling", "--fmus", str(FOLDER), "--out", str(out)]
    call(CHASSIS, "bench", "run", "EspCar", *base, "--no-page", "--with", controller, *python, *more)
    assessment = json.loads((out / "assessment.json").read_text(encoding="utf-8"))
    rows = {row["id"]: row for row in assessment["metrics"]}
    times = rows["step_steer.yaw_rate.response_time"]
    assert times["with"] < 0.9 * times["without"]
    assert assessment["with"][0]["fmu"] == "PythonYawControl"
    assert assessment["idle"] == []


def test_both_masters_agree_to_the_last_bit(folder: Path, python: list[str]) -> None:
    out = folder / "native"
    # The Python command finds the library automatically.
    call(sys.executable, "-m", "chassis_fmu", "run", *options(folder), "--out", str(out))
    assert python
    names = sorted(p.name for p in (out / "swapped" / "runs").glob("*.csv"))
    assert names == ["coordination.csv", "left_out.csv", "python.csv", "sign.csv"]
    for name in names:
        native, fmpy = (folder / master / "swapped" / "runs" / name for master in ("native", "fmpy"))
        assert native.read_bytes() == fmpy.read_bytes(), name

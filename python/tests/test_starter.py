"""`chassis new`: the scenarios that it writes run, for every plant in the library."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from chassis_fmu.files import results
from tests.commands import chassis, unwrapped

PLANTS = ["BicycleCar", "EspCar", "HeavyVehicle", "HydroPneumaticHalfCar", "RescueVehicle"]

# The maneuvers of the driver, except for the table of angles, which needs a file.
MANEUVERS = ["straight", "ramp_step", "fishhook", "double_lane_change", "slalom", "sine_with_dwell", "sine_sweep"]


def start(plant: str, maneuver: str, folder: Path) -> Path:
    """Write a scenario and check that it is short."""
    name = folder / f"{plant}_{maneuver}".lower()
    code, _ = chassis("new", name, "--plant", plant, "--maneuver", maneuver)
    assert code == 0
    scenario = name.with_suffix(".toml")
    assert len(scenario.read_text(encoding="utf-8").splitlines()) <= 60
    return scenario


def lateral_acceleration(scenario: Path, out: Path, *options: str) -> NDArray[np.floating[Any]]:
    code, _ = chassis("run", scenario, "--no-page", "--out", out, *options)
    assert code == 0
    file = out / scenario.stem / "runs" / "open_loop.csv"
    return results.read_csv(file, ["vehicle.lateral_acceleration"]).values["vehicle.lateral_acceleration"]


@pytest.mark.parametrize("plant", PLANTS)
def test_a_new_scenario_runs(plant: str, tmp_path: Path) -> None:
    scenario = start(plant, "sine_with_dwell", tmp_path)
    # The driver steers, so the vehicle accelerates to both sides.
    acceleration = lateral_acceleration(scenario, tmp_path / "out")
    assert acceleration.min() < -0.5
    assert acceleration.max() > 0.5
    # Nothing is overwritten.
    code, _ = chassis("new", scenario.with_suffix(""), "--plant", plant)
    assert code == 1


@pytest.mark.parametrize("maneuver", MANEUVERS)
def test_every_maneuver_runs_with_every_plant(maneuver: str, tmp_path: Path) -> None:
    for plant in PLANTS:
        acceleration = lateral_acceleration(start(plant, maneuver, tmp_path), tmp_path / "out", "--stop", "3")
        assert np.isfinite(acceleration).all(), plant
        # All other maneuvers steer within these 3 s. On a rough road, the vehicle also moves when it drives straight
        # ahead.
        assert maneuver == "straight" or np.abs(acceleration).max() > 0.5, plant


def test_the_maneuvers_are_those_of_the_driver(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    code, _ = chassis("new", tmp_path / "a", "--plant", "EspCar", "--maneuver", "none_of_them")
    assert code == 1
    text = unwrapped(capfd.readouterr().err)
    for name in MANEUVERS:
        assert f"{name}," in text
    # The error for a maneuver that needs more than its name lists what is missing.
    code, _ = chassis("new", tmp_path / "a", "--plant", "EspCar", "--maneuver", "table")
    assert code == 1
    assert "table.file" in unwrapped(capfd.readouterr().err)


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        (("--plant", "EspCarr"), "did you mean `EspCar`?"),
        (("--plant", "EspCar", "--maneuver", "sine_with_dwel"), "did you mean `sine_with_dwell`?"),
        (("--plant", "Driver", "--maneuver", "fishhook", "--fmus", "nowhere"), "`cargo fmu pack Driver`"),
    ],
)
def test_mistakes_are_named(
    options: tuple[str, ...], expected: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    code, _ = chassis("new", tmp_path / "my-test", *options)
    assert code == 1
    assert expected in unwrapped(capfd.readouterr().err)
    assert not list(tmp_path.iterdir())

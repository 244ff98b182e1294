"""`cargo fmu new --kind scenario`: what it writes runs, for every plant of the library."""

from pathlib import Path

import pytest

from chassis_fmu import results, shell


def cargo_fmu(*arguments: str | Path) -> tuple[int, str]:
    return shell.cargo_fmu([str(argument) for argument in arguments], "test", capture=True)


@pytest.mark.parametrize("plant", ["EspCar", "HeavyVehicle", "HydroPneumaticHalfCar", "RescueVehicle"])
def test_a_new_scenario_runs(plant: str, tmp_path: Path) -> None:
    options = ("--kind", "scenario", "--plant", plant, "--maneuver", "sine_with_dwell")
    code, _ = cargo_fmu("new", tmp_path / "my-test", *options)
    assert code == 0
    scenario = tmp_path / "my-test.toml"
    assert len(scenario.read_text(encoding="utf-8").splitlines()) < 25
    code, _ = cargo_fmu("run", scenario, "--out", tmp_path / "out")
    assert code == 0
    recording = results.read_csv(tmp_path / "out/my-test/runs/open_loop.csv", ["vehicle.lateral_acceleration"])
    # The driver steers: the vehicle is pushed to both sides.
    acceleration = recording.values["vehicle.lateral_acceleration"]
    assert acceleration.min() < -0.5
    assert acceleration.max() > 0.5
    # Nothing is overwritten.
    code, _ = cargo_fmu("new", tmp_path / "my-test", *options)
    assert code == 1


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
    code, _ = cargo_fmu("new", tmp_path / "my-test", "--kind", "scenario", *options)
    assert code == 1
    assert expected in " ".join(capfd.readouterr().err.replace("│", " ").split())
    assert not list(tmp_path.iterdir())

"""Every model in `examples` becomes an FMU that passes `cargo fmu check` and simulates in FMPy.

References: closed forms and published values, stated at each test. The tests of the packages have tighter tolerances;
this file tests the export as an FMU.
"""

from __future__ import annotations

import math
import subprocess
import sys
from pathlib import Path

import fmpy
import numpy as np
import pytest
from numpy.typing import NDArray

from tests.commands import CARGO_FMU

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

ROOT = Path(__file__).parents[2]
NAMES = sorted(
    package["package"]["name"]
    for path in (ROOT / "examples").glob("*/src/lib.rs")
    for package in [tomllib.loads((path.parents[1] / "Cargo.toml").read_text(encoding="utf-8"))]
)


def call(*command: str) -> str:
    done = subprocess.run(
        command,
        cwd=ROOT,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        encoding="utf-8",
        check=False,
    )
    assert done.returncode == 0, done.stdout
    return done.stdout


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("examples")
    call(*CARGO_FMU, "pack", *NAMES, "--out", str(folder))
    return folder


def fmu(folder: Path, package: str) -> str:
    return str(folder / f"{''.join(word.capitalize() for word in package.split('-'))}.fmu")


def simulate(folder: Path, package: str, **options: object) -> NDArray[np.void]:
    options = {"fmi_type": "CoSimulation"} | options
    result: NDArray[np.void] = fmpy.simulate_fmu(fmu(folder, package), **options)
    return result


@pytest.mark.parametrize("package", NAMES)
def test_the_check_has_no_finding(folder: Path, package: str) -> None:
    report = call(*CARGO_FMU, "check", fmu(folder, package))
    assert "error: " not in report, report
    assert "warning: " not in report, report


@pytest.mark.parametrize("package", NAMES)
def test_the_default_experiment_runs(folder: Path, package: str) -> None:
    result = simulate(folder, package)
    for name in result.dtype.names or ():
        if result[name].dtype.kind == "f":
            assert np.isfinite(result[name]).all(), name


def test_van_der_pol_has_the_amplitude_of_its_limit_cycle(folder: Path) -> None:
    """Reference: 2.00861986, as in the package's test.

    Tolerance: a peak between rows every 10 ms, x'' step^2 / 8 = 2.5e-5.
    """
    result = simulate(folder, "van-der-pol", stop_time=40.0, output_interval=0.01)
    assert np.abs(result["x"][result["time"] > 20.0]).max() == pytest.approx(2.00861986, abs=3e-5)


@pytest.mark.parametrize("fmi_type", ["CoSimulation", "ModelExchange"])
def test_a_bouncing_ball_follows_its_closed_form(folder: Path, fmi_type: str) -> None:
    """Reference: t_n+1 = t_n + 2 v_n / g, v_n+1 = e v_n.

    Tolerance: rounding, and the time of an event. In model exchange, an event is up to 1e-9 m behind the zero crossing,
    to make its indicator differ from zero: 1e-7 s at the lowest velocity, less than 2e-6 s in 18 bounces.
    """
    g, restitution, least = 9.81, 0.7, 0.01
    exchange = fmi_type == "ModelExchange"
    options = {"relative_tolerance": 1e-12, "record_events": False} if exchange else {}
    near, soon = (2e-8, 2e-6) if exchange else (1e-9, 1e-9)
    result = simulate(folder, "bouncing-ball", stop_time=3.0, fmi_type=fmi_type, output_interval=0.01, **options)
    bounces, time, velocity = [], math.sqrt(2.0 / g), restitution * math.sqrt(2.0 * g)
    while velocity >= least:
        bounces.append((time, velocity))
        time, velocity = time + 2.0 * velocity / g, restitution * velocity
    end = time
    for row in result:
        passed = [bounce for bounce in bounces if bounce[0] <= row["time"]]
        assert row["bounces"] == len(passed) + (row["time"] >= end), row
        assert bool(row["at_rest"]) == (row["time"] >= end), row
        if row["time"] >= end:
            assert row["height"] == row["velocity"] == 0.0
        elif passed:
            start, rebound = passed[-1]
            flight = row["time"] - start
            assert row["height"] == pytest.approx(rebound * flight - 0.5 * g * flight**2, abs=near)
            # The time of the last bounce follows from the velocity.
            assert row["time"] - (rebound - row["velocity"]) / g == pytest.approx(start, abs=soon)
    assert result["at_rest"][-1]


def test_robertson_has_the_published_fractions(folder: Path) -> None:
    """Reference: Hairer and Wanner, "Solving Ordinary Differential Equations II", section IV.10, the values at 40 s."""
    end = simulate(folder, "robertson", stop_time=40.0)[-1]
    published = {"a": 0.7158270688, "b": 9.185534765e-6, "c": 0.2841637458}
    for name, expected in published.items():
        assert end[name] == pytest.approx(expected, rel=1e-6)


def test_the_drive_reaches_its_reference_under_load(folder: Path) -> None:
    """Reference: k i = b w + M and u = R i + k w without control error. Tolerance: the remaining error after 30 s."""
    values = {"reference_speed": 150.0, "load_torque": 0.25, "motor.resistance": 0.6}
    result = simulate(folder, "dc-motor-drive", stop_time=30.0, output_interval=0.01, start_values=values)
    end, constant, friction = result[-1], 0.05, 1e-4
    current = (friction * 150.0 + 0.25) / constant
    assert end["speed"] == pytest.approx(150.0, rel=1e-9)
    assert end["current"] == pytest.approx(current, rel=1e-9)
    assert end["voltage"] == pytest.approx(0.6 * current + constant * 150.0, rel=1e-9)
    # After 10 ms the voltage is still at its limit.
    assert result["saturated"][1]
    assert not end["saturated"]


def test_a_drive_that_is_off_stands_still(folder: Path) -> None:
    result = simulate(folder, "dc-motor-drive", start_values={"enabled": False})
    assert not result["speed"].any()


@pytest.mark.parametrize("parallel", [False, True])
def test_the_heat_exchanger_has_its_effectiveness(folder: Path, parallel: bool) -> None:
    """Reference: the effectiveness from the number of transfer units. Tolerance: the error of 200 cells, 0.5 %."""
    capacities = [0.5 * 4180.0, 0.8 * 4180.0]
    units, ratio = 4000.0 / min(capacities), min(capacities) / max(capacities)
    part = math.exp(-units * (1.0 + ratio)) if parallel else math.exp(-units * (1.0 - ratio))
    expected = (1.0 - part) / (1.0 + ratio) if parallel else (1.0 - part) / (1.0 - ratio * part)
    end = simulate(folder, "heat-exchanger", start_values={"parallel": parallel})[-1]
    assert end["heat_flow"] / (min(capacities) * 60.0) == pytest.approx(expected, rel=5e-3)


def test_the_lookup_table_is_interpolated(folder: Path) -> None:
    """Reference: the rows of `torque.csv`."""
    for speed, torque in [(-1.0, 180.0), (50.0, 200.0), (200.0, 240.0), (575.0, 30.0), (700.0, 0.0)]:
        result = simulate(folder, "lookup-table", stop_time=0.1, start_values={"speed": speed})
        assert result["torque"].tolist() == [torque] * len(result)


def test_the_warehouse_is_a_sawtooth(folder: Path) -> None:
    """Reference: a lot of 50 every five days; 20 pieces are left when it arrives and 10 are sold on the same day."""
    result = simulate(folder, "wrapped-simulation", stop_time=50 * 86_400.0)
    assert result["stock"][-10:].tolist() in [([60, 50, 40, 30, 20] * 3)[k : k + 10] for k in range(5)]


@pytest.mark.parametrize("selected", [False, True])
def test_all_types_pass_through_the_fmu(folder: Path, selected: bool) -> None:
    """Reference: the outputs are copies of the inputs, or of the parameters."""
    types = {"real": 0.125, "integer": -7, "boolean": True, "string": "ä ≤ b", "gear": 3, "listed_gear": 1}
    others = {"real": -2.5, "integer": 9, "boolean": False, "string": "other", "gear": 1, "listed_gear": 3}
    path = fmu(folder, "all-types")
    description = fmpy.read_model_description(path)
    variables = {v.name: v for v in description.modelVariables}
    kinds = [variables[f"y.{name}"].type for name in types]
    assert kinds == ["Real", "Integer", "Boolean", "String", "Integer", "Enumeration"]
    unpacked = fmpy.extract(path)
    instance = fmpy.instantiate_fmu(unpacked, description, "CoSimulation")
    instance.setupExperiment(startTime=0.0)
    for prefix, values in (("p", others if selected else types), ("u", types if selected else others)):
        for name, value in values.items():
            variable = variables[f"{prefix}.{name}"]
            setter = "setInteger" if variable.type == "Enumeration" else f"set{variable.type}"
            getattr(instance, setter)([variable.valueReference], [value])
    instance.setBoolean([variables["u.select_parameters"].valueReference], [selected])
    instance.enterInitializationMode()
    instance.exitInitializationMode()
    instance.doStep(currentCommunicationPoint=0.0, communicationStepSize=0.1)
    found = {}
    for name in types:
        variable = variables[f"y.{name}"]
        getter = "getInteger" if variable.type == "Enumeration" else f"get{variable.type}"
        (value,) = getattr(instance, getter)([variable.valueReference])
        found[name] = value.decode() if isinstance(value, bytes) else value
    instance.terminate()
    instance.freeInstance()
    assert found == others

"""A closed loop of each vehicle, written by `chassis export`, in third-party masters.

The reference is the native master with the same execution order: libcosim and Ecos step all components at once, which
is our order `jacobi`. All recorded signals are compared at every step. Measured differences, relative to the peak of
the signal:

- FMPy, reading the SSP file, in both orders: bit-identical.
- libcosim, from OspSystemStructure.xml, from the SSP file and by calls: up to 3e-13. It counts time in nanoseconds,
  while our time is start + k step; the times differ in the last bit, and therefore also the driver's signal and the
  road.
- Ecos, from the SSP file and by calls: signals that do not depend on an input at the same instant are bit-identical.
  Ecos reads the others (accelerations, wheel loads) again after setting the inputs of the next step, so they belong to
  the new inputs: up to 1.1 of the peak where a sliding mode switches. FMPy with the same reading order gives the same
  bits as Ecos.
- The whole loop as one FMU, made by fmucontainer and run by FMPy, in both orders: bit-identical.

Ecos and libcosim need Linux on x86-64; Ecos needs Debian's libtbb12, libcosim a Python from 3.11 to 3.14. Their tests
carry the marker `ci`: `.ci/run` installs what they need and runs them.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import zipfile
from dataclasses import dataclass
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.ssp import ssd
from lxml import etree

import exported_system as systems
from chassis_fmu.files.results import Recording, read_csv
from tests.commands import CARGO_FMU, CHASSIS

ROOT = Path(__file__).parents[2]
FMUS = Path(os.environ.get("CHASSIS_FMU_DIR") or ROOT / "target" / "fmu")

# A thousand times the measured differences, and far below the effect of a wrong wire, parameter or order.
TOLERANCE = 1e-9


@dataclass(frozen=True)
class Loop:
    """A run of a scenario, long enough for its maneuver to begin (s).

    Rounding must not move the last step beyond the stop time: our masters would shorten this step, others do not.
    """

    scenario: str
    options: tuple[str, ...]
    run: str
    stop: float

    def __str__(self) -> str:
        return self.scenario


LOOPS = (
    Loop("rescue_vehicle_step_steer", ("--case", "coordination"), "coordination_1", 8.0),
    Loop("hydro_pneumatic_jturn_random", ("--case", "switched"), "switched_1", 8.0),
    Loop("esp_car_braking", ("--case", "coordination", "--point", "rough"), "coordination_rough_1", 2.5),
    Loop("heavy_vehicle_control", ("--case", "controlled", "--point", "step"), "controlled_step_1", 3.0),
)


# The findings of `cargo fmu check` for a container.
CONTAINER = (
    "is listed in ModelStructure/InitialUnknowns, where it does not belong",
    "a wrong GUID is accepted",
    ", but the binary starts with 0.0",
)


@dataclass(frozen=True)
class Written:
    """The exported files, and the native results by order."""

    folder: Path
    native: dict[str, Recording]


def call(*command: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, encoding="utf-8", check=False
    )


def chassis(*arguments: str) -> None:
    done = call(CHASSIS, *arguments)
    assert done.returncode == 0, done.stdout


@pytest.fixture(scope="module", params=LOOPS, ids=str)
def written(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Written:
    loop: Loop = request.param
    folder = tmp_path_factory.mktemp(loop.scenario)
    scenario = str(ROOT / "scenarios" / f"{loop.scenario}.toml")
    shared = ("--fmus", str(FMUS), "--stop", str(loop.stop))
    chassis("export", scenario, *loop.options, *shared, "--out", str(folder / "system"))
    native = {}
    for order in ("sequential", "jacobi"):
        chassis("run", scenario, "--no-page", *shared, "--seeds", "1", "--order", order, "--out", str(folder / order))
        native[order] = read_csv(folder / order / loop.scenario / "runs" / f"{loop.run}.csv")
    return Written(folder / "system", native)


def run(written: Written, tool: str) -> Recording:
    """Run the files in a tool, in a separate process: a tool that crashes fails only one test."""
    out = written.folder.with_name(f"{tool}.csv")
    done = call(
        sys.executable,
        str(ROOT / "tests/other_masters/run_system.py"),
        str(written.folder),
        "--tool",
        tool,
        "--out",
        str(out),
    )
    assert done.returncode == 0, done.stdout
    return read_csv(out)


def differences(found: Recording, expected: Recording) -> dict[str, float]:
    """Return the largest difference, relative to the peak, for every recorded signal, from the first row of `found`."""
    rows = len(found.times)
    assert len(expected.times) - rows in (0, 1)
    # Times of other masters are sums of steps or whole nanoseconds.
    assert np.abs(found.times - expected.times[-rows:]).max() < TOLERANCE
    result = {}
    for name, values in expected.values.items():
        matches = [key for key in found.values if name in (key, key.split(":")[-1])]
        assert len(matches) == 1, f"{name}: {matches}"
        peak = float(np.abs(values).max()) or 1.0
        difference = found.values[matches[0]] - values[-rows:]
        assert np.isfinite(difference).all(), name
        result[name] = float(np.abs(difference).max()) / peak
    assert result
    return result


def test_the_files_follow_the_schemas_of_ssp(written: Written) -> None:
    path = str(systems.package(written.folder))
    # Both raise an exception if the file violates the schema.
    structure = ssd.read_ssd(path)
    for component in structure.system.elements:
        for binding in component.parameterBindings:
            ssd.read_ssv(path, binding.source)
    # The FMUs also provide model exchange, and FMPy ignores which interface a component uses.
    with zipfile.ZipFile(path) as package:
        root = etree.fromstring(package.read("SystemStructure.ssd"))
    components = list(root.iter("{http://ssp-standard.org/SSP1/SystemStructureDescription}Component"))
    assert len(components) == len(structure.system.elements)
    assert {component.get("implementation") for component in components} == {"CoSimulation"}


@pytest.mark.parametrize("order", ["sequential", "jacobi"])
def test_fmpy_gives_the_same_bits(written: Written, order: systems.Order) -> None:
    found = systems.with_fmpy(written.folder, order)
    assert set(differences(found, written.native[order]).values()) == {0.0}


def test_the_orders_differ(written: Written) -> None:
    """The comparisons detect a wrong order: in the other order, the same files are far outside the tolerance."""
    assert max(differences(written.native["sequential"], written.native["jacobi"]).values()) > 1e-3


@pytest.mark.ci
@pytest.mark.parametrize("tool", ["libcosim", "libcosim-ssp", "libcosim-calls"])
def test_libcosim_agrees(written: Written, tool: str) -> None:
    found = differences(run(written, tool), written.native["jacobi"])
    assert {name: value for name, value in found.items() if value > TOLERANCE} == {}


@pytest.mark.ci
@pytest.mark.parametrize("tool", ["ecos", "ecos-calls"])
def test_ecos_agrees(written: Written, tool: str) -> None:
    found = run(written, tool)
    # With Ecos's reading order, all signals are bit-identical; with the native master's order, only the signals in the
    # loop.
    fresh = systems.with_fmpy(written.folder, "jacobi", fresh=True)
    for name, values in fresh.values.items():
        assert np.array_equal(found.values[name], values), name
    passed_on = differences(found, written.native["jacobi"])
    outputs = direct(written)
    assert {n: d for n, d in passed_on.items() if d > 0.0 and n.split(":")[-1] not in outputs} == {}


CHAIN = """title = "Chain"
[simulation]
stop = 0.01
step = 0.001
order = "jacobi"
[[component]]
name = "sensor"
fmu = "Sensor"
[[component]]
name = "car"
fmu = "BicycleCar"
inputs = { "road_friction.fl" = 1.0 }
[[component]]
name = "driver"
fmu = "Driver"
[component.parameters]
maneuver = "ramp_step"
"steer.amplitude" = 0.1
"steer.start" = 0.0
"steer.rise_time" = 0.0
"speed.initial" = 20.0
[[connection]]
from = "car:vehicle.lateral_acceleration"
to = "sensor:sensor.true_value"
[[connection]]
from = "driver:driver.steer"
to = "car:steer.front"
[[case]]
name = "only"
title = "Only"
[record]
signals = ["*"]
"""


@pytest.mark.ci
@pytest.mark.parametrize("tool", ["libcosim", "libcosim-ssp", "libcosim-calls", "ecos", "ecos-calls", "fmpy"])
def test_a_chain_listed_backwards_starts_alike(tool: str, tmp_path: Path) -> None:
    """The sensor measures the lateral acceleration due to the driver's angle, through two outputs with feedthrough.

    The native master starts in the order of the dependencies, the others pass values on repeatedly.
    """
    scenario = tmp_path / "chain.toml"
    scenario.write_text(CHAIN)
    chassis("export", str(scenario), "--fmus", str(FMUS), "--out", str(tmp_path / "system"))
    chassis("run", str(scenario), "--no-page", "--fmus", str(FMUS), "--out", str(tmp_path))
    native = read_csv(tmp_path / "chain" / "runs" / "only.csv")
    measured = native.values["sensor.measured_value"][0]
    assert measured == native.values["vehicle.lateral_acceleration"][0] != 0.0
    found = run(Written(tmp_path / "system", {}), tool)
    if tool.startswith("libcosim"):
        # Its first row is the one after the first step. In this step, the sensor reads the value at the start.
        assert found.values["sensor:sensor.measured_value"][0] == measured
    else:
        assert {name: values[0] for name, values in native.values.items()} == {
            key.split(":")[1]: values[0] for key, values in found.values.items()
        }


def direct(written: Written) -> set[str]:
    """Return the outputs that depend on inputs at the same instant, according to the model structure."""
    names = set()
    for path in written.folder.glob("*.fmu"):
        description = fmpy.read_model_description(str(path))
        for unknown in description.outputs:
            if any(d.causality == "input" for d in unknown.dependencies or ()):
                names.add(unknown.variable.name)
    return names


@pytest.mark.parametrize("order", ["sequential", "jacobi"])
def test_the_loop_as_one_fmu(written: Written, order: str, tmp_path: Path) -> None:
    path = tmp_path / "loop.fmu"
    script = str(ROOT / "tests/other_masters/run_system.py")
    done = call(
        sys.executable, script, str(written.folder), "--tool", "container", "--order", order, "--out", str(path)
    )
    assert done.returncode == 0, done.stdout
    structure = systems.Structure(systems.package(written.folder))
    names = {f"{systems.OUT}{component}.{name}": f"{component}:{name}" for component, name, _ in structure.outputs}
    rows = fmpy.simulate_fmu(
        str(path),
        start_time=structure.start,
        stop_time=structure.stop,
        step_size=structure.step,
        output_interval=structure.step,
        output=list(names),
    )
    found = Recording(rows["time"], {named: rows[name].astype(float) for name, named in names.items()})
    assert set(differences(found, written.native[order]).values()) == {0.0}
    # Exactly the findings that docs/masters.md lists.
    checked = call(*CARGO_FMU, "check", str(path))
    findings = [line for line in checked.stdout.splitlines() if line.startswith(("  error: ", "  warning: "))]
    assert any(CONTAINER[0] in finding for finding in findings), checked.stdout
    assert [finding for finding in findings if not any(words in finding for words in CONTAINER)] == []


def test_a_tool_that_fails_says_why(tmp_path: Path) -> None:
    script = str(ROOT / "tests/other_masters/run_system.py")
    done = call(sys.executable, script, str(tmp_path), "--tool", "fmpy")
    assert done.returncode == 1
    assert "must contain one SSP file, found 0" in done.stdout


@pytest.mark.ci
@pytest.mark.parametrize("tool", ["ecos-calls", "libcosim-calls"])
def test_a_missing_fmu_is_named(written: Written, tool: str, tmp_path: Path) -> None:
    folder = tmp_path / "system"
    shutil.copytree(written.folder, folder)
    missing = next(folder.glob("*.fmu"))
    missing.unlink()
    with pytest.raises(AssertionError, match=missing.name):
        run(Written(folder, {}), tool)

"""FMI 3.0 FMUs pass the validators, and their results are bit-identical to FMI 2.0.

References: the schemas of FMI 3.0 that FMPy ships; the rules of FMPy, of the FMU manipulation toolbox and of
`cargo fmu check`; FMI 2.0 FMUs from the same sources. `.ci/run` packs some FMUs for FMI 3.0, `scripts/nightly fmi3` all
of them and the examples. CHASSIS_FMU3_DIR replaces the folder target/fmu3.
"""

from __future__ import annotations

import ctypes
import importlib.util
import math
import os
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest
from fmpy.fmi3 import (
    FMU3ScheduledExecution,
    FMU3Slave,
    fmi3Boolean,
    fmi3ClockUpdateCallback,
    fmi3LockPreemptionCallback,
    fmi3LogMessageCallback,
    fmi3UnlockPreemptionCallback,
    printLogMessage,
)
from fmpy.model_description import ModelDescription
from lxml import etree
from numpy.typing import NDArray

import chassis_fmu as cf
from tests.commands import CARGO_FMU, chassis, unwrapped

_spec = importlib.util.spec_from_file_location("test_validators", Path(__file__).with_name("test_validators.py"))
assert _spec is not None
assert _spec.loader is not None
validators = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(validators)

pytestmark = pytest.mark.ci

FOLDER3 = Path(os.environ.get("CHASSIS_FMU3_DIR", validators.ROOT / "target" / "fmu3"))
FMUS = sorted(FOLDER3.glob("*.fmu"))
SCHEMAS = Path(fmpy.__file__).parent / "schema" / "fmi3"
# Duration of the compared runs, s.
DURATION = 2.0

# FMI 2.0 does not have their types or clocks.
ONLY_FMI3 = {"Clocks", "Feedthrough", "StateSpace"}
each_fmu = pytest.mark.parametrize("path", FMUS, ids=lambda path: path.stem)
both = pytest.mark.parametrize("interface", ["CoSimulation", "ModelExchange"])


def test_there_are_fmus_of_every_kind() -> None:
    kinds = {"RescueVehicle", "AllWheelSteering", "Driver", "BouncingBall", "AllTypes", "WrappedSimulation"} | ONLY_FMI3
    kinds |= ORIGINALS.keys()
    missing = kinds - {path.stem for path in FMUS}
    assert not missing, f"run `cargo fmu pack --fmi 3 {' '.join(sorted(missing))}`"


@each_fmu
@pytest.mark.parametrize(
    ("entry", "schema"),
    [
        ("modelDescription.xml", "fmi3ModelDescription.xsd"),
        ("terminalsAndIcons/terminalsAndIcons.xml", "fmi3TerminalsAndIcons.xsd"),
    ],
    ids=["description", "terminals"],
)
def test_the_schemas_find_nothing(path: Path, entry: str, schema: str) -> None:
    validator = etree.XMLSchema(etree.parse(SCHEMAS / schema))
    with zipfile.ZipFile(path) as archive:
        validator.validate(etree.fromstring(archive.read(entry)))
        assert "terminalsAndIcons/icon.png" in archive.namelist()
    assert [str(error) for error in validator.error_log] == []


@each_fmu
def test_fmpy_and_the_toolbox_find_nothing(path: Path) -> None:
    assert validators.by_fmpy(path) == []
    assert validators.by_toolbox(path) == []


@each_fmu
def test_our_own_check_finds_nothing(path: Path) -> None:
    done = validators.call(*CARGO_FMU, "check", str(path))
    assert done.returncode == 0, done.stdout


@pytest.fixture(scope="module")
def with_arrays(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Pack a model with numbered elements, and one with named elements and terminals."""
    folder = tmp_path_factory.mktemp("arrays")
    names = ["HeatExchanger", "SuspensionMixer"]
    done = validators.call(*CARGO_FMU, "pack", "--fmi", "3", "--arrays", "--out", str(folder), *names)
    assert done.returncode == 0, done.stdout
    return [folder / f"{name}.fmu" for name in names]


def test_native_arrays_pass_the_validators(with_arrays: list[Path]) -> None:
    for path in with_arrays:
        description = fmpy.read_model_description(str(path))
        has_arrays = any(variable.dimensions for variable in description.modelVariables)
        assert has_arrays == (path.stem == "HeatExchanger")
        test_the_schemas_find_nothing(path, "modelDescription.xml", "fmi3ModelDescription.xsd")
        test_the_schemas_find_nothing(path, "terminalsAndIcons/terminalsAndIcons.xml", "fmi3TerminalsAndIcons.xsd")
        test_fmpy_and_the_toolbox_find_nothing(path)
        test_our_own_check_finds_nothing(path)


# fmi-sim 0.7.0 reads output clocks with fmi3GetBoolean, and a single value of an array.
@both
@pytest.mark.parametrize(
    "path", [p for p in FMUS if p.stem not in ("Clocks", "StateSpace")], ids=lambda path: path.stem
)
def test_fmi_sim_runs_it(path: Path, tmp_path: Path, interface: str) -> None:
    """Ten steps of a copy without units, quantities and nominal values, which fmi-sim 0.7.0 cannot read."""
    description = fmpy.read_model_description(str(path))
    if interface == "ModelExchange" and description.modelExchange is None:
        return
    plain = tmp_path / path.name
    with zipfile.ZipFile(path) as archive, zipfile.ZipFile(plain, "w") as changed:
        for name in archive.namelist():
            content = archive.read(name)
            if name == "modelDescription.xml":
                root = etree.fromstring(content)
                for variable in root.iter("Float64", "Float32"):
                    for attribute in ("unit", "displayUnit", "quantity", "nominal"):
                        variable.attrib.pop(attribute, None)
                for definitions in root.findall("UnitDefinitions"):
                    root.remove(definitions)
                content = etree.tostring(root, xml_declaration=True, encoding="UTF-8")
            changed.writestr(name, content)
    step = float(description.defaultExperiment.stepSize)
    command = [str(validators.fmi_sim()), "--model", str(plain), "--output-file", str(tmp_path / "out.csv")]
    command += ["co-simulation" if interface == "CoSimulation" else "model-exchange"]
    done = validators.call(*command, "--step", str(step), "--output-interval", str(step), "-f", str(10 * step))
    assert done.returncode == 0, done.stdout
    assert [line for line in done.stdout.splitlines() if not line.startswith("Recorded outputs")] == []


@each_fmu
def test_terminals_name_variables(path: Path) -> None:
    names = {variable.name for variable in fmpy.read_model_description(str(path)).modelVariables}
    with zipfile.ZipFile(path) as archive:
        root = etree.fromstring(archive.read("terminalsAndIcons/terminalsAndIcons.xml"))
    members = [member.get("variableName") for member in root.iter("TerminalMemberVariable")]
    assert set(members) <= names
    if path.stem == "RescueVehicle":
        axles_and_wheels = ["front", "middle", "rear", "fl", "fr", "ml", "mr", "rl", "rr"]
        assert [terminal.get("name") for terminal in root.iter("Terminal")] == axles_and_wheels


@both
@pytest.mark.parametrize("path", [path for path in FMUS if path.stem not in ONLY_FMI3], ids=lambda path: path.stem)
def test_runs_have_the_bits_of_fmi_2(path: Path, interface: str) -> None:
    """Inputs change in every step.

    FMPy integrates model exchange by Euler's method, in the same way for both versions.
    """
    old = validators.FOLDER / path.name
    if not old.is_file():
        # An example, which is not among the packed FMUs of the library.
        old = FOLDER3.with_name("fmu2") / path.name
    descriptions = [fmpy.read_model_description(str(file)) for file in (old, path)]
    if interface == "ModelExchange" and descriptions[1].modelExchange is None:
        assert descriptions[0].modelExchange is None
        return
    results = [run(file, description, interface) for file, description in zip((old, path), descriptions, strict=True)]
    assert results[0].dtype.names == results[1].dtype.names
    for name in results[0].dtype.names or ():
        assert np.array_equal(results[0][name], results[1][name]), name


# The limits of each type.
LIMITS: dict[str, list[Any]] = {
    "Float32": [np.finfo(np.float32).max, -np.finfo(np.float32).max, float(np.float32(0.1))],
    "Float64": [np.finfo(np.float64).max, -0.1],
    "Boolean": [True, False],
    "String": ["Set me!", "", "ä"],
    "Enumeration": [2, 1],
    "Binary": [b"foo", bytes([0x00, 0xFF, 0x00, 0x01]), b"", bytes(128)],
}
for bits in (8, 16, 32, 64):
    LIMITS[f"Int{bits}"] = [-(2 ** (bits - 1)), 2 ** (bits - 1) - 1]
    LIMITS[f"UInt{bits}"] = [0, 2**bits - 1]


HEAD = """title = "All types"
simulation = { stop = 1.0, step = 0.5 }
case = [{ name = "only", title = "Only" }]
"""

# Texts of the values in the scenario of the guide, by the names of the outputs. The Float32 is 0.1 as a Float64.
EXPECTED = {
    "Float32_discrete": "0.10000000149011612",
    "Float64_continuous": "0.1",
    **{f"{sign}Int{bits}": "1.0" for bits in (8, 16, 32) for sign in ("", "U")},
    "Int64": "-9223372036854775808",
    "UInt64": "18446744073709551615",
    "Boolean": "1.0",
    "Binary": "00ff0001",
    "Enumeration": "2.0",
}


def test_every_type_passes_through_fmpy(tmp_path: Path) -> None:
    """Outputs are inputs at the limits of each type, in FMPy's own wrapper of the C functions."""
    path = FOLDER3 / "Feedthrough.fmu"
    description = fmpy.read_model_description(str(path))
    of = {variable.name: variable for variable in description.modelVariables}
    fmu = co_simulation(path, description, tmp_path)
    fmu.instantiate()
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    inputs = [variable for variable in description.modelVariables if variable.causality == "input"]
    assert {variable.type for variable in inputs} == set(LIMITS)
    for variable in inputs:
        output = of[variable.name.replace("input", "output")]
        name = "Int64" if variable.type == "Enumeration" else variable.type
        setter, getter = getattr(fmu, f"set{name}"), getattr(fmu, f"get{name}")
        for value in LIMITS[variable.type]:
            setter([variable.valueReference], [value])
            (found,) = getter([output.valueReference])
            if isinstance(found, bytes) and variable.type == "String":
                found = found.decode()
            assert found == value, (variable.name, value)
    fmu.terminate()
    fmu.freeInstance()


# The Reference FMUs at 1258711: causality, variability, initial, unit, quantity, start, min, max.
STATE = ("output", "continuous", "exact", None, None)
DERIVATIVE = ("local", "continuous", "calculated", None, None, None, None, None)
PARAMETER = ("parameter", "fixed", "exact", None, None, "1", None, None)
ORIGINALS: dict[str, dict[str, tuple[str | None, ...]]] = {
    "ReferenceBouncingBall": {
        "h": ("output", "continuous", "exact", "m", "Position", "1", None, None),
        "der(h)": ("local", "continuous", "calculated", "m/s", None, None, None, None),
        "v": ("output", "continuous", "exact", "m/s", "Velocity", "0", None, None),
        "der(v)": ("local", "continuous", "calculated", "m/s2", None, None, None, None),
        "g": ("parameter", "fixed", "exact", "m/s2", "Acceleration", "-9.81", None, None),
        "e": ("parameter", "tunable", "exact", None, None, "0.7", "0.5", "1"),
        "v_min": ("local", "constant", "exact", "m/s", "Velocity", "0.1", None, None),
    },
    "Dahlquist": {"x": (*STATE, "1", None, None), "der(x)": DERIVATIVE, "k": PARAMETER},
    "ReferenceVanDerPol": {
        "x0": (*STATE, "2", None, None),
        "der(x0)": DERIVATIVE,
        "x1": (*STATE, "0", None, None),
        "der(x1)": DERIVATIVE,
        "mu": PARAMETER,
    },
    # The counter of the original can be set: it is exact, with the start value 1.
    "Stair": {"counter": ("output", "discrete", "calculated", None, None, None, None, "10")},
    "Resource": {"y": ("output", "discrete", "calculated", None, None, None, None, None)},
}


@pytest.mark.parametrize("model", ORIGINALS)
def test_variables_are_declared_as_in_the_reference_fmus(model: str) -> None:
    """The originals have quantities in types, also for derivatives, and leave out defaults of the other attributes."""
    description = fmpy.read_model_description(str(FOLDER3 / f"{model}.fmu"))
    # FMPy also lists each alias as a variable.
    of = {variable.name: variable for variable in description.modelVariables if variable.alias is None}
    # The solver's step, and the variables that every FMU of FMI 3.0 of this exporter has.
    assert set(of) - {"event_indicator[1]"} == set(ORIGINALS[model]) | {"time", "max_step"}

    def number(text: str | None) -> float | None:
        return None if text is None else float(text)

    for name, expected in ORIGINALS[model].items():
        variable = of[name]
        found = (variable.causality, variable.variability, variable.initial, variable.unit, variable.quantity)
        assert found == expected[:5], name
        limits = [number(text) for text in (variable.start, variable.min, variable.max)]
        assert limits == [number(text) for text in expected[5:]], name
    aliases = [(alias.name, alias.description, alias.displayUnit) for v in of.values() for alias in v.aliases]
    assert aliases == ([("h_ft", "Position in feet", "ft")] if model == "ReferenceBouncingBall" else [])


each_version = pytest.mark.parametrize("folder", [FOLDER3, FOLDER3.with_name("fmu2")], ids=["fmi3", "fmi2"])


@each_version
def test_dahlquist_decays_as_in_the_reference_fmus(folder: Path) -> None:
    """References: exp(-t); 0.9^100, the last value of the published FMU, which uses Euler's method.

    Tolerances: the error of the Runge-Kutta method, 0.1^4 t / 120 relative to x; rounding in 100 steps.
    """
    path = str(folder / "Dahlquist.fmu")
    result = fmpy.simulate_fmu(path, step_size=0.1, output_interval=0.1)
    assert len(result) == 101
    assert result["x"] == pytest.approx(np.exp(-result["time"]), rel=1e-5, abs=0.0)
    euler = fmpy.simulate_fmu(path, fmi_type="ModelExchange", solver="Euler", step_size=0.1, output_interval=0.1)
    assert euler["x"][-1] == pytest.approx(0.9**100, rel=1e-13, abs=0.0)


@each_version
def test_van_der_pol_oscillates_as_in_the_reference_fmus(folder: Path) -> None:
    """References: a solution with eight decimals; the last values of the published FMU, with nine.

    Tolerances: half of the last decimal and, in co-simulation, the error of the Runge-Kutta method, 4.8e-8 at 20 s.
    FMPy integrates model exchange by the method and step of the published FMU.
    """
    path = str(folder / "ReferenceVanDerPol.fmu")
    result = fmpy.simulate_fmu(path, step_size=0.01, output_interval=0.01)
    rows = result[[100, 500, 1000, 2000]]
    assert list(rows["time"]) == pytest.approx([1.0, 5.0, 10.0, 20.0])
    assert list(rows["x0"]) == pytest.approx([1.50814424, -0.83707745, -2.00834078, 2.00814976], rel=0.0, abs=6e-8)
    assert list(rows["x1"]) == pytest.approx([-0.78021807, 1.30708894, 0.03290707, -0.04250888], rel=0.0, abs=6e-8)
    euler = fmpy.simulate_fmu(path, fmi_type="ModelExchange", solver="Euler", step_size=0.01, output_interval=0.01)
    assert list(euler[-1])[1:] == pytest.approx([2.014841886, 0.244194708], rel=0.0, abs=0.5e-9)


@each_version
@pytest.mark.parametrize("events", [False, True], ids=["steps", "Event Mode"])
def test_the_stair_ends_the_simulation_at_9_s(folder: Path, events: bool) -> None:
    """The published FMU: 1 at the start, one more at each second, the last of 46 rows at 9 s with 10.

    With Event Mode, FMPy also records the value before each of the nine events, and after the end once more.
    """
    options = {"use_event_mode": events, "early_return_allowed": events}
    result = fmpy.simulate_fmu(str(folder / "Stair.fmu"), step_size=0.2, output_interval=0.2, **options)
    time, index = np.unique(result["time"][::-1].round(6), return_index=True)
    last = result["counter"][::-1][index]
    assert list(time) == pytest.approx([0.2 * row for row in range(46)])
    assert list(last) == [1 + row // 5 for row in range(46)]
    assert len(result) == (56 if events and folder == FOLDER3 else 46)


@each_version
def test_the_stair_ends_model_exchange_at_9_s(folder: Path) -> None:
    """FMPy stops before it records the value after the last event."""
    path = str(folder / "Stair.fmu")
    result = fmpy.simulate_fmu(path, fmi_type="ModelExchange", step_size=0.2, output_interval=0.2)
    assert result["time"][-1] == pytest.approx(9.0)
    assert list(np.unique(result["counter"])) == list(range(1, 10))


@each_version
@both
def test_the_resource_is_97(folder: Path, interface: str) -> None:
    """The code of `a`, the first character of the file of the published FMU, too."""
    result = fmpy.simulate_fmu(str(folder / "Resource.fmu"), fmi_type=interface, step_size=1.0)
    assert list(result["y"]) == [97] * len(result)


def test_an_alias_of_fmi_2_has_the_values_of_its_variable() -> None:
    """References: the parabola h = 1 - 9.81/2 t^2 before the first bounce; FMPy's reader of value references."""
    path = FOLDER3.with_name("fmu2") / "ReferenceBouncingBall.fmu"
    result = fmpy.simulate_fmu(str(path), stop_time=0.4, step_size=0.1, output=["h", "h_ft", "v_min"])
    assert np.array_equal(result["h"], result["h_ft"])
    assert np.allclose(result["h"], 1 - 9.81 / 2 * result["time"] ** 2, rtol=0, atol=1e-12)
    assert set(result["v_min"]) == {0.1}


@each_fmu
def test_dependency_functions_agree_with_the_description(path: Path, tmp_path: Path) -> None:
    """FMPy 0.3.32 has wrappers for lists, but the first of them passes a type in place of a pointer."""
    description = fmpy.read_model_description(str(path))
    fmu = co_simulation(path, description, tmp_path)
    fmu.instantiate()
    sizes = {v.valueReference: math.prod(v.shape or (1,)) for v in description.modelVariables}

    def found(reference: int) -> set[int]:
        count = ctypes.c_size_t()
        fmu.fmi3GetNumberOfVariableDependencies(fmu.component, reference, ctypes.byref(count))
        n = count.value
        elements, on = (ctypes.c_size_t * n)(), (ctypes.c_uint * n)()
        of, kind = (ctypes.c_size_t * n)(), (ctypes.c_int * n)()
        fmu.fmi3GetVariableDependencies(fmu.component, reference, elements, on, of, kind, n)
        assert all(1 <= element <= sizes[reference] for element in elements)
        assert all(1 <= element <= sizes[other] for other, element in zip(on, of, strict=True))
        assert set(kind) <= {5}
        assert len(set(zip(elements, on, of, strict=True))) == n
        return set(on)

    def compare(unknowns: list[Any]) -> None:
        for unknown in unknowns:
            listed = {variable.valueReference for variable in unknown.dependencies}
            assert found(unknown.variable.valueReference) == listed, unknown.variable.name

    compare(description.initialUnknowns)
    fmu.enterInitializationMode()
    compare(description.initialUnknowns)
    fmu.exitInitializationMode()
    compare(description.outputs + description.derivatives)
    fmu.freeInstance()


# Per second: ticks of the three clocks and of all, result2, output3, and whether outClock ticks. From the published
# model in scheduled execution.
TICKS = [
    ([1, 1, 0, 2], 10, 0, False),
    ([2, 2, 0, 4], 20, 0, False),
    ([3, 2, 0, 5], 20, 0, True),
    ([4, 2, 0, 6], 20, 0, False),
    ([5, 2, 1, 8], 20, 1000, False),
    ([6, 2, 1, 9], 20, 1000, False),
    ([7, 2, 1, 10], 20, 1000, True),
    ([8, 2, 1, 11], 20, 1000, False),
    ([9, 3, 1, 13], 30, 1000, False),
    ([10, 4, 1, 15], 40, 1000, True),
]


def test_clocks_tick_as_in_the_published_model(tmp_path: Path) -> None:
    """FMPy activates inClock1 every second, inClock2 at 0, 1, 8 and 9 s, and inClock3 when it is due."""
    path = FOLDER3 / "Clocks.fmu"
    description = fmpy.read_model_description(str(path))
    of = {variable.name: variable.valueReference for variable in description.modelVariables}
    fmu = co_simulation(path, description, tmp_path)
    fmu.instantiate(eventModeUsed=True)
    fmu.enterInitializationMode()
    assert interval(fmu, of["inClock1"]) == (1.0, 1)  # known from the description
    assert interval(fmu, of["inClock3"])[1] == 0
    fmu.exitInitializationMode()
    counters = ["inClock1Ticks", "inClock2Ticks", "inClock3Ticks", "totalInClockTicks", "result2", "output3"]
    last = dict.fromkeys(counters, 0)
    for second, expected in enumerate(TICKS):
        has_fired = False
        active = ["inClock1"] + (["inClock2"] if second in (0, 1, 8, 9) else [])
        while active:
            fmu.setInt32([of["input2"]], [10])
            fmu.setClock([of[name] for name in active], [True] * len(active))
            has_fired |= fmu.getClock([of["outClock"]])[0]
            for name in counters:
                clocks = next(v.clocks for v in description.modelVariables if v.name == name)
                if any(clock.name in active for clock in clocks):
                    (last[name],) = fmu.getInt32([of[name]])
            fmu.updateDiscreteStates()
            # It was started with an interval of 0.
            active = ["inClock3"] if interval(fmu, of["inClock3"]) == (0.0, 2) else []
        ticks, result2, output3, fires = expected
        assert (list(last.values()), has_fired) == ([*ticks, result2, output3], fires), second
        fmu.enterStepMode()
        fmu.doStep(float(second), 1.0)
        fmu.enterEventMode()
    fmu.terminate()
    fmu.freeInstance()


def test_fmpy_schedules_the_parts_of_the_published_model(tmp_path: Path) -> None:
    """FMPy activates the clocks in scheduled execution; the FMU reports ticks of outClock and intervals of inClock3."""
    path = FOLDER3 / "Clocks.fmu"
    description = fmpy.read_model_description(str(path))
    of = {variable.name: variable.valueReference for variable in description.modelVariables}
    fmu = FMU3ScheduledExecution(
        guid=description.guid,
        unzipDirectory=fmpy.extract(str(path), unzipdir=str(tmp_path)),
        modelIdentifier=description.scheduledExecution.modelIdentifier,
    )
    updates: list[tuple[tuple[float, int], bool]] = []
    locks: list[str] = []

    def update(_: Any) -> None:
        updates.append((interval(fmu, of["inClock3"]), fmu.getClock([of["outClock"]])[0]))

    # FMPy's method `instantiate` passes callbacks that do nothing.
    callbacks = (
        fmi3LogMessageCallback(printLogMessage),
        fmi3ClockUpdateCallback(update),
        fmi3LockPreemptionCallback(lambda: locks.append("lock")),
        fmi3UnlockPreemptionCallback(lambda: locks.append("unlock")),
    )
    no, token = fmi3Boolean(False), description.guid.encode()
    fmu.component = fmu.fmi3InstantiateScheduledExecution(b"instance", token, None, no, no, None, *callbacks)
    fmu.enterInitializationMode()
    assert interval(fmu, of["inClock1"]) == (1.0, 1)
    fmu.exitInitializationMode()
    counters = ["inClock1Ticks", "inClock2Ticks", "inClock3Ticks", "totalInClockTicks", "result2", "output3"]
    for second, (ticks, result2, output3, fires) in enumerate(TICKS):
        fmu.activateModelPartition(of["inClock1"], float(second))
        if second in (0, 1, 8, 9):
            fmu.setInt32([of["input2"]], [10])
            fmu.activateModelPartition(of["inClock2"], float(second))
        if updates and updates[0][0] == (0.0, 2):
            fmu.activateModelPartition(of["inClock3"], float(second))
        assert fmu.getInt32([of[name] for name in counters]) == [*ticks, result2, output3], second
        expected = [((0.0, 2), False)] if second == 4 else [((0.0, 0), True)] * fires
        assert updates == expected, second
        updates.clear()
    assert locks == ["lock", "unlock"] * (len(locks) // 2)
    fmu.terminate()
    fmu.freeInstance()


def interval(fmu: FMU3Slave | FMU3ScheduledExecution, clock: int) -> tuple[float, int]:
    """Return the interval of a clock and its qualifier: 0 not yet known, 1 unchanged, 2 changed."""
    references, intervals, qualifiers = (ctypes.c_uint32 * 1)(clock), (ctypes.c_double * 1)(), (ctypes.c_int * 1)()
    fmu.getIntervalDecimal(references, intervals, qualifiers)
    return intervals[0], qualifiers[0]


def test_fmpy_gets_intermediate_updates(tmp_path: Path) -> None:
    """FMPy's callback reads the ball and ends the step at the first bounce. Reference: the closed form of the fall."""
    path = FOLDER3 / "BouncingBall.fmu"
    description = fmpy.read_model_description(str(path))
    assert description.coSimulation.providesIntermediateUpdate
    assert description.coSimulation.canReturnEarlyAfterIntermediateUpdate
    references = {variable.name: variable.valueReference for variable in description.modelVariables}
    required = [references["height"], references["velocity"]]
    gravity, rebound = 9.81, 0.7
    times: list[float] = []

    # FMPy's type of the callback has pointers as the last two arguments.
    def update(
        _: Any, time: float, can_set: bool, can_get: bool, finished: bool, can_return: bool, early: Any, end: Any
    ) -> None:
        assert [can_set, can_get, finished, can_return] == [False, True, True, True]
        height, velocity = fmu.getFloat64(required)
        assert fmu.getOutputDerivatives(required, [1, 1]) == [velocity, -gravity]
        if velocity > 0:
            early[0], end[0] = True, time
        else:
            assert abs(height - (1.0 - gravity / 2.0 * time**2)) < 1e-12
        times.append(time)

    fmu = co_simulation(path, description, tmp_path)
    fmu.instantiate(earlyReturnAllowed=True, intermediateUpdate=update, requiredIntermediateVariables=required)
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    event, terminate, is_early, last = fmu.doStep(0.0, 1.0)
    bounce = (2.0 / gravity) ** 0.5
    assert (event, terminate, is_early) == (False, False, True)
    assert abs(last - bounce) < 1e-9
    # Steps of at most 0.01 s, and the step to the bounce.
    assert len(times) == 46
    assert times[-1] == last
    assert np.allclose(times[:-1], 0.01 * np.arange(1, 46), rtol=0.0, atol=1e-12)
    assert abs(fmu.getFloat64(required)[1] - rebound * gravity * bounce) < 1e-8
    fmu.terminate()
    fmu.freeInstance()


@pytest.mark.parametrize("engine", ["native", "fmpy"])
def test_the_scenario_of_the_guide_keeps_every_value(engine: str, tmp_path: Path) -> None:
    """Each output of Feedthrough is its input, so both instances have the values of the scenario."""
    guide = (validators.ROOT / "docs" / "guide" / "src" / "scenarios.md").read_text(encoding="utf-8")
    (block,) = [block for block in guide.split("```") if block.startswith("toml\n") and 'fmu = "Feedthrough"' in block]
    scenario = tmp_path / "all_types.toml"
    scenario.write_text(HEAD + block.removeprefix("toml\n"), encoding="utf-8")
    (tmp_path / "frame.bin").write_bytes(bytes([0x00, 0xFF, 0x00, 0x01]))
    options = ("--fmus", FOLDER3, "--out", tmp_path, "--no-page", "--engine", engine)
    assert chassis("run", scenario, *options)[0] == 0
    rows = (tmp_path / "all_types" / "runs" / "only.csv").read_text().splitlines()
    assert rows[0].split(",")[1:] == [f"{name}_output" for name in EXPECTED]
    for row in rows[1:]:
        assert row.split(",")[1:] == list(EXPECTED.values())
    assert len(rows) == 4


def test_the_sizes_of_a_system_can_change(tmp_path: Path) -> None:
    """x1' = x2 + 1, x2' = -x1 from 0: x = (sin t, cos t - 1); the step of 1 ms has an error below 1e-13 per second."""
    path = FOLDER3 / "StateSpace.fmu"
    description = fmpy.read_model_description(str(path))
    of = {variable.name: variable.valueReference for variable in description.modelVariables}
    fmu = co_simulation(path, description, tmp_path)
    fmu.instantiate()

    def resize(size: int) -> None:
        fmu.enterConfigurationMode()
        fmu.setUInt64([of["m"], of["n"], of["r"]], [size] * 3)
        fmu.exitConfigurationMode()

    resize(2)
    fmu.setFloat64([of["A"]], [0.0, 1.0, -1.0, 0.0])
    fmu.setFloat64([of["D"], of["max_step"]], [0.0] * 4 + [0.001])
    fmu.enterInitializationMode()
    fmu.setFloat64([of["u"]], [1.0, 0.0])
    fmu.exitInitializationMode()
    fmu.doStep(0.0, 1.0)
    assert np.allclose(fmu.getFloat64([of["y"]], 2), [math.sin(1.0), math.cos(1.0) - 1.0], rtol=0.0, atol=1e-12)
    # In Reconfiguration Mode, the states keep their values. The third state grows by itself: x3' = x3 + 3 from 0.
    resize(3)
    assert np.allclose(fmu.getFloat64([of["x"]], 3), [math.sin(1.0), math.cos(1.0) - 1.0, 0.0], rtol=0.0, atol=1e-12)
    fmu.doStep(1.0, 1.0)
    expected = [math.sin(2.0), math.cos(2.0) - 1.0, 3.0 * (math.exp(1.0) - 1.0)]
    assert np.allclose(fmu.getFloat64([of["x"]], 3), expected, rtol=0.0, atol=1e-12)
    fmu.terminate()
    fmu.freeInstance()


def test_the_sizes_of_the_guide_give_an_oscillator(
    tmp_path: Path, run_by_both_masters: Callable[[Path, Path], Path], capfd: pytest.CaptureFixture[str]
) -> None:
    """The reference is the closed form of the test above."""
    guide = (validators.ROOT / "docs" / "guide" / "src" / "scenarios.md").read_text(encoding="utf-8")
    (block,) = [block for block in guide.split("```") if block.startswith("toml\n") and 'fmu = "StateSpace"' in block]
    scenario = tmp_path / "oscillator.toml"
    scenario.write_text(HEAD + block.removeprefix("toml\n"), encoding="utf-8")
    rows = run_by_both_masters(scenario, FOLDER3).read_text().splitlines()
    assert rows[0] == "time,y[1],y[2]"
    for row in rows[1:]:
        time, *found = map(float, row.split(","))
        assert np.allclose(found, [math.sin(time), math.cos(time) - 1.0], rtol=0.0, atol=1e-12)
    scenario.write_text(scenario.read_text().replace("n = 2", "k = 2"), encoding="utf-8")
    assert chassis("plan", scenario, "--fmus", FOLDER3)[0] == 1
    assert "no structural parameter `k`" in unwrapped(capfd.readouterr().err)


def test_python_gets_the_exact_values(tmp_path: Path) -> None:
    """The reference is the value that is set."""
    scenario = tmp_path / "one.toml"
    inputs = '"*Int*_input" = 1, "Float*" = 0.5, Boolean_input = false, Enumeration_input = 1, Binary_input = "Zm9v"'
    component = f'component = [{{ name = "one", fmu = "Feedthrough", inputs = {{ {inputs} }} }}]'
    scenario.write_text(f'{HEAD}{component}\nrecord = {{ signals = ["*"] }}\n', encoding="utf-8")
    values: dict[str, int | bytes] = {"one:Int64_input": -(2**63), "one:UInt64_input": 2**64 - 1}
    values["one:Binary_input"] = bytes([0, 255])
    table = cf.Scenario(scenario, fmus=[FOLDER3]).simulate(values)
    for name, value in values.items():
        column = table[name.removeprefix("one:").replace("input", "output")]
        assert column.to_pylist() == [value] * 3
    with pytest.raises(cf.ScenarioError, match="expected a whole number from 0 to 18446744073709551615"):
        cf.Scenario(scenario, fmus=[FOLDER3]).simulate({"one:UInt64_input": -1})


def co_simulation(path: Path, description: ModelDescription, folder: Path) -> FMU3Slave:
    """Load an FMU for co-simulation, without an instance."""
    return FMU3Slave(
        guid=description.guid,
        unzipDirectory=fmpy.extract(str(path), unzipdir=str(folder)),
        modelIdentifier=description.coSimulation.modelIdentifier,
    )


def run(path: Path, description: ModelDescription, interface: str) -> NDArray[np.void]:
    """Record the outputs. Aliases are left out, because FMI 2.0 declares them as local variables."""
    outputs = [v for v in description.modelVariables if v.causality == "output" and v.alias is None]
    step = float(description.defaultExperiment.stepSize)
    result: NDArray[np.void] = fmpy.simulate_fmu(
        str(path),
        fmi_type=interface,
        solver="Euler",
        input=inputs(description, step),
        output=[v.name for v in outputs if v.type != "String"],
        stop_time=DURATION,
        step_size=step,
        output_interval=step,
        record_events=False,
    )
    return result


def inputs(description: ModelDescription, step: float) -> NDArray[np.float64] | None:
    """Return moving inputs if all are real or Boolean."""
    types = {v.type for v in description.modelVariables if v.causality == "input"}
    if not types <= {"Real", "Float64", "Boolean"}:
        return None
    signals: NDArray[np.float64] | None = validators.waves(description, step)
    return signals

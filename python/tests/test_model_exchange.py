"""Model exchange against co-simulation: the same FMU, integrated by CVode and by its own solver.

The importer is FMPy with CVode from SUNDIALS. Inputs come from the runs in `tests/references`. In both interfaces they
are constant for 10 ms; in model exchange, they change in an event. `fmpy.simulate_fmu` is not used, because it
interpolates inputs.

CVode runs with a relative tolerance of 1e-12. With 1e-10, its error in the slip of a free-rolling wheel, a small
difference of two large speeds, is 1e-5 of the peak, and it is proportional to the tolerance. With 1e-12, the error is
4e-8 in the worst signal of all runs (EspCar on a rough road), measured against co-simulation in steps of 6 us.
"""

from __future__ import annotations

import csv
import gzip
import io
import math
import os
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from ctypes import c_double
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, TypeAlias

import fmpy
import numpy as np
import pytest
from fmpy.fmi2 import FMU2Model, FMU2Slave
from fmpy.model_description import ScalarVariable
from fmpy.sundials import CVodeSolver
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.float64]
Values: TypeAlias = Mapping[str, float]

ROOT = Path(__file__).parents[2]
FOLDER = Path(os.environ.get("CHASSIS_FMU_DIR") or ROOT / "target" / "fmu")

# Row interval of a reference run, and the time for which inputs from every tenth row are held (s).
ROW = 0.001
HOLD = 0.01

CVODE_TOLERANCE = 1e-12

# Smallest peak of a signal, so that signals that are zero up to rounding pass.
FLOOR = 1e-6


class Fmu:
    def __init__(self, path: Path, folder: Path) -> None:
        fmpy.extract(str(path), str(folder))
        self.folder = folder
        self.name = path.stem
        self.description = fmpy.read_model_description(str(folder))
        self.variables: dict[str, ScalarVariable] = {v.name: v for v in self.description.modelVariables}
        self.states: int = self.description.numberOfContinuousStates
        self.indicators: int = self.description.numberOfEventIndicators
        self.state_references = [d.variable.derivative.valueReference for d in self.description.derivatives]

    def of(self, causality: str) -> list[ScalarVariable]:
        return [v for v in self.description.modelVariables if v.causality == causality]

    @contextmanager
    def instance(self, interface: type[Any], parameters: Values, inputs: Values) -> Iterator[Any]:
        """Yield an initialized instance of `FMU2Model` or `FMU2Slave`."""
        element = self.description.modelExchange if interface is FMU2Model else self.description.coSimulation
        instance = interface(
            guid=self.description.guid,
            unzipDirectory=str(self.folder),
            modelIdentifier=element.modelIdentifier,
            instanceName=self.name,
        )
        instance.instantiate()
        try:
            instance.setupExperiment(startTime=0.0)
            for name, value in parameters.items():
                write(instance, self.variables[name], value)
            instance.enterInitializationMode()
            for name, value in inputs.items():
                write(instance, self.variables[name], value)
            instance.exitInitializationMode()
            if interface is FMU2Model:
                instance.newDiscreteStates()
                instance.enterContinuousTimeMode()
            yield instance
            instance.terminate()
        finally:
            instance.freeInstance()


def write(instance: Any, variable: ScalarVariable, value: float) -> None:
    kind = "Integer" if variable.type == "Enumeration" else variable.type
    convert = {"Real": float, "Integer": int, "Boolean": bool}[kind]
    getattr(instance, f"set{kind}")([variable.valueReference], [convert(value)])


def read(instance: Any, variables: Sequence[ScalarVariable]) -> list[float]:
    """Return the values of variables of any type as floats."""
    result = []
    for variable in variables:
        kind = "Integer" if variable.type == "Enumeration" else variable.type
        result.append(float(getattr(instance, f"get{kind}")([variable.valueReference])[0]))
    return result


@pytest.fixture(scope="module")
def fmus(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Fmu]:
    paths = sorted(FOLDER.glob("*.fmu"))
    assert len(paths) > 20, "run `cargo fmu pack --all`"
    folder = tmp_path_factory.mktemp("fmus")
    return {path.stem: Fmu(path, folder / path.stem) for path in paths}


# Continuous-time models -----------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Run:
    """Inputs of an FMU from a reference run."""

    fmu: str
    # Path in tests/references, or the folder of a package with its own reference run.
    file: str
    parameters: Values = field(default_factory=dict)
    # Inputs that the file does not contain.
    constants: Values = field(default_factory=dict)
    # End of the run, if it is before the end of the file (s).
    stop: float = math.inf
    # `max_step` (s) to measure order 4. At this step and at half of it, errors are far above CVode's.
    coarse: float | None = None

    def __str__(self) -> str:
        return self.file

    def inputs(self, fmu: Fmu) -> tuple[list[str], Array]:
        """Return the names of the inputs, and their values in every interval of the length `HOLD`."""
        path = ROOT / "tests" / "references" / f"{self.file}.csv.gz"
        if path.exists():
            text = gzip.decompress(path.read_bytes()).decode()
        else:
            text = (ROOT / self.file / "reference.csv").read_text(encoding="utf-8")
        names, *rows = csv.reader(io.StringIO(text))
        chosen = [i for i, n in enumerate(names) if n in fmu.variables and fmu.variables[n].causality == "input"]
        held = rows[: len(rows) if math.isinf(self.stop) else round(self.stop / ROW) : round(HOLD / ROW)]
        values = np.array([[float(row[i]) for i in chosen] + list(self.constants.values()) for row in held])
        return [names[i] for i in chosen] + list(self.constants), values


ROLLING = {"vehicle.initial_speed": 60.0 / 3.6}
SPEED_70 = {"driver.speed": 70.0 / 3.6}

# Parameters of Actuator for which the reference run reaches the limits of rate and range.
LIMITED = {
    "actuator.time_constant": 0.02,
    "actuator.rate_limit": 5.0,
    "actuator.minimum": -1.0,
    "actuator.maximum": 1.5,
}

SMOOTH = (
    Run("EspCar", "esp_car/plant_ride_60", ROLLING),
    Run("RescueVehicle", "rescue_vehicle/plant_nominal", coarse=5e-3),
    Run("RescueVehicle", "rescue_vehicle/plant_linear_tire", {"tire.model": 0, "tire.lift_off": 0}, coarse=5e-3),
    Run("HydroPneumaticHalfCar", "hydro_pneumatic/plant_step_steer", {}, SPEED_70, coarse=2.5e-3),
    Run("HydroPneumaticHalfCar", "hydro_pneumatic/plant_road_forces", {}, SPEED_70, coarse=2.5e-3),
    Run("HeavyVehicle", "heavy_vehicle/plant_coupled_step60_roadB", {}, {"driver.speed": 60.0 / 3.6}, coarse=2.5e-3),
    Run("HeavyVehicle", "heavy_vehicle/plant_coupled_all_inputs72", {}, {"driver.speed": 72.0 / 3.6}, coarse=2.5e-3),
    Run("BicycleCar", "driving/plant_bicycle_car", {"tire.friction": 0.9}),
    Run("BrakeAndDriveActuators", "esp_car/actuators"),
    Run("Actuator", "fmu-plant/actuator", {"actuator.time_constant": 0.02}),
)

# Runs that show order 4. EspCar's run ends at 0.9 s, before the slip of its wheels passes zero, where the second
# derivative of the force jumps. BicycleCar is excluded because its error is below that of CVode even at 10 ms, the
# longest step here; BrakeAndDriveActuators and Actuator, because they use their solutions in closed form.
CONVERGING = (*(run for run in SMOOTH if run.coarse), replace(SMOOTH[0], stop=0.9, coarse=1.25e-3))

# Runs with kinks: tires that lift off, contacts that begin to slide, wheels that lock.
KINKED = (
    Run("EspCar", "esp_car/plant_handling_lock", ROLLING),
    Run("EspCar", "esp_car/plant_launch_stop", {"vehicle.initial_speed": 0.0}),
    Run("RescueVehicle", "rescue_vehicle/plant_limits"),
    Run("HydroPneumaticHalfCar", "hydro_pneumatic/plant_lift_off", {}, SPEED_70),
    Run("Actuator", "fmu-plant/actuator", LIMITED),
)

# The runs with kinks in which relations change their sides. Lift-off in HydroPneumaticHalfCar is computed by `max`,
# which is not a relation; its only relation is for a vehicle in the air.
SWITCHING = KINKED[:3]


def co_simulation(fmu: Fmu, run: Run, max_step: float | None = None, part: int = 1) -> Array:
    """Return all outputs at the start of every step; an interval of length `HOLD` has `part` steps."""
    names, rows = run.inputs(fmu)
    inputs = [fmu.variables[name].valueReference for name in names]
    outputs = [v.valueReference for v in fmu.of("output")]
    parameters = dict(run.parameters) | ({} if max_step is None else {"max_step": max_step})
    found = []
    with fmu.instance(FMU2Slave, parameters, dict(zip(names, rows[0].tolist(), strict=True))) as instance:
        for k, row in enumerate(rows.tolist()):
            instance.setReal(inputs, row)
            for i in range(part):
                found.append(instance.getReal(outputs))
                instance.doStep(k * HOLD + i * HOLD / part, HOLD / part)
    return np.array(found)


class Held:
    """A replacement for the inputs of FMPy's solver, which does nothing: inputs are set in events."""

    def apply(self, time: float) -> None:
        pass


def solver(fmu: Fmu, instance: Any) -> CVodeSolver:
    return CVodeSolver(
        nx=fmu.states,
        nz=fmu.indicators,
        get_x=instance.getContinuousStates,
        set_x=instance.setContinuousStates,
        get_dx=instance.getDerivatives,
        get_z=instance.getEventIndicators,
        get_nominals=instance.getNominalsOfContinuousStates,
        set_time=instance.setTime,
        input=Held(),
        startTime=0.0,
        relativeTolerance=CVODE_TOLERANCE,
        maxNumSteps=100_000,
    )


def pass_event(instance: Any) -> None:
    """Handle the events at the current time."""
    instance.enterEventMode()
    instance.newDiscreteStates()
    instance.enterContinuousTimeMode()


def sides(fmu: Fmu, instance: Any) -> list[bool]:
    """Return the sides of all relations, which are the signs of their event indicators after an event."""
    indicators = (c_double * fmu.indicators)()
    instance.getEventIndicators(indicators, fmu.indicators)
    return [value > 0.0 for value in indicators]


Changes: TypeAlias = "dict[int, list[float]]"


def model_exchange(fmu: Fmu, run: Run) -> tuple[Array, Changes]:
    """Return all outputs at the start of every interval, and the times at which each relation changes its side."""
    names, rows = run.inputs(fmu)
    inputs = [fmu.variables[name].valueReference for name in names]
    outputs = [v.valueReference for v in fmu.of("output")]
    found: list[list[float]] = []
    changes: Changes = {}
    with fmu.instance(FMU2Model, run.parameters, dict(zip(names, rows[0].tolist(), strict=True))) as instance:
        cvode = solver(fmu, instance)
        before = sides(fmu, instance)

        def note(time: float) -> None:
            nonlocal before
            after = sides(fmu, instance)
            for i in (i for i, (old, new) in enumerate(zip(before, after, strict=True)) if old != new):
                changes.setdefault(i, []).append(time)
            before = after

        for k, row in enumerate(rows.tolist()):
            time, end = k * HOLD, (k + 1) * HOLD
            instance.setTime(time)
            instance.enterEventMode()
            instance.setReal(inputs, row)
            instance.newDiscreteStates()
            instance.enterContinuousTimeMode()
            note(time)
            found.append(instance.getReal(outputs))
            cvode.reset(time)
            while time < end:
                is_event, _, time = cvode.step(time, end)
                instance.setTime(time)
                if is_event:
                    pass_event(instance)
                    note(time)
                    cvode.reset(time)
    return np.array(found), changes


def errors(fmu: Fmu, found: Array, expected: Array) -> dict[str, float]:
    """Return the largest difference, relative to the peak, for every output."""
    assert np.isfinite(found).all()
    assert np.isfinite(expected).all()
    peak = np.maximum(np.abs(expected).max(axis=0), FLOOR)
    names = [v.name for v in fmu.of("output")]
    return dict(zip(names, (np.abs(found - expected).max(axis=0) / peak).tolist(), strict=True))


def above(found: Mapping[str, float], tolerance: float) -> dict[str, float]:
    return {name: error for name, error in found.items() if not error <= tolerance}


@pytest.mark.parametrize("run", SMOOTH, ids=str)
def test_smooth_runs_are_equal(fmus: dict[str, Fmu], run: Run) -> None:
    """Tolerance: three times the error of co-simulation, which is 3.5e-7 in the slip of EspCar's free-rolling wheels.

    This slip passes zero repeatedly, where the second derivative of the tire force jumps.
    """
    fmu = fmus[run.fmu]
    expected, changes = model_exchange(fmu, run)
    assert not changes
    assert not above(errors(fmu, co_simulation(fmu, run), expected), 1e-6)


@pytest.mark.parametrize("run", CONVERGING, ids=str)
def test_the_difference_falls_with_order_four(fmus: dict[str, Fmu], run: Run) -> None:
    """Reference: order 4 of the classical Runge-Kutta method. Half the step gives a sixteenth of the error.

    Signals are compared if their errors are far above the errors of CVode. Tolerance: the next term of the error, of
    the size of the step times the fastest eigenvalue; the measured orders are 3.86 to 4.29.
    """
    fmu = fmus[run.fmu]
    assert run.coarse is not None
    expected, _ = model_exchange(fmu, run)
    coarse, fine = (errors(fmu, co_simulation(fmu, run, step), expected) for step in (run.coarse, run.coarse / 2.0))
    orders = {name: math.log2(coarse[name] / error) for name, error in fine.items() if error > 1e-7}
    assert len(orders) > 3
    assert not {name: order for name, order in orders.items() if not abs(order - 4.0) < 0.35}


@pytest.mark.parametrize("run", KINKED, ids=str)
def test_runs_with_kinks_are_equal(fmus: dict[str, Fmu], run: Run) -> None:
    """Tolerance: a kink within a step gives co-simulation an error of the order `max_step` squared; measured 2e-6."""
    fmu = fmus[run.fmu]
    expected, _ = model_exchange(fmu, run)
    assert not above(errors(fmu, co_simulation(fmu, run), expected), 1e-5)


class Kerb(Run):
    """EspCar brakes from 60 km/h until its rear wheels lock, and runs over a kerb with them at 0.8 s."""

    def inputs(self, fmu: Fmu) -> tuple[list[str], Array]:
        times = HOLD * np.arange(150)
        zero, torque = np.zeros_like(times), np.where(times >= 0.2, 1.0, 0.0)
        height = np.where((times > 0.795) & (times < 0.855), 0.1, 0.0)
        columns = {"road_height.rl": height, "road_height.rr": height, "steer.front": zero}
        columns |= {f"brake_torque.{wheel}": most * torque for wheel, most in LOCKING.items()}
        assert set(columns) <= set(fmu.variables)
        return list(columns), np.array(list(columns.values())).T


# Brake torque that locks the rear wheels (N m).
LOCKING = {"fl": 1500.0, "fr": 1500.0, "rl": 2500.0, "rr": 2500.0}


def test_locked_wheels_leave_the_ground(fmus: dict[str, Fmu]) -> None:
    """Sliding tires lose their load: D and N in Dugoff's law become 0 at the same time. Tolerance: as for kinks."""
    fmu, run = fmus["EspCar"], Kerb("EspCar", "kerb", ROLLING)
    found = co_simulation(fmu, run)
    names = [v.name for v in fmu.of("output")]
    in_the_air = found[:, names.index("tire_load.rl")] == 0.0
    assert (found[in_the_air, names.index("tire_longitudinal_slip.rl")] < -0.9).any()
    expected, _ = model_exchange(fmu, run)
    assert not above(errors(fmu, found, expected), 1e-5)


@pytest.mark.parametrize("run", SWITCHING, ids=str)
def test_relations_change_within_one_step(fmus: dict[str, Fmu], run: Run) -> None:
    """Co-simulation does not report its relations, so its states are passed to an instance in model exchange.

    The states are known at the ends of steps, so a change is detected at the first end after the event: up to one
    `max_step` late (measured: 0 to 0.995 of it). Tolerance: 1 % of `max_step`, because the two solutions differ.
    """
    fmu = fmus[run.fmu]
    _, expected = model_exchange(fmu, run)
    assert expected
    max_step = float(fmu.variables["max_step"].start)
    part = round(HOLD / max_step)
    outputs = [v.valueReference for v in fmu.of("output")]
    # Calculated states are listed as outputs, too.
    columns = [outputs.index(reference) for reference in fmu.state_references]
    trajectory = co_simulation(fmu, run, part=part)[:, columns]
    names, rows = run.inputs(fmu)
    inputs = [fmu.variables[name].valueReference for name in names]
    found: Changes = {}
    with fmu.instance(FMU2Model, run.parameters, dict(zip(names, rows[0].tolist(), strict=True))) as instance:
        before = sides(fmu, instance)
        for k, x in enumerate(trajectory):
            instance.setTime(k * max_step)
            instance.setContinuousStates((c_double * fmu.states)(*x), fmu.states)
            instance.enterEventMode()
            instance.setReal(inputs, rows[k // part].tolist())
            instance.newDiscreteStates()
            instance.enterContinuousTimeMode()
            after = sides(fmu, instance)
            for i in (i for i, (old, new) in enumerate(zip(before, after, strict=True)) if old != new):
                found.setdefault(i, []).append(k * max_step)
            before = after
    assert {i: len(times) for i, times in found.items()} == {i: len(times) for i, times in expected.items()}
    for i, times in found.items():
        for late, event in zip(times, expected[i], strict=True):
            assert -0.01 * max_step < late - event < 1.01 * max_step, (i, late, event)


# Random states --------------------------------------------------------------------------------------------------------


class Point:
    """An instance in model exchange that is moved through its states."""

    def __init__(self, fmu: Fmu, instance: Any) -> None:
        self.fmu, self.instance = fmu, instance
        self.inputs = [v.valueReference for v in fmu.of("input")]
        self.x = (c_double * fmu.states)()

    def move(self, states: Array) -> Array:
        """Set the states between events and return the indicators."""
        self.x[:] = states.tolist()
        self.instance.setContinuousStates(self.x, len(self.x))
        return self.indicators()

    def event(self, inputs: Array | None = None) -> Array:
        """Handle an event; returns the indicators in event mode."""
        self.instance.enterEventMode()
        if inputs is not None:
            self.instance.setReal(self.inputs, inputs.tolist())
        self.instance.newDiscreteStates()
        indicators = self.indicators()
        self.instance.enterContinuousTimeMode()
        return indicators

    def indicators(self) -> Array:
        values = (c_double * self.fmu.indicators)()
        self.instance.getEventIndicators(values, self.fmu.indicators)
        return np.array(values)

    def derivatives(self) -> Array:
        values = (c_double * self.fmu.states)()
        self.instance.getDerivatives(values, self.fmu.states)
        return np.array(values)


def spread(fmu: Fmu, random: np.random.Generator) -> tuple[Array, Array]:
    """Return random states and inputs: up to three nominal values and within the limits, some of them zero."""

    def draw(variables: Sequence[ScalarVariable]) -> Array:
        nominal = np.array([float(v.nominal or 1.0) for v in variables])
        values = (
            nominal * random.choice([0.0, 0.01, 0.1, 1.0, 3.0], len(variables)) * random.normal(size=len(variables))
        )
        low = [-np.inf if v.min is None else float(v.min) for v in variables]
        high = [np.inf if v.max is None else float(v.max) for v in variables]
        return np.asarray(np.clip(values, low, high))

    by_reference = {v.valueReference: v for v in fmu.description.modelVariables if v.type == "Real"}
    return draw([by_reference[r] for r in fmu.state_references]), draw(fmu.of("input"))


@pytest.mark.parametrize("states", [500, pytest.param(10_000, marks=pytest.mark.nightly)])
@pytest.mark.parametrize(
    "name",
    [
        "EspCar",
        "HeavyVehicle",
        "HydroPneumaticHalfCar",
        "RescueVehicle",
    ],
)
def test_indicators_keep_their_sides_between_events(fmus: dict[str, Fmu], name: str, states: int) -> None:
    """Properties at random states and on random lines through them.

    - After an event, no indicator is zero, and leaving event mode does not change the indicators.
    - If no indicator has changed its sign, an event does not change derivatives, so the frozen relations agree with the
      current values. Tolerance: the hysteresis of the exporter's relations, 1e-9 of their scales.
    - An indicator that has changed its sign keeps the new sign in the event, so no second event follows.
    """
    fmu, random = fmus[name], np.random.default_rng(20261122)
    crossings = 0
    with fmu.instance(FMU2Model, {}, {}) as instance:
        point = Point(fmu, instance)
        nominals = (c_double * fmu.states)()
        instance.getNominalsOfContinuousStates(nominals, fmu.states)
        # Relative to a derivative of one nominal value per second.
        tolerance = 1e-9 * np.array(nominals)
        for _ in range(states):
            (x, u), (direction, _) = spread(fmu, random), spread(fmu, random)
            point.move(x)
            start = point.event(u)
            assert (start != 0.0).all()
            assert (point.indicators() == start).all()
            positive = start > 0.0
            state = instance.getFMUstate()
            after = None
            for s in np.linspace(0.0, 2.0, 33):
                if ((point.move(x + s * direction) > 0.0) != positive).any():
                    after = s
                    break
                frozen = point.derivatives()
                point.event()
                assert (np.abs(point.derivatives() - frozen) <= tolerance).all(), s
                instance.setFMUstate(state)
            if after is not None:
                crossings += 1
                before = after - 2.0 / 32
                for _ in range(60):
                    middle = 0.5 * (before + after)
                    is_before = ((point.move(x + middle * direction) > 0.0) == positive).all()
                    before, after = (middle, after) if is_before else (before, middle)
                crossed = point.move(x + after * direction) > 0.0
                assert ((point.event() > 0.0) == crossed)[crossed != positive].all()
            instance.freeFMUstate(state)
    assert crossings > 0


# Discrete-time models -------------------------------------------------------------------------------------------------


def test_discrete_outputs_are_equal_at_every_sample(fmus: dict[str, Fmu]) -> None:
    """Reference: co-simulation, which samples at the start of a step. The inputs are those of the run in the FMU.

    Outputs of all types must be bit-identical, also in the events between samples in which inputs change.
    """
    compared = []
    for fmu in fmus.values():
        if fmu.states:
            continue
        with zipfile.ZipFile(FOLDER / f"{fmu.name}.fmu") as archive:
            text = archive.read("extra/io.github.chassis-fmu/reference.csv").decode()
        names, *rows = csv.reader(io.StringIO(text))
        inputs = [(i, fmu.variables[n]) for i, n in enumerate(names) if n in {v.name for v in fmu.of("input")}]
        times = [float(row[names.index("time")]) if "time" in names else k * ROW for k, row in enumerate(rows)]
        assert times[0] == 0.0
        outputs = fmu.of("output")
        sample_time = float(fmu.variables["sample_time"].start)

        with fmu.instance(FMU2Slave, {}, {}) as instance:
            expected = []
            for time, row in zip(times, rows, strict=True):
                for i, variable in inputs:
                    write(instance, variable, float(row[i]))
                instance.doStep(time, ROW)
                expected.append(read(instance, outputs))

        # The first sample is part of the first event, so its inputs are set in initialization mode.
        first = {variable.name: float(rows[0][i]) for i, variable in inputs}
        samples = 0
        with fmu.instance(FMU2Model, {}, first) as instance:
            for k, (time, row) in enumerate(zip(times, rows, strict=True)):
                instance.setTime(time)
                instance.enterEventMode()
                for i, variable in inputs:
                    write(instance, variable, float(row[i]))
                *_, is_defined, next_time = instance.newDiscreteStates()
                instance.enterContinuousTimeMode()
                assert read(instance, outputs) == expected[k], (fmu.name, time)
                assert is_defined
                # The next sample is a whole number of sample times away, up to rounding of the row times.
                assert next_time > time
                periods = next_time / sample_time
                assert abs(periods - round(periods)) < 1e-9 * max(1.0, periods), (fmu.name, next_time)
                assert next_time - time < sample_time * (1.0 + 1e-6)
                samples += 1
        assert samples == len(rows) > 90
        assert len({tuple(row) for row in expected}) > 1, f"the outputs of {fmu.name} do not move"
        compared.append(fmu.name)
    assert len(compared) == 21

"""Random declarations: pack, validate, make random calls, save and restore states.

References: FMPy's rules, `cargo fmu check`, and a small model of the standard (`tests.expected_fmu`), with which every
value and every rejected call is compared. A failure prints the seed, the calls and the source of the model.

The first tier has the seeds 0 to 5. To repeat a nightly test: `pytest -m nightly -k seed17` and this file.
"""

from __future__ import annotations

import copy
import ctypes
import os
import random
import shutil
import subprocess
from collections.abc import Callable
from fractions import Fraction
from itertools import groupby
from pathlib import Path
from typing import Any

import fmpy
import pytest
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import FMU2Slave
from fmpy.fmi3 import FMU3Slave
from fmpy.model_description import ModelDescription
from fmpy.validation import validate_fmu

from tests.commands import CARGO_FMU, ROOT
from tests.declarations import LIMITS, Clock, Model, Value, Variable, generate, source
from tests.expected_fmu import ExpectedFmu, State, equal

WORKSPACE = ROOT / "target" / "declarations"
# Each seed has its own model; six seeds have every kind of model, with sizes in array variables and without.
SEEDS = [*range(6), *(pytest.param(seed, marks=pytest.mark.nightly) for seed in range(6, 48))]
CALLS = 600

MANIFEST = """[package]
name = "{}"
version = "0.1.0"
edition = "2024"
license = "MIT"
[lib]
crate-type = ["cdylib", "rlib"]
[dependencies]
fmu.workspace = true
"""


def write(path: Path, text: str) -> None:
    """Write a file, unless it has this text: cargo compiles nothing again then."""
    path.parent.mkdir(parents=True, exist_ok=True)
    if not path.is_file() or path.read_text(encoding="utf-8") != text:
        path.write_text(text, encoding="utf-8")


def call(*command: str | Path) -> str:
    environment = os.environ | {"CARGO_NET_OFFLINE": "true", "CARGO_TERM_QUIET": "true"}
    options: dict[str, Any] = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT, "encoding": "utf-8"}
    done = subprocess.run(command, cwd=WORKSPACE, check=False, env=environment, **options)
    assert done.returncode == 0, done.stdout
    return str(done.stdout)


@pytest.fixture(scope="module")
def fmus(request: pytest.FixtureRequest) -> dict[tuple[int, int], Path]:
    """Pack the models of the selected tests, in one workspace. The FMUs are listed by seed and version of FMI."""
    items: list[Any] = [item for item in request.session.items if item.path == request.path]
    models = [generate(item.callspec.params["seed"]) for item in items]
    packages = ", ".join(f'"{model.package}"' for model in models)
    dependency = f'fmu = {{ path = "{(ROOT / "crates" / "fmu").as_posix()}" }}'
    manifest = f'[workspace]\nresolver = "3"\nmembers = [{packages}]\n[workspace.dependencies]\n{dependency}\n'
    write(WORKSPACE / "Cargo.toml", manifest)
    # The same versions of the dependencies.
    shutil.copy(ROOT / "Cargo.lock", WORKSPACE / "Cargo.lock")
    for model in models:
        folder = WORKSPACE / model.package
        write(folder / "Cargo.toml", MANIFEST.format(model.package))
        write(folder / "README.md", "# Random declarations\n")
        write(folder / "src" / "lib.rs", source(model))
    packed: dict[tuple[int, int], Path] = {}
    for option in ("--fmi=3 --arrays", "--fmi=3", "--fmi=2"):
        version, arrays = int(option[6]), "--arrays" in option
        wanted = [m for m in models if version in m.versions and (version == 2 or m.arrays == arrays)]
        out = WORKSPACE / f"fmi{version}"
        if wanted:
            names = [model.name for model in wanted]
            call(*CARGO_FMU, "pack", "--no-portable", "--debug", *option.split(), "--out", out, *names)
        packed |= {(model.seed, version): out / f"{model.name}.fmu" for model in wanted}
    return packed


class Fmu:
    """An instance in FMPy, with the same functions for both versions of FMI."""

    def __init__(self, unpacked: Path, description: ModelDescription, expected: ExpectedFmu) -> None:
        self.expected, self.version, self.model = expected, expected.version, expected.model
        of = {variable.name: variable for variable in description.modelVariables}
        self.references: dict[str, list[int]] = {}
        for variable in expected.variables:
            is_array = variable.name in of and bool(variable.shape)
            names = [variable.name] if is_array else variable.element_names()
            self.references[variable.field] = [of[name].valueReference for name in names]
        self.clocks = {clock.name: of[clock.name].valueReference for clock in self.model.clocks if clock.name in of}
        self.fired = of["fired"].valueReference if "fired" in of else 0
        self.time = description.modelVariables[0].valueReference
        slave = FMU3Slave if self.version == 3 else FMU2Slave
        identifier = description.coSimulation.modelIdentifier
        self.slave = slave(
            guid=description.guid, unzipDirectory=str(unpacked), modelIdentifier=identifier, instanceName="one"
        )
        self.slave.instantiate(**({"eventModeUsed": expected.uses_events} if self.version == 3 else {}))

    def kind(self, variable: Variable) -> str:
        """Return the name of the type in the functions that read and set the variable."""
        base = self.model.number_type(variable)
        if self.version == 3:
            return "Int64" if base == "Enumeration" else base
        return {"Float64": "Real", "Float32": "Real", "Boolean": base, "String": base}.get(base, "Integer")

    def get(self, kind: str, variables: list[Variable]) -> list[list[Value]]:
        """Read variables of one type in one call."""
        counts = [len(self.expected.present(variable)) for variable in variables]
        references = [reference for variable in variables for reference in self.references[variable.field]]
        read = getattr(self.slave, f"get{kind}")
        values = read(references, sum(counts)) if self.version == 3 else read(references)
        if kind == "Boolean":
            values = [bool(value) for value in values]
        elif self.version == 2 and kind == "String":
            values = [value.decode("utf-8") for value in values]
        return [[values.pop(0) for _ in range(count)] for count in counts]

    def assign(self, kind: str, assignments: list[tuple[Variable, list[Value]]]) -> None:
        """Set variables of one type in one call."""
        references = [reference for variable, _ in assignments for reference in self.references[variable.field]]
        getattr(self.slave, f"set{kind}")(references, [value for _, values in assignments for value in values])

    def initialize(self, start: float) -> None:
        if self.version == 2:
            self.slave.setupExperiment(startTime=start)
            self.slave.enterInitializationMode()
        else:
            self.slave.enterInitializationMode(startTime=start)

    def intervals(self, clocks: list[Clock]) -> list[tuple[float, int]]:
        count = len(clocks)
        references = (ctypes.c_uint32 * count)(*(self.clocks[clock.name] for clock in clocks))
        intervals, qualifiers = (ctypes.c_double * count)(), (ctypes.c_int * count)()
        self.slave.getIntervalDecimal(references, intervals, qualifiers)
        return list(zip(intervals, qualifiers, strict=True))

    def fraction(self, clock: Clock, what: str) -> Fraction:
        reference, counter, resolution = (
            (ctypes.c_uint32 * 1)(self.clocks[clock.name]),
            *((ctypes.c_uint64 * 1)(), (ctypes.c_uint64 * 1)()),
        )
        if what == "shift":
            self.slave.getShiftFraction(reference, counter, resolution)
        else:
            self.slave.getIntervalFraction(reference, counter, resolution, (ctypes.c_int * 1)())
        return Fraction(counter[0], resolution[0])


class Importer:
    """Makes random calls, and compares the FMU with the expected one after each of them."""

    def __init__(self, path: Path, unpacked: Path, model: Model, version: int, uses_events: bool, seed: str) -> None:
        self.rng = random.Random(seed)
        self.model, self.version, self.path, self.unpacked = model, version, path, unpacked
        self.description = fmpy.read_model_description(str(path))
        self.expected = ExpectedFmu(model, version, uses_events)
        self.fmu = Fmu(unpacked, self.description, self.expected)
        self.saved: list[tuple[Any, State]] = []
        self.log: list[str] = []

    def run(self, calls: int) -> None:
        try:
            self.check()
            for _ in range(calls):
                self.act()
        except Exception as error:
            log = "\n".join(self.log[-40:])
            message = error if isinstance(error, AssertionError) else repr(error)
            raise AssertionError(f"{message}\nseed {self.model.seed}, FMI {self.version}; last calls:\n{log}") from None
        if self.expected.mode in ("Configuration", "Reconfiguration"):
            self.exit_configuration()
        self.free_saved()
        self.fmu.slave.freeInstance()

    # Comparisons with the expected values.

    def check(self) -> None:
        expected = self.expected
        readable = [variable for variable in expected.variables if expected.is_readable(variable)]
        for kind, variables in groupby(sorted(readable, key=self.fmu.kind), key=self.fmu.kind):
            listed = list(variables)
            self.rng.shuffle(listed)
            for variable, found in zip(listed, self.fmu.get(kind, listed), strict=True):
                wanted = expected.get(variable)
                is_exact = variable.role != "state" and not variable.kind.startswith("time of")
                assert equal(found, wanted, is_exact), f"{variable.name} = {found}, expected {wanted}"
        if self.version == 3 and expected.mode in ("Instantiated", "Step", "Event", "Terminated"):
            (time,) = self.fmu.slave.getFloat64([self.fmu.time])
            assert equal([time], [float(expected.state.time)], False), f"time = {time}, expected {expected.state.time}"
        if expected.mode == "Event":
            found = self.fmu.slave.getClock([*self.fmu.clocks.values(), self.fmu.fired])
            wanted = [name in expected.state.active for name in self.fmu.clocks] + [expected.evaluated().has_fired]
            assert found == wanted, f"clocks {found}, expected {wanted}"
        elif self.version == 2 and self.model.clocks and expected.mode == "Step":
            (fired,) = self.fmu.slave.getBoolean([self.fmu.fired])
            assert bool(fired) == expected.state.has_fired, "the output clock"

    def rejected(self, text: str, call: Callable[[], object]) -> None:
        """Make a call that the standard forbids; it must fail and change nothing."""
        self.log.append(f"rejected: {text}")
        try:
            call()
        except FMICallException:
            self.check()
        else:
            raise AssertionError(f"not rejected: {text}")

    # Calls.

    def act(self) -> None:
        rng, expected = self.rng, self.expected
        always = [self.save, self.restore, self.restore, self.forbidden, self.forbidden, self.forbidden]
        rare: list[Callable[[], object]] = [self.transfer, self.reset] if rng.random() < 0.2 else []
        actions: list[Callable[[], object]]
        match expected.mode:
            case "Instantiated":
                actions = [self.set_values, self.set_values, self.initialize, *always, *rare, *self.configurations()]
            case "Configuration" | "Reconfiguration":
                actions = [self.set_values, self.set_values, self.forbidden, self.exit_configuration]
            case "Initialization":
                actions = [self.set_values, self.set_values, self.exit_initialization, *always, *rare]
                actions += [self.read_intervals] if self.version == 3 and self.model.clocks else []
            case "Step":
                steps = [self.enter_event_mode if expected.uses_events else self.step]
                steps = (
                    steps
                    if expected.uses_events and expected.next_tick() == expected.state.time
                    else [*steps, self.step]
                )
                ends = [self.terminate] if rng.random() < 0.1 else []
                actions = [self.set_values, self.set_values, *steps * 3, *always, *rare, *ends, *self.configurations()]
            case "Event":
                actions = [
                    self.set_values,
                    *[self.activate] * 4,
                    self.deactivate,
                    *[self.update] * 3,
                    *[self.enter_step_mode] * 3,
                ]
                actions += [self.read_intervals, *always, *rare]
            case _:
                actions = [self.restore, self.reset, self.forbidden, *rare]
        rng.choice(actions)()
        if rng.random() < 0.7:
            self.check()

    def configurations(self) -> list[Callable[[], object]]:
        is_settable = [
            v.tunable or self.expected.mode == "Instantiated" for v in self.expected.variables if v.structural
        ]
        return [self.enter_configuration] if self.version == 3 and any(is_settable) else []

    def values(self, variable: Variable) -> list[Value]:
        return [self.model.value(self.rng, variable) for _ in self.expected.present(variable)]

    def pick(self, variables: list[Variable], most: int) -> tuple[str, list[Variable]]:
        """Return some variables of one type."""
        first = self.rng.choice(variables)
        others = [v for v in variables if v is not first and self.fmu.kind(v) == self.fmu.kind(first)]
        return self.fmu.kind(first), [first, *self.rng.sample(others, min(len(others), self.rng.randrange(most)))]

    def set_values(self) -> None:
        settable = [variable for variable in self.expected.variables if self.expected.is_settable(variable)]
        if settable:
            # After a structural parameter, the other variables of the call would have other sizes.
            kind, variables = self.pick(settable, 3)
            assignments = [(variable, self.values(variable)) for variable in variables]
            self.log.append(f"set{kind} {[(variable.name, values) for variable, values in assignments]}")
            self.fmu.assign(kind, assignments)
            for variable, values in assignments:
                self.expected.assign(variable, values)

    def initialize(self) -> None:
        start = self.rng.choice([Fraction(0), Fraction(1, 2), Fraction(-3), Fraction(1000)])
        self.log.append(f"initialize at {start}")
        self.fmu.initialize(float(start))
        self.expected.initialize(start)

    def exit_initialization(self) -> None:
        self.log.append("exitInitializationMode")
        self.fmu.slave.exitInitializationMode()
        self.expected.exit_initialization()

    def step(self) -> None:
        expected = self.expected
        following = expected.next_tick() if expected.uses_events else None
        steps = [Fraction(n, 16) for n in range(1, 9)]
        if following is not None:
            left = following - expected.state.time
            steps = [left, left, left / 2, left / 3]
        self.do_step(self.rng.choice(steps))

    def do_step(self, step: Fraction) -> None:
        self.log.append(f"doStep {float(self.expected.state.time)} {step}")
        found = self.fmu.slave.doStep(float(self.expected.state.time), float(step))
        self.expected.step(step)
        if self.version == 3:
            assert found[:3] == (False, False, False)
            assert equal([found[3]], [float(self.expected.state.time)], False), found

    def enter_event_mode(self) -> None:
        self.log.append("enterEventMode")
        self.fmu.slave.enterEventMode()
        self.expected.enter_event_mode()

    def activate(self) -> None:
        triggered = {clock.name for clock in self.model.clocks if clock.kind == "triggered"}
        possible = sorted(self.expected.due() | triggered)
        if possible:
            names = self.rng.sample(possible, self.rng.randint(1, len(possible)))
            self.log.append(f"setClock {names}")
            self.fmu.slave.setClock([self.fmu.clocks[name] for name in names], [True] * len(names))
            self.expected.state.active |= set(names)

    def deactivate(self) -> None:
        if active := sorted(self.expected.state.active):
            name = self.rng.choice(active)
            self.log.append(f"setClock {name} inactive")
            self.fmu.slave.setClock([self.fmu.clocks[name]], [False])
            self.expected.state.active.discard(name)

    def update(self) -> None:
        self.log.append("updateDiscreteStates")
        assert self.fmu.slave.updateDiscreteStates()[:5] == (False,) * 5
        self.expected.update_discrete_states()

    def enter_step_mode(self) -> None:
        expected = self.expected
        if expected.state.is_updated and not expected.state.active and not expected.due():
            self.log.append("enterStepMode")
            self.fmu.slave.enterStepMode()
            expected.state.mode = "Step"

    def read_intervals(self) -> None:
        timed = [clock for clock in self.model.clocks if clock.kind != "triggered"]
        clocks = self.rng.sample(timed, self.rng.randint(1, len(timed)))
        self.log.append(f"getIntervalDecimal {[clock.name for clock in clocks]}")
        for clock, (interval, qualifier) in zip(clocks, self.fmu.intervals(clocks), strict=True):
            wanted, qualifiers = self.expected.read_interval(clock)
            assert equal([interval], [wanted], False), f"interval of {clock.name} = {interval}, expected {wanted}"
            assert qualifier in qualifiers, f"qualifier of {clock.name} = {qualifier}, expected {qualifiers}"
            if clock.kind == "constant" and self.expected.mode == "Initialization":
                assert self.fmu.fraction(clock, "interval") == clock.interval
                assert self.fmu.fraction(clock, "shift") == clock.shift

    def enter_configuration(self) -> None:
        self.log.append("enterConfigurationMode")
        self.fmu.slave.enterConfigurationMode()
        self.expected.state.mode = "Configuration" if self.expected.mode == "Instantiated" else "Reconfiguration"

    def exit_configuration(self) -> None:
        self.log.append("exitConfigurationMode")
        self.fmu.slave.exitConfigurationMode()
        self.expected.state.mode = "Instantiated" if self.expected.mode == "Configuration" else "Step"

    def terminate(self) -> None:
        self.log.append("terminate")
        self.fmu.slave.terminate()
        self.expected.state.mode = "Terminated"

    def reset(self) -> None:
        self.log.append("reset")
        self.fmu.slave.reset()
        self.expected.reset()

    # States.

    def save(self) -> None:
        self.log.append(f"getFMUState: {len(self.saved)}")
        self.saved.append((self.fmu.slave.getFMUState(), copy.deepcopy(self.expected.state)))

    def restore(self) -> None:
        if self.saved:
            number = self.rng.randrange(len(self.saved))
            self.log.append(f"setFMUState {number}")
            state, expected = self.saved[number]
            self.fmu.slave.setFMUState(state)
            self.expected.state = copy.deepcopy(expected)

    def transfer(self) -> None:
        """Continue in another instance, which gets the state as bytes."""
        self.log.append("serializeFMUState, deserializeFMUState in a new instance")
        state = self.fmu.slave.getFMUState()
        data = self.fmu.slave.serializeFMUState(state)
        self.fmu.slave.freeFMUState(state)
        self.free_saved()
        other = Fmu(self.unpacked, self.description, self.expected)
        self.fmu.slave.freeInstance()
        self.fmu = other
        state = other.slave.deserializeFMUState(data)
        other.slave.setFMUState(state)
        other.slave.freeFMUState(state)
        self.check()

    def free_saved(self) -> None:
        for state, _ in self.saved:
            self.fmu.slave.freeFMUState(state)
        self.saved.clear()

    # Calls that the standard forbids.

    def forbidden(self) -> None:
        kinds = [self.call_out_of_order, self.call_out_of_order, self.set_fixed, self.set_wrong, self.read_inaccessible]
        self.rng.choice([*kinds, self.use_wrong_function, self.do_wrong_step, self.activate_wrong])()

    def call_out_of_order(self) -> None:
        slave, mode = self.fmu.slave, self.expected.mode
        allowed = {
            "enterInitializationMode": {"Instantiated"},
            "exitInitializationMode": {"Initialization"},
            "doStep": {"Step"},
            "terminate": {"Step", "Event"},
        }
        if self.version == 3:
            allowed |= {
                "enterStepMode": {"Event"},
                "updateDiscreteStates": {"Event"},
                "exitConfigurationMode": {"Configuration", "Reconfiguration"},
                "enterConfigurationMode": {mode}
                if self.configurations() and mode in ("Instantiated", "Step")
                else set(),
                "enterEventMode": {"Step"},
            }
        name = self.rng.choice([name for name, modes in allowed.items() if mode not in modes])
        arguments = (float(self.expected.state.time), 0.125) if name == "doStep" else ()
        self.rejected(name, lambda: getattr(slave, name)(*arguments))

    def set_with(self, text: str, variable: Variable, values: list[Value]) -> None:
        """Set a variable to values that are rejected, together with one that could be set alone."""
        expected, kind = self.expected, self.fmu.kind(variable)
        settable = [
            v for v in expected.variables if self.fmu.kind(v) == kind and expected.is_settable(v) and v is not variable
        ]
        good = [(v, self.values(v)) for v in self.rng.sample(settable, min(1, len(settable)))]
        self.rejected(
            f"{text}: set{kind} {[(v.name, x) for v, x in good]}, {variable.name} {values}",
            lambda: self.fmu.assign(kind, [*good, (variable, values)]),
        )

    def set_fixed(self) -> None:
        expected = self.expected
        fixed = [v for v in expected.variables if not expected.is_settable(v) and expected.present(v)]
        if fixed:
            variable = self.rng.choice(fixed)
            values = self.values(variable) if variable.start else [0.0 for _ in expected.present(variable)]
            self.set_with("not settable", variable, values)

    def set_wrong(self) -> None:
        """Set a value outside the limits or the type."""
        expected = self.expected
        wrong: list[tuple[Variable, Value]] = []
        for variable in (v for v in expected.variables if expected.is_settable(v) and expected.present(v)):
            base, limits = variable.type, variable.limits if variable.role == "parameter" else None
            if base in ("Float64", "Float32"):
                wrong += [(variable, float("nan")), (variable, float("inf"))]
                wrong += [(variable, limits[1] * 2)] if limits and limits[1] else []
            elif base == "Binary":
                wrong.append((variable, bytes(variable.capacity + 1)))
            elif base == "Enumeration":
                wrong.append((variable, max(self.model.levels) + 1))
            elif limits and limits[1] < LIMITS[base][1]:
                wrong.append((variable, limits[1] + 1))
        if wrong:
            variable, value = self.rng.choice(wrong)
            values = self.values(variable)
            values[self.rng.randrange(len(values))] = value
            self.set_with("wrong value", variable, values)

    def read_inaccessible(self) -> None:
        expected = self.expected
        hidden = [v for v in expected.variables if not expected.is_readable(v) and expected.present(v)]
        if hidden:
            variable = self.rng.choice(hidden)
            kind = self.fmu.kind(variable)
            self.rejected(f"get{kind} {variable.name}", lambda: self.fmu.get(kind, [variable]))

    def use_wrong_function(self) -> None:
        """Read a variable with the function of another type, or with another number of values."""
        expected = self.expected
        readable = [variable for variable in expected.variables if expected.is_readable(variable)]
        if not readable:
            return
        variable = self.rng.choice(readable)
        kinds = {self.fmu.kind(other) for other in readable} - {self.fmu.kind(variable)}
        if expected.present(variable):
            kind = self.rng.choice(sorted(kinds))
            self.rejected(f"get{kind} {variable.name}", lambda: self.fmu.get(kind, [variable]))
        if self.version == 3 and variable.type not in ("String", "Binary"):
            read = getattr(self.fmu.slave, f"get{self.fmu.kind(variable)}")
            count = len(expected.present(variable)) + 1
            references = self.fmu.references[variable.field]
            self.rejected(f"{count} values of {variable.name}", lambda: read(references, count))

    def do_wrong_step(self) -> None:
        if self.expected.mode != "Step":
            return
        time = float(self.expected.state.time)
        wrong = [(time + 0.125, 0.125), (time, 0.0), (time, -0.125), (time, float("nan"))]
        following = self.expected.next_tick() if self.expected.uses_events else None
        if following is not None:
            wrong += [(time, float(following - self.expected.state.time) + 0.01)] * 4
        arguments = self.rng.choice(wrong)
        self.rejected(f"doStep {arguments}", lambda: self.fmu.slave.doStep(*arguments))

    def activate_wrong(self) -> None:
        if self.expected.mode != "Event":
            return
        due = self.expected.due()
        waiting = [clock.name for clock in self.model.clocks if clock.kind != "triggered" and clock.name not in due]
        name = self.rng.choice(["fired", *waiting])
        reference = self.fmu.clocks.get(name, self.fmu.fired)
        self.rejected(f"setClock {name}", lambda: self.fmu.slave.setClock([reference], [True]))


@pytest.mark.parametrize("seed", SEEDS, ids=lambda seed: f"seed{seed}")
def test_a_random_model_behaves_as_the_standard_says(
    seed: int, fmus: dict[tuple[int, int], Path], tmp_path: Path
) -> None:
    model, failure = generate(seed), ""
    try:
        for version in model.versions:
            path = fmus[seed, version]
            assert list(validate_fmu(str(path))) == []
            call(*CARGO_FMU, "check", path)
            unpacked = Path(fmpy.extract(str(path), unzipdir=str(tmp_path / str(version))))
            # An importer without Event Mode gets the ticks inside the steps.
            for uses_events in [True, False] if model.clocks and version == 3 else [False]:
                Importer(path, unpacked, model, version, uses_events, f"calls {seed} {version}").run(CALLS)
    except AssertionError as error:
        failure = str(error)
    if failure:
        pytest.fail(f"{failure}\n\nsource of the model:\n{source(model)}", pytrace=False)

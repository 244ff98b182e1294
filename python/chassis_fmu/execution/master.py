"""The co-simulation master: executes one run of a plan through fmpy.

The calls, their order and their arguments are those of the native master (`chassis run`), so the results are
bit-identical. FMI 3.0 components are called through `fmi3`. The inner loop passes preallocated arrays directly to
fmpy's ctypes functions: fmpy's convenience methods create two arrays per call and would dominate the run time.
"""

from __future__ import annotations

import contextlib
import ctypes
import math
import os
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn, Protocol

import numpy as np
from fmpy import calloc, free, read_model_description
from fmpy.fmi2 import (
    FMU2Slave,
    addLoggerProxy,
    fmi2CallbackAllocateMemoryTYPE,
    fmi2CallbackFreeMemoryTYPE,
    fmi2CallbackFunctions,
    fmi2CallbackLoggerTYPE,
)
from fmpy.fmi3 import FMU3Slave

from .. import _native
from ..files.plan import Bytes, Component, InputSeries, PlanError, Run, Setting, Simulation, Wire
from . import calls, clocks, fmi3, rates
from .bus import Array, ExactValues, RealInputs, RealOutputs, WholeGroup, of_type
from .calls import Board
from .fmi3 import DISCARD, ERROR, OK
from .start import change, evaluate, solve

WARNING = 1
FATAL = 4
# Kinds of fmi2StatusKind.
LAST_SUCCESSFUL_TIME = 2
TERMINATED = 3
STATUS = ("OK", "warning", "discard", "error", "fatal", "pending")

# Tolerance for sample times of a held input series, in steps: a sample at t_k applies even if t_k is rounded.
SERIES_SLACK = 1e-9

# A discarded step is complete if the FMU reports a last successful time this close to its end, in steps.
STEP_SLACK = 1e-6
# Operands whose sums show the rounding mode. With literals, Python would add them when it compiles the expression.
_ONE = 1.0
_HALF_ULP = 2.0**-53
# FE_TONEAREST of <fenv.h>, on all processors that the FMUs are built for.
_TO_NEAREST = 0


@dataclass(eq=False)
class RunError(Exception):
    """A run that ended early: component, function, time, and the messages that the component logged."""

    component: str
    function: str
    time: float | None
    detail: str
    messages: Iterable[str] = ()
    fatal: bool = False
    is_end: bool = False
    """The FMU has asked to end the simulation; this is not an error."""
    status: int | None = None
    """The status that the function has returned."""
    recorded: tuple[Array, Array] | None = None
    """Times and rows before the error."""

    def __post_init__(self) -> None:
        # Copy the messages, because the log continues.
        self.messages = tuple(self.messages)

    @property
    def is_discarded(self) -> bool:
        """The FMU has discarded a step."""
        return self.status == DISCARD and self.function.endswith("DoStep")

    def __str__(self) -> str:
        when = "" if self.time is None else f" at t = {self.time:.9g} s"
        return self.described(when)

    def described(self, when: str = "") -> str:
        """Describe the error; `when` is inserted after the function name."""
        first = f"component {self.component}, {self.function}{when}: {self.detail}"
        return "\n".join([first, *(f"  log: {m}" for m in self.messages)])


# Log messages of the current run by instance name. There is one logger per process, because fmpy's proxy, which expands
# the printf arguments, supports only one.
_log: dict[str, deque[str]] = {}

# Number of the latest messages that are kept for each component.
KEPT_MESSAGES = 20


def _logger(_environment: object, instance: bytes | None, status: int, category: bytes, message: bytes) -> None:
    # fmpy has expanded the printf format; FMI 2.0 (section 2.1.5) doubles each "#" too.
    text = (message or b"").decode("utf-8", "replace").replace("##", "#")
    _note((instance or b"").decode("utf-8", "replace"), status, category, text)


def _note(name: str, status: int, category: bytes | None, text: str) -> None:
    label = STATUS[status] if 0 <= status < len(STATUS) else str(status)
    _log.setdefault(name, deque(maxlen=KEPT_MESSAGES)).append(
        f"[{label}, {(category or b'').decode('utf-8', 'replace')}] {text}"
    )


def _error(component: str, function: str, time: float | None, detail: str, **more: Any) -> RunError:
    """Return the error of a component with the messages that it has logged."""
    return RunError(component, function, time, detail, _log.get(component, ()), **more)


def messages() -> list[tuple[str, str]]:
    """Return the messages of the latest run, as pairs of component and message."""
    return [(component, text) for component, texts in _log.items() for text in texts]


_callbacks = fmi2CallbackFunctions()
_callbacks.logger = fmi2CallbackLoggerTYPE(_logger)
_callbacks.allocateMemory = fmi2CallbackAllocateMemoryTYPE(calloc)
_callbacks.freeMemory = fmi2CallbackFreeMemoryTYPE(free)
addLoggerProxy(ctypes.byref(_callbacks))


class Instance(Protocol):
    """A loaded FMU with one instance; `functions` is a shared library with argument types, or a mock in a test."""

    functions: Any
    component: Any
    clocks: clocks.Description

    def free(self) -> None:
        """Free the instance and unload the library."""


def _starts(component: Component) -> tuple[Setting, ...]:
    """Return the start values that are set before initialization, in this order."""
    if component.steady == ():
        raise PlanError(
            f"the steady state in which `{component.name}` starts has not been found; `chassis plan --json` finds it"
        )
    return component.parameters + (component.steady or ())


class FmpyInstance:
    """An instance made by fmpy, of either version of FMI."""

    def __init__(self, component: Component, folder: Path) -> None:
        if component.integration:
            message = "only the native master integrates an FMU for model exchange: leave out --engine fmpy"
            raise RunError(component.name, "loading", None, message)
        is_new = component.fmi == "3.0"
        try:
            arrays = {array.reference for array in component.arrays}
            self.clocks = clocks.Description.read(folder, arrays) if is_new else clocks.Description()
            self._slave = (FMU3Slave if is_new else FMU2Slave)(
                guid=component.guid,
                unzipDirectory=str(folder),
                modelIdentifier=component.model_identifier,
                instanceName=component.name,
            )
        except Exception as error:  # fmpy raises bare Exceptions here
            raise RunError(component.name, "loading", None, f"{component.fmu.name}: {error}") from error
        description = read_model_description(str(folder), validate=False) if is_new else None
        if description and description.coSimulation is None:
            message = "only the native master runs an FMU without co-simulation: leave out --engine fmpy"
            raise RunError(component.name, "fmi3InstantiateCoSimulation", None, message)
        try:
            if is_new:
                logger = self._logger_of(component.name)
                self._slave.instantiate(eventModeUsed=self.clocks.has_clocks, logMessage=logger)
            else:
                self._slave.instantiate(callbacks=_callbacks, loggingOn=False)
        except Exception as error:
            function = "fmi3InstantiateCoSimulation" if is_new else "fmi2Instantiate"
            raise _error(component.name, function, None, str(error)) from error
        self.component = self._slave.component
        self.functions: Any = self._slave.dll
        if description:
            variables = description.modelVariables
            references = {variable.name: variable.valueReference for variable in variables}
            types = {variable.valueReference: str(variable.type) for variable in variables}
            structure = component.structure or {}
            self.functions = fmi3.Functions(self._slave.dll, types, component.arrays, self.clocks.clocked)
            self.functions.structure = [(references[name], name, value) for name, value in structure.items()]

    @staticmethod
    def _logger_of(name: str) -> Callable[..., None]:
        """Return a logger for an FMI 3.0 instance; unlike in FMI 2.0, the callback gets neither name nor arguments."""

        def log(_environment: object, status: int, category: bytes | None, message: bytes | None) -> None:
            _note(name, status, category, (message or b"").decode("utf-8", "replace"))

        return log

    def free(self) -> None:
        """Free the instance and unload the library."""
        self._slave.freeInstance()


class Slave:
    """A running component: its instance and its connection to the bus."""

    def __init__(
        self,
        component: Component,
        instance: Instance,
        bus: Array,
        board: Board,
        index: int,
        exact: ExactValues | None = None,
    ) -> None:
        self.component = component
        self.instance = instance
        self._board = board
        self.index = index
        self._has_changed_rounding = False
        self._names = fmi3.NAMES if component.fmi == "3.0" else {}
        hot = ("fmi2SetReal", "fmi2DoStep", "fmi2GetReal")
        self._calls = tuple(calls.code(index, self._named(name)) for name in hot)
        self._functions = instance.functions
        # Value references of integers that can have more than 32 bits.
        self._wide: set[int] = instance.functions.wide if component.fmi == "3.0" else set()
        # Value references of Int64 and UInt64.
        self._exact: set[int] = instance.functions.exact if component.fmi == "3.0" else set()
        self._exact_values = exact or ExactValues()
        self._bus = bus
        self._component = instance.component
        self._do_step = self._functions.fmi2DoStep
        self._set_real = self._functions.fmi2SetReal
        self._get_real = self._functions.fmi2GetReal
        self._inputs = RealInputs(of_type(component.inputs, "Real"), bus)
        self._outputs = RealOutputs(of_type(component.outputs, "Real"), bus)
        self._whole_inputs = self._whole_groups(component.inputs, bus)
        self._whole_outputs = self._whole_groups(component.outputs, bus)
        self._exact_inputs, self._exact_outputs = map(self._exact_wires, (component.inputs, component.outputs))
        self._binary_inputs = of_type(component.inputs, "Binary")
        self._binary_outputs = of_type(component.outputs, "Binary")
        has_clocks = component.fmi == "3.0" and instance.clocks.has_clocks
        self.clocks = clocks.Clocks(self, instance.clocks) if has_clocks else None
        # The components with which this one makes its steps, if it has clocks.
        self.group: clocks.Group | None = None
        self._restore_rounding("fmi2Instantiate")
        if component.structure:
            self.call("fmi3EnterConfigurationMode", None)
            for reference, name, value in self._functions.structure:
                self.access("set", reference, None, fmi3.given(value), subject=f"{name} = {value!r}")
            self.call("fmi3ExitConfigurationMode", None)

    def _exact_wires(self, wires: Sequence[Wire]) -> list[Wire]:
        return [w for w in of_type(wires, "Integer") if w.reference in self._exact]

    def _whole_groups(self, wires: Sequence[Wire], bus: Array) -> list[WholeGroup]:
        """Group the 32-bit Integers, the Booleans and the UInt32 variables; empty groups are left out."""
        integers = [w for w in of_type(wires, "Integer") if w.reference not in self._exact]
        groups = (
            WholeGroup([w for w in integers if w.reference not in self._wide], bus, "Integer"),
            WholeGroup(of_type(wires, "Boolean"), bus, "Boolean"),
            WholeGroup([w for w in integers if w.reference in self._wide], bus, "Integer", wide=True),
        )
        return [group for group in groups if group.count]

    def check(self, status: int, function: str, time: float | None, subject: str = "") -> None:
        """Raise RunError unless a status is OK or warning. `function` has its FMI 2.0 name."""
        if not OK <= status <= WARNING:
            function = self._named(function)
            label = STATUS[status] if 0 <= status < len(STATUS) else "unknown"
            detail = f"status {status} ({label})" + (f", {subject}" if subject else "")
            raise _error(self.component.name, function, time, detail, fatal=status == FATAL, status=status)

    def _named(self, function: str) -> str:
        """Translate the name of an FMI 2.0 function to the FMI version of the component."""
        return self._names.get(function, function)

    def _enter(self, function: str) -> None:
        self._board.call = calls.code(self.index, self._named(function))

    def call(self, function: str, time: float | None, *arguments: Any, subject: str = "") -> None:
        """Call a function by its FMI 2.0 name; raises RunError unless its status is OK or warning."""
        self._enter(function)
        status = getattr(self._functions, function)(self._component, *arguments)
        self._restore_rounding(function)
        self.check(status, function, time, subject)

    def _restore_rounding(self, function: str) -> None:
        """Restore rounding to nearest if a call has changed it: the FMUs and this master share the rounding mode."""
        # Each of the other rounding modes changes one of these sums.
        if _ONE + _HALF_ULP != 1.0 or -_ONE - _HALF_ULP != -1.0 or _ONE - 0.5 * _HALF_ULP != 1.0:
            set_rounding = getattr(ctypes.CDLL(None), "fesetround", None) if os.name == "posix" else None
            if set_rounding is not None:
                set_rounding(_TO_NEAREST)
            if not self._has_changed_rounding:
                self._has_changed_rounding = True
                text = "changes the rounding mode of its process; it is restored after the call"
                _note(self.component.name, WARNING, None, f"{self._named(function)} {text}")

    def apply(self, settings: Iterable[Setting], time: float) -> None:
        """Set parameters or constant inputs, one call each."""
        for s in settings:
            value: Any
            subject = f"{s.name} = {s.value!r}"
            if s.reference in self._exact:
                self.access("set", s.reference, time, int(s.value), subject=subject)  # type: ignore[arg-type]
                continue
            if isinstance(s.value, Bytes):
                binary = bytes.fromhex(s.value.hex)
                self.access("set", s.reference, time, binary, subject=f"{s.name} with {len(binary)} bytes")
                continue
            if s.type == "Real":
                value = (ctypes.c_double * 1)(float(s.value))
            elif s.type == "Integer":
                value = ((ctypes.c_int64 if s.reference in self._wide else ctypes.c_int) * 1)(int(s.value))
                if value[0] != s.value:
                    # ctypes lets integers overflow silently.
                    self.check(ERROR, "fmi2SetInteger", time, subject)
            elif s.type == "Boolean":
                value = (ctypes.c_int * 1)(int(bool(s.value)))
            else:
                value = (ctypes.c_char_p * 1)(str(s.value).encode())
            reference = (ctypes.c_uint * 1)(s.reference)
            self.call(f"fmi2Set{s.type}", time, reference, 1, value, subject=subject)

    def access(self, method: str, reference: int, time: float | None, *values: Any, subject: str = "") -> Any:
        """Call a method of `fmi3.Functions` that gets or sets a variable; returns the value or values."""
        name = self._functions.function("Set" if values else "Get", reference)
        self._enter(name)
        status, value = getattr(self._functions, method)(self._component, reference, *values)
        self._restore_rounding(name)
        self.check(status, name, time, subject)
        return value

    def set(self, time: float, member: rates.Member | None = None, held: Array | None = None) -> None:
        """Set the wired inputs from the bus, or to the values and slopes of the lines of a member.

        Integers and Booleans are set from the bus `held` if it is given.
        """
        group = self._inputs
        if group.count:
            group.load()
            for i, value in member.values if member else ():
                group.buffer[i] = value
            self._board.call = self._calls[0]
            status = self._set_real(self._component, group.references, group.count, group.values)
            self._restore_rounding("fmi2SetReal")
            if not OK <= status <= WARNING:
                self.check(status, "fmi2SetReal", time)
        if member and member.lines:
            arguments = (member.references, len(member.lines), member.orders, member.slopes)
            self.call("fmi2SetRealInputDerivatives", time, *arguments)
        for whole in self._whole_inputs:
            name = f"fmi2Set{whole.kind}"
            if not whole.load(held):
                self.check(ERROR, name, time, "a value does not fit the type of the variable")
            self.call(name, time, whole.references, whole.count, whole.values)
        for wire in self._exact_inputs:
            signal = float(self._bus[wire.slot])
            integer = self._exact_values.integers.get(wire.slot)
            if integer is None and (not signal.is_integer() or abs(signal) > fmi3.LARGEST_WHOLE):
                name = self._functions.function("Set", wire.reference)
                self.check(ERROR, name, time, "a value does not fit the type of the variable")
            self.access("set", wire.reference, time, int(signal) if integer is None else integer)
        for wire in self._binary_inputs:
            binary = self._exact_values.binaries.get(wire.slot, b"")
            self.access("set", wire.reference, time, binary, subject=f"{wire.name} with {len(binary)} bytes")

    def is_clocked(self, reference: int) -> bool:
        """Return whether a variable belongs to clocks."""
        return self.clocks is not None and self._functions.place(reference)[0] in self.clocks.description.clocked

    def outputs(self) -> list[Any]:
        """Return the values on the bus that the component writes, for comparison."""
        slots = [wire.slot for wire in self.component.outputs]
        exact = self._exact_values
        return [(self._bus[s].tobytes(), exact.integers.get(s), exact.binaries.get(s)) for s in slots]

    def end_initialization(self, time: float) -> None:
        """Leave Initialization Mode."""
        if self.clocks:
            self.clocks.start(time)
        self.call("fmi2ExitInitializationMode", time)

    def step(self, time: float, step: float) -> RunError | None:
        """Advance from `time` by `step`.

        If the FMU ends the simulation at the end of the step, returns a RunError with `is_end`. If it ends the
        simulation earlier, raises that error; any other failure raises a RunError without `is_end`.
        """
        return self.group.step_of(self, time, step) if self.group else self.advance(time, step, time, step)

    def advance(self, now: float, size: float, time: float, step: float) -> RunError | None:
        """Call fmi2DoStep from `now` by `size`, in the step of the master from `time` by `step`."""
        self._board.call = self._calls[1]
        status = self._do_step(self._component, now, size, 1)
        self._restore_rounding("fmi2DoStep")
        if OK <= status <= WARNING:
            return None
        if status == DISCARD:
            reached = self._reached()
            if reached is not None:
                is_done = abs(reached - (time + step)) <= STEP_SLACK * step
                end = self.ended("fmi2DoStep", time + is_done * step)
                if not is_done:
                    raise end
                return end
        self.check(status, "fmi2DoStep", time)
        return None

    def fail(self, function: str, time: float, detail: str) -> NoReturn:
        """Raise RunError for a call."""
        raise _error(self.component.name, function, time, detail)

    def ended(self, function: str, time: float) -> RunError:
        """Return the error of a call with which the FMU ended the simulation."""
        return _error(self.component.name, self._named(function), time, "the FMU ended the simulation", is_end=True)

    def _reached(self) -> float | None:
        """Return the last successful time if the FMU ends the simulation, otherwise None."""
        wants, reached = ctypes.c_int(0), ctypes.c_double(math.nan)
        self._enter("fmi2GetBooleanStatus")
        status = self._functions.fmi2GetBooleanStatus(self._component, TERMINATED, ctypes.byref(wants))
        if not OK <= status <= WARNING or not wants.value:
            return None
        self._enter("fmi2GetRealStatus")
        self._functions.fmi2GetRealStatus(self._component, LAST_SUCCESSFUL_TIME, ctypes.byref(reached))
        return reached.value

    def read(self, time: float) -> None:
        """Read the wired and recorded outputs onto the bus."""
        group = self._outputs
        if group.count:
            self._board.call = self._calls[2]
            status = self._get_real(self._component, group.references, group.count, group.values)
            self._restore_rounding("fmi2GetReal")
            if not OK <= status <= WARNING:
                self.check(status, "fmi2GetReal", time)
            group.store()
        for whole in self._whole_outputs:
            self.call(f"fmi2Get{whole.kind}", time, whole.references, whole.count, whole.values)
            whole.store()
        for wire in self._exact_outputs:
            integer = self.access("get", wire.reference, time)
            self._exact_values.integers[wire.slot] = integer
            self._bus[wire.slot] = integer
        for wire in self._binary_outputs:
            value = self.access("get", wire.reference, time)
            self._exact_values.binaries[wire.slot] = value
            self._bus[wire.slot] = len(value)

    def derivatives(self, slot: int, slots: Sequence[int], time: float) -> list[tuple[int, float]]:
        """Return the derivatives of the outputs in `slots` with respect to the input signal in `slot`, with slots."""
        outputs = [w for w in of_type(self.component.outputs, "Real") if w.slot in slots]
        wires = [w for w in of_type(self.component.inputs, "Real") if w.slot == slot]
        inputs = [w.reference for w in wires]
        if not inputs:
            return []
        unknowns = (ctypes.c_uint * len(outputs))(*(w.reference for w in outputs))
        knowns = (ctypes.c_uint * len(inputs))(*inputs)
        factors = [1.0 if w.conversion is None else w.conversion.factor for w in wires]
        seed, result = (ctypes.c_double * len(inputs))(*factors), (ctypes.c_double * len(outputs))()
        arguments = (unknowns, len(outputs), knowns, len(inputs), seed, result)
        self.call("fmi2GetDirectionalDerivative", time, *arguments)
        return [(wire.slot, value) for wire, value in zip(outputs, result, strict=True)]

    def terminate(self, time: float) -> None:
        """End the simulation."""
        self._enter("fmi2Terminate")
        self.check(self._functions.fmi2Terminate(self._component), "fmi2Terminate", time)

    def free(self) -> None:
        """Free the instance."""
        self._enter("fmi2FreeInstance")
        self.instance.free()


class Player:
    """Plays an input series: linear between its samples, or held."""

    def __init__(self, feed: InputSeries, step: float) -> None:
        self.feed = feed
        self._linear = feed.interpolation == "linear"
        # In a step, a linear series has the value at the middle of the step, a held series the last sample up to its
        # start.
        self._later = 0.5 * step if self._linear else SERIES_SLACK * step
        self._row = 0

    def at_start(self, time: float) -> float:
        """Return the value at `time`. Times must rise from call to call."""
        return self._at(time if self._linear else time + self._later)

    def of_step(self, time: float) -> float:
        """Return the value for the step that begins at `time`. Times must rise from call to call."""
        return self._at(time + self._later)

    def peek(self, time: float) -> float:
        """Return the value at a later time."""
        row = self._row
        value = self._at(time)
        self._row = row
        return value

    def _at(self, time: float) -> float:
        times, values, row = self.feed.times, self.feed.values, self._row
        while row + 1 < len(times) and times[row + 1] <= time:
            row += 1
        self._row = row
        before, value = times[row], values[row]
        if self._linear and row + 1 < len(times) and time > before:
            return value + (values[row + 1] - value) * ((time - before) / (times[row + 1] - before))
        return value


def _non_finite(slaves: Sequence[Slave], bus: Array) -> tuple[str, str] | None:
    """Return the component that wrote the first non-finite value on the bus, and a message about it."""
    bad = np.flatnonzero(~np.isfinite(bus))
    if not bad.size:
        return None
    slot, value = int(bad[0]), float(bus[bad[0]])
    for slave in slaves:
        for wire in slave.component.outputs:
            if wire.slot == slot:
                return slave.component.name, f"output {wire.name} is {value}"
    return "input file", f"the value for bus slot {slot} is {value}"


def _end(slaves: Iterable[Slave], time: float) -> None:
    """Terminate all components after one has ended the simulation; further errors are ignored."""
    for slave in slaves:
        with contextlib.suppress(RunError):
            slave.terminate(time)


def simulate(
    run: Run,
    simulation: Simulation,
    instantiate: Callable[[Component], Instance],
    fresh: bool = False,
    board: Board | None = None,
    is_repeated: bool = False,
    texts: dict[int, list[str]] | None = None,
) -> tuple[Array, Array]:
    """Execute a run.

    Returns the times (s) and the rows of the recorded columns that exist in this run, in the order of the plan.
    `instantiate` makes the instance of a component.
    With `fresh`, the rows contain outputs that are read again after the inputs have been set, as in Ecos. The standard
    does not define their values; the FMUs of this project return the outputs for the new inputs.
    Every call is recorded on the `board`. `is_repeated` states that an earlier attempt crashed or hung at the end of
    the run; the instances are then neither terminated nor freed.
    `texts` gets the texts of the columns with values that a double cannot represent, by their position in a row.
    Raises RunError if an FMU cannot be loaded, a call returns neither OK nor warning, a value is not finite, or an FMU
    ends the simulation before the stop time; the error contains the rows before it.
    """
    _log.clear()
    start, step, steps, every = simulation.start, simulation.step, simulation.steps, simulation.every
    bus: Array = np.zeros(run.slots)
    exact = ExactValues()
    recorded = np.array([c for c in run.columns if c is not None], dtype=np.intp)
    times, rows = np.empty(simulation.rows), np.empty((simulation.rows, len(recorded)))
    done = 0
    players = [Player(f, step) for f in run.series]
    slaves: list[Slave] = []
    time = start
    board = board or Board()
    board.begin()

    def record(row: int, t: float) -> None:
        nonlocal done
        if fresh:
            passed_on = bus.copy()
            for slave in slaves:
                slave.set(t)
            for slave in slaves:
                slave.read(t)
            finite(t, "fmi2GetReal")
        bus.take(recorded, out=rows[row], mode="clip")
        if fresh:
            bus[:] = passed_on
        times[row] = t
        done = row + 1
        if texts is not None:
            for column, slot in enumerate(recorded.tolist()):
                text = exact.text(slot, run.binary)
                if text is not None:
                    texts.setdefault(column, []).append(text)

    def finite(t: float, function: str) -> None:
        # Fast path: a finite sum proves that all values are finite.
        with np.errstate(all="ignore"):
            total = float(np.add.reduce(bus))
        if not math.isfinite(total):
            bad = _non_finite(slaves, bus)
            if bad is not None:
                raise _error(bad[0], function, t, bad[1])

    try:
        for index, component in enumerate(run.components):
            board.load(index)
            slaves.append(Slave(component, instantiate(component), bus, board, index, exact))
        groups = clocks.groups(slaves)
        for slave in slaves:
            slave.call("fmi2SetupExperiment", start, 0, 0.0, start, 1, simulation.stop)
        for slave in slaves:
            slave.apply(_starts(slave.component), start)
        for slave in slaves:
            slave.call("fmi2EnterInitializationMode", start)
        for player in players:
            bus[player.feed.slot] = player.at_start(start)
        for slave in slaves:
            slave.read(start)
        constants = [slave.component.constants for slave in slaves]
        for part in run.initialization:
            for index in part.components:
                slaves[index].apply(constants[index], start)
                constants[index] = ()
            of_part = [slaves[index] for index in part.components]
            if part.equations is None:
                evaluate(of_part, start)
                continue
            try:
                solve(part.equations, of_part, bus, exact, start)
            except _native.NoSolutionError as error:
                problem, detail = error.args
                text = (
                    f"the algebraic loop at the start {problem}: {part.equations.path}; {detail}; "
                    "break it with a delay, or give the input another start value"
                )
                raise RunError(of_part[0].component.name, "initialization", None, text) from None
        before = bus.copy()
        for slave in slaves:
            slave.end_initialization(start)
        for group in groups:
            group.event(start, None)
        for slave in slaves:
            slave.read(start)
        changed = change(slaves, before, bus)
        if changed is not None:
            _note(changed[0], WARNING, None, changed[1])
        finite(start, "initialization")
        record(0, start)

        parts = [slaves] if simulation.order == "jacobi" else [[slave] for slave in slaves]
        coupling = rates.Coupling(run, simulation, slaves, players, bus) if rates.Coupling.is_needed(run) else None
        end: RunError | None = None
        for k in range(steps):
            time = rates.time_of(simulation, k)
            board.step(time, k)
            size = rates.step_size(simulation, k, time)
            for player in () if coupling else players:
                bus[player.feed.slot] = player.of_step(time)
            if coupling:
                end = coupling.step(k, time, size)
            for of_part in () if coupling else parts:
                for slave in of_part:
                    slave.set(time)
                for slave in of_part:
                    ended = slave.step(time, size)
                    end = end or ended
                for slave in of_part:
                    slave.read(time)
            now = rates.time_of(simulation, k + 1)
            finite(now, "fmi2DoStep")
            if (k + 1) % every == 0:
                record((k + 1) // every, now)
            if end is not None:
                end.time = now
                break
        if is_repeated:
            slaves.clear()
        if end is not None:
            if k + 1 < steps:
                raise end
            _end(slaves, time)
        else:
            for slave in slaves:
                slave.terminate(simulation.stop)
    except RunError as error:
        error.recorded = (times[:done], rows[:done]) if done else None
        if error.fatal:
            # The standard forbids any further call after fmi2Fatal.
            slaves.clear()
            raise
        if error.is_end:
            _end(slaves, time)
            raise
        # If an FMU rejects a non-finite value from another component, report where the value came from.
        bad = _non_finite(slaves, bus)
        if bad is not None and bad[0] != error.component:
            error.messages = (*error.messages, f"component {bad[0]}: {bad[1]}")
        raise
    finally:
        for slave in slaves:
            slave.free()
        board.begin()
    return times, rows

"""Components with rates, and inputs that are lines in time: the calls of `session/rates.rs` with equal arguments."""

from __future__ import annotations

import ctypes
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

from ..files.plan import InputSeries, Linear, Run, Simulation
from .bus import Array, of_type

if TYPE_CHECKING:
    from .master import RunError, Slave

# Part of a step, at its end, in which a jump of a series does not belong to the step.
END_SLACK = 1e-9


class Player(Protocol):
    """An input series."""

    feed: InputSeries

    def of_step(self, time: float) -> float:
        """Return the value for the step that begins at a time."""

    def at_start(self, time: float) -> float:
        """Return the value at a time. Times must rise from call to call."""

    def peek(self, time: float) -> float:
        """Return the value at a later time."""


def time_of(simulation: Simulation, steps: float) -> float:
    """Return the time after a number of steps; the last one is the stop time."""
    time = simulation.start + steps * simulation.step
    return simulation.stop if time + 0.5 * simulation.step > simulation.stop else time


def step_size(simulation: Simulation, steps: int, time: float) -> float:
    """Return the size of the step at `time`, after a number of steps."""
    if simulation.step_argument == "difference":
        return time_of(simulation, steps + 1) - time
    # FMUs can reject a step beyond the stop time, and rounding of the sum can exceed it.
    return simulation.stop - time if time + simulation.step > simulation.stop else simulation.step


@dataclass(frozen=True)
class Interval:
    """A step of the components that have no rate: the number of steps before it, start, size and end in s."""

    number: int
    time: float
    size: float
    end: float


class Lines:
    """The inputs of a component that are lines, and the arguments for their slopes."""

    def __init__(self, slave: Slave, is_ahead: Sequence[bool]) -> None:
        wires = [(i, w) for i, w in enumerate(of_type(slave.component.inputs, "Real")) if w.is_ramp]
        self.count = len(wires)
        # Index among the Real inputs, slot, conversion, and whether the source steps before the reader.
        self.lines: list[tuple[int, int, Linear | None, bool]] = [
            (i, w.slot, w.conversion, is_ahead[w.slot]) for i, w in wires
        ]
        self.values = [0.0] * self.count
        self.references = (ctypes.c_uint * self.count)(*(w.reference for _, w in wires))
        self.orders = (ctypes.c_int * self.count)(*[1] * self.count)
        self.slopes = (ctypes.c_double * self.count)()

    def store(self, buffer: Array) -> None:
        """Put the values into the Real inputs."""
        for (i, *_), value in zip(self.lines, self.values, strict=True):
            buffer[i] = value


class _Member:
    """A component with its rate."""

    def __init__(self, slave: Slave, is_ahead: Sequence[bool]) -> None:
        self.slave = slave
        self.lines = Lines(slave, is_ahead)
        self.every, self.substeps = slave.component.every, slave.component.substeps
        # Outputs that the bus interpolates, and their values at both ends of the step of the component.
        self.ramps = [w.slot for w in slave.component.outputs if w.is_ramp]
        self.ends = [(0.0, 0.0)] * len(self.ramps)


class Coupling:
    """The steps of a run whose components have rates, or inputs that are lines."""

    def __init__(
        self, run: Run, simulation: Simulation, slaves: Sequence[Slave], players: Sequence[Player], bus: Array
    ) -> None:
        self.simulation, self._players, self._bus = simulation, players, bus
        is_jacobi = simulation.order == "jacobi"
        is_ahead = [False] * run.slots
        self._members: list[_Member] = []
        for slave in slaves:
            self._members.append(_Member(slave, is_ahead))
            for wire in slave.component.outputs:
                is_ahead[wire.slot] = not is_jacobi
        self._parts = [self._members] if is_jacobi else [[member] for member in self._members]
        self._sources = {slot for member in self._members for _, slot, *_ in member.lines.lines}
        # By slot, the value at the start of the step, and the slope in the step before.
        self._start, self._slopes = [0.0] * run.slots, [0.0] * run.slots
        self._steps = math.floor((simulation.stop - simulation.start) / simulation.step + 0.5)

    @staticmethod
    def is_needed(run: Run) -> bool:
        """Return whether not all components make one step per step of the run with constant inputs."""
        return any(
            (component.every, component.substeps) != (1, 1) or any(wire.is_ramp for wire in component.inputs)
            for component in run.components
        )

    def step(self, number: int, time: float, size: float) -> RunError | None:
        """Make a step of all components, see `Slave.step`."""
        at = Interval(number, time, size, time_of(self.simulation, number + 1))
        self._begin(at)
        end: RunError | None = None
        for part in self._parts:
            for member in part:
                self._set(member, at, time)
            for member in part:
                ended = self._advance(member, at)
                end = end or ended
            for member in part:
                self._read(member, at)
        for slot in self._sources:
            self._slopes[slot] = (float(self._bus[slot]) - self._start[slot]) / (at.end - time)
        return end

    def _begin(self, at: Interval) -> None:
        """Write the input series and remember the values at the start of a step."""
        for player in self._players:
            slot = player.feed.slot
            if not self._sources:
                self._bus[slot] = player.of_step(at.time)
                continue
            self._bus[slot] = player.at_start(at.time)
            if player.feed.interpolation == "linear":
                end = at.time + (1.0 - END_SLACK) * at.size
                self._slopes[slot] = (player.peek(end) - float(self._bus[slot])) / (end - at.time)
        for slot in self._sources:
            self._start[slot] = float(self._bus[slot])

    def _set(self, member: _Member, at: Interval, time: float) -> None:
        """Set the inputs of a component that is due, with the values that lines have at `time`."""
        if at.number % member.every:
            return
        lines = member.lines
        for k, (_, slot, conversion, is_ahead) in enumerate(lines.lines):
            first = self._start[slot]
            rise = (float(self._bus[slot]) - first) / at.size if is_ahead else self._slopes[slot]
            value = first + rise * (time - at.time)
            if conversion is not None:
                value, rise = conversion.factor * value + conversion.offset, conversion.factor * rise
            lines.values[k], lines.slopes[k] = value, rise
        member.slave.set(at.time, lines)

    def _advance(self, member: _Member, at: Interval) -> RunError | None:
        """Make the steps of a component that is due."""
        every, substeps = member.every, member.substeps
        if (every, substeps) == (1, 1):
            return member.slave.step(at.time, at.size)
        if at.number % every:
            return None
        time = at.time
        for i in range(1, substeps + 1):
            done = every if i == substeps else i / substeps
            end = time_of(self.simulation, at.number + done)
            if i > 1 and member.lines.count:
                self._set(member, at, time)
            ended = member.slave.step(time, end - time)
            if ended is not None:
                # Other components have not reached the end of this step, or have passed it.
                ended.time = at.time
                raise ended
            time = end
        return None

    def _read(self, member: _Member, at: Interval) -> None:
        """Read the outputs of a component that has made a step; those of a slow one are interpolated."""
        bus, done = self._bus, at.number % member.every
        if done == 0:
            before = [float(bus[slot]) for slot in member.ramps]
            member.slave.read(at.time)
            member.ends = [(old, float(bus[slot])) for old, slot in zip(before, member.ramps, strict=True)]
        count = min(member.every, self._steps - (at.number - done))
        for slot, (old, new) in zip(member.ramps, member.ends, strict=True):
            bus[slot] = new if done + 1 == count else old + (done + 1) / count * (new - old)

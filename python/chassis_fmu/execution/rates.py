"""Components with rates, and inputs that are lines in time: the calls of `session/rates.rs` with equal arguments."""

from __future__ import annotations

import ctypes
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from ..files.plan import Run, Simulation
from .bus import Array, of_type

if TYPE_CHECKING:
    from .master import Player, RunError, Slave

# Part of a step, at its end, in which a jump of a series does not belong to the step.
END_SLACK = 1e-9


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


class Member:
    """A component with its rate, the inputs that are lines, and the arguments for their slopes."""

    def __init__(self, slave: Slave, is_ahead: Sequence[bool]) -> None:
        self.slave = slave
        self.every, self.substeps = slave.component.every, slave.component.substeps
        # Outputs that the bus interpolates, and their values at both ends of the step of the component.
        self.ramps = [w.slot for w in slave.component.outputs if w.is_ramp]
        self.ends = [(0.0, 0.0)] * len(self.ramps)
        # Index among the Real inputs, wire, and whether the source steps before the reader.
        wires = [(i, w) for i, w in enumerate(of_type(slave.component.inputs, "Real")) if w.is_ramp]
        self.lines = [(i, w, is_ahead[w.slot]) for i, w in wires]
        self.values = [(i, 0.0) for i, _ in wires]
        self.references = (ctypes.c_uint * len(wires))(*(w.reference for _, w in wires))
        self.orders = (ctypes.c_int * len(wires))(*[1] * len(wires))
        self.slopes = (ctypes.c_double * len(wires))()


class Coupling:
    """The steps of a run whose components have rates, or inputs that are lines."""

    def __init__(
        self, run: Run, simulation: Simulation, slaves: Sequence[Slave], players: Sequence[Player], bus: Array
    ) -> None:
        self.simulation, self._players, self._bus = simulation, players, bus
        is_jacobi = simulation.order == "jacobi"
        is_ahead = [False] * run.slots
        self._members: list[Member] = []
        for slave in slaves:
            self._members.append(Member(slave, is_ahead))
            for wire in slave.component.outputs:
                is_ahead[wire.slot] = not is_jacobi
        self._parts = [self._members] if is_jacobi else [[member] for member in self._members]
        self._sources = {wire.slot for member in self._members for _, wire, _ in member.lines}
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

    def _set(self, member: Member, at: Interval, time: float) -> None:
        """Set the inputs of a component that is due, with the values that lines have at `time`."""
        if at.number % member.every:
            return
        for k, (i, wire, is_ahead) in enumerate(member.lines):
            first = self._start[wire.slot]
            rise = (float(self._bus[wire.slot]) - first) / at.size if is_ahead else self._slopes[wire.slot]
            value = first + rise * (time - at.time)
            if wire.conversion is not None:
                value, rise = wire.conversion.factor * value + wire.conversion.offset, wire.conversion.factor * rise
            member.values[k], member.slopes[k] = (i, value), rise
        member.slave.set(at.time, member)

    def _advance(self, member: Member, at: Interval) -> RunError | None:
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
            if i > 1 and member.lines:
                self._set(member, at, time)
            ended = member.slave.step(time, end - time)
            if ended is not None:
                # Other components have not reached the end of this step, or have passed it.
                ended.time = at.time
                raise ended
            time = end
        return None

    def _read(self, member: Member, at: Interval) -> None:
        """Read the outputs of a component that has made a step; those of a slow one are interpolated."""
        bus, done = self._bus, at.number % member.every
        if done == 0:
            before = [float(bus[slot]) for slot in member.ramps]
            member.slave.read(at.time)
            member.ends = [(old, float(bus[slot])) for old, slot in zip(before, member.ramps, strict=True)]
        count = min(member.every, self._steps - (at.number - done))
        for slot, (old, new) in zip(member.ramps, member.ends, strict=True):
            bus[slot] = new if done + 1 == count else old + (done + 1) / count * (new - old)

"""Clocks of FMI 3.0 in co-simulation (FMI 3.0.2, sections 2.2.8, 2.3.5 and 4.2).

Calls, their order and the times of ticks are those of the native master (`fmu_import::loader::clocks`,
`fmu_system::session::events`), which describes the rules, so the results are bit-identical.
"""

from __future__ import annotations

import contextlib
import ctypes
import itertools
import math
from collections.abc import Container, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree

if TYPE_CHECKING:
    from .master import RunError, Slave

# Two times are the same instant if they differ by at most this fraction of the step, or four units in the last place.
SLACK = 1e-6
ROUNDINGS = 4.0
# Maximum number of event iterations at one time, and of evaluations of a component in an iteration.
MOST_ITERATIONS = 100
# Qualifier of fmi3GetIntervalDecimal.
CHANGED = 2

UPDATE = "fmi3UpdateDiscreteStates"
GET_INTERVAL = "fmi3GetIntervalDecimal"


def slack(time: float, part: float) -> float:
    """Return the tolerance for a time (s) at which a step or interval of `part` (s) ends."""
    return SLACK * min(part, 1.0) + ROUNDINGS * (math.nextafter(abs(time), math.inf) - abs(time))


@dataclass
class InputClock:
    """An input clock and its ticks; times in s."""

    name: str
    reference: int
    kind: str
    given: float | None
    """Interval in the description; None if the FMU must be asked."""
    shift: float
    base: float = 0.0
    """Time from which the ticks of a periodic clock are counted."""
    count: int = 0
    next: float | None = None
    """Time of the next tick, if it is known."""

    def __post_init__(self) -> None:
        self.is_periodic = self.kind in ("constant", "fixed", "tunable")
        self.interval = self.given or 0.0
        # Whether the interval may change with a parameter.
        self.is_tunable = self.kind == "tunable" and self.given is None

    def is_due(self, time: float, step: float) -> bool:
        """Return whether the clock ticks at a time."""
        part = min(step, self.interval) if self.interval > 0.0 else step
        return self.next is not None and self.next <= time + slack(time, part)

    def set_interval(self, interval: float, time: float) -> None:
        """Set a new interval, which counts from `time` or, for a periodic clock, from the last tick."""
        if not self.is_periodic:
            self.next = time + interval
        elif self.count > 0:
            last = self.base + (self.count - 1) * self.interval
            self.base, self.count = max(last, time - interval), 1
            self.next = max(self.base + interval, time)
        self.interval = interval

    def advance(self) -> None:
        """Move on after a tick."""
        self.next = None
        if self.is_periodic:
            self.count += 1
            self.next = self.base + self.count * self.interval


@dataclass
class Description:
    """The clocks of an FMU, and the variables that belong to them."""

    inputs: list[InputClock] = field(default_factory=list)
    outputs: list[tuple[int, list[int]]] = field(default_factory=list)
    """Output clocks and the clocks on which they depend."""
    clocked: dict[int, tuple[list[int], bool]] = field(default_factory=dict)
    """By reference: the clocks of a variable, and whether it is an input."""
    has_clocks: bool = False

    @staticmethod
    def read(folder: Path, arrays: Container[int]) -> Description:
        """Read the description of an unpacked FMU; it lists those clocked arrays only that are among `arrays`."""
        root = ElementTree.parse(folder / "modelDescription.xml").getroot()
        types = {of.get("name"): of for of in root.iter("ClockType")}
        found = Description()
        for variable in root.iterfind("ModelVariables/*"):
            reference, causality = int(variable.get("valueReference", "0")), variable.get("causality", "local")
            clocks = [int(clock) for clock in variable.get("clocks", "").split()]
            if variable.tag != "Clock":
                if clocks and (variable.find("Dimension") is None or reference in arrays):
                    found.clocked[reference] = (clocks, causality == "input")
                continue
            found.has_clocks = True
            attributes = {**getattr(types.get(variable.get("declaredType")), "attrib", {}), **variable.attrib}
            if causality == "input":
                interval, shift = attributes.get("intervalDecimal"), float(attributes.get("shiftDecimal", "0"))
                interval = None if interval is None else float(interval)
                kind = attributes["intervalVariability"]
                found.inputs.append(InputClock(attributes["name"], reference, kind, interval, shift))
            elif causality == "output":
                found.outputs.append((reference, clocks))
        return found


class Clocks:
    """The clocks of a component; between ticks, clocked variables keep their values.

    A clock that is due at the start of a step ticks with the inputs of the step, one that is due at the end in the next
    step. The methods of an event raise RunError.
    """

    def __init__(self, slave: Slave, description: Description) -> None:
        self.is_in_event = False
        self.slave = slave
        self._functions = slave.instance.functions
        self.description = description
        # Values of clocked variables; for an output clock, whether it has ticked in the last step.
        self._held: dict[int, Sequence[Any]] = {}
        self.begin_step()
        self._active: list[int] = []
        self._fired: list[int] = []
        self._next_event: float | None = None

    def start(self, start: float) -> None:
        """In Initialization Mode: ask for intervals and shifts, and read the clocked variables."""
        for reference in self.description.clocked:
            self._held[reference] = self.slave.access("read", reference, start)
        for clock in self.description.inputs:
            if clock.is_periodic:
                if clock.given is None:
                    clock.interval = self._interval(clock, start)[0]
                    shift = (ctypes.c_double * 1)()
                    self._call("fmi3GetShiftDecimal", start, clock.reference, shift)
                    clock.shift = shift[0]
                if not (0.0 < clock.interval < math.inf and math.isfinite(clock.shift)):
                    self._reject_interval(start)
                clock.base = clock.next = start + clock.shift
            elif clock.kind != "triggered":
                self._ask(clock, start)
        # The end of the initialization enters Event Mode.
        self.is_in_event = True

    def begin_step(self) -> None:
        """Before a step and its events."""
        self._held |= {clock: [0] for clock, _ in self.description.outputs}
        self._functions.held = self._held

    def is_active(self, clock: int) -> bool:
        """Return whether a clock ticks in the present iteration of an event."""
        return clock in self._active or clock in self._fired

    def active_names(self) -> list[str]:
        """Return the names of the active input clocks."""
        return [clock.name for clock in self.description.inputs if self.is_active(clock.reference)]

    def next_tick(self, now: float, end: float, step: float) -> float:
        """Return the time of the next tick or time event after `now`, `end` if there is none before it."""
        times = [*(clock.next for clock in self.description.inputs), self._next_event]
        following = min((time for time in times if time is not None), default=end)
        return following if now < following < end - slack(end, step) else end

    def is_event_needed(self, time: float, step: float) -> bool:
        """Return whether a step must start with an event: one is due, or a parameter may have changed an interval."""
        is_event_due = self._next_event is not None and self._next_event <= time + slack(time, step)
        return is_event_due or any(clock.is_tunable or clock.is_due(time, step) for clock in self.description.inputs)

    def wants_event(self) -> bool:
        """Return whether the FMU has requested an event in the last step."""
        return bool(self._functions.event.value)

    def due(self, time: float, step: float | None) -> list[int]:
        """Return the time-based clocks that are due; none without a communication step (s)."""
        inputs = self.description.inputs if step is not None else []
        return [clock.reference for clock in inputs if clock.is_due(time, step or 0.0)]

    def begin(self, time: float) -> None:
        """Enter Event Mode, unless the component is in it."""
        if not self.is_in_event:
            self.is_in_event = True
            self._functions.event.value = False
            self.slave.call("fmi3EnterEventMode", time)

    def activate(self, clocks: Sequence[int], time: float) -> None:
        """Activate input clocks in an event, which begins if necessary."""
        if clocks:
            self.begin(time)
            self._active += clocks
            references, count = (ctypes.c_uint * len(clocks))(*clocks), ctypes.c_size_t(len(clocks))
            self.slave.call(
                "fmi3SetClock", time, references, count, (ctypes.c_bool * len(clocks))(*[True] * len(clocks))
            )

    def evaluate(self, time: float) -> None:
        """Set the inputs of the active clocks; read their outputs and those of the output clocks that tick."""
        with self._accessible():
            pending = self._functions.pending
            for reference, (clocks, is_input) in self.description.clocked.items():
                if is_input and reference in pending and not set(clocks).isdisjoint(self._active):
                    self.slave.access("write", reference, time, self._held[reference])
                    pending.discard(reference)
            active = list(self._active)
            for clock, on in self.description.outputs:
                if not on or not set(on).isdisjoint(active):
                    ticks = (ctypes.c_bool * 1)()
                    self._call("fmi3GetClock", time, clock, ticks)
                    active += [clock] * ticks[0]
            for reference, (clocks, is_input) in self.description.clocked.items():
                if not is_input and not set(clocks).isdisjoint(active):
                    self._held[reference] = self.slave.access("read", reference, time)
            self._fired = active[len(self._active) :]

    def update(self, time: float) -> bool:
        """Update the discrete states, which ends the ticks; returns whether the FMU needs another iteration."""
        with self._accessible():
            flags, following = [ctypes.c_bool() for _ in range(5)], ctypes.c_double()
            self.slave.call(UPDATE, time, *map(ctypes.byref, flags), ctypes.byref(following))
            is_needed_again, terminate, _, _, is_defined = (flag.value for flag in flags)
            if terminate:
                raise self.slave.ended(UPDATE, time)
            self._next_event = following.value if is_defined else None
            self._held |= {clock: [1] for clock in self._fired}
            active, self._active, self._fired = self._active, [], []
            for clock in self.description.inputs:
                has_ticked = clock.reference in active
                if has_ticked:
                    clock.advance()
                if clock.is_tunable or clock.kind == "countdown" or (clock.kind == "changing" and has_ticked):
                    self._ask(clock, time)
            return is_needed_again

    def end(self, time: float) -> None:
        """Enter Step Mode after an event."""
        self.slave.call("fmi3EnterStepMode", time)
        self.is_in_event = False

    @contextlib.contextmanager
    def _accessible(self) -> Iterator[None]:
        """Give access to the clocked variables of the FMU instead of the values of the last tick."""
        self._functions.held = {}
        try:
            yield
        finally:
            self._functions.held = self._held

    def _call(self, function: str, time: float, clock: int, *values: Any) -> None:
        self.slave.call(function, time, (ctypes.c_uint * 1)(clock), ctypes.c_size_t(1), *values)

    def _interval(self, clock: InputClock, time: float) -> tuple[float, int]:
        interval, qualifier = (ctypes.c_double * 1)(), (ctypes.c_int * 1)()
        self._call(GET_INTERVAL, time, clock.reference, interval, qualifier)
        return interval[0], qualifier[0]

    def _ask(self, clock: InputClock, time: float) -> None:
        """Ask for a new interval of a clock."""
        interval, qualifier = self._interval(clock, time)
        if qualifier == CHANGED:
            if not (math.isfinite(interval) and (interval > 0.0 or (interval == 0.0 and not clock.is_periodic))):
                self._reject_interval(time)
            clock.set_interval(interval, time)

    def _reject_interval(self, time: float) -> None:
        rule = "a finite number, or not above 0 for a periodic clock"
        self.slave.fail(GET_INTERVAL, time, f"the FMU returned an interval that is not {rule}")


class Group:
    """Components that end their steps together at each tick and handle the events together.

    Their clocks or clocked variables are connected, or it is a single component with clocks, which gets its inputs once
    per communication step.
    """

    def __init__(self, members: Sequence[Clocks], edges: Sequence[tuple[Clocks, Clocks]] = ()) -> None:
        """`members` are in order: each after those that it reads. `edges` are the connections between them."""
        self._members = members
        for one in members:
            one.slave.group = self
        self._is_connected = bool(edges)
        self._readers = {one: [reader for writer, reader in edges if writer is one] for one in members}
        of = {one.slave.component.name: one for one in members}
        wires = [(one, wire) for one in members for wire in one.slave.component.clocks]
        self._wires = [(of[wire.component], wire.source_reference, one, wire.reference) for one, wire in wires]

    def step_of(self, slave: Slave, time: float, step: float) -> RunError | None:
        """Make a step of all components in the place of the first one; the result is that of `Slave.step`."""
        if slave.index > min(one.slave.index for one in self._members):
            return None
        end, now, ended = time + step, time, None
        for one in self._members:
            one.begin_step()
        while now < end:
            self.event(now, step)
            until = min(one.next_tick(now, end, step) for one in self._members)
            for one in self._members:
                self._set(one, time)
                at_end = one.slave.advance(now, until - now, time, step)
                ended = ended or at_end
            for one in self._members:
                self._read(one, time)
            now = until
        if self._is_connected:
            self.event(now, None)
        elif ended is None and self._members[0].wants_event():
            # Clocks that are due at the end of the step tick in this event, otherwise in the next step.
            self.event(now, step)
        return ended

    def _set(self, one: Clocks, time: float) -> None:
        if self._is_connected:
            one.slave.set(time)

    def _read(self, one: Clocks, time: float) -> None:
        if self._is_connected:
            one.slave.read(time)

    def event(self, time: float, step: float | None) -> None:
        """Handle an event, if there is one; time-based clocks tick only with a communication step (s)."""
        for one in self._members:
            if one.wants_event() or (step is not None and one.is_event_needed(time, step)):
                one.begin(time)
        is_needed = any(one.is_in_event for one in self._members)
        for iteration in itertools.count():
            if not is_needed:
                return
            for one in self._members:
                one.activate(one.due(time, step), time)
            self._propagate(time)
            active = [one for one in self._members if one.is_in_event]
            if iteration == MOST_ITERATIONS:
                names = ", ".join(f"`{o.slave.component.name}:{c}`" for o in active for c in o.active_names()) or "none"
                text = f"more than {MOST_ITERATIONS} event iterations at one time, in each of which these clocks tick: "
                active[0].slave.fail(UPDATE, time, f"{text}{names}; start one of them with an interval above 0")
            is_needed = False
            for one in active:
                is_needed |= one.update(time)
                self._read(one, time)
            is_needed |= any(one.due(time, step) for one in active)
            if not is_needed:
                for one in active:
                    one.end(time)

    def _propagate(self, time: float) -> None:
        """Transfer signals and activate connected clocks until nothing changes."""
        waiting = {one for one in self._members if one.is_in_event}
        for evaluations in itertools.count():
            waiting = waiting or self._activated(time)
            if not waiting:
                return
            one = min(waiting, key=self._members.index)
            waiting.discard(one)
            if evaluations == MOST_ITERATIONS * len(self._members):
                names = "`, `".join(reader.slave.component.name for reader in self._readers[one])
                text = (
                    f"the outputs at a tick still change after {MOST_ITERATIONS} evaluations: they depend on those of "
                    f"`{names}`, and these on them; one of them must depend on values from before the tick only"
                )
                one.slave.fail(UPDATE, time, text)
            before = one.slave.outputs()
            self._set(one, time)
            one.evaluate(time)
            self._read(one, time)
            if one.slave.outputs() != before:
                waiting.update(reader for reader in self._readers[one] if reader.is_in_event)

    def _activated(self, time: float) -> set[Clocks]:
        """Activate the clocks that are connected to clocks that tick; returns their components."""
        found = set()
        for source, clock, target, triggered in self._wires:
            if source.is_active(clock) and not target.is_active(triggered):
                target.activate([triggered], time)
                found.add(target)
        return found


def groups(slaves: Sequence[Slave]) -> list[Group]:
    """Return the groups of the components with clocks."""
    of = {slave.component.name: slave.clocks for slave in slaves}
    writers = {wire.slot: (slave, wire.reference) for slave in slaves for wire in slave.component.outputs}
    edges: list[tuple[Clocks, Clocks]] = []
    coupled: set[Clocks] = set()
    for slave in slaves:
        if slave.clocks is None:
            continue
        sources = [(of[wire.component], True) for wire in slave.component.clocks]
        for wire in slave.component.inputs:
            writer, reference = writers.get(wire.slot, (slave, 0))
            if writer is not slave:
                sources.append((writer.clocks, writer.is_clocked(reference) or slave.is_clocked(wire.reference)))
        for source, is_coupled in sources:
            if source is not None:
                edges.append((source, slave.clocks))
                coupled |= {source, slave.clocks} if is_coupled else set()
    ordered: list[Clocks] = []

    def visit(one: Clocks, seen: set[Clocks]) -> None:
        if one in coupled and one not in seen:
            seen.add(one)
            for source, target in edges:
                if target is one:
                    visit(source, seen)
            ordered.append(one)

    with_clocks = [slave.clocks for slave in slaves if slave.clocks is not None]
    seen: set[Clocks] = set()
    for one in with_clocks:
        visit(one, seen)
    single = [Group([one]) for one in with_clocks if one not in coupled]
    return single + ([Group(ordered, [edge for edge in edges if coupled.issuperset(edge)])] if ordered else [])

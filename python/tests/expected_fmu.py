"""A small model of the standard: values, modes, sizes and clocks of a random FMU in co-simulation.

References: FMI 3.0.2, sections 2.2.6 (values), 2.2.8 (clocks), 2.3 (modes) and 4.2 (co-simulation); FMI 2.0.4, section
4.2.4; for the values of elements that an array gets when it grows, and for steps beyond a tick, the guide.
"""

from __future__ import annotations

import copy
import math
from dataclasses import dataclass, field
from fractions import Fraction

from tests.declarations import Clock, Model, Value, Variable

SAMPLE_TIME = Fraction(1, 8)


@dataclass
class Schedule:
    """The ticks of a clock. Times in s."""

    interval: Fraction | None
    next: Fraction | None
    last: Fraction
    since: Fraction
    """Time from which the interval of an aperiodic clock counts."""
    has_ticked: bool = False
    is_new: bool | None = None
    """Whether the importer has not asked for the interval; None if both answers are right."""

    def start(self, time: Fraction, after: Fraction) -> None:
        self.next, self.since, self.interval, self.is_new = time + after, time, after, True


@dataclass
class State:
    """All that a saved state contains."""

    values: dict[str, list[Value]]
    """By the field of the variable; arrays whose size can change have all possible elements."""
    past: dict[str, list[Value]]
    mode: str = "Instantiated"
    start: Fraction = Fraction(0)
    time: Fraction = Fraction(0)
    sample: int = 0
    schedules: dict[str, Schedule] = field(default_factory=dict)
    active: set[str] = field(default_factory=set)
    has_fired: bool = False
    is_updated: bool = False
    """Whether discrete states were updated since the instance has entered Event Mode."""
    total: int = 0
    pulses: int = 0


class ExpectedFmu:
    """What an importer may call in each mode, and the values that it reads."""

    def __init__(self, model: Model, version: int, uses_events: bool) -> None:
        self.model = model
        self.version = version
        self.uses_events = uses_events
        self.variables = [v for v in model.variables if v.fmi in (None, version)]
        self.state = self.initial()

    def initial(self) -> State:
        values = {v.field: list(v.start) or [None] * v.count for v in self.model.variables}
        defaults = {"Boolean": False, "String": "", "Binary": b"", "Enumeration": self.model.levels[0]}
        past = [v for v in self.model.of("output") if v.kind == "past"]
        return State(values, {v.source: [defaults.get(v.type, 0)] * v.count for v in past})

    @property
    def mode(self) -> str:
        return self.state.mode

    # Values.

    def present(self, variable: Variable) -> list[int]:
        """Return the positions of the present elements among all possible ones, row by row."""
        if not variable.sizes:
            return list(range(variable.count))
        named = {v.name: v for v in self.model.variables}
        positions = [0]
        for name, most in zip(variable.sizes, variable.shape, strict=True):
            (length,) = self.state.values[named[name].field]
            positions = [position * most + i for position in positions for i in range(length)]
        return positions

    def all_elements(self, variable: Variable) -> list[Value]:
        if variable.constant:
            return variable.start
        is_computed = variable.role == "output" and self.model.kind == "continuous"
        if is_computed or variable.role in ("derived", "derivative"):
            return self.all_elements(self.model.by_field(variable.source))
        state = self.evaluated() if variable.role == "output" else self.state
        return state.values[variable.field]

    def get(self, variable: Variable) -> list[Value]:
        values = self.all_elements(variable)
        return [values[position] for position in self.present(variable)]

    def assign(self, variable: Variable, values: list[Value]) -> None:
        for position, value in zip(self.present(variable), values, strict=True):
            self.state.values[variable.field][position] = value
        if variable.structural:
            for array in (array for array in self.model.variables if array.sizes and array.start):
                present = self.present(array)
                for position in set(range(array.count)) - set(present):
                    self.state.values[array.field][position] = array.start[position]

    def is_accessible(self, variable: Variable) -> bool:
        """Return whether clocks permit the access."""
        is_free = not (variable.clocks and self.uses_events) or self.mode in ("Instantiated", "Initialization")
        return is_free or (self.mode == "Event" and bool(self.state.active & set(variable.clocks)))

    def is_readable(self, variable: Variable) -> bool:
        modes = {"Initialization", "Step", "Terminated"} | ({"Instantiated", "Event"} if self.version == 3 else set())
        return self.mode in modes and self.is_accessible(variable)

    def is_settable(self, variable: Variable) -> bool:
        if not self.is_accessible(variable) or variable.constant:
            return False
        before_start = self.mode in ("Instantiated", "Initialization")
        match variable.role:
            case "parameter" if variable.structural and self.version == 3:
                return self.mode == "Configuration" or (self.mode == "Reconfiguration" and variable.tunable)
            case "input":
                return before_start or self.mode in ("Step", "Event")
            case "parameter":
                return before_start or (variable.tunable and self.mode in ("Step", "Event"))
            case "output":
                return before_start and self.model.kind != "continuous"
            case "state":
                return before_start
        return False

    # Modes.

    def initialize(self, start: Fraction) -> None:
        self.state.mode, self.state.start, self.state.time = "Initialization", start, start

    def exit_initialization(self) -> None:
        self.state.mode = "Event" if self.uses_events else "Step"
        for clock in self.model.clocks:
            self.state.schedules[clock.name] = self.first(clock)

    def first(self, clock: Clock) -> Schedule:
        start, interval = self.state.start, self.interval(clock)
        match clock.kind:
            case "constant" | "parameter":
                after: Fraction | None = clock.shift
            case _:
                after = interval
        return Schedule(interval, None if after is None else start + after, start, start)

    def interval(self, clock: Clock) -> Fraction | None:
        return Fraction(self.state.values[clock.parameter][0]) if clock.parameter else clock.interval

    def enter_event_mode(self) -> None:
        self.state.mode, self.state.is_updated = "Event", False

    def reset(self) -> None:
        self.state = self.initial()

    # Steps.

    def step(self, step: Fraction) -> None:
        state, end = self.state, self.state.time + step
        state.has_fired = False
        for variable in self.model.of("state"):
            rates = state.values[variable.source]
            values = state.values[variable.field]
            for position in self.present(variable):
                values[position] += rates[position] * float(step)
        while self.model.kind == "discrete" and state.start + state.sample * SAMPLE_TIME < end:
            self.take_sample()
        if self.model.kind == "clocked":
            self.take_over_intervals(state)
            while not self.uses_events and (due := self.due_before(end)):
                self.tick(state, due[1], due[0])
        state.time = end

    def take_sample(self) -> None:
        state = self.state
        state.sample += 1
        for output in (output for output in self.model.of("output") if not output.constant):
            source = state.values[output.source]
            values = state.past[output.source] if output.kind == "past" else source
            for position in self.present(output):
                state.values[output.field][position] = values[position]
        for name in state.past:
            state.past[name] = list(state.values[name])

    def due_before(self, end: Fraction) -> tuple[Fraction, set[str]] | None:
        """Return the time of the next ticks, if they are before the end of a step, and their clocks."""
        known = [s.next for s in self.state.schedules.values() if s.next is not None and s.next < end]
        if not known:
            return None
        return min(known), {name for name, s in self.state.schedules.items() if s.next == min(known)}

    # Clocks.

    def next_tick(self) -> Fraction | None:
        """Return the time of the next tick, with the present values of the parameters."""
        state = copy.deepcopy(self.state)
        self.take_over_intervals(state)
        return min((s.next for s in state.schedules.values() if s.next is not None), default=None)

    def due(self) -> set[str]:
        return {name for name, schedule in self.state.schedules.items() if schedule.next == self.state.time}

    def take_over_intervals(self, state: State) -> None:
        for clock in (clock for clock in self.model.clocks if clock.parameter):
            schedule, interval = state.schedules[clock.name], Fraction(state.values[clock.parameter][0])
            if interval != schedule.interval:
                schedule.interval, schedule.is_new = interval, True
                if schedule.has_ticked:
                    schedule.next = max(schedule.last + interval, state.time)

    def tick(self, state: State, active: set[str], time: Fraction) -> None:
        """Run the parts of the clocks that are active, in the order of the methods."""
        for clock in (clock for clock in self.model.clocks if clock.name in active):
            schedule = state.schedules[clock.name]
            schedule.last, schedule.has_ticked = time, True
            if clock.kind in ("constant", "parameter"):
                assert schedule.next is not None
                assert schedule.interval is not None
                schedule.next += schedule.interval
            else:
                schedule.next = None
        for clock in (clock for clock in self.model.clocks if clock.name in active):
            state.total += 1
            state.has_fired |= state.total % self.model.fires_every == 0
            for output in self.model.of("output"):
                if output.kind == f"count of {clock.name}":
                    state.values[output.field][0] += 1
                elif output.kind == f"time of {clock.name}":
                    state.values[output.field][0] = float(time)
                elif output.kind == f"copy at {clock.name}":
                    for position in self.present(output):
                        state.values[output.field][position] = state.values[output.source][position]
            if clock.starts:
                state.schedules[clock.starts].start(time, Fraction(state.values["delay"][0]))
            if clock.kind == "changing":
                state.pulses += 1
                state.schedules[clock.name].start(time, Fraction(1 + state.pulses % 3, 8))

    def evaluated(self) -> State:
        """Return the state after the ticks of the active clocks, from the state before the event."""
        if not self.state.active:
            return self.state
        state = copy.deepcopy(self.state)
        state.has_fired = False
        self.tick(state, state.active, state.time)
        return state

    def update_discrete_states(self) -> None:
        self.state = self.evaluated()
        self.take_over_intervals(self.state)
        self.state.active, self.state.has_fired, self.state.is_updated = set(), False, True

    def read_interval(self, clock: Clock) -> tuple[float, set[int]]:
        """Return the interval, and the qualifiers that are right: 0 not yet known, 1 unchanged, 2 changed."""
        if self.mode == "Initialization":
            interval = self.interval(clock)
            return (0.0, {0}) if interval is None else (float(interval), {1, 2})
        schedule = self.state.schedules[clock.name]
        if schedule.next is None or schedule.interval is None:
            return 0.0, {0}
        is_late = clock.kind in ("changing", "countdown") and schedule.is_new is not False
        is_late = is_late and schedule.since != self.state.time
        interval = max(schedule.next - self.state.time, Fraction(0)) if is_late else schedule.interval
        qualifiers = {None: {1, 2}, True: {2}, False: {1}}[schedule.is_new]
        schedule.is_new = False
        return float(interval), qualifiers


def equal(found: list[Value], expected: list[Value], is_exact: bool) -> bool:
    """Compare values; sums and times may have rounding errors."""
    if is_exact or len(found) != len(expected):
        return found == expected
    return all(math.isclose(a, b, rel_tol=1e-12, abs_tol=1e-12) for a, b in zip(found, expected, strict=True))

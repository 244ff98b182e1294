"""Consistent values of connected inputs and outputs in Initialization Mode, as in the native master."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, TypeVar

from .. import _native
from .bus import Array, ExactValues
from .fmi3 import DISCARD

if TYPE_CHECKING:
    from ..files.plan import AlgebraicLoop
    from .master import Slave

T = TypeVar("T")

# Maximum number of rounds until the signals that are not Real no longer change.
ROUNDS = 10


def evaluate(slaves: Sequence[Slave], time: float, held: Array | None = None) -> None:
    """Set the inputs of components, Integers and Booleans from the bus `held` if given, then read their outputs."""
    for slave in slaves:
        slave.set(time, held=held)
    for slave in slaves:
        slave.read(time)


def change(slaves: Sequence[Slave], before: Array, after: Array) -> tuple[str, str] | None:
    """Return the component and a warning of the first connected output that the end of initialization changes."""
    inputs = {wire.slot for slave in slaves for wire in slave.component.inputs}
    for slave in slaves:
        for wire in () if slave.clocks else slave.component.outputs:
            old, new = float(before[wire.slot]), float(after[wire.slot])
            limit = 1e-6 * max(abs(new), wire.nominal or 1.0) if wire.type == "Real" else 0.0
            if abs(new - old) > limit and wire.slot in inputs:
                text = f"output `{wire.name}` changes from {old} to {new} at the end of initialization"
                return slave.component.name, f"{text}; the inputs that read it were initialized with the first value"
    return None


def _unless_discarded(call: Callable[..., T]) -> Callable[..., T | None]:
    """Return a function that returns None where a component discards a call."""
    # `master` imports this module.
    from .master import RunError

    def called(*arguments: list[float]) -> T | None:
        try:
            return call(*arguments)
        except RunError as error:
            if error.status == DISCARD:
                return None
            raise

    return called


class _Values:
    """The values of some slots."""

    def __init__(self, slots: Sequence[int], bus: Array, exact: ExactValues) -> None:
        self.slots = list(slots)
        self.numbers = bus[self.slots].copy()
        self.integers = {slot: value for slot, value in exact.integers.items() if slot in self.slots}
        self.binaries = {slot: value for slot, value in exact.binaries.items() if slot in self.slots}

    def write(self, bus: Array, exact: ExactValues) -> None:
        bus[self.slots] = self.numbers
        exact.integers.update(self.integers)
        exact.binaries.update(self.binaries)

    def is_same(self, other: _Values) -> bool:
        same = self.numbers.tobytes() == other.numbers.tobytes()
        return same and (self.integers, self.binaries) == (other.integers, other.binaries)


def solve(equations: AlgebraicLoop, slaves: Sequence[Slave], bus: Array, exact: ExactValues, time: float) -> None:
    """Solve an algebraic loop; raises _native.NoSolutionError."""
    slots = [unknown.slot for unknown in equations.unknowns]
    z = [unknown.start for unknown in equations.unknowns]
    for _ in range(ROUNDS):
        held, before = _Values(equations.held, bus, exact), bus.copy()

        def values(z: list[float], held: _Values = held, before: Array = before) -> list[float]:
            held.write(bus, exact)
            bus[slots] = z
            evaluate(slaves, time, before)
            found: list[float] = bus[slots].tolist()
            return found

        def derivatives() -> list[list[float]]:
            columns = [[0.0] * len(slots) for _ in slots]
            for slave in slaves:
                for column, slot in zip(columns, slots, strict=True):
                    for found, value in slave.derivatives(slot, slots, time):
                        column[slots.index(found)] = value
            return columns

        nominal = [unknown.nominal for unknown in equations.unknowns]
        slopes = _unless_discarded(derivatives) if equations.has_derivatives else None
        z = _native.solve(z, nominal, _unless_discarded(values), slopes)
        values(z)
        if held.is_same(_Values(equations.held, bus, exact)):
            return
    detail = f"signals that are not Real change in each of {ROUNDS} rounds"
    raise _native.NoSolutionError("does not settle", detail)

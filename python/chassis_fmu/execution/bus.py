"""The bus of a run (an array of doubles), and the transfer of a component's variables from and to the bus."""

from __future__ import annotations

import base64
import ctypes
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..files.plan import BaseType, BinaryText, Wire

Array = NDArray[np.floating[Any]]


def _pointer(array: NDArray[Any], kind: Any) -> Any:
    return array.ctypes.data_as(ctypes.POINTER(kind))


class _Group:
    """The wired variables of one base type and direction, with the arrays that are passed to FMI calls."""

    def __init__(self, wires: Sequence[Wire], bus: Array) -> None:
        self.count = len(wires)
        self.bus = bus
        self.slots = np.array([w.slot for w in wires], dtype=np.intp)
        self._references = np.array([w.reference for w in wires], dtype=np.uint32)
        self.references = _pointer(self._references, ctypes.c_uint)


class RealInputs(_Group):
    """Real inputs, which are set from a buffer."""

    def __init__(self, wires: Sequence[Wire], bus: Array) -> None:
        super().__init__(wires, bus)
        self.buffer = np.zeros(self.count)
        self.values = _pointer(self.buffer, ctypes.c_double)
        self.conversions = [(i, w.conversion) for i, w in enumerate(wires) if w.conversion is not None]

    def load(self) -> None:
        """Copy the values from the bus to the buffer, converted to the units of the inputs."""
        # Mode "clip" writes directly into the buffer; the slots are always valid.
        self.bus.take(self.slots, out=self.buffer, mode="clip")
        for i, conversion in self.conversions:
            self.buffer[i] = conversion.factor * self.buffer[i] + conversion.offset


class RealOutputs(_Group):
    """Real outputs. If their slots are consecutive, FMI calls write directly to the bus, otherwise to a buffer."""

    def __init__(self, wires: Sequence[Wire], bus: Array) -> None:
        super().__init__(wires, bus)
        self.direct = self.count > 0 and bool(np.all(np.diff(self.slots) == 1))
        first = int(self.slots[0]) if self.count else 0
        self.buffer = bus[first : first + self.count] if self.direct else np.zeros(self.count)
        self.values = _pointer(self.buffer, ctypes.c_double)

    def store(self) -> None:
        """Put the values onto the bus."""
        if not self.direct:
            self.bus[self.slots] = self.buffer


class WholeGroup(_Group):
    """Integers or Booleans, which are doubles on the bus.

    A Boolean output is 0 or 1 there, and a Boolean input is true above 0.5, so Real and Boolean can be connected.
    UInt32 variables form a separate group (`wide`).
    """

    def __init__(self, wires: Sequence[Wire], bus: Array, kind: BaseType, wide: bool = False) -> None:
        super().__init__(wires, bus)
        self.kind = kind
        self.buffer = np.zeros(self.count, dtype=np.int64 if wide else np.int32)
        self.values = _pointer(self.buffer, ctypes.c_int64 if wide else ctypes.c_int)

    def load(self, held: Array | None = None) -> bool:
        """Copy the values from the bus, or from `held`; returns whether all of them fit the type of the variables."""
        values = (self.bus if held is None else held)[self.slots]
        if self.kind == "Boolean":
            self.buffer[:] = values > 0.5
            return True
        with np.errstate(invalid="ignore"):
            self.buffer[:] = values
        return bool((self.buffer == values).all())

    def store(self) -> None:
        """Put the values onto the bus."""
        self.bus[self.slots] = self.buffer != 0 if self.kind == "Boolean" else self.buffer


class ExactValues:
    """The values that a double cannot represent, by slot of the bus: those of Int64, UInt64 and Binary outputs."""

    def __init__(self) -> None:
        self.integers: dict[int, int] = {}
        self.binaries: dict[int, bytes] = {}

    def text(self, slot: int, encoding: BinaryText | None) -> str | None:
        """Return the text of a value in a file of results; None if the slot has a double."""
        if slot in self.integers:
            return str(self.integers[slot])
        value = self.binaries.get(slot)
        if value is None:
            return None
        return value.hex() if encoding == "hex" else base64.b64encode(value).decode()


def of_type(wires: Iterable[Wire], kind: BaseType) -> list[Wire]:
    """Return the wires of a type."""
    return [w for w in wires if w.type == kind]

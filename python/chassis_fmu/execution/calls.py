"""The call board: which function of which component a process is in, in a file that its parent reads.

It outlives the process, so its parent can tell what it was doing when it crashed, exited or hung. The layout is that of
`fmu_import::loader::calls`.
"""

from __future__ import annotations

import ctypes
import math
from collections.abc import Sequence

# Number in place of a function while a library is loaded.
LOADING = 0xFF
# Bits of a call that number the function; the component is above them.
FUNCTION_BITS = 8
# Numbers of the functions of a version of FMI.
FUNCTIONS = 127

_numbers: dict[str, int] = {}


class Board(ctypes.Structure):
    """The call that a process is in, start of its step (s), steps done, a number that changes with progress."""

    _fields_ = (
        ("call", ctypes.c_uint64),
        ("time", ctypes.c_double),
        ("steps", ctypes.c_uint64),
        ("pulse", ctypes.c_uint64),
        ("component", ctypes.c_uint64),
    )

    call: int
    time: float
    steps: int
    pulse: int

    def begin(self) -> None:
        """Begin or end a run."""
        self.call = 0
        self.step(math.nan, 0)

    def step(self, time: float, done: int) -> None:
        """Begin a step, after some others."""
        self.time = time
        self.steps = done
        self.pulse += 1

    def load(self, component: int) -> None:
        """Load the library of a component."""
        self.call = component << FUNCTION_BITS | LOADING
        self.pulse += 1


def define(names: Sequence[Sequence[str]]) -> None:
    """Define the numbers of the functions: `names` has those in FMI 2.0 and in FMI 3.0, in their order."""
    for version, of in enumerate(zip(*names, strict=True)):
        _numbers.update({name: FUNCTIONS * version + number for number, name in enumerate(of, 1)})


def code(component: int, function: str) -> int:
    """Return the number of a call on the board; 0 without a parent that has defined the numbers."""
    return component << FUNCTION_BITS | _numbers[function] if _numbers else 0

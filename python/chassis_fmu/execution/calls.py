"""The call board: a file with the FMU function and component that this process is executing.

The parent reads the file to report what the process was doing when it crashed, exited or hung. The layout is defined in
`fmu_import::loader::calls`.
"""

from __future__ import annotations

import ctypes
import math
from collections.abc import Sequence

# Function number while a library is being loaded.
LOADING = 0xFF
# Number of low bits in the code of a call that contain the function number; the bits above contain the component.
FUNCTION_BITS = 8
# Function numbers reserved for each version of FMI.
FUNCTIONS = 127

_numbers: dict[str, int] = {}


class Board(ctypes.Structure):
    """The current call, the start time of the step (s), the number of completed steps, and a progress counter."""

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
        """Clear the board at the beginning or end of a run."""
        self.call = 0
        self.step(math.nan, 0)

    def step(self, time: float, done: int) -> None:
        """Record the start of a step at `time`, after `done` steps."""
        self.time = time
        self.steps = done
        self.pulse += 1

    def load(self, component: int) -> None:
        """Record that the library of a component is being loaded."""
        self.call = component << FUNCTION_BITS | LOADING
        self.pulse += 1


def define(names: Sequence[Sequence[str]]) -> None:
    """Define the function numbers: each element of `names` has the name of a function in FMI 2.0 and in FMI 3.0."""
    for version, of in enumerate(zip(*names, strict=True)):
        _numbers.update({name: FUNCTIONS * version + number for number, name in enumerate(of, 1)})


def code(component: int, function: str) -> int:
    """Return the code of a call for the board; 0 if no function numbers are defined (no parent process)."""
    return component << FUNCTION_BITS | _numbers[function] if _numbers else 0

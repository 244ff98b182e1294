"""The call board: which function of which component a process is in, in memory that another process can read.

It outlives the process, so whoever started it can tell what it was doing when it crashed, exited or hung.
"""

from __future__ import annotations

import ctypes
import math

from .fmi3 import NAMES

LOADING = "loading or fmi2Instantiate"
LOADING_3 = "loading or fmi3InstantiateCoSimulation"
FUNCTIONS = (
    LOADING,
    LOADING_3,
    *NAMES,
    "fmi2GetRealStatus",
    "fmi2GetBooleanStatus",
    *sorted(set(NAMES.values())),
)

# No call.
NONE = -1


class Board(ctypes.Structure):
    """The call that a process is in, the start of its step (s), and a number that changes with progress."""

    _fields_ = (("call", ctypes.c_int64), ("time", ctypes.c_double), ("pulse", ctypes.c_int64))

    call: int
    time: float
    pulse: int

    def begin(self) -> None:
        """Begin a run."""
        self.call = NONE
        self.time = math.nan
        self.pulse += 1

    def step(self, time: float) -> None:
        """Begin a step."""
        self.time = time
        self.pulse += 1

    def where(self) -> tuple[int, str, float | None] | None:
        """Return the index of the component, the function and the start of the step; None outside of all components."""
        if self.call < 0:
            return None
        component, function = divmod(self.call, len(FUNCTIONS))
        return component, FUNCTIONS[function], None if math.isnan(self.time) else self.time


def code(component: int, function: str) -> int:
    """Return the number of a call on the board."""
    return component * len(FUNCTIONS) + FUNCTIONS.index(function)

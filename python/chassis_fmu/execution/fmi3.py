"""Adapter that gives the functions of an FMI 3.0 FMU the names and arguments of FMI 2.0.

It makes the same FMI 3.0 calls as the native master, so the results are bit-identical: one call transfers several
scalars, but if one of them has a type that FMI 2.0 lacks, each scalar is transferred by a separate call.
"""

from __future__ import annotations

import ctypes
import math
from collections.abc import Callable, Mapping
from typing import Any

# FMI 3.0 functions that replace those of FMI 2.0.
NAMES = {
    "fmi2Instantiate": "fmi3InstantiateCoSimulation",
    "fmi2SetupExperiment": "fmi3EnterInitializationMode",
    "fmi2EnterInitializationMode": "fmi3EnterInitializationMode",
    "fmi2ExitInitializationMode": "fmi3ExitInitializationMode",
    "fmi2Terminate": "fmi3Terminate",
    "fmi2FreeInstance": "fmi3FreeInstance",
    "fmi2DoStep": "fmi3DoStep",
    "fmi2GetReal": "fmi3GetFloat64",
    "fmi2GetInteger": "fmi3GetInt32",
    "fmi2GetBoolean": "fmi3GetBoolean",
    "fmi2SetReal": "fmi3SetFloat64",
    "fmi2SetInteger": "fmi3SetInt32",
    "fmi2SetBoolean": "fmi3SetBoolean",
    "fmi2SetString": "fmi3SetString",
}

OK = 0
DISCARD = 2
ERROR = 3

# Types that FMI 2.0 also has.
PLAIN = ("Float64", "Int32", "Boolean", "String")

# Suffix of the get and set functions, and C type, by FMI 3.0 type.
_INTEGERS = [f"{sign}Int{bits}" for bits in (8, 16, 32, 64) for sign in ("", "U")]
SPECIAL: Mapping[str, tuple[str, Any]] = {
    "Float32": ("Float32", ctypes.c_float),
    "Float64": ("Float64", ctypes.c_double),
    **{name: (name, getattr(ctypes, f"c_{name.lower()}")) for name in _INTEGERS},
    "Enumeration": ("Int64", ctypes.c_int64),
}

# Integers whose values can exceed the range of a 32-bit signed integer.
WIDE = ("UInt32", "Int64", "UInt64")
# Types with values that a double does not represent.
EXACT = ("Int64", "UInt64")
# Signals are doubles, which represent all whole numbers up to this one.
LARGEST_WHOLE = 2**53

# Largest number of Booleans in a call, as in the native master.
CHUNK = 64

_REFERENCES = ctypes.POINTER(ctypes.c_uint)


def _function(library: Any, name: str, *arguments: Any) -> Callable[..., int]:
    """Return a library function with its argument types, which apply to the returned object only."""
    function = library[name]
    function.argtypes = [ctypes.c_void_p, *arguments]
    function.restype = ctypes.c_int
    call: Callable[..., int] = function
    return call


def _getter(library: Any, name: str, kind: Any) -> Callable[..., int]:
    """Return one of the library's get or set functions."""
    return _function(library, name, _REFERENCES, ctypes.c_size_t, ctypes.POINTER(kind), ctypes.c_size_t)


class Functions:
    """The functions of a shared library of FMI 3.0; `types` has the type of each value reference."""

    def __init__(self, library: Any, types: Mapping[int, str]) -> None:
        self._library = library
        self._types = types
        self.exact = {reference for reference, name in types.items() if name in EXACT}
        self._special = {reference for reference, name in types.items() if name not in PLAIN}
        self.wide = {reference for reference, name in types.items() if name in WIDE}
        self._experiment: tuple[float, bool, float] = (0.0, False, 0.0)
        # Real: Float64 and Float32. Integer: enumerations and integers of all widths, up to 2^53 in magnitude.
        self.fmi2GetReal = self._transfer("Get", "Float64", ctypes.c_double)
        self.fmi2SetReal = self._transfer("Set", "Float64", ctypes.c_double)
        self.fmi2GetInteger = self._transfer("Get", "Int32", ctypes.c_int)
        self.fmi2SetInteger = self._transfer("Set", "Int32", ctypes.c_int)
        self._get_boolean = _getter(library, "fmi3GetBoolean", ctypes.c_uint8)
        self._set_boolean = _getter(library, "fmi3SetBoolean", ctypes.c_uint8)
        self._set_string = _getter(library, "fmi3SetString", ctypes.c_char_p)
        flag, real, pointer = ctypes.c_bool, ctypes.c_double, ctypes.POINTER
        self._enter = _function(library, "fmi3EnterInitializationMode", flag, real, real, flag, real)
        flags = (pointer(flag),) * 3
        self._do_step = _function(library, "fmi3DoStep", real, real, flag, *flags, pointer(real))
        self._outcome = (ctypes.c_bool(), ctypes.c_bool(), ctypes.c_bool(), ctypes.c_double())
        self._outcome_pointers = tuple(ctypes.byref(value) for value in self._outcome)
        self.fmi2ExitInitializationMode = _function(library, "fmi3ExitInitializationMode")
        self.fmi2Terminate = _function(library, "fmi3Terminate")

    def fmi2SetupExperiment(
        self, _component: Any, _has_tolerance: int, _tolerance: float, start: float, has_stop: int, stop: float
    ) -> int:
        """Keep the times for the initialization."""
        self._experiment = (start, bool(has_stop), stop)
        return OK

    def fmi2EnterInitializationMode(self, component: Any) -> int:
        """Enter the initialization mode with the times of the experiment."""
        start, has_stop, stop = self._experiment
        return int(self._enter(component, False, 0.0, start, has_stop, stop))

    def fmi2DoStep(self, component: Any, time: float, step: float, final: int) -> int:
        """Advance; if the FMU ends the simulation or returns early, the status is "discard", as in FMI 2.0."""
        _, terminate, early, _ = self._outcome
        terminate.value = early.value = False
        status = int(self._do_step(component, time, step, bool(final), *self._outcome_pointers))
        return DISCARD if status < DISCARD and (terminate.value or early.value) else status

    def fmi2GetRealStatus(self, _component: Any, _kind: int, value: Any) -> int:
        """Return the last successful time of the latest step."""
        value._obj.value = self._outcome[3].value
        return OK

    def fmi2GetBooleanStatus(self, _component: Any, _kind: int, value: Any) -> int:
        """Return whether the latest step has ended the simulation."""
        value._obj.value = int(self._outcome[1].value)
        return OK

    def _transfer(self, verb: str, plain: str, kind: Any) -> Callable[..., int]:
        """Return a function that gets or sets all variables that FMI 2.0 would treat as one type."""
        at_once = _getter(self._library, f"fmi3{verb}{plain}", kind)
        one_by_one = self._get if verb == "Get" else self._set

        def transfer(component: Any, references: Any, count: int, values: Any) -> int:
            if self._special and any(references[i] in self._special for i in range(count)):
                return one_by_one(component, references, count, values, plain)
            return at_once(component, references, count, values, count)

        return transfer

    def _get(self, component: Any, references: Any, count: int, values: Any, plain: str) -> int:
        least, most = -(2**31), 2**31 - 1
        if values._type_ is ctypes.c_int64:
            least, most = -LARGEST_WHOLE, LARGEST_WHOLE
        for i in range(count):
            name, kind = SPECIAL[self._types.get(references[i], plain)]
            value = (kind * 1)()
            reference = (ctypes.c_uint * 1)(references[i])
            status = _getter(self._library, f"fmi3Get{name}", kind)(component, reference, 1, value, 1)
            if not OK <= status < DISCARD:
                return status
            if plain == "Int32" and not least <= value[0] <= most:
                return ERROR
            values[i] = value[0]
        return OK

    def _set(self, component: Any, references: Any, count: int, values: Any, plain: str) -> int:
        for i in range(count):
            name, kind = SPECIAL[self._types.get(references[i], plain)]
            value = (kind * 1)(values[i])
            # ctypes lets integers overflow silently, and converts numbers beyond Float32 to infinity.
            if plain == "Int32" and value[0] != values[i]:
                return ERROR
            if plain == "Float64" and math.isfinite(value[0]) != math.isfinite(values[i]):
                return ERROR
            reference = (ctypes.c_uint * 1)(references[i])
            status = _getter(self._library, f"fmi3Set{name}", kind)(component, reference, 1, value, 1)
            if not OK <= status < DISCARD:
                return status
        return OK

    def fmi2GetBoolean(self, component: Any, references: Any, count: int, values: Any) -> int:
        """Read Booleans, which have one byte in FMI 3.0."""
        return self._booleans(self._get_boolean, component, references, count, values)

    def fmi2SetBoolean(self, component: Any, references: Any, count: int, values: Any) -> int:
        """Set Booleans."""
        return self._booleans(self._set_boolean, component, references, count, values)

    @staticmethod
    def _booleans(call: Callable[..., int], component: Any, references: Any, count: int, values: Any) -> int:
        for first in range(0, count, CHUNK):
            part = range(first, min(first + CHUNK, count))
            few = (ctypes.c_uint * len(part))(*(references[i] for i in part))
            flags = (ctypes.c_uint8 * len(part))(*(int(values[i] != 0) for i in part))
            status = call(component, few, len(part), flags, len(part))
            if not OK <= status < DISCARD:
                return status
            for i, flag in zip(part, flags, strict=True):
                values[i] = flag
        return OK

    def exact_function(self, verb: str, reference: int) -> str:
        """Return the name of the function that gets or sets an Int64 or UInt64."""
        return f"fmi3{verb}{self._types[reference]}"

    def get_exact(self, component: Any, reference: int) -> tuple[int, int]:
        """Return the status, and the value of an Int64 or UInt64."""
        name, kind = SPECIAL[self._types[reference]]
        value = (kind * 1)()
        status = _getter(self._library, f"fmi3Get{name}", kind)(component, (ctypes.c_uint * 1)(reference), 1, value, 1)
        return int(status), int(value[0])

    def set_exact(self, component: Any, reference: int, value: int) -> int:
        """Set an Int64 or UInt64; returns an error for a value outside of its range."""
        name, kind = SPECIAL[self._types[reference]]
        values = (kind * 1)(value)
        if values[0] != value:
            return ERROR
        set_value = _getter(self._library, f"fmi3Set{name}", kind)
        return set_value(component, (ctypes.c_uint * 1)(reference), 1, values, 1)

    def get_binary(self, component: Any, reference: int) -> tuple[int, bytes]:
        """Return the status, and the value of a Binary, whose bytes are copied."""
        size, value = (ctypes.c_size_t * 1)(), (ctypes.c_void_p * 1)()
        status = self._binary("Get")(component, (ctypes.c_uint * 1)(reference), 1, size, value, 1)
        if not OK <= status < DISCARD or not size[0]:
            return status, b""
        return (status, ctypes.string_at(value[0], size[0])) if value[0] else (ERROR, b"")

    def set_binary(self, component: Any, reference: int, value: bytes) -> int:
        """Set a Binary."""
        buffer = ctypes.create_string_buffer(value, max(len(value), 1))
        pointer = (ctypes.c_void_p * 1)(ctypes.addressof(buffer))
        size = (ctypes.c_size_t * 1)(len(value))
        return self._binary("Set")(component, (ctypes.c_uint * 1)(reference), 1, size, pointer, 1)

    def _binary(self, verb: str) -> Callable[..., int]:
        sizes, values = ctypes.POINTER(ctypes.c_size_t), ctypes.POINTER(ctypes.c_void_p)
        name, count = f"fmi3{verb}Binary", ctypes.c_size_t
        return _function(self._library, name, _REFERENCES, count, sizes, values, count)

    def fmi2SetString(self, component: Any, references: Any, count: int, values: Any) -> int:
        """Set Strings."""
        return self._set_string(component, references, count, values, count)

"""Adapter that gives the functions of an FMI 3.0 FMU the names and arguments of FMI 2.0.

It makes the same FMI 3.0 calls as the native master, so the results are bit-identical: one call transfers several
scalars, but if one of them has a type that FMI 2.0 lacks, belongs to a clock or is an element of an array, each one is
transferred by a separate call.
"""

from __future__ import annotations

import ctypes
import functools
import itertools
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from ..files.plan import ArrayElements, Bytes, Value

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
    "fmi2GetDirectionalDerivative": "fmi3GetDirectionalDerivative",
}

OK = 0
DISCARD = 2
ERROR = 3

# Types that FMI 2.0 also has.
PLAIN = ("Float64", "Int32", "Boolean", "String")
FLOATS = ("Float32", "Float64")

# Suffix of the get and set functions, and C type, by FMI 3.0 type.
_INTEGERS = [f"{sign}Int{bits}" for bits in (8, 16, 32, 64) for sign in ("", "U")]
SPECIAL: Mapping[str, tuple[str, Any]] = {
    "Float32": ("Float32", ctypes.c_float),
    "Float64": ("Float64", ctypes.c_double),
    **{name: (name, getattr(ctypes, f"c_{name.lower()}")) for name in _INTEGERS},
    "Enumeration": ("Int64", ctypes.c_int64),
    "Boolean": ("Boolean", ctypes.c_uint8),
    "String": ("String", ctypes.c_char_p),
}

# Integers whose values can exceed the range of a 32-bit signed integer.
WIDE = ("UInt32", "Int64", "UInt64")
# Types with values that a double does not represent.
EXACT = ("Int64", "UInt64")
# Signals are doubles, which represent all whole numbers up to this one.
LARGEST_WHOLE = 2**53

# A step that ends earlier than this before its end, in steps, has returned early even without the flag. FMUs add up
# step sizes: after 1,000,000 steps of 1 ms, the sum is wrong by 2e-5 steps.
EARLY = 1e-3

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


def _in_chunks(call: Callable[..., int], component: Any, references: Any, count: int, values: Any, _size: int) -> int:
    """Get or set Booleans, which have one byte in FMI 3.0."""
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


def given(value: Value) -> Any:
    """Return a value of the plan as it is passed to the FMU."""
    if isinstance(value, Bytes):
        return bytes.fromhex(value.hex)
    return value.encode() if isinstance(value, str) else value


class Functions:
    """The functions of a shared library of FMI 3.0.

    `types` has the type of each value reference, `arrays` the arrays whose elements have references of their own,
    `clocked` the references of variables that belong to clocks.
    """

    def __init__(
        self,
        library: Any,
        types: Mapping[int, str],
        arrays: Sequence[ArrayElements] = (),
        clocked: Iterable[int] = (),
    ) -> None:
        self.library = library
        self._sizes = {array.reference: array.size for array in arrays}
        # The array and the index of each element.
        self._elements = {array.first + i: (array.reference, i) for array in arrays for i in range(array.size)}
        self._types = {**types, **{element: types[array] for element, (array, _) in self._elements.items()}}
        self.exact = {reference for reference, name in self._types.items() if name in EXACT}
        self._special = {reference for reference, name in self._types.items() if name not in PLAIN}
        self._special |= self._elements.keys() | set(clocked)
        self.wide = {reference for reference, name in self._types.items() if name in WIDE}
        # Values of arrays before the initialization, when they cannot be read (FMI 3.0.2, section 2.3.2).
        self._given = {array.reference: [given(value) for value in array.starts] for array in arrays if array.starts}
        # Structural parameters that are set after the instantiation: reference, name, value.
        self.structure: Sequence[tuple[int, str, Value]] = ()
        # Values of clocked variables by reference, between the ticks of their clocks.
        self.held: dict[int, Sequence[Any]] = {}
        # Clocked inputs that were set since the last tick.
        self.pending: set[int] = set()
        self._experiment: tuple[float, bool, float] = (0.0, False, 0.0)
        # Real: Float64 and Float32. Integer: enumerations and integers of all widths, up to 2^53 in magnitude.
        self.fmi2GetReal = self._transfer("Get", "Float64", ctypes.c_double)
        self.fmi2SetReal = self._transfer("Set", "Float64", ctypes.c_double)
        self.fmi2GetInteger = self._transfer("Get", "Int32", ctypes.c_int)
        self.fmi2SetInteger = self._transfer("Set", "Int32", ctypes.c_int)
        self.fmi2GetBoolean = self._transfer("Get", "Boolean", ctypes.c_uint8)
        self.fmi2SetBoolean = self._transfer("Set", "Boolean", ctypes.c_uint8)
        self.fmi2SetString = self._transfer("Set", "String", ctypes.c_char_p)
        flag, real, pointer = ctypes.c_bool, ctypes.c_double, ctypes.POINTER
        self._enter = _function(library, "fmi3EnterInitializationMode", flag, real, real, flag, real)
        flags = (pointer(flag),) * 3
        self._do_step = _function(library, "fmi3DoStep", real, real, flag, *flags, pointer(real))
        # Whether the latest step requests an event.
        self.event = ctypes.c_bool()
        self._outcome = (self.event, ctypes.c_bool(), ctypes.c_bool(), ctypes.c_double())
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
        self._given.clear()
        return int(self._enter(component, False, 0.0, start, has_stop, stop))

    def fmi2DoStep(self, component: Any, time: float, step: float, final: int) -> int:
        """Advance; if the FMU ends the simulation or returns early, the status is "discard", as in FMI 2.0."""
        event, terminate, early, reached = self._outcome
        event.value = terminate.value = early.value = False
        reached.value = math.nan
        status = int(self._do_step(component, time, step, bool(final), *self._outcome_pointers))
        is_early = early.value or reached.value < time + (1.0 - EARLY) * step
        return DISCARD if status < DISCARD and (terminate.value or is_early) else status

    def fmi2GetRealStatus(self, _component: Any, _kind: int, value: Any) -> int:
        """Return the last successful time of the latest step."""
        value._obj.value = self._outcome[3].value
        return OK

    def fmi2GetBooleanStatus(self, _component: Any, _kind: int, value: Any) -> int:
        """Return whether the latest step has ended the simulation."""
        value._obj.value = int(self._outcome[1].value)
        return OK

    def __getattr__(self, name: str) -> Callable[..., int]:
        """Return a function that FMI 2.0 lacks; its arguments after the component have types of ctypes."""
        function = self.library[name]
        return lambda component, *arguments: int(function(ctypes.c_void_p(component), *arguments))

    def _transfer(self, verb: str, plain: str, kind: Any) -> Callable[..., int]:
        """Return a function that gets or sets all variables that FMI 2.0 would treat as one type."""
        at_once = _getter(self.library, f"fmi3{verb}{plain}", kind)
        if plain == "Boolean":
            at_once = functools.partial(_in_chunks, at_once)

        def transfer(component: Any, references: Any, count: int, values: Any) -> int:
            if self._special and any(references[i] in self._special for i in range(count)):
                if verb == "Get":
                    return self._get(component, references, count, values, plain)
                return self._set(component, references, count, values)
            return at_once(component, references, count, values, count)

        return transfer

    def _get(self, component: Any, references: Any, count: int, values: Any, plain: str) -> int:
        least, most = -(2**31), 2**31 - 1
        if values._type_ is ctypes.c_int64:
            least, most = -LARGEST_WHOLE, LARGEST_WHOLE
        for array, places in itertools.groupby(range(count), lambda i: self.place(references[i])[0]):
            status, whole = self.read(component, array)
            if not OK <= status < DISCARD:
                return status
            for i in places:
                values[i] = value = whole[self.place(references[i])[1]]
                if plain == "Int32" and not least <= value <= most:
                    return ERROR
        return OK

    def _set(self, component: Any, references: Any, count: int, values: Any) -> int:
        for array, places in itertools.groupby(range(count), lambda i: self.place(references[i])[0]):
            status, whole = OK, self._given.get(array, [0])
            if array in self._sizes and array not in self._given:
                status, found = self.read(component, array)
                whole = list(found)
            if OK <= status < DISCARD:
                for i in places:
                    whole[self.place(references[i])[1]] = values[i]
                status, _ = self.write(component, array, whole)
            if not OK <= status < DISCARD:
                return status
        return OK

    def place(self, reference: int) -> tuple[int, int]:
        """Return the array with an element, and its index; any other variable itself, and 0."""
        return self._elements.get(reference, (reference, 0))

    def read(self, component: Any, reference: int) -> tuple[int, Sequence[Any]]:
        """Return the status, and the values of a variable or array; the bytes of Binaries are copied."""
        if reference in self.held:
            return OK, self.held[reference]
        size, one = self._sizes.get(reference, 1), (ctypes.c_uint * 1)(reference)
        if self._types[reference] == "Binary":
            sizes, pointers = (ctypes.c_size_t * size)(), (ctypes.c_void_p * size)()
            status = self._binary("Get")(component, one, 1, sizes, pointers, size)
            if not OK <= status < DISCARD:
                return status, ()
            if any(length and not pointer for length, pointer in zip(sizes, pointers, strict=True)):
                return ERROR, ()
            return status, [ctypes.string_at(pointer or b"", n) for n, pointer in zip(sizes, pointers, strict=True)]
        name, kind = SPECIAL[self._types[reference]]
        values = (kind * size)()
        return int(_getter(self.library, f"fmi3Get{name}", kind)(component, one, 1, values, size)), values

    def write(self, component: Any, reference: int, values: Sequence[Any]) -> tuple[int, None]:
        """Set a variable or array; the status is an error for a value that its type does not have."""
        if reference in self.held:
            self.held[reference] = list(values)
            self.pending.add(reference)
            return OK, None
        size, one, type_name = len(values), (ctypes.c_uint * 1)(reference), self._types[reference]
        if type_name == "Binary":
            buffers = [ctypes.create_string_buffer(value, max(len(value), 1)) for value in values]
            pointers = (ctypes.c_void_p * size)(*map(ctypes.addressof, buffers))
            sizes = (ctypes.c_size_t * size)(*map(len, values))
            return self._binary("Set")(component, one, 1, sizes, pointers, size), None
        name, kind = SPECIAL[type_name]
        converted = (kind * size)(*values)
        # ctypes lets integers overflow silently, and converts numbers beyond Float32 to infinity.
        for value, new in zip(values, converted, strict=True):
            if math.isfinite(new) != math.isfinite(value) if type_name in FLOATS else new != value:
                return ERROR, None
        return _getter(self.library, f"fmi3Set{name}", kind)(component, one, 1, converted, size), None

    def get(self, component: Any, reference: int) -> tuple[int, Any]:
        """Return the status, and the value of a scalar or an element."""
        array, index = self.place(reference)
        status, values = self.read(component, array)
        return status, values[index] if OK <= status < DISCARD else None

    def set(self, component: Any, reference: int, value: Any) -> tuple[int, None]:
        """Set a scalar or an element; returns the status."""
        return self._set(component, [reference], 1, [value]), None

    def function(self, verb: str, reference: int) -> str:
        """Return the name of the function that gets or sets a variable."""
        name = self._types[reference]
        return f"fmi3{verb}{SPECIAL.get(name, (name,))[0]}"

    def _binary(self, verb: str) -> Callable[..., int]:
        sizes, values = ctypes.POINTER(ctypes.c_size_t), ctypes.POINTER(ctypes.c_void_p)
        name, count = f"fmi3{verb}Binary", ctypes.c_size_t
        return _function(self.library, name, _REFERENCES, count, sizes, values, count)

    def fmi2GetDirectionalDerivative(
        self, component: Any, unknowns: Any, results: int, knowns: Any, seeds: int, seed: Any, result: Any
    ) -> int:
        """Get directional derivatives."""
        count, reals = ctypes.c_size_t, ctypes.POINTER(ctypes.c_double)
        kinds = (_REFERENCES, count, _REFERENCES, count, reals, count, reals, count)
        get = _function(self.library, "fmi3GetDirectionalDerivative", *kinds)
        return get(component, unknowns, results, knowns, seeds, seed, seeds, result, results)

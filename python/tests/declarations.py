"""Random models: declarations of variables and clocks, and their source in Rust.

The equations are trivial, so that `tests.expected_fmu` knows every value: an output is a copy of an input or parameter,
the input of the last sample, or a count of ticks; the derivative of a state is an input.
"""

from __future__ import annotations

import dataclasses
import itertools
import json
import math
import random
import struct
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

Value = Any
RUST = {"Float64": "f64", "Float32": "f32", "Boolean": "bool", "String": "String", "Enumeration": "Level"}
RUST |= {f"{sign}Int{bits}": f"{sign.lower() or 'i'}{bits}" for bits in (8, 16, 32, 64) for sign in ("", "U")}
SCALARS = [*RUST, "Binary"]
LIMITS = {f"Int{bits}": (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1) for bits in (8, 16, 32, 64)}
LIMITS |= {f"UInt{bits}": (0, 2**bits - 1) for bits in (8, 16, 32, 64)}
WIDE = ("UInt32", "Int64", "UInt64")
TEXTS = ["", "a", "Set me!", "ä ≤ 𝄞", "<&>'", 'say "x"', "  two  spaces ", "back\\slash"]
LARGEST64, LARGEST32 = sys.float_info.max, struct.unpack("f", b"\xff\xff\x7f\x7f")[0]
LARGEST = (LARGEST64, -LARGEST64, LARGEST32, -LARGEST32)
EIGHTHS = [Fraction(n, 8) for n in range(1, 9)]


@dataclass
class Variable:
    """A variable, or an array of variables."""

    name: str
    field: str
    type: str
    role: str
    """parameter, derived, input, output, state or derivative"""
    shape: tuple[int, ...] = ()
    """Lengths; for an array whose size can change, the greatest ones."""
    sizes: tuple[str, ...] = ()
    """Structural parameters that are the lengths."""
    tunable: bool = False
    structural: bool = False
    local: bool = False
    constant: bool = False
    group: str = ""
    """Field with the nested struct."""
    start: list[Value] = dataclasses.field(default_factory=list)
    limits: tuple[Value, Value] | None = None
    capacity: int = 0
    """Greatest number of bytes of a Binary."""
    fmi: int | None = None
    """The only version that has the variable."""
    clocks: tuple[str, ...] = ()
    aliases: tuple[str, ...] = ()
    elements: tuple[str, ...] = ()
    choices: list[Value] | None = None
    """The only values that the test sets."""
    is_listed: bool = False
    """An Enumeration of FMI, not an integer with named values."""
    kind: str = ""
    """How the model computes it: copy, past (the copy in the sample before), count or time."""
    source: str = ""
    """Field of the variable that it copies."""

    @property
    def count(self) -> int:
        return math.prod(self.shape)

    def element_names(self) -> list[str]:
        if not self.shape:
            return [self.name]
        if self.elements:
            return [f"{self.name}.{element}" for element in self.elements]
        head, end = (self.name[:-1], ")") if self.role == "derivative" else (self.name, "")
        indices = itertools.product(*(range(1, length + 1) for length in self.shape))
        return [f"{head}[{','.join(map(str, index))}]{end}" for index in indices]


@dataclass
class Clock:
    """An input clock with its part of the model."""

    name: str
    kind: str
    """constant, parameter, changing, countdown or triggered"""
    interval: Fraction | None = None
    shift: Fraction = Fraction(0)
    parameter: str = ""
    """Field of the parameter that is the interval."""
    starts: str = ""
    """Name of the countdown clock that each tick starts."""


@dataclass
class Model:
    """The declarations of a model."""

    seed: int
    kind: str
    """continuous, discrete or clocked"""
    arrays: bool
    versions: list[int]
    levels: list[int]
    repr: str
    variables: list[Variable] = dataclasses.field(default_factory=list)
    clocks: list[Clock] = dataclasses.field(default_factory=list)
    fires_every: int = 3
    """The output clock ticks at each tick whose number is a multiple of this."""

    @property
    def name(self) -> str:
        return f"Random{self.seed}"

    @property
    def package(self) -> str:
        return f"random-{self.seed}"

    def of(self, *roles: str) -> list[Variable]:
        return [variable for variable in self.variables if variable.role in roles]

    def by_field(self, field: str) -> Variable:
        return next(variable for variable in self.variables if variable.field == field)

    def number_type(self, variable: Variable) -> str:
        """Return the type in FMI 3.0: that of an enumeration depends on its `repr`."""
        if variable.type != "Enumeration" or variable.is_listed:
            return variable.type
        return {"u": "UInt", "i": "Int"}[self.repr[0]] + self.repr[1:] if self.repr else "Int32"

    def value(self, rng: random.Random, variable: Variable) -> Value:
        """Return a value that the variable may have."""
        if variable.choices:
            return rng.choice(variable.choices)
        if variable.limits:
            least, most = variable.limits
            between = rng.randint(math.ceil(least), math.floor(most))
            return rng.choice([least, most, type(least)(between)])
        match variable.type:
            case "Float64":
                return rng.choice([0.0, 0.1, -2.5, 1e300, -LARGEST64, LARGEST64, 5e-324, rng.randint(-99, 99) / 8])
            case "Float32":
                return rng.choice([0.0, -0.375, LARGEST32, -LARGEST32, rng.randint(-99, 99) / 8])
            case "Boolean":
                return rng.random() < 0.5
            case "String":
                return rng.choice(TEXTS)
            case "Binary":
                return rng.randbytes(rng.choice([0, variable.capacity, rng.randint(0, variable.capacity)]))
            case "Enumeration":
                return rng.choice(self.levels)
        least, most = LIMITS[variable.type]
        return rng.choice([least, most, rng.randint(least, most)])


class Generator:
    """Draws the declarations of one model."""

    def __init__(self, seed: int) -> None:
        self.rng = rng = random.Random(f"declarations {seed}")
        kind = ("continuous", "discrete", "clocked")[seed % 3]
        self.is_sized = seed % 2 == 0
        versions = [3] if self.is_sized else [2, 3]
        levels = sorted(rng.sample(range(100), 3))
        self.model = Model(
            seed=seed,
            kind=kind,
            arrays=self.is_sized or (seed > 5 and rng.random() < 0.5),
            versions=versions,
            levels=levels,
            repr=rng.choice(["", "u8", "i16", "u32", "i64"]),
            fires_every=rng.randint(2, 4),
        )
        self.lengths: list[Variable] = []
        self.groups = {"input": ["", "", "ug"], "output": ["", "", "yg"], "parameter": ["", "", "pg"]}

    def generate(self) -> Model:
        rng, model = self.rng, self.model
        if self.is_sized:
            for _ in range(2):
                most = rng.randint(2, 4)
                length = self.add("parameter", "UInt64", structural=True, tunable=rng.random() < 0.6, limits=(0, most))
                length.start = [rng.randint(1, most)]
                self.lengths.append(length)
        if self.is_sized or rng.random() < 0.5:
            self.add("parameter", rng.choice(["Boolean", "Int16"]), structural=True)
        if model.kind == "clocked":
            self.add_clocks()
        # A struct that is generic over the number type needs a Float64.
        for role in ("input", "output", "parameter"):
            for group in dict.fromkeys(self.groups[role]):
                if role == "output":
                    self.add_output(self.add("input", "Float64"), group=group)
                else:
                    self.add(role, "Float64", group=group)
        for scalar in rng.sample(SCALARS, len(SCALARS)):
            for _ in range(rng.randint(1, 2)):
                self.add_pair(scalar)
        for scalar in rng.sample(["Float64", "Int16", "Boolean", "Enumeration"], 2):
            output = self.add("output", scalar, constant=True, kind="constant")
            output.fmi = None
        if model.kind == "continuous":
            for _ in range(2):
                self.add_state()
        self.add_derived()
        return model

    def shape(self) -> dict[str, Any]:
        """Return the shape of a random array, as fields of a variable."""
        rng = self.rng
        if self.lengths and rng.random() < 0.5:
            sizes = [rng.choice(self.lengths) for _ in range(rng.randint(1, 2))]
            assert all(size.limits for size in sizes)
            return {
                "shape": tuple(size.limits[1] for size in sizes if size.limits),
                "sizes": tuple(s.name for s in sizes),
            }
        shape = tuple(rng.randint(1, 3) for _ in range(rng.choice([0, 0, 1, 2])))
        is_named = len(shape) == 1 and rng.random() < 0.3
        return {"shape": shape, "elements": ("fl", "fr", "r")[: shape[0]] if is_named else ()}

    def add(self, role: str, scalar: str, **fields: Any) -> Variable:
        rng, model = self.rng, self.model
        number = len(model.variables)
        name = rng.choice([f"v{number}", f"v{number}", f"deep.v{number}", f"Sig_{number}"])
        variable = Variable(name=name, field=f"v{number}", type=scalar, role=role, **fields)
        if variable.group:
            variable.name = f"{variable.group}.{name}"
        if scalar == "Binary":
            variable.capacity = variable.capacity or rng.randint(1, 9)
            variable.fmi = 3
        is_free = not (variable.limits or variable.choices or variable.constant)
        if scalar in LIMITS and is_free:
            least, most = LIMITS[scalar]
            if scalar in WIDE and 2 in model.versions and role != "derived":
                if rng.random() < 0.5:
                    variable.fmi = 3
                else:
                    variable.limits = (max(least, -1000), 2**31 - 1)
            elif rng.random() < 0.3:
                variable.limits = tuple(sorted(rng.randint(least, most) for _ in range(2)))  # type: ignore[assignment]
        if scalar == "Float64" and is_free and rng.random() < 0.3:
            variable.limits = (-1.5, 1e6)
        if not (variable.structural or variable.fmi) and is_free and len(model.versions) == 2 and rng.random() < 0.1:
            variable.fmi = rng.choice([2, 3])
        # FMPy 0.3.32 expects the aliases of calculated variables among the initial unknowns (docs/validators.md).
        is_calculated = role == "derived" or (role == "output" and model.kind == "continuous" and not variable.constant)
        if not (variable.shape or is_calculated) and rng.random() < 0.2:
            variable.aliases = (f"alias{number}",)
        variable.is_listed = scalar == "Enumeration" and rng.random() < 0.5
        if not variable.start:
            variable.start = [model.value(rng, variable) for _ in range(variable.count)]
            # `cargo fmu check` tries values near the start.
            variable.start = [0.25 if x in LARGEST else x for x in variable.start]
            if rng.random() < 0.3:
                variable.start = variable.start[:1] * variable.count
        model.variables.append(variable)
        return variable

    def add_pair(self, scalar: str) -> None:
        """Add an input or a parameter, and an output that is its copy."""
        rng = self.rng
        if rng.random() < 0.7:
            group = rng.choice(self.groups["input"])
            source = self.add("input", scalar, group=group, **self.shape())
        else:
            is_tunable = rng.random() < 0.5
            group = rng.choice(self.groups["parameter"])
            shape = {} if scalar == "Float64" else self.shape()
            source = self.add("parameter", scalar, group=group, tunable=is_tunable, **shape)
        self.add_output(source, group=rng.choice(self.groups["output"]))

    def add_output(self, source: Variable, group: str) -> Variable:
        rng, model = self.rng, self.model
        fields = {"shape": source.shape, "sizes": source.sizes, "capacity": source.capacity, "limits": source.limits}
        kind = "copy"
        if model.kind == "discrete" and source.role == "input" and not source.sizes and rng.random() < 0.3:
            kind = "past"
        if model.kind == "clocked":
            clock = rng.choice(model.clocks).name
            fields["clocks"] = (clock,) if rng.random() < 0.7 else ()
            if source.role == "input" and rng.random() < 0.5:
                source.clocks = (clock,)
            kind = f"copy at {clock}"
        output = self.add("output", source.type, group=group, kind=kind, source=source.field, **fields)
        # Limits of an output are information only. Those of a wide integer decide whether FMI 2.0 can express it.
        output.fmi = source.fmi
        return output

    def add_state(self) -> None:
        """Add a state and an input that is its derivative."""
        rng, shape = self.rng, self.shape()
        shape.pop("elements", None)
        choices = [n / 8 for n in range(-32, 33)]
        rate = self.add("input", "Float64", choices=choices, **shape)
        rate.fmi = None
        state = self.add("state", "Float64", local=rng.random() < 0.5, choices=choices, **shape)
        state.fmi, state.source = None, rate.field
        derivative = Variable(
            f"der({state.name})", f"der({state.name})", "Float64", "derivative", state.shape, state.sizes
        )
        derivative.source, derivative.kind, derivative.local = rate.field, "copy", True
        self.model.variables.append(derivative)

    def add_derived(self) -> None:
        parameters = [p for p in self.model.of("parameter") if not (p.structural or p.sizes or p.elements or p.choices)]
        for source in self.rng.sample(parameters, min(2, len(parameters))):
            fields = {"shape": source.shape, "capacity": source.capacity}
            derived = self.add("derived", source.type, kind="copy", source=source.field, **fields)
            derived.fmi, derived.limits, derived.is_listed = (
                (3 if source.type in (*WIDE, "Binary") else None),
                None,
                False,
            )

    def add_clocks(self) -> None:
        rng, model = self.rng, self.model
        denominators = [rng.choice([3, 5, 8, 10]), rng.choice([2, 4])]
        for number, denominator in enumerate(denominators):
            interval = Fraction(rng.randint(1, 3), denominator)
            shift = Fraction(rng.randint(0, 2), rng.choice([2, 3, 4]))
            model.clocks.append(Clock(f"periodic{number}", "constant", interval, shift))
        choices = [float(eighth) for eighth in EIGHTHS]
        parameter = self.add("parameter", "Float64", choices=choices, tunable=rng.random() < 0.6)
        parameter.fmi, parameter.limits = None, (1 / 16, 2.0)
        shift = rng.choice([Fraction(0), Fraction(1, 4)])
        model.clocks.append(Clock("by_parameter", "parameter", None, shift, parameter.field))
        delay = self.add("input", "Float64", choices=[0.0, *choices])
        delay.field, delay.fmi = "delay", None
        model.clocks.append(Clock("timeout", "countdown", rng.choice([None, Fraction(1, 8)])))
        model.clocks[0].starts = "timeout"
        model.clocks.append(Clock("pulse", "changing", rng.choice(EIGHTHS)))
        if 2 not in model.versions:
            model.clocks.append(Clock("message", "triggered"))
        rng.shuffle(model.clocks)
        for clock in model.clocks:
            clocks, scalar = (clock.name,) if rng.random() < 0.5 else (), rng.choice(["Int32", "UInt16", "Int16"])
            self.add("output", scalar, kind=f"count of {clock.name}", clocks=clocks, choices=[0, 7, 1000])
            self.add("output", "Float64", kind=f"time of {clock.name}", clocks=clocks)
        for variable in model.of("output"):
            variable.fmi = variable.limits = None
            variable.start = [0.0 if variable.type == "Float64" else 0]


def generate(seed: int) -> Model:
    """Return the model of a seed: continuous-time, discrete-time and with clocks in turn."""
    return Generator(seed).generate()


# The source in Rust.


def literal(variable: Variable, value: Value) -> str:
    match variable.type:
        case "Boolean":
            return str(value).lower()
        case "String":
            return json.dumps(value, ensure_ascii=False)
        case "Binary":
            return 'b"' + "".join(f"\\x{byte:02x}" for byte in value) + '"'
        case "Enumeration":
            return f"Level::L{value}"
    return repr(value)


def nested(texts: list[str], shape: tuple[int, ...]) -> str:
    if not shape:
        return texts[0]
    size = len(texts) // shape[0] if shape[0] else 0
    return f"[{', '.join(nested(texts[size * i : size * (i + 1)], shape[1:]) for i in range(shape[0]))}]"


def rust_type(variable: Variable, real: str) -> str:
    text = f"Bytes<{variable.capacity}>" if variable.type == "Binary" else RUST[variable.type]
    text = real if variable.type == "Float64" else text
    for length in reversed(variable.shape):
        text = f"Array<{text}, {length}>" if variable.sizes else f"[{text}; {length}]"
    return text


def attribute(model: Model, variable: Variable) -> str:
    keys = []
    name = variable.name.removeprefix(f"{variable.group}.") if variable.group else variable.name
    if name != variable.field:
        keys.append(json.dumps(name))
    if variable.constant:
        keys.append(f"constant = {literal(variable, variable.start[0])}")
    elif variable.role != "derived" and (variable.role, model.kind) != ("output", "continuous"):
        texts = [literal(variable, value) for value in variable.start]
        # A path is the start of all elements of a list only, not of a matrix.
        is_same = len(set(texts)) == 1 and not (variable.type == "Enumeration" and len(variable.shape) > 1)
        keys.append(f"start = {texts[0] if is_same else nested(texts, variable.shape)}")
    if variable.limits and not variable.constant:
        keys += [f"{key} = {limit!r}" for key, limit in zip(("min", "max"), variable.limits, strict=True)]
    flags = {"tunable": variable.tunable, "structural": variable.structural, "enumeration": variable.is_listed}
    flags["local"] = variable.local
    keys += [flag for flag, is_set in flags.items() if is_set]
    if variable.fmi:
        keys.append(f"fmi = {variable.fmi}")
    lists = {"clock": variable.clocks, "size": variable.sizes, "elements": variable.elements}
    keys += [f"{key} = {json.dumps(names)}" for key, names in lists.items() if names]
    keys += [f'alias("{alias}")' for alias in variable.aliases]
    return f"#[var({', '.join(keys)})]" if keys else "#[var]"


def structs(model: Model, derive: str, name: str, role: str) -> Iterator[str]:
    """Return the struct with the variables of a role, and its nested structs."""
    is_generic = model.kind == "continuous" and role in ("input", "output", "state")
    parameter, real = ("<T>", "T") if is_generic else ("", "f64")
    variables = model.of(role)
    groups = {variable.group: None for variable in variables}
    for group in groups:
        struct_name = f"{name}{group.capitalize()}" if group else name
        yield f"#[derive({derive})]\npub struct {struct_name}{parameter} {{"
        for variable in (variable for variable in variables if variable.group == group):
            unit = " (m)" if variable.type.startswith("Float") else ""
            yield f"    /// Variable {variable.field}{unit}\n    {attribute(model, variable)}"
            yield f"    pub {variable.field}: {rust_type(variable, real)},"
        if not group:
            for inner in (inner for inner in groups if inner):
                yield f"    #[var(nested)]\n    pub {inner}: {name}{inner.capitalize()}{parameter},"
        yield "}\n"


def path(variable: Variable) -> str:
    return f"{variable.group}.{variable.field}" if variable.group else variable.field


def expression(model: Model, variable: Variable, inputs: str) -> str:
    """Return the expression that computes an output, a derivative or a calculated parameter."""
    if variable.constant:
        # Ignored: the FMU has the declared value.
        is_generic = variable.type == "Float64" and model.kind == "continuous"
        return "T::from(0.0)" if is_generic else "Default::default()"
    source = model.by_field(variable.source)
    if variable.kind == "past":
        return f"std::mem::replace(&mut sample.state.{source.field}, {inputs}.{path(source)}.clone())"
    owner = "self" if source.role == "parameter" else inputs
    text = f"{owner}.{path(source)}.clone()"
    is_converted = model.kind == "continuous" and source.role == "parameter" and source.type == "Float64"
    return f"T::from({text})" if is_converted and variable.role != "derived" else text


def construction(model: Model, name: str, variables: list[Variable], inputs: str) -> str:
    """Return an expression of a struct with the values of the variables."""
    groups = {variable.group: None for variable in variables}
    parts = []
    for variable in variables:
        if not variable.group:
            parts.append(f"{variable.field}: {expression(model, variable, inputs)}")
    for group in (group for group in groups if group):
        fields = [f"{v.field}: {expression(model, v, inputs)}" for v in variables if v.group == group]
        parts.append(f"{group}: {name}{group.capitalize()} {{ {', '.join(fields)} }}")
    return f"{name} {{ {', '.join(parts)} }}"


def source(model: Model) -> str:
    """Return the Rust source of a model."""
    lines = [
        "//! Generated by python/tests/declarations.py.",
        "#![allow(unused, clippy::all)]",
        "use fmu::prelude::*;\n",
    ]
    lines += ["/// Level", "#[derive(Enumeration, Clone, Copy, Debug, Default, PartialEq)]"]
    if model.repr:
        lines.append(f"#[repr({model.repr})]")
    lines.append("pub enum Level {")
    for number, level in enumerate(model.levels):
        lines.append(f"    /// Level {level}\n    {'' if number else '#[default]'} L{level} = {level},")
    lines.append("}\n")
    for derive, name, role in [("Parameters", model.name, "parameter"), ("Inputs", "U", "input")]:
        lines += structs(model, derive, name, role)
    output_clock = len(lines)
    lines += structs(model, "Outputs", "Y", "output")
    lines += structs(model, "State", "X", "state")
    lines += structs(model, "Derived", "D", "derived")
    past = [model.by_field(variable.source) for variable in model.of("output") if variable.kind == "past"]
    lines += {"continuous": continuous, "discrete": discrete, "clocked": clocked}[model.kind](model)
    if model.kind == "clocked":
        at = next(i for i in range(output_clock, len(lines)) if lines[i].endswith("struct Y {"))
        lines.insert(at + 1, "    /// Output clock\n    pub fired: Clock,")
        lines.append("#[derive(DiscreteState, Clone, Default)]\npub struct S { total: u32, pulses: u32 }")
    if past:
        fields = ", ".join(f"{variable.field}: {rust_type(variable, 'f64')}" for variable in past)
        lines.append(f"#[derive(DiscreteState, Clone, Default)]\npub struct S {{ {fields} }}")
    return "\n".join(lines) + "\n"


def implementation(model: Model, items: list[str]) -> list[str]:
    derived = model.of("derived")
    if derived:
        items.insert(0, "type Derived = D;")
        items.append(f"fn derived(&self) -> Result<D, String> {{ Ok({construction(model, 'D', derived, '')}) }}")
    trait = "Continuous" if model.kind == "continuous" else "Discrete"
    head = ["/// Random declarations", "#[fmu::model(stop_time = 10.0, step_size = 0.125)]"]
    return [*head, f"impl {trait} for {model.name} {{", *(f"    {item}" for item in items), "}\n"]


def continuous(model: Model) -> list[str]:
    items = ["type Inputs<T: Scalar> = U<T>;", "type Outputs<T: Scalar> = Y<T>;", "type State<T: Scalar> = X<T>;"]
    rates = ", ".join(
        f"{state.field}: at.inputs.{path(model.by_field(state.source))}.clone()" for state in model.of("state")
    )
    items.append(f"fn derivatives<T: Scalar>(&self, at: At<T, Self>) -> X<T> {{ X {{ {rates} }} }}")
    outputs = construction(model, "Y", model.of("output"), "at.inputs")
    items.append(f"fn outputs<T: Scalar>(&self, at: At<T, Self>) -> Y<T> {{ {outputs} }}")
    return implementation(model, items)


def discrete(model: Model) -> list[str]:
    items = ["type Inputs = U;", "type Outputs = Y;"]
    if any(variable.kind == "past" for variable in model.of("output")):
        items.append("type State = S;")
    outputs = construction(model, "Y", model.of("output"), "sample.inputs")
    items.append(f"fn update(&self, sample: Sample<Self>) -> Y {{ {outputs} }}")
    return implementation(model, items)


def seconds(interval: Fraction) -> str:
    return f"{interval.numerator} / {interval.denominator}"


def clocked(model: Model) -> list[str]:
    items = ["type Inputs = U;", "type Outputs = Y;", "type State = S;"]
    for clock in model.clocks:
        match clock.kind:
            case "constant":
                assert clock.interval is not None
                keys = f"interval = {seconds(clock.interval)}" + (
                    f", shift = {seconds(clock.shift)}" if clock.shift else ""
                )
            case "parameter":
                name = model.by_field(clock.parameter).name
                keys = f"interval_of = {json.dumps(name)}" + (f", shift = {float(clock.shift)}" if clock.shift else "")
            case _:
                keys = clock.kind + (f", interval = {seconds(clock.interval)}" if clock.interval else "")
        body = ["tick.state.total += 1;"]
        body.append(f"if tick.state.total % {model.fires_every} == 0 {{ tick.outputs.fired.fire(); }}")
        for output in model.of("output"):
            if output.kind == f"count of {clock.name}":
                body.append(f"tick.outputs.{path(output)} += 1;")
            elif output.kind == f"time of {clock.name}":
                body.append(f"tick.outputs.{path(output)} = tick.time;")
            elif output.kind == f"copy at {clock.name}":
                body.append(f"tick.outputs.{path(output)} = {expression(model, output, 'tick.inputs')};")
        if clock.starts:
            body.append(f"let after = tick.inputs.delay.abs(); tick.start({model.name}Clock::Timeout, after);")
        if clock.kind == "changing":
            body.append("tick.state.pulses += 1; let n = tick.state.pulses;")
            body.append(f"tick.start({model.name}Clock::Pulse, f64::from(1 + n % 3) / 8.0);")
        inner = "\n        ".join(body)
        items.append(f"/// Clock {clock.name}\n    #[clock({keys})]")
        items.append(f"fn {clock.name}(&self, mut tick: Tick<Self>) {{\n        {inner}\n    }}")
    return implementation(model, items)

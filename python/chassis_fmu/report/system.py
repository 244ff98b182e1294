"""The systems of a scenario as pictures: components in order of execution, and the connections between them.

A picture is a matrix (N² chart): components are on its diagonal, and the number in a row and a column counts the
connections from the component of the row to the component of the column.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ..files.plan import Component, Connected, Loop, Plan, Simulation, Wiring
from . import tables

# Name and meaning of each time of the values that connections carry, and the distance of its lines from the center
# (pixels), because lines with different times may be side by side.
TIMES = {
    "on_time": ("on time", "the component uses the value at the time to which it belongs", 0),
    "held": ("held", "the value from the start of a step holds over the step", 4),
    "late": ("late", "a sample arrives one step late", -7),
    "early": ("early", "a sample is taken at the end of a step instead of its start", 7),
    "file": ("from the input file", "the value comes from a recording", 0),
}
CONVERSIONS = {"boolean_to_real": "Boolean to Real: 0 or 1", "real_to_boolean": "Real to Boolean: above 0.5"}
INPUT_FILE = "input file"


@dataclass(frozen=True)
class Bundle:
    """Connections from one component to another whose values have the same time."""

    source: str
    reader: str
    timing: str
    signals: tuple[tuple[str, str], ...]
    """Names, and what happens to the values on the way."""
    in_loop: bool


@dataclass(frozen=True)
class System:
    """The system of one or several cases."""

    held: str
    """Describes how a connection uses the value from the start of a step."""
    boxes: tuple[str, ...]
    bundles: tuple[Bundle, ...]
    loops: tuple[Loop, ...]
    rates: tuple[tuple[str, str], ...]
    """Components that do not make one step in each communication step, and how many they make."""

    @property
    def times(self) -> dict[str, tuple[str, str, int]]:
        """Name, meaning and distance of each time, see `TIMES`."""
        return TIMES | {"held": ("held", self.held, TIMES["held"][2])}

    @property
    def half(self) -> float:
        """Half of the width of a box, pixels."""
        return max(36.0, max(map(len, self.boxes)) * 3.7 + 10.0)

    def place(self, column: str, row: str | None = None) -> tuple[float, float]:
        """Return the center of a box, or of the number in a column and a row (pixels)."""
        across, down = self.boxes.index(column), self.boxes.index(row or column)
        return self.half + 4.0 + across * (self.half + 24.0), 24.0 + down * 52.0

    def numbers(self) -> list[tuple[Bundle, float, float, int]]:
        """Return each bundle with the place of its number, and the side of the diagonal: 1 above, -1 below."""
        found = []
        for bundle in self.bundles:
            (x, y), shift = self.place(bundle.reader, bundle.source), TIMES[bundle.timing][2]
            side = 1 if y < self.place(bundle.reader)[1] else -1
            found.append((bundle, x + shift, y + shift, side))
        return found


def _signal(connected: Connected) -> tuple[str, str]:
    """Return names and conversion of a connection."""
    source, name, change = connected.source, connected.input.variable, connected.conversion
    output = source.output.variable if source.output else source.file
    text = CONVERSIONS.get(connected.type_change or "", "")
    if change is not None:
        sign = "−" if change.offset < 0.0 else "+"
        shift = f" {sign} {tables.scientific(abs(change.offset))}" if change.offset else ""
        text = f"× {tables.scientific(change.factor)}{shift}"
    return (name if output == name else f"{output} → {name}"), text


def _rate(component: Component) -> str:
    slow = f"1 per {component.every}" if component.every > 1 else ""
    return f"{component.substeps} per 1" if component.substeps > 1 else slow


def _system(components: Sequence[Component], wiring: Wiring, simulation: Simulation) -> System:
    """Return the system of a case with its components in the order of execution."""
    paths = [f" -> {loop.path} -> " for loop in wiring.loops]
    found: dict[tuple[str, str, str], list[tuple[str, str]]] = {}
    in_loop = set()
    for connected in wiring.inputs:
        output, reader = connected.source.output, connected.input
        if output or connected.source.file:
            key = (output.component if output else INPUT_FILE, reader.component, connected.timing or "file")
            found.setdefault(key, []).append(_signal(connected))
            link = f" -> {output.component}:{output.variable} -> " if output else ""
            if link and any(f"{link}{reader.component}:{reader.variable} -> " in path for path in paths):
                in_loop.add(key)
    boxes = tuple(component.name for component in components)
    if any(source == INPUT_FILE for source, *_ in found):
        boxes = (INPUT_FILE, *boxes)
    keys = sorted(found, key=lambda key: (boxes.index(key[0]), boxes.index(key[1])))
    bundles = tuple(Bundle(*key, tuple(found[key]), key in in_loop) for key in keys)
    held = TIMES["held"][1]
    if simulation.extrapolation == "linear":
        held = "the value from the start of a step is extrapolated over the step"
    if simulation.iterate:
        held = "the step is repeated until the value agrees with that of its end"
    return System(held, boxes, bundles, wiring.loops, tuple((c.name, _rate(c)) for c in components if _rate(c)))


def systems(plan: Plan) -> list[tuple[System, list[str]]]:
    """Return the different systems, each with the titles of its cases; that with the most connections comes first."""
    orders = {run.case: run.components for run in reversed(plan.runs)}
    found: dict[System, list[str]] = {}
    for wiring in plan.wiring:
        if wiring.case in orders and wiring.inputs:
            system = _system(orders[wiring.case], wiring, plan.simulation)
            found.setdefault(system, []).append(plan.case_titles[wiring.case])
    return sorted(found.items(), key=lambda item: -sum(len(bundle.signals) for bundle in item[0].bundles))

"""The page of an assessment."""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from .. import _native
from ..files.plan import Case
from ..report import index, lab, rendering, tables
from .assessment import Assessment, Folder, Name, Number, Row, Run, Suite
from .charts import CHARTS, Source

SUITES: dict[Suite, tuple[str, str]] = {
    "handling": ("Handling", "ISO 4138, ISO 7401, ISO 14791"),
    "stability": ("Stability", "FMVSS 126, UN R140, ISO 3888-1, ISO 3888-2"),
    "rollover": ("Rollover", "NHTSA, 49 CFR 575.106"),
    "braking": ("Braking", "UN R13-H, ISO 7975"),
    "ride": ("Ride", "ISO 8608, ISO 2631-1"),
}
"""Titles and procedures of the groups of maneuvers."""

VERDICTS = {
    "pass": ("passed", "Passed"),
    "fail": ("failed", "Failed"),
    "error": ("failed", "Error"),
    "comparison": ("open", "Comparison"),
    "dropped": ("open", "Left out"),
    "info": ("open", "No limit"),
}
"""CSS class and text of the badges."""

CHANGES = {
    "better": ("passed", "better"),
    "worse": ("failed", "worse"),
    "same": ("same", "same"),
    "not_comparable": ("open", "not comparable"),
}

DATA = {
    "class": "Car up to 3,500 kg, truck above; regulatory limits apply to cars only.",
    "mass": "Mass of the vehicle, or the sum of its tire loads in the first row divided by 9.81 m/s².",
    "width": "Largest width; it determines the footprint between cones and the width of the driver's lanes.",
    "front": "From the reference point to the front bumper.",
    "rear": "From the reference point to the rear bumper.",
    "wheelbase": "Distance between two axles. With more axles, the wheelbase of a two-axle vehicle that turns equally "
    "(Winkler): L (1 + (T/L²) (1 + C_r/C_f)), with L from the front axle to the mean position of the other axles, T "
    "their mean square distance from this position, and the cornering stiffness C.",
    "steer_ratio": "Steering-wheel angle divided by front-wheel angle.",
    "understeer_gradient": "Front-wheel angle per lateral acceleration, known to the driver model.",
}
"""Definitions of the vehicle data."""

FLAGS = {
    "spun": "spun",
    "rolled_over": "rolled over",
    "lost": "lost the path",
    "not_finished": "did not reach the end",
    "not_settled": "did not settle",
    "diverged": "broke down",
}

# The road class for which tire loads are shown by wheel.
ROAD = "c"


def words(name: str) -> str:
    """Format the name of a maneuver."""
    known = {"iso3888_1": "ISO 3888-1", "iso3888_2": "ISO 3888-2", "j_turn": "J-turn"}
    text = known.get(name, name.replace("_", " "))
    return text[:1].upper() + text[1:]


def shown(value: Number, row: Row) -> str:
    """Format the value of a metric, with angles in degrees."""
    if value is None:
        return "–"
    if isinstance(value, bool):
        return "yes" if value else "no"
    factor, _ = unit_of(row)
    return tables.number(factor * value, None)


def value(row: Row, system: Name) -> str:
    """Format the value for a system, or the bound that replaces a missing value."""
    number = row.without if system == "without" else row.with_
    return row.bounds.get(system, "–") if number is None else shown(number, row)


def notes(row: Row, cases: Sequence[Case]) -> list[str]:
    """Describe why values are missing or not comparable, and at which speed or amplitude they were compared."""
    if len(cases) == 1:
        return [row.reason] if row.reason else []
    found = []
    if row.without is None and row.reason_without and (row.with_ is not None or row.reason_without != row.reason):
        found.append(f"without controllers: {row.reason_without}")
    if row.reason:
        # The reason can also be that a limit does not apply.
        of = "with controllers: " if row.with_ is None and row.without is not None else ""
        found.append(f"{of}{row.reason}")
    if row.compared is not None:
        both = " and ".join(shown(row.compared[system], row) for system in ("without", "with"))
        found.append(f"compared at {tables.number(row.compared['at'], None)} {row.compared['at_unit']}: {both}")
    if row.incomparable and row.without is not None and row.with_ is not None:
        found.append(f"not comparable: {row.incomparable}")
    return found


def unit_of(row: Row) -> tuple[float, str]:
    """Return the unit that a metric is shown in, and the factor to it."""
    if row.unit.startswith("rad"):
        return 180.0 / math.pi, tables.pretty_unit("deg" + row.unit.removeprefix("rad"))
    return 1.0, tables.pretty_unit(row.unit)


def limit(row: Row) -> str:
    """Format the limit of a metric."""
    if row.limit is None:
        return ""
    if "is" in row.limit:
        return "yes"
    factor, unit = unit_of(row)
    low, high = (factor * row.limit[end] if end in row.limit else None for end in ("min", "max"))
    return _native.limits(low, high, unit)


def systems(found: Assessment) -> tuple[Case, ...]:
    """Return the systems as cases for figures."""
    if len(found.systems) == 1:
        return (Case("without", found.plant["fmu"], None),)
    return Case("without", "Without controllers", None), Case("with", "With controllers", "without")


def units(found: Assessment) -> str:
    """Return a phrase with the FMUs of the assessment."""
    plant = " and ".join([found.plant["fmu"], *(unit["fmu"] for unit in found.base)])
    controllers = ", ".join(unit["fmu"] for unit in found.with_)
    return f"{plant}, without and with {controllers}" if controllers else plant


def _loads(found: Assessment, cases: Sequence[Case]) -> Iterator[tuple[str, Sequence[tuple[Case, float]]]]:
    of: dict[Case, list[dict[str, Any]]] = {}
    for case in cases:
        on_road = [run for run in found.runs_of("ride", case.name) if run.name.split(".")[1] == ROAD]
        of[case] = [run.metrics.get("dynamic_load_coefficient") or {} for run in on_road]
    for wheel in dict.fromkeys(name for runs in of.values() for run in runs for name in run):
        values = []
        for case, runs in of.items():
            known = [float(run[wheel]) for run in runs if isinstance(run.get(wheel), (int, float))]
            if known and len(known) == len(runs):
                values.append((case, sum(known) / len(known)))
        if values:
            yield wheel, values


def _troubles(found: Assessment, cases: Sequence[Case]) -> list[tuple[str, list[tuple[Case, Run]]]]:
    """Return the runs with a flag or an error, by flag."""
    by_flag: dict[str, list[tuple[Case, Run]]] = {}
    for case, run in itertools.product(cases, found.runs):
        for flag in run.flags if run.system == case.name else ():
            by_flag.setdefault(FLAGS.get(flag, flag), []).append((case, run))
    return list(by_flag.items())


def render(found: Assessment, folder: Folder, command: str) -> str:
    """Return the page, and write its figures beside it."""
    source = Source(found, folder, systems(found))
    drawings = rendering.Drawings(source.cases, folder.path / "figures")
    sections = []
    for suite, (title, procedures) in SUITES.items():
        rows = [row for row in found.metrics if row.suite == suite]
        if not rows:
            continue
        maneuvers: dict[str, list[Row]] = {}
        for row in rows:
            maneuvers.setdefault(row.maneuver, []).append(row)
        charts = [chart for make in CHARTS[suite] if (chart := make(source)) is not None]
        replays = [(words(name), link) for name in maneuvers if (link := _replay(found, name, folder.path)) is not None]
        loads = list(_loads(found, source.cases)) if suite == "ride" else []
        sections.append(
            {
                "title": title,
                "procedures": procedures,
                "maneuvers": maneuvers.items(),
                "has_amplitude": any(row.unit == "A" for row in rows),
                "drawings": [drawings.draw(chart) for chart in charts],
                "loads": loads,
                "largest_load": max((value for _, values in loads for _, value in values), default=1.0),
                "replays": replays,
            }
        )
    return rendering.render(
        "assess.html.j2",
        paragraphs=(),
        found=found,
        units=units(found),
        cases=source.cases,
        sections=sections,
        counts=counts(found),
        changes=changes(found),
        troubles=_troubles(found, source.cases),
        interactive=drawings.interactive,
        command=command,
        value=value,
        notes=lambda row: notes(row, source.cases),
        unit_of=unit_of,
        limit=limit,
        words=words,
        pretty_unit=tables.pretty_unit,
        is_signal=is_signal,
        signed=tables.signed,
        number=lambda value: tables.number(value, None),
        verdict_badges=VERDICTS,
        change_badges=CHANGES,
        road=ROAD.upper(),
        verdicts=[row for row in found.metrics if {row.verdict, row.verdict_without} != {"info"}],
        data_definitions=DATA,
        seeds=list(dict.fromkeys(f"{run.parameters['seed']:g}" for run in found.runs if "seed" in run.parameters)),
    )


def _replay(found: Assessment, maneuver: str, folder: Path) -> str | None:
    """Return the address of a maneuver's replay in the lab: its last run, or the run at the highest entry speed.

    The lab contains only the FMUs of the library, with their default parameters, and replays one run at a time.
    """
    runs = found.runs_of(maneuver, found.systems[-1])
    units = [unit["fmu"] for unit in (found.plant, *found.base, *found.with_)]
    if not runs or not all(lab.has(unit) for unit in units):
        return None
    parameters = runs[-1].parameters
    values = {"speed": parameters["speed"]}
    entry = found.by_name.get(f"{maneuver}.max_entry_speed")
    largest = None if entry is None else entry.with_ if len(found.systems) > 1 else entry.without
    if largest is not None:
        values["speed"] = largest / 3.6
    if "amplitude" in parameters:
        values["steering_wheel"] = math.radians(parameters["amplitude"])
    return lab.of_system(found.plant["fmu"], [unit["fmu"] for unit in found.with_], maneuver, values, folder)


def is_signal(value: str) -> bool:
    """Return whether the test bench sets an input to a signal, such as `driver.steer`, instead of a constant."""
    return re.fullmatch(r"[A-Za-z]\w*\.[A-Za-z][\w.]*", value) is not None


def counts(found: Assessment) -> dict[str, int]:
    """Count the verdicts on the system with controllers, or on the only system."""
    verdicts = [row.verdict for row in found.metrics]
    numbers = {"passed": verdicts.count("pass"), "failed": verdicts.count("fail") + verdicts.count("error")}
    return {name: count for name, count in numbers.items() if count}


def changes(found: Assessment) -> dict[str, int]:
    """Count the metrics that the controllers improve or worsen."""
    judgments = [row.judgment for row in found.metrics]
    return {name: judgments.count(name) for name in ("better", "same", "worse", "not_comparable")}


def write(found: Assessment, folder: Folder, command: str) -> Path:
    """Write the page and the list of all results; returns the path of the page."""
    entry = index.Entry(f"Test bench: {units(found)}", "", counts(found))
    return index.write(folder.path, render(found, folder, command), entry)

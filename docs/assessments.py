"""Assess the vehicles of the library with the controllers of their papers, and write docs/assessments.md.

Call `.venv/bin/python docs/assessments.py` after `scripts/setup --all` and `scripts/build`.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from chassis_fmu.assess.assessment import Assessment, Folder, Name, Number, Row
from chassis_fmu.assess.report import words
from chassis_fmu.program import ROOT
from tune_on_bench import TUNINGS, driven


@dataclass(frozen=True)
class System:
    """A vehicle with controllers, and notes on the results: `{SYSTEM.METRIC}` in a note inserts a value."""

    plant: str
    title: str
    controllers: tuple[str, ...]
    notes: tuple[str, ...]


SYSTEMS = (
    System(
        "EspCar",
        "yaw control and antilock brakes",
        ("DirectYawControl", "AntilockBraking"),
        (
            "Without controllers, the car spins in sine with dwell from {without.sine_with_dwell.unstable_from} A on. "
            "Yaw control keeps it stable by braking single wheels. This takes away so much speed that the lateral "
            "displacement is only {with.sine_with_dwell.lateral_displacement} m.",
            "Because of this braking, the car leaves ISO 3888-2 at {with.iso3888_2.exit_speed} m/s instead of "
            "{without.iso3888_2.exit_speed} m/s, with a lower entry speed.",
            "On split friction, the antilock brakes hold the wheels on the slippery side at their limit and brake the "
            "other side fully. To keep the car straight, the driver turns the steering wheel by "
            "{with.split_friction.steering_wheel_peak_2s} degrees in the first two seconds and by "
            "{with.split_friction.steering_wheel_peak} degrees in total; 120 and 240 degrees are allowed. Cars that "
            "pass let the brake pressure on the high-friction side rise slowly. Without antilock brakes, the steering "
            "wheel reaches {without.split_friction.steering_wheel_peak} degrees, the limit of the driver model (12 "
            "rad).",
            "In braking in a turn, the front wheels of the car without antilock brakes lock, and the car goes "
            "straight on: after 1 s, its yaw rate is {without.brake_in_turn.yaw_rate_ratio_1s} times the yaw rate on "
            "the circle.",
        ),
    ),
    System(
        "EspCar",
        "all controllers, coordinated",
        ("FiniteStateCoordination", "SemiActivePidSuspension", "DirectYawControl", "AntilockBraking"),
        (
            "The displacement in sine with dwell is only {with.sine_with_dwell.lateral_displacement} m, because the "
            "coordination switches the antilock brakes off while the driver does not brake: the brake pressures from "
            "yaw control then lock wheels. The same controllers without coordination, but with `enable.antilock` at "
            "0, lock the same wheels and give an equally small displacement. An earlier reaction of yaw control is "
            "not the cause: yaw control waits for the driving state `turning`.",
            "The coordination improves ride and roll, by means of the semi-active suspension.",
        ),
    ),
    System(
        "RescueVehicle",
        "coordinated steering and active suspension",
        (
            "FuzzyCoordination",
            "DualSlidingModeSteering",
            "IntegratedLqrSuspension",
            "RollLqrSuspension",
            "SuspensionMixer",
        ),
        (
            "Steering the middle and rear axles makes the vehicle understeer: the understeer gradient rises to "
            "{with.slowly_increasing_steer.understeer_gradient} rad/(m/s2). In the fishhook, it halves the lateral "
            "acceleration and therefore the load transfer.",
            "In ISO 3888-2, the driver cannot turn the vehicle fast enough: the vehicle leaves the path at 20 km/h, "
            "the lowest speed of the bench, so no other speed is driven. `--adapt`, which gives the driver model the "
            "understeer gradient of the vehicle with controllers, does not change this.",
        ),
    ),
    System(
        "HeavyVehicle",
        "six-wheel steering",
        ("YawRateReference", "ActiveFrontSteering", "AllWheelSteering"),
        (
            "With six-wheel steering, the truck is faster through ISO 3888-1. In the fishhook, it reaches a higher "
            "lateral acceleration, so the load transfer is larger, too.",
            "ISO 3888-2 is designed for cars: at 20 km/h, the truck is outside of the third section by a few "
            "centimeters, with and without controllers.",
        ),
    ),
    System(
        "HydroPneumaticHalfCar",
        "switched sliding mode control",
        ("ComfortSlidingMode", "HandlingSlidingMode", "SuspensionSwitch"),
        (
            "The tires of this model do not lose grip, so the vehicle tips over in fishhook and J-turn at their "
            "lowest speed. The controllers act on the suspension and cannot prevent this.",
            "In ISO 3888-2, the rear corner of the vehicle swings over the edge of the first section at 30 km/h, the "
            "lowest speed for cars, so no other speed is driven.",
        ),
    ),
)


@dataclass(frozen=True)
class Tuned:
    """Metrics for which the page compares the values of docs/tune_on_bench.py with the values of the paper."""

    name: str
    """Name of the tuning and of the parameter set."""
    title: str
    metrics: tuple[str, ...]
    suites: tuple[str, ...]
    others: Mapping[str, Sequence[str]] = field(default_factory=dict)
    """Conditions that the search did not include: titles and values (`--set`)."""


SPEEDS = ("iso3888_1.max_entry_speed", "iso3888_2.max_entry_speed")
LOADS = ("fishhook.load_transfer_peak", "j_turn.load_transfer_peak")
CAR = ("sine_with_dwell.stable", "sine_with_dwell.lateral_displacement", *SPEEDS, LOADS[0])
RIDE = ("ride.c.heave_weighted", "ride.c.dynamic_load_coefficient", "ride.c.suspension_travel_rms")
STABILITY = ("stability", "rollover")

TUNED = (
    Tuned(
        "bench_esp_car", "EspCar, tuned for friction 0.77", CAR, STABILITY, TUNINGS["bench_esp_car_friction"].conditions
    ),
    Tuned("bench_esp_car_friction", "EspCar, tuned for friction 0.6 to 0.9", CAR, STABILITY),
    Tuned("bench_rescue_vehicle", "RescueVehicle", ("sine_with_dwell.unstable_from", *SPEEDS, *LOADS), STABILITY),
    Tuned("bench_heavy_vehicle", "HeavyVehicle", (*SPEEDS, *LOADS), STABILITY),
    Tuned("bench_hydro_pneumatic_half_car", "HydroPneumaticHalfCar", RIDE, ("ride",)),
)


class Reference(NamedTuple):
    """A value from the independent implementation of the bench, as given in its specification."""

    plant: str
    quantity: str
    unit: str
    ours: str
    """Our value: a metric, or `RUN:METRIC` for a metric of a single run."""
    without: str
    with_: str
    """Value with the controllers of the first system of the plant."""
    coordinated: str
    why: str
    """Key of `WHY`: difference from the value in the tables of the page."""


# Section 10 of the specification of the bench.
REFERENCES = """\
EspCar | A | deg | slowly_increasing_steer.A | 20.6 | | |
EspCar | understeer gradient | | slowly_increasing_steer.understeer_gradient | 0.001916 | | |
EspCar | step steer, overshoot of the yaw rate | | step_steer.yaw_rate.overshoot | 0.062 | 0.033 | |
EspCar | step steer, response time | s | step_steer.yaw_rate.response_time | 0.200 | 0.169 | |
EspCar | sine with dwell, unstable from | A | sine_with_dwell.unstable_from | 3 | | |
EspCar | sine with dwell, displacement at 5 A | m | sine_with_dwell.left.103.0:lateral_displacement | 2.57 | | |
EspCar | sine with dwell, displacement at 5 A | m | sine_with_dwell.left.103.0:lateral_displacement | | 1.69 | | min
EspCar | sine with dwell, displacement at 270 deg | m | sine_with_dwell.left.270.0:lateral_displacement | | 1.22 | | min
EspCar | sine with dwell, displacement at 270 deg | m | sine_with_dwell.lateral_displacement | | | 0.71 |
EspCar | braking, MFDD | m/s2 | braking.mfdd | 5.81 | 6.72 | 6.73 |
EspCar | braking, distance | m | braking.distance | 71.5 | 60.6 | 60.1 |
EspCar | split friction, yaw angle | rad | split_friction.yaw_peak | 2.1 | 0.36 | |
EspCar | split friction, offset | m | split_friction.lateral_peak | | 0.74 | |
EspCar | split friction, steering wheel in 2 s | deg | split_friction.steering_wheel_peak_2s | | 504 | |
EspCar | split friction, steering wheel | deg | split_friction.steering_wheel_peak | | 636 | |
EspCar | brake in turn, yaw rate ratio | | brake_in_turn.yaw_rate_ratio_1s | 0.01 | | |
EspCar | brake in turn, yaw rate ratio | | brake_in_turn.yaw_rate_ratio_1s | | 1.18 | 0.95 | cycles
EspCar | ISO 3888-1 | km/h | iso3888_1.max_entry_speed | 78.75 | 78.75 | | bisection
EspCar | ISO 3888-2 | km/h | iso3888_2.max_entry_speed | 51.25 | 47.5 | | bisection
EspCar | ride, class C | m/s2 | ride.c.1:vibration_total | 0.718 | | 0.605 | seed
RescueVehicle | ISO 3888-1 | km/h | iso3888_1.max_entry_speed | 38.75 | 46.25 | | bisection
RescueVehicle | ISO 3888-2 | km/h | iso3888_2.max_entry_speed | 21.25 | | | bisection
RescueVehicle | ISO 3888-2 | km/h | iso3888_2.max_entry_speed | | none | |
RescueVehicle | fishhook, load transfer | | fishhook.load_transfer_peak | 0.66 | 0.33 | |
HeavyVehicle | ISO 3888-1 | km/h | iso3888_1.max_entry_speed | 55 | 66.25 | | bisection
HeavyVehicle | fishhook, load transfer | | fishhook.load_transfer_peak | 0.81 | 0.92 | |
HydroPneumaticHalfCar | ISO 3888-1 | km/h | iso3888_1.max_entry_speed | 70 | 70 | | bisection
HydroPneumaticHalfCar | fishhook, rolls over at | mph | fishhook.lift_speed | 35 | 35 | |"""

WHY = {
    "": "",
    "min": "the table above gives the least displacement of all runs from 5 A on",
    "bisection": "we bisect to 0.5 km/h, the reference to 1.25 km/h",
    "cycles": "see below",
    "seed": "seed 1; the table above gives the mean of three seeds",
}

# The metrics that the page shows for each system.
METRICS = (
    "slowly_increasing_steer.understeer_gradient",
    "step_steer.yaw_rate.response_time",
    "step_steer.yaw_rate.overshoot",
    "single_lane_change.overshoot",
    "sine_with_dwell.stable",
    "sine_with_dwell.unstable_from",
    "sine_with_dwell.lateral_displacement",
    "iso3888_1.max_entry_speed",
    "iso3888_2.max_entry_speed",
    "fishhook.no_lift",
    "fishhook.load_transfer_peak",
    "j_turn.no_lift",
    "j_turn.load_transfer_peak",
    "braking.mfdd",
    "braking.distance",
    "split_friction.held",
    "split_friction.yaw_peak",
    "split_friction.steering_wheel_peak_2s",
    "split_friction.steering_wheel_peak",
    "brake_in_turn.yaw_rate_ratio_1s",
    "ride.c.vibration_total",
    "ride.c.dynamic_load_coefficient",
)

PAGE = ROOT / "docs" / "assessments.md"

HEAD = """# The library on its test bench

This page shows the effect of the papers' controllers outside of the papers' maneuvers: each vehicle drives through the
[test bench](guide/src/assess.md) without and with its controllers. `docs/assessments.py` writes this page.

The bench follows procedures of standards; it certifies nothing. *Passed* and *failed* refer to limits of regulations
that apply to the vehicle. *Better*, *worse* and *same* compare with the vehicle without controllers; *same* is a change
below 1 %.
"""

VERDICTS = {"pass": "passed", "fail": "**failed**", "error": "**error**", "comparison": "", "info": "", "dropped": ""}


def assessed(plant: str, controllers: Sequence[str], more: Sequence[str] = ()) -> Assessment:
    return driven(ROOT / "target" / "assessments" / plant, plant, controllers, more)


def number(value: Number) -> str:
    if value is None:
        return "–"
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:.4g}"


def value(found: Assessment, system: str, name: str) -> Number:
    row = found.by_name[name]
    return row.with_ if system == "with" else row.without


def note(text: str, found: Assessment) -> str:

    def fill(place: re.Match[str]) -> str:
        return number(value(found, *place[1].split(".", 1)))

    return re.sub(r"\{([^}]+)\}", fill, text)


def line(row: Row) -> str:
    judged = None if row.judgment is None else row.judgment.replace("_", " ")
    if row.compared is not None and judged is not None:
        judged += f" at {row.compared['at']:.4g} {row.compared['at_unit']}"
    parts = [judged, VERDICTS[row.verdict], row.reason if row.with_ is None else None]
    cells = (
        label(row),
        "" if row.unit == "1" else row.unit,
        number(row.without),
        number(row.with_),
        ", ".join(part for part in parts if part),
    )
    return f"| {' | '.join(cells)} |"


def section(system: System, found: Assessment) -> list[str]:
    lines = [
        "",
        f"## {system.plant} with {system.title}",
        "",
        f"Controllers: {', '.join(f'`{name}`' for name in system.controllers)}.",
        "",
        "| metric | unit | without | with | |",
        "|---|---|---|---|---|",
        *(line(found.by_name[name]) for name in METRICS if name in found.by_name),
        "",
        *(f"- {note(text, found)}" for text in system.notes),
    ]
    if found.dropped:
        left = "; ".join(f"{words(dropped['run'])} ({dropped['reason']})" for dropped in found.dropped)
        lines += ["", f"Left out: {left}."]
    broken = [f"{run.system} {run.name}" for run in found.runs if run.error]
    if broken:
        lines += ["", f"Failed runs: {', '.join(broken)}."]
    return lines


def compared(plant: str, is_coordinated: bool, found: Assessment) -> Iterator[str]:
    """Return the table rows that compare with the independent implementation."""
    references = (Reference(*(cell.strip() for cell in row.split("|"))) for row in REFERENCES.splitlines())
    for of in (of for of in references if of.plant == plant):
        quantity = ", ".join(filter(None, (of.quantity, "coordinated" if is_coordinated else "", of.unit)))
        systems: dict[Name, str] = (
            {"with": of.coordinated} if is_coordinated else {"without": of.without, "with": of.with_}
        )
        for system, theirs in systems.items():
            if theirs:
                run_name, _, metric = of.ours.partition(":")
                if metric:
                    runs = (run for run in found.runs if (run.name, run.system) == (run_name, system))
                    ours: Number = float(next(runs).metrics[metric])
                else:
                    ours = value(found, system, run_name)
                yield f"| {plant} | {quantity} | {system} | {theirs} | {number(ours)} | {WHY[of.why]} |"


def turning(found: Assessment, controllers: Sequence[str]) -> str:
    """Explain how strongly the yaw rate ratio in braking in a turn depends on details of the run."""
    run = next(run for run in found.runs_of("brake_in_turn", "with"))
    recording = Folder(ROOT / "target" / "assessments" / found.plant["fmu"]).recording("with", run.name)
    if recording is None:
        raise SystemExit("error: the run of braking in a turn was not recorded")
    v, times = recording.values, recording.times
    # Braking begins at 16 s, so the ratio is read at 17 s.
    ratio = np.abs(v["vehicle.yaw_rate"]) * run.metrics["radius"] / v["vehicle.speed"]
    before, after = (float(np.interp(17.0 + step, times, ratio)) for step in (-0.01, 0.01))
    base = ["--suite", "braking", "--base", "BrakeAndDriveActuators"]
    other = assessed(found.plant["fmu"], controllers, base).by_name["brake_in_turn.yaw_rate_ratio_1s"]
    return (
        "The yaw rate ratio in braking in a turn is read at one instant, 1 s after braking begins, while the antilock "
        "brakes raise and lower the pressures. With yaw control and antilock brakes, it changes "
        f"from {before:.3f} to {after:.3f} between 0.99 and 1.01 s. If the controller cycle is broken at another "
        f"controller (`--base BrakeAndDriveActuators` before `--with`), it is {number(other.with_)}. The difference "
        "from the reference is smaller than these changes; its cause is not known."
    )


COMPARED_HEAD = """
## Comparison with an independent implementation

The reference numbers are from an independent implementation of the bench, the driver, the vehicles and the controllers.
If a table above defines a quantity differently, the last column describes the difference.

| vehicle | quantity | controllers | reference | ours | |
|---|---|---|---|---|---|
"""


def tuned_section(tuned: Tuned) -> list[str]:
    tuning = TUNINGS[tuned.name]
    file = f"modelDescription/parameters/{tuned.name}.ssv"
    controllers = "".join(f" --with {name}" for name in tuning.controllers)
    lines = [
        "",
        f"### {tuned.title}",
        "",
        "```sh",
        f"chassis bench run {tuning.plant}{controllers} --parameters {file}",
        "```",
        "",
        "| condition | metric | unit | without | paper | tuned |",
        "|---|---|---|---|---|---|",
    ]
    suites = [part for suite in tuned.suites for part in ("--suite", suite)]
    missed = []
    for title, values in {"unchanged": (), **tuning.conditions, **tuned.others}.items():
        settings = [part for value in values for part in ("--set", value)]
        paper = assessed(tuning.plant, tuning.controllers, [*suites, *settings])
        ours = assessed(tuning.plant, tuning.controllers, [*suites, *settings, "--parameters", file])
        for name in tuned.metrics:
            row, other = paper.by_name[name], ours.by_name[name]
            unit = "" if row.unit == "1" else row.unit
            numbers = (number(row.without), number(row.with_), number(other.with_))
            lines.append(f"| {title} | {label(row)} | {unit} | {' | '.join(numbers)} |")
        is_searched = title == "unchanged" or title in tuning.conditions
        where = title if is_searched else f"{title}, not in the search"
        missed += [
            f"- Requirement missed ({where}): {label(ours.by_name[requirement.metric])}, by {share:.1%}."
            for requirement in tuning.requirements
            if (share := requirement.missed_by(ours)) > 0.0
        ]
    return [*lines, "", *(missed or ["All requirements of the search are met."])]


def label(row: Row) -> str:
    return f"{words(row.maneuver)}: {row.title[:1].lower()}{row.title[1:]}"


TUNED_HEAD = """
## Tuned on the bench

`docs/tune_on_bench.py` searches for better values of some controller parameters. The values are not those of the
papers: they are fitted to the bench, with the same vehicles and control laws. The search requires the limits of sine
with dwell for the car, and stability in sine with dwell for the rescue vehicle. Compared with the vehicle without
controllers, and with a slack of 1 %, entry speeds must not be lower, load transfers of the truck must not be higher,
and wheel loads of the half car must not vary more. The requirements apply to all conditions in a table, except those
marked *not in the search* in the list below it. Values for rides are means over three roads. A dash means that the
maneuver fails at its lowest speed.
"""


def main() -> None:
    lines = HEAD.splitlines()
    beside: list[str] = []
    for system in SYSTEMS:
        found = assessed(system.plant, system.controllers)
        lines += section(system, found)
        beside += compared(system.plant, "FiniteStateCoordination" in system.controllers, found)
        if system is SYSTEMS[0]:
            explanation = turning(found, system.controllers)
        print(f"{system.plant}: {system.title}", file=sys.stderr)
    lines += [*COMPARED_HEAD.rstrip().splitlines(), *beside, "", explanation]
    lines += TUNED_HEAD.rstrip().splitlines()
    for tuned in TUNED:
        lines += tuned_section(tuned)
        print(f"{TUNINGS[tuned.name].plant}: tuned on the bench", file=sys.stderr)
    PAGE.write_text("\n".join(lines) + "\n", encoding="utf-8")
    print(PAGE.relative_to(ROOT))


if __name__ == "__main__":
    main()

"""Assesses the vehicles of the library with the controllers of their papers, and writes docs/assessments.md.

`.venv/bin/python scripts/assess_library.py`, after `scripts/build`; takes some minutes.
"""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from chassis_fmu.assess.assessment import Assessment, Folder, Number, Row
from chassis_fmu.assess.report import words
from chassis_fmu.shell import ROOT


@dataclass(frozen=True)
class System:
    """A vehicle with controllers, and what their numbers mean: `{SYSTEM.METRIC}` in a note is a number of the run."""

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
            "Without controllers the car spins in sine with dwell from {without.sine_with_dwell.unstable_from} A on. "
            "Yaw control keeps it stable by braking single wheels, and the braking takes so much speed that the car is "
            "moved to the side by only {with.sine_with_dwell.lateral_displacement} m.",
            "The same braking makes the car leave ISO 3888-2 at {with.iso3888_2.exit_speed} instead of "
            "{without.iso3888_2.exit_speed} m/s, at an entry speed that is lower.",
            "On split friction the antilock brakes hold the slippery side at its limit and brake the other one fully; "
            "the driver has to steer against it with {with.split_friction.steering_wheel_peak} degrees. Cars that pass "
            "let the brake pressure of the better side rise slowly.",
            "While braking in the turn the front wheels of the car without antilock brakes lock, and it goes straight "
            "on: its yaw rate after 1 s is {without.brake_in_turn.yaw_rate_ratio_1s} of that of the circle.",
        ),
    ),
    System(
        "EspCar",
        "all controllers, coordinated",
        ("FiniteStateCoordination", "SemiActivePidSuspension", "DirectYawControl", "AntilockBraking"),
        (
            "Coordination lets yaw control act earlier: the displacement of sine with dwell is "
            "{with.sine_with_dwell.lateral_displacement} m. What it adds is ride and roll: the semi-active suspension.",
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
            "The steering of the middle and the rear axle makes the vehicle understeer: the understeer gradient rises "
            "to {with.slowly_increasing_steer.understeer_gradient} rad/(m/s2). It halves the load transfer of the "
            "fishhook, because it halves the lateral acceleration.",
            "In ISO 3888-2 the driver cannot turn the vehicle fast enough: at the lowest speed of the bench it loses "
            "the path. `--adapt`, with which the driver knows the vehicle with controllers, does not change that.",
        ),
    ),
    System(
        "HeavyVehicle",
        "six-wheel steering",
        ("YawRateReference", "ActiveFrontSteering", "AllWheelSteering"),
        (
            "Six-wheel steering is faster through ISO 3888-1. In the fishhook it lets the truck reach more lateral "
            "acceleration, so that the load transfer is larger, too.",
            "ISO 3888-2 is made for cars: at 20 km/h both systems miss the third section by some centimeters.",
        ),
    ),
    System(
        "HydroPneumaticHalfCar",
        "switched sliding mode control",
        ("ComfortSlidingMode", "HandlingSlidingMode", "SuspensionSwitch"),
        (
            "The tires of this model lose no grip, so that fishhook and J-turn tip it over at their lowest speed; its "
            "controllers act on the suspension and cannot prevent that.",
            "In ISO 3888-2 its rear corner swings over the edge of the first section, at any speed of the bench.",
        ),
    ),
)


@dataclass(frozen=True)
class Tuned:
    """Controllers with values of scripts/tune_on_bench.py, beside those of the paper."""

    plant: str
    controllers: tuple[str, ...]
    parameters: str
    metrics: tuple[str, ...]
    suites: tuple[str, ...]
    conditions: tuple[tuple[str, tuple[str, ...]], ...]
    """Titles of other conditions, and the values that make them (`--set`)."""
    notes: tuple[str, ...]


TUNED = (
    Tuned(
        "EspCar",
        ("DirectYawControl", "AntilockBraking"),
        "bench_esp_car",
        (
            "sine_with_dwell.stable",
            "sine_with_dwell.lateral_displacement",
            "iso3888_1.max_entry_speed",
            "iso3888_2.max_entry_speed",
            "fishhook.load_transfer_peak",
        ),
        ("stability", "rollover"),
        (("friction 0.6 instead of 0.77", ("esp_car:tire.friction=0.6", "direct_yaw_control:tire.friction=0.6")),),
        (),
    ),
    Tuned(
        "RescueVehicle",
        (
            "FuzzyCoordination",
            "DualSlidingModeSteering",
            "IntegratedLqrSuspension",
            "RollLqrSuspension",
            "SuspensionMixer",
        ),
        "bench_rescue_vehicle",
        (
            "sine_with_dwell.unstable_from",
            "iso3888_1.max_entry_speed",
            "iso3888_2.max_entry_speed",
            "fishhook.load_transfer_peak",
            "j_turn.load_transfer_peak",
        ),
        ("stability", "rollover"),
        (
            ("friction 0.5 instead of 0.7", ("rescue_vehicle:tire.friction=0.5",)),
            ("a mass of 30 t instead of 36 t", ("rescue_vehicle:vehicle.mass=30000.0",)),
        ),
        (),
    ),
    Tuned(
        "HeavyVehicle",
        ("YawRateReference", "ActiveFrontSteering", "AllWheelSteering"),
        "bench_heavy_vehicle",
        (
            "iso3888_1.max_entry_speed",
            "iso3888_2.max_entry_speed",
            "fishhook.load_transfer_peak",
            "j_turn.load_transfer_peak",
        ),
        ("stability", "rollover"),
        (),
        (),
    ),
    Tuned(
        "HydroPneumaticHalfCar",
        ("ComfortSlidingMode", "HandlingSlidingMode", "SuspensionSwitch"),
        "bench_hydro_pneumatic_half_car",
        (
            "ride.c.heave_weighted",
            "ride.c.dynamic_load_coefficient",
            "ride.c.suspension_travel_rms",
            "fishhook.no_lift",
            "j_turn.no_lift",
        ),
        ("ride", "rollover"),
        (),
        (),
    ),
)

# What the page shows of each.
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
    "split_friction.steering_wheel_peak",
    "brake_in_turn.yaw_rate_ratio_1s",
    "ride.c.vibration_total",
    "ride.c.dynamic_load_coefficient",
)

PAGE = ROOT / "docs" / "assessments.md"

HEAD = """# The library on its test bench

What the controllers of the papers are worth outside the maneuvers of the papers: each vehicle goes through the
[test bench](guide/src/assess.md) without and with them. `scripts/assess_library.py` writes this page.

The bench follows procedures of standards; it certifies nothing. *Passed* and *failed* are about limits of regulations
that apply to the vehicle. *Better* and *worse* compare with the same vehicle without the controllers; a change below
1 % is *same*.
"""

VERDICTS = {"pass": "passed", "fail": "**failed**", "error": "**error**", "comparison": "", "info": "", "dropped": ""}


def assessed(plant: str, controllers: Sequence[str], more: Sequence[str] = ()) -> Assessment:
    """Assess a vehicle."""
    out = ROOT / "target" / "assessments" / plant
    command = ["cargo", "fmu", "assess", plant, "--out", str(out), *more]
    for controller in controllers:
        command += ["--with", controller]
    done = subprocess.run(command, cwd=ROOT, stdout=subprocess.DEVNULL, check=False)
    if done.returncode not in (0, 1):
        raise SystemExit(f"error: {' '.join(command)}: exit code {done.returncode}")
    return Folder(out).read()


def number(value: Number) -> str:
    """Write a value."""
    if value is None:
        return "–"
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:.4g}"


def note(text: str, found: Assessment) -> str:
    """Fill the numbers of an assessment into a note."""

    def fill(place: re.Match[str]) -> str:
        system, name = place[1].split(".", 1)
        row = found.by_name[name]
        return number(row.with_ if system == "with" else row.without)

    return re.sub(r"\{([^}]+)\}", fill, text)


def line(row: Row) -> str:
    """Return the line of a metric."""
    parts = [row.judgment, VERDICTS[row.verdict], row.reason if row.with_ is None else None]
    cells = (
        f"{words(row.maneuver)}: {row.title[:1].lower()}{row.title[1:]}",
        "" if row.unit == "1" else row.unit,
        number(row.without),
        number(row.with_),
        ", ".join(part for part in parts if part),
    )
    return f"| {' | '.join(cells)} |"


def section(system: System, found: Assessment) -> list[str]:
    """Return the lines of a system."""
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
        left = "; ".join(f"{words(dropped.run)} ({dropped.reason})" for dropped in found.dropped)
        lines += ["", f"Left out: {left}."]
    broken = [f"{run.system} {run.name}" for run in found.runs if run.error]
    if broken:
        lines += ["", f"Runs that broke down: {', '.join(broken)}."]
    return lines


def tuned_section(tuned: Tuned) -> list[str]:
    """Return the lines of tuned controllers."""
    file = f"modelDescription/parameters/{tuned.parameters}.ssv"
    lines = [
        "",
        f"### {tuned.plant}",
        "",
        f"`cargo fmu assess {tuned.plant} --parameters {file}` with {', '.join(f'`{c}`' for c in tuned.controllers)}.",
        "",
        "| condition | metric | unit | without | paper | tuned |",
        "|---|---|---|---|---|---|",
    ]
    suites = [part for suite in tuned.suites for part in ("--suite", suite)]
    for title, values in (("as tuned", ()), *tuned.conditions):
        settings = [part for value in values for part in ("--set", value)]
        paper = assessed(tuned.plant, tuned.controllers, [*suites, *settings])
        ours = assessed(tuned.plant, tuned.controllers, [*suites, *settings, "--parameters", file])
        for name in tuned.metrics:
            row, other = paper.by_name[name], ours.by_name[name]
            label = f"{words(row.maneuver)}: {row.title[:1].lower()}{row.title[1:]}"
            unit = "" if row.unit == "1" else row.unit
            numbers = (number(row.without), number(row.with_), number(other.with_))
            lines.append(f"| {title} | {label} | {unit} | {' | '.join(numbers)} |")
    return [*lines, "", *(f"- {text}" for text in tuned.notes)] if tuned.notes else lines


TUNED_HEAD = """
## Tuned on the bench

`scripts/tune_on_bench.py` searches other values for some parameters of the controllers. They are not those of the
papers: the vehicle, the law and the bench are the same, the numbers are fitted to the bench. A dash is a maneuver that
fails at its lowest speed.
"""


def main() -> int:
    """Run the command; returns its exit code."""
    lines = HEAD.splitlines()
    for system in SYSTEMS:
        lines += section(system, assessed(system.plant, system.controllers))
        print(f"{system.plant}: {system.title}", file=sys.stderr)
    lines += TUNED_HEAD.rstrip().splitlines()
    for tuned in TUNED:
        lines += tuned_section(tuned)
        print(f"{tuned.plant}: tuned on the bench", file=sys.stderr)
    PAGE.write_text("\n".join(lines) + "\n", encoding="utf-8")
    print(Path(PAGE).relative_to(ROOT))
    return 0


if __name__ == "__main__":
    sys.exit(main())

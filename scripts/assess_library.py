"""Assesses the vehicles of the library with the controllers of their papers, and writes docs/assessments.md.

`.venv/bin/python scripts/assess_library.py`, after `scripts/build`; takes some minutes.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from chassis_fmu.shell import ROOT

# Vehicle, what controls it, and the FMUs of that.
SYSTEMS = (
    ("EspCar", "yaw control and antilock brakes", ("DirectYawControl", "AntilockBraking")),
    (
        "EspCar",
        "all controllers, coordinated",
        ("FiniteStateCoordination", "SemiActivePidSuspension", "DirectYawControl", "AntilockBraking"),
    ),
    (
        "RescueVehicle",
        "coordinated steering and active suspension",
        (
            "FuzzyCoordination",
            "DualSlidingModeSteering",
            "IntegratedLqrSuspension",
            "RollLqrSuspension",
            "SuspensionMixer",
        ),
    ),
    ("HeavyVehicle", "six-wheel steering", ("YawRateReference", "ActiveFrontSteering", "AllWheelSteering")),
    (
        "HydroPneumaticHalfCar",
        "switched sliding mode control",
        ("ComfortSlidingMode", "HandlingSlidingMode", "SuspensionSwitch"),
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


def assessed(plant: str, controllers: Sequence[str]) -> dict[str, Any]:
    """Assess a vehicle."""
    out = ROOT / "target" / "assessments" / plant
    command = ["cargo", "fmu", "assess", plant, "--out", str(out)]
    for controller in controllers:
        command += ["--with", controller]
    done = subprocess.run(command, cwd=ROOT, stdout=subprocess.DEVNULL, check=False)
    if done.returncode not in (0, 1):
        raise SystemExit(f"error: {' '.join(command)}: exit code {done.returncode}")
    found: dict[str, Any] = json.loads((out / "assessment.json").read_text(encoding="utf-8"))
    return found


def number(value: object) -> str:
    """Write a value."""
    if value is None:
        return "–"
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:.4g}"


def section(plant: str, title: str, controllers: Sequence[str], found: dict[str, Any]) -> list[str]:
    """Return the lines of a system."""
    names = ", ".join(f"`{name}`" for name in controllers)
    lines = [
        "",
        f"## {plant} with {title}",
        "",
        f"Controllers: {names}.",
        "",
        "| metric | unit | without | with | |",
        "|---|---|---|---|---|",
    ]
    rows = {row["id"]: row for row in found["metrics"]}
    for name in METRICS:
        row = rows.get(name)
        if row is None:
            continue
        unit = "" if row["unit"] == "1" else row["unit"]
        maneuver, title = name.split(".")[0].replace("_", " "), row["title"]
        words = [word for word in (row["judgment"], VERDICTS[row["verdict"]]) if word]
        if row["with"] is None and row["reason"]:
            words.append(row["reason"])
        cells = (f"{maneuver}: {title}", unit, number(row["without"]), number(row["with"]), ", ".join(words))
        lines.append(f"| {' | '.join(cells)} |")
    dropped = [f"{d['run'].replace('_', ' ')} ({d['reason']})" for d in found["dropped"]]
    if dropped:
        lines += ["", f"Left out: {'; '.join(dropped)}."]
    broken = [f"{run['system']} {run['id']}" for run in found["runs"] if run["error"]]
    if broken:
        lines += ["", f"Runs that broke down: {', '.join(broken)}."]
    return lines


def main() -> int:
    """Run the command; returns its exit code."""
    lines = HEAD.splitlines()
    for plant, title, controllers in SYSTEMS:
        lines += section(plant, title, controllers, assessed(plant, controllers))
        print(f"{plant}: {title}", file=sys.stderr)
    PAGE.write_text("\n".join(lines) + "\n", encoding="utf-8")
    print(Path(PAGE).relative_to(ROOT))
    return 0


if __name__ == "__main__":
    sys.exit(main())

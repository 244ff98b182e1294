"""Connections between Real and Boolean, in both masters, on FMUs of the library."""

from __future__ import annotations

import csv
import os
from collections.abc import Callable
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parents[2]
FOLDER = Path(os.environ.get("CHASSIS_FMU_DIR") or ROOT / "target" / "fmu")

# The brake pedal (a Real from 0 to 1) enables the first antilock logic, a Boolean input. Its Boolean flag is connected
# to a target slip of the second logic, a Real. The slip of all wheels is above 0.5 throughout.
SCENARIO = """
title = "Conversion"
reference = "None: a test."
[simulation]
stop = 1.0
step = 0.001
[[component]]
name = "driver"
fmu = "Driver"
parameters = { maneuver = "straight", "brake.amplitude" = 1.0, "brake.start" = 0.2, "brake.rise_time" = 0.4 }
[[component]]
name = "first"
fmu = "AntilockBraking"
[component.inputs]
"target_slip.*" = 0.2
"*pressure*" = 5.0
"vehicle.speed" = 20.0
"wheel_speed.*" = 25.0
[[component]]
name = "second"
fmu = "AntilockBraking"
[component.inputs]
"target_slip.f*" = 0.2
"target_slip.rr" = 0.2
"*pressure*" = 5.0
"vehicle.speed" = 20.0
"wheel_speed.*" = 25.0
"enable.antilock" = true
[[connection]]
from = "driver:driver.brake"
to = "first:enable.antilock"
[[connection]]
from = "first:antilock_active.fl"
to = "second:target_slip.rl"
[[case]]
name = "only"
title = "Only"
[record]
signals = ["driver:driver.brake", "first:antilock_active.fl", "second:antilock_active.r*", "second:brake_*"]
"""


def test_both_masters_convert_alike(tmp_path: Path, run_by_both_masters: Callable[[Path, Path], Path]) -> None:
    scenario = tmp_path / "conversion.toml"
    scenario.write_text(SCENARIO, encoding="utf-8")
    with run_by_both_masters(scenario, FOLDER).open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    names = ("driver.brake", "antilock_active.fl", "antilock_active.rl", "antilock_active.rr")
    pedal, first, left, right = (np.array([float(row[name]) for row in rows]) for name in names)
    # The logic samples every millisecond or later, so its flag may follow the pedal by a sample.
    on = int(np.argmax(pedal > 0.5))
    switched = int(np.argmax(first == 1.0))
    assert pedal[0] == 0.0
    assert on > 300
    assert on <= switched <= on + 20
    assert not first[:switched].any()
    # The pressure is modulated with target slip 0, but not with 1. The neighboring wheel shows that the slip does not
    # change.
    assert left[switched - 1] == 1.0
    assert left[-1] == 0.0
    assert right[-1] == 1.0

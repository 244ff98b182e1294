"""Texts in scenarios contain no typed numbers, and the numbers in their tables agree with references.

The references are tables computed by an independent implementation in another language. Deterministic numbers (without
a road, or with the same road as the reference) agree to the printed digits. The roads of the rescue vehicle, the half
car and the car are other realizations than the reference's, so their means are compared within six standard errors: in
about three hundred means of three to eight values, the largest deviation is about five standard errors.
"""

from __future__ import annotations

import csv
import json
import math
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

ROOT = Path(__file__).resolve().parents[2]
SCENARIOS = sorted((ROOT / "scenarios").glob("*.toml"))

# Text that can contain digits: numbers from the results, references to a paper, names of scenarios.
ALLOWED = re.compile(
    r"\{[^}]*\}"
    r"|\b(Figures?|Tables?|Sections?|equations?) \d+(\.\d+)*( \([a-z]\))?(( and | to |, )\d+)*"
    rf"|\b({'|'.join(p.stem for p in SCENARIOS)})\b"
)


def texts(path: Path) -> Iterator[tuple[str, str]]:
    scenario = tomllib.loads(path.read_text(encoding="utf-8"))
    for finding in scenario.get("finding", []):
        yield "claim", finding["claim"]
        yield "explanation", finding["explanation"]
    for figure in scenario.get("figure", []):
        yield f"caption of {figure['name']}", figure.get("caption", "")


@pytest.mark.parametrize("path", SCENARIOS, ids=lambda p: p.stem)
def test_texts_take_their_numbers_from_the_results(path: Path) -> None:
    typed = [f"{where}: {text}" for where, text in texts(path) if re.search(r"\d", ALLOWED.sub("", text))]
    assert not typed


def test_typed_numbers_are_found() -> None:
    for text in ("By 12 %.", "At 5 s.", "Table 4 says 0.06.", "{a.b} of 7", "about 2x"):
        assert re.search(r"\d", ALLOWED.sub("", text)), text
    for text in ("By {roll_rms.a@speed_5:by}.", "See Figure 11 and Figures 7 to 12.", "(Figure 12 (a))"):
        assert not re.search(r"\d", ALLOWED.sub("", text)), text


CHANGE = "change_percent"


@dataclass(frozen=True)
class Pin:
    """A cell of a table and its reference.

    `within` is the uncertainty from the printed digits of the reference. The reference is a mean over `seeds` other
    roads. Six standard errors of the difference between the two means are therefore added, computed from the scatter
    between our roads. The addition is limited to a third of the number (two percentage points for a small change), so
    large scatter does not pass.
    """

    cell: str
    expected: float
    within: float
    seeds: int = 0
    column: str = "ours"

    def misses(self, row: dict[str, str]) -> str | None:
        got, scatter = float(row[self.column]), 0.0
        if self.seeds:
            deviation = float(row[f"{self.column}_deviation"] or 0.0)
            scatter = 6.0 * deviation * math.sqrt(1.0 / int(row["seeds"]) + 1.0 / self.seeds)
            scatter = min(scatter, max(abs(self.expected) / 3.0, 2.0 if self.column == CHANGE else 0.0) + self.within)
        allowed = self.within + scatter
        if abs(got - self.expected) <= allowed:
            return None
        return f"{self.cell}, {self.column}: {got:.6g}, expected {self.expected:g} within {allowed:.3g}"


def pins(cells: str, within: float, seeds: int = 0, column: str = "ours") -> list[Pin]:
    """Read "cell value" pairs, one per line."""
    rows = (line.split() for line in cells.strip().splitlines())
    return [Pin(cell, float(expected), within, seeds, column) for cell, expected in rows]


def columns(metrics: str, table: str, within: str, seeds: int) -> list[Pin]:
    """Read a table with a case and its numbers per line; "-" stands for a missing number."""
    names, digits = metrics.split(), [float(d) for d in within.split()]
    return [
        Pin(f"{name}.{case}", float(number), digit, seeds)
        for line in table.strip().splitlines()
        for case, *numbers in [line.split()]
        for name, number, digit in zip(names, numbers, digits, strict=True)
        if number != "-"
    ]


# Section 8 of the half car: columns of its tables, and the uncertainty of their printed digits.
HALF_CAR = (
    "heave_acceleration_rms heave_acceleration_rms_straight heave_acceleration_rms_turn roll_acceleration_rms"
    " settled_roll roll_peak load_transfer_mean load_transfer_max load_transfer_above load_transfer_crossing wheel_lift"
    " force_peak"
)
HALF_CAR_DIGITS = "0.001 0.001 0.001 0.01 0.001 0.001 0.001 0.01 0.01 0.01 0.01 0.1"

PINS: dict[str, list[Pin]] = {
    # Table 4 and section 7 of the rescue vehicle: means and scatter over eight roads.
    "rescue_vehicle_step_steer": [
        *pins(
            """
            roll_rms.individual 0.0619
            roll_acceleration_rms.individual 0.173
            yaw_acceleration_rms.individual 0.0761
            lateral_acceleration_rms.individual 3.1523
            """,
            0.0005,
            seeds=8,
        ),
        *pins("roll_rms.coordination -12.3", 0.1, 8, CHANGE),
        *pins("roll_acceleration_rms.coordination -0.7", 0.5, 8, CHANGE),
        *pins("yaw_acceleration_rms.coordination 0.05", 0.02, 8, CHANGE),
        *pins("heave_acceleration_rms.coordination 23", 1.0, 8, CHANGE),
    ],
    # Variants in section 7, on one road. Variants whose effect is smaller than the scatter between roads are left out.
    "rescue_vehicle_step_steer_variants": [
        *pins(
            """
            roll_rms.accepted_roll_0_25 -57
            roll_rms.accepted_roll_0_5 -32
            roll_rms.accepted_roll_acceleration_0_7 -13
            roll_rms.accepted_roll_acceleration_0_5 12
            roll_acceleration_rms.no_suspension_control 51
            roll_rms.roll_only -14
            roll_rms.lateral_coordination -13
            """,
            1.0,
            1,
            CHANGE,
        ),
        *pins(
            """
            roll_rms.accepted_roll_2_0 -3.6
            roll_rms.accepted_roll_3_0 -1.7
            roll_rms.as_printed -2.4
            yaw_acceleration_rms.no_suspension_control 0.1
            roll_rms.half_half -7.7
            roll_rms.smooth_coordination -12.5
            roll_acceleration_rms.smooth_coordination -11.8
            roll_rms.ordinary_coordination -12.4
            """,
            0.1,
            1,
            CHANGE,
        ),
    ],
    # Table 5, on one road.
    "rescue_vehicle_double_lane_change": [
        *pins("roll_rms.individual 0.0151\nroll_rate_rms.individual 0.0229\nsideslip_rms.individual 0.0007", 0.0001, 1),
        *pins("roll_acceleration_rms.individual 0.09", 0.0001, 1),
        *pins("sideslip_rms.coordination 238", 1.0, 1, CHANGE),
        *pins("roll_rms.coordination -9.0\nroll_rate_rms.coordination -7.1", 0.1, 1, CHANGE),
        *pins("roll_acceleration_rms.coordination 18\nyaw_rate_peak.coordination 0.5", 0.5, 1, CHANGE),
        *pins(
            """
            sideslip_rms.always_on -5.6
            roll_rms.always_on -7.5
            roll_rate_rms.always_on -7.4
            roll_acceleration_rms.always_on -1.8
            """,
            0.1,
            1,
            CHANGE,
        ),
    ],
    # Table 7, on one road. For the time before the turn, the shares follow from the fuzzy rules without steering, and
    # the other numbers are from the audit.
    "rescue_vehicle_test_condition": [
        *pins("roll_rms.individual 0.0295\nyaw_acceleration_rms.individual 0.0467", 0.0001, 1),
        *pins("roll_acceleration_rms.individual 0.1515\nlateral_acceleration_rms.individual 1.5258", 0.0001, 1),
        *pins("roll_rms.coordination -12.4\nroll_acceleration_rms.coordination -0.1", 0.1, 1, CHANGE),
        *pins("yaw_acceleration_rms.coordination 0.0", 0.05, 1, CHANGE),
        *pins("share_integrated_straight.coordination 0.62\nshare_roll_straight.coordination 0.38", 0.005),
        *pins("share_integrated_straight.individual 1\nshare_roll_straight.individual 0", 1e-9),
        *pins("roll_rms_straight.coordination -4", 0.5, 1, CHANGE),
        *pins("heave_acceleration_rms_straight.coordination 15", 3.0, 1, CHANGE),
    ],
    "rescue_vehicle_speed_sweep": pins(
        """
        roll_rms.coordination@speed_5 -8.2
        roll_rms.coordination@speed_15 -10.5
        roll_rms.coordination@speed_25 -11.5
        roll_rms.coordination@speed_35 -12.4
        roll_acceleration_rms.coordination@speed_35 -0.3
        yaw_acceleration_rms.coordination@speed_35 0.1
        """,
        0.1,
        1,
        CHANGE,
    ),
    # Table 3 of the truck, on the same roads as the reference, to the printed digits.
    "heavy_vehicle_control": pins(
        """
        heave_acceleration_rms.uncontrolled@step 0.9283
        pitch_acceleration_rms.uncontrolled@step 0.4996
        roll_acceleration_rms.uncontrolled@step 0.1873
        heave_acceleration_rms.uncontrolled@serpentine 0.9284
        pitch_acceleration_rms.uncontrolled@serpentine 0.4995
        roll_acceleration_rms.uncontrolled@serpentine 0.0867
        heave_acceleration_rms.controlled@step 0.6055
        pitch_acceleration_rms.controlled@step 0.3176
        roll_acceleration_rms.controlled@step 0.0494
        heave_acceleration_rms.controlled@serpentine 0.6051
        pitch_acceleration_rms.controlled@serpentine 0.3177
        roll_acceleration_rms.controlled@serpentine 0.0391
        sideslip_rms.uncontrolled@step 0.0361
        sideslip_rms.controlled@step 0.0019
        sideslip_rms.uncontrolled@serpentine 0.0237
        sideslip_rms.controlled@serpentine 0.0030
        yaw_rate_error_rms.uncontrolled@step 0.0516
        yaw_rate_error_rms.controlled@step 0.0026
        yaw_rate_error_rms.uncontrolled@serpentine 0.0369
        yaw_rate_error_rms.controlled@serpentine 0.0029
        """,
        0.0001,
    ),
    "heavy_vehicle_control_variants": pins(
        """
        heave_acceleration_rms.suspension@step 0.605
        pitch_acceleration_rms.suspension@step 0.317
        roll_acceleration_rms.suspension@step 0.101
        roll_acceleration_rms.suspension@serpentine 0.055
        heave_acceleration_rms.steering@step 0.928
        roll_acceleration_rms.steering@step 0.065
        roll_acceleration_rms.steering@serpentine 0.049
        heave_acceleration_rms.active@step 0.565
        pitch_acceleration_rms.active@step 0.293
        roll_acceleration_rms.active@step 0.046
        heave_acceleration_rms.command@step 0.606
        pitch_acceleration_rms.command@step 0.327
        roll_acceleration_rms.command@step 0.050
        heave_acceleration_rms.standard_rules@step 0.627
        pitch_acceleration_rms.standard_rules@step 0.329
        roll_acceleration_rms.standard_rules@step 0.048
        """,
        0.001,
    ),
    "heavy_vehicle_coupling": pins(
        """
        heave_acceleration_rms.coupled@step 0.92834
        heave_acceleration_rms.vertical@step 0.92839
        pitch_acceleration_rms.coupled@step 0.49955
        pitch_acceleration_rms.vertical@step 0.49952
        roll_acceleration_rms.coupled@step 0.1873
        roll_acceleration_rms.vertical@step 0.0382
        roll_acceleration_rms.coupled@serpentine 0.0867
        roll_acceleration_rms.vertical@serpentine 0.0382
        """,
        0.0001,
    ),
    # The table of section 4, without a road.
    "heavy_vehicle_steering": [
        *pins(
            """
            yaw_rate_end.front_wheel@speed_40 0.1599
            yaw_rate_end.all_wheel@speed_40 0.1552
            yaw_rate_end.six_wheel@speed_40 0.1600
            yaw_rate_end.front_wheel@speed_60 0.1985
            yaw_rate_end.all_wheel@speed_60 0.1551
            yaw_rate_end.six_wheel@speed_60 0.1498
            yaw_rate_end.front_wheel@speed_80 0.2029
            yaw_rate_end.all_wheel@speed_80 0.1392
            yaw_rate_end.six_wheel@speed_80 0.1309
            yaw_rate_error_rms.front_wheel@speed_60 0.0482
            yaw_rate_error_rms.all_wheel@speed_60 0.0071
            yaw_rate_error_rms.six_wheel@speed_60 0.0023
            yaw_rate_error_rms.six_wheel@speed_80 0.0042
            sideslip_end.front_wheel@speed_80 -0.0735
            sideslip_peak.front_wheel@speed_80 0.0800
            sideslip_peak.all_wheel@speed_80 0.0188
            sideslip_peak.six_wheel@speed_80 0.0149
            """,
            0.0001,
        ),
        *pins(
            """
            lateral_acceleration_end.six_wheel@speed_60 2.50
            lateral_acceleration_end.front_wheel@speed_80 4.51
            lateral_acceleration_overshoot.six_wheel@speed_40 0.02
            lateral_acceleration_overshoot.six_wheel@speed_60 0.11
            lateral_acceleration_overshoot.six_wheel@speed_80 0.16
            lateral_acceleration_rise.six_wheel@speed_40 0.53
            lateral_acceleration_rise.six_wheel@speed_60 0.50
            lateral_acceleration_rise.six_wheel@speed_80 0.51
            lateral_acceleration_rise.front_wheel@speed_40 0.60
            lateral_acceleration_rise.front_wheel@speed_60 0.91
            lateral_acceleration_rise.front_wheel@speed_80 1.02
            roll_rise.six_wheel@speed_40 0.41
            roll_rise.front_wheel@speed_40 0.39
            """,
            0.01,
        ),
    ],
    # Table 7 of the car: on a flat road to the printed digits, on rough roads as means over four other roads.
    "esp_car_uniform": [
        *pins(
            """
            vertical_acceleration_rms.none 0.8960
            vertical_acceleration_rms.individual 0.7232
            roll_acceleration_rms.none 1.5817
            roll_acceleration_rms.individual 1.2852
            pitch_acceleration_rms.none 0.6977
            pitch_acceleration_rms.individual 0.6068
            """,
            0.0001,
            4,
        ),
        *pins("vertical_acceleration_rms.individual -19", 8.0, 0, CHANGE),
    ],
    "esp_car_acceleration": [
        *pins(
            """
            pitch_acceleration_rms.none@flat 0.0905
            pitch_acceleration_rms.individual@flat 0.0516
            pitch_acceleration_rms.coordination@flat 0.0489
            """,
            0.0001,
        ),
        *pins(
            """
            vertical_acceleration_rms.none@rough 0.4418
            vertical_acceleration_rms.individual@rough 0.4044
            vertical_acceleration_rms.coordination@rough 0.3979
            pitch_acceleration_rms.none@rough 0.5913
            pitch_acceleration_rms.individual@rough 0.4875
            """,
            0.0001,
            4,
        ),
    ],
    "esp_car_braking": [
        *pins(
            """
            pitch_acceleration_rms.none@flat 0.3780
            pitch_acceleration_rms.individual@flat 0.2498
            pitch_acceleration_rms.coordination@flat 0.2404
            """,
            0.0001,
        ),
        *pins("distance.none@flat 22.82\ndistance.individual@flat 21.75\ndistance.coordination@flat 21.56", 0.01),
        *pins(
            """
            distance.none@rough 22.94
            distance.individual@rough 23.05
            distance.coordination@rough 22.71
            vertical_acceleration_rms.none@rough 0.6001
            vertical_acceleration_rms.individual@rough 0.4526
            """,
            0.01,
            4,
        ),
    ],
    "esp_car_step_steer": [
        *pins(
            """
            roll_acceleration_rms.none@flat 0.0812
            roll_acceleration_rms.individual@flat 0.0552
            roll_acceleration_rms.coordination@flat 0.0539
            yaw_rate_rms.none@flat 0.0899
            yaw_rate_rms.coordination@flat 0.0899
            yaw_rate_peak.none@flat 0.0927
            yaw_rate_peak.coordination@flat 0.0928
            yaw_rate_error_rms.none@flat 0.0008
            """,
            0.0001,
        ),
        *pins(
            """
            vertical_acceleration_rms.none@rough 0.8720
            vertical_acceleration_rms.individual@rough 0.6776
            roll_acceleration_rms.none@rough 1.5520
            """,
            0.0001,
            4,
        ),
    ],
    "esp_car_steering_braking": [
        *pins("distance.none@flat 25.19\ndistance.individual@flat 24.48\ndistance.coordination@flat 24.42", 0.01),
        *pins(
            """
            roll_acceleration_rms.none@flat 0.7559
            roll_acceleration_rms.individual@flat 0.4627
            roll_acceleration_rms.coordination@flat 0.4334
            pitch_acceleration_rms.none@flat 0.3564
            pitch_acceleration_rms.individual@flat 0.2251
            pitch_acceleration_rms.coordination@flat 0.2187
            yaw_rate_rms.none@flat 0.0984
            yaw_rate_rms.individual@flat 0.1624
            yaw_rate_rms.coordination@flat 0.1669
            yaw_rate_peak.none@flat 0.2647
            yaw_rate_peak.individual@flat 0.3249
            yaw_rate_peak.coordination@flat 0.3281
            yaw_rate_error_rms.individual@flat 0.0764
            """,
            0.0001,
        ),
        # We record the target after the step, one row later than the reference does.
        *pins("yaw_rate_error_rms.none@flat 0.1749", 0.0002),
        *pins(
            """
            distance.none@rough 25.29
            distance.individual@rough 25.50
            distance.coordination@rough 25.41
            vertical_acceleration_rms.none@rough 0.5884
            vertical_acceleration_rms.individual@rough 0.4679
            """,
            0.01,
            4,
        ),
    ],
    "esp_car_steering_acceleration": [
        *pins(
            """
            roll_acceleration_rms.none@flat 0.2568
            roll_acceleration_rms.individual@flat 0.1629
            roll_acceleration_rms.coordination@flat 0.1558
            pitch_acceleration_rms.none@flat 0.0459
            pitch_acceleration_rms.individual@flat 0.0284
            pitch_acceleration_rms.coordination@flat 0.0267
            yaw_rate_rms.none@flat 0.2301
            yaw_rate_rms.individual@flat 0.2656
            yaw_rate_peak.none@flat 0.2548
            yaw_rate_peak.individual@flat 0.2779
            yaw_rate_error_rms.none@flat 0.0556
            yaw_rate_error_rms.individual@flat 0.0118
            """,
            0.0001,
        ),
        *pins(
            """
            vertical_acceleration_rms.none@rough 0.9678
            vertical_acceleration_rms.individual@rough 0.7457
            roll_acceleration_rms.none@rough 1.9518
            """,
            0.0001,
            4,
        ),
    ],
    # Section 8 of the half car: means over eight other roads.
    "hydro_pneumatic_jturn_random": columns(
        HALF_CAR,
        """
        passive  0.792 0.684 0.881 1.33 0.184 0.227 0.872 1.07 0.90 6.56 0.05 0.0
        comfort  0.194 0.204 0.183 1.34 0.164 0.192 0.867 1.06 0.92 6.56 0.06 3.2
        handling 1.493 0.704 1.986 2.98 0.000 0.000 0.777 1.36 0.31 6.34 0.35 10.2
        switched 1.125 0.204 1.578 5.15 0.041 0.149 0.726 1.48 0.40 6.56 0.16 11.1
        damped   0.423 0.204 0.561 1.23 0.011 0.155 0.810 1.06 0.52 6.56 0.05 5.4
        """,
        HALF_CAR_DIGITS,
        8,
    ),
    "hydro_pneumatic_jturn_bump": columns(
        HALF_CAR,
        """
        passive  4.582 2.860 5.764 8.40 0.179 0.581 0.698 1.80 0.40 6.43 0.36 0.0
        comfort  1.293 0.938 1.567 7.26 0.173 0.377 0.738 1.40 0.31 6.45 0.35 15.8
        handling 5.502 3.036 7.147 3.01 0.000 0.000 0.559 1.95 0.25 6.66 0.57 22.1
        switched 1.970 0.938 2.620 8.72 0.076 0.269 0.674 1.47 0.27 6.45 0.33 18.8
        damped   1.330 0.938 1.628 7.07 0.145 0.331 0.728 1.45 0.27 6.45 0.35 13.7
        """,
        HALF_CAR_DIGITS,
        8,
    ),
    "hydro_pneumatic_fishhook_random": columns(
        HALF_CAR,
        """
        passive  0.796 0.684 0.888 1.94 0.185 0.291 0.874 1.06 0.91 5.74 0.08 0.0
        comfort  0.220 0.204 0.233 1.96 0.165 0.303 0.869 1.05 0.93 5.73 0.10 3.2
        handling 1.547 0.704 2.066 2.98 0.000 0.000 0.779 1.35 0.31 5.66 0.35 10.1
        switched 1.241 0.204 1.744 5.48 0.039 0.297 0.716 1.49 0.39 5.73 0.23 11.2
        damped   0.505 0.204 0.681 1.78 0.012 0.238 0.813 1.04 0.54 5.73 0.07 5.3
        """,
        HALF_CAR_DIGITS,
        8,
    ),
    "hydro_pneumatic_fishhook_bump": columns(
        HALF_CAR,
        """
        passive  4.679 2.860 5.922 8.47 0.168 0.691 0.693 1.90 0.39 5.71 0.37 0.0
        comfort  1.320 0.938 1.611 7.24 0.178 0.399 0.741 1.43 0.32 5.72 0.37 15.7
        handling 5.618 3.036 7.307 3.02 0.000 0.000 0.560 1.91 0.24 5.76 0.57 23.6
        switched 2.007 0.938 2.674 8.62 0.074 0.318 0.679 1.48 0.28 5.72 0.35 19.2
        damped   1.380 0.938 1.708 7.07 0.142 0.346 0.728 1.43 0.28 5.72 0.36 14.6
        """,
        HALF_CAR_DIGITS,
        8,
    ),
    "hydro_pneumatic_robustness": [
        *columns(
            "heave_acceleration_rms settled_roll roll_peak load_transfer_mean load_transfer_max",
            """
            nominal@switched             1.125 0.041 0.149 0.726 1.48
            nominal@damped               0.423 0.011 0.155 0.810 1.06
            nominal@comfort              0.194 0.164 0.192 0.867 1.06
            sprung_mass_plus_20@switched 0.738 0.077 0.186 0.730 1.27
            sprung_mass_minus_20@switched 1.855 0.007 0.119 0.736 1.73
            unsprung_mass_plus_20@comfort 0.176 0.164 0.192 0.855 1.06
            damping_plus_20@switched     0.911 0.049 0.148 0.762 1.34
            damping_minus_20@switched    1.318 0.034 0.151 0.682 1.60
            speed_minus_20@comfort       0.228 0.137 0.162 0.724 0.89
            speed_minus_30@comfort       0.241 0.117 0.142 0.619 0.74
            disturbance_1@comfort        0.195 0.164 0.192 0.867 1.06
            disturbance_2@comfort        0.197 0.164 0.192 0.867 1.06
            """,
            "0.001 0.001 0.001 0.001 0.01",
            8,
        ),
        # From the audit: the effect of disturbances before the turn, which is equal for all controls, and the nominal
        # peak on one road.
        *(
            Pin(f"roll_shift.disturbance_{n}@{control}", shift, 0.0005)
            for n, shift in ((1, 0.019), (2, 0.038))
            for control in ("switched", "damped", "comfort")
        ),
        *pins("roll_peak_straight.nominal@switched 0.029", 0.0005, 5),
    ],
    # Sections 6 and 7: means over sixteen other roads, or over eight for the two columns of Table 5.
    "hydro_pneumatic_passive_table2": [
        *pins("heave_acceleration_rms.passive 0.80", 0.01, 16),
        *pins("roll_acceleration_rms.passive 1.16", 0.01, 16),
        *pins(
            """
            suspension_deflection_left_rms.passive 0.0156
            suspension_deflection_right_rms.passive 0.0205
            tire_deflection_left_rms.passive 0.0053
            tire_deflection_right_rms.passive 0.0060
            """,
            0.0001,
            16,
        ),
    ],
    "hydro_pneumatic_table5": [
        *pins("objective_ride.comfort 0.890\nobjective_ride.comfort_ga 4.681", 0.001, 1),
        *pins("heave_acceleration_rms_straight.comfort_ga 1.623", 0.001, 8),
    ],
}

# Every tier runs these scenarios, which have no road and take seconds. .ci/run adds a sample of the other scenarios,
# and scripts/nightly runs all scenarios.
FIRST_TIER = ("heavy_vehicle_steering",)
SAMPLE = ("rescue_vehicle_test_condition", "esp_car_steering_braking")


def tier(path: Path) -> object:
    """Return the scenario as a test parameter with the marker of its tier."""
    marks = [] if path.stem in FIRST_TIER else [pytest.mark.ci] if path.stem in SAMPLE else [pytest.mark.nightly]
    return pytest.param(path, id=path.stem, marks=marks)


@pytest.mark.parametrize("path", [tier(p) for p in SCENARIOS])
def test_the_tables_are_those_of_the_references(path: Path, tmp_path: Path) -> None:
    command = [sys.executable, "-m", "chassis_fmu", "run", str(path), "--out", str(tmp_path)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    with (tmp_path / path.stem / "table.csv").open(encoding="utf-8", newline="") as file:
        rows = {
            f"{r['metric']}.{r['case']}" + (f"@{r['point']}" if r["point"] else ""): r for r in csv.DictReader(file)
        }
    missed = [text for pin in PINS.get(path.stem, []) if (text := pin.misses(rows[pin.cell]))]
    assert not missed, "\n".join(missed)
    # Badges that say that a claim of ours is refuted, or that a check was not evaluated, mean a mistake in the
    # scenario.
    badges = json.loads((tmp_path / path.stem / "page.json").read_text(encoding="utf-8"))["badges"]
    assert not {"refuted", "open"} & set(badges), done.stdout


def test_every_table_has_its_references() -> None:
    # Scenarios without a paper have no references: those for tuning, for swapping controllers, and for sensors and
    # actuators.
    without = {p.stem for p in SCENARIOS} - set(PINS)
    own = ("swap_", "hydro_pneumatic_tuning_", "rescue_vehicle_sensor_actuator")
    assert all(name.startswith(own) for name in without)


@pytest.mark.studies
@pytest.mark.parametrize(("study", "bound"), [("hydro_pneumatic_ride", 0.82), ("hydro_pneumatic_handling", 0.30)])
def test_the_tuner_stays_below_the_bounds(study: str, bound: float) -> None:
    """Bounds for PACSA with any seed (section 6 of the half car): ride 0.82, handling 0.30."""
    studies = Path(os.environ["CHASSIS_FMU_STUDIES"])
    summary = json.loads((studies / study / "summary.json").read_text(encoding="utf-8"))
    found = [m["best"]["objective"] for m in summary["methods"] if m["kind"] == "pacsa"]
    assert found
    assert max(found) < bound

"""Requirements: the verdicts of `chassis run` and of its page are the same, including their text."""

import subprocess
from pathlib import Path

import numpy as np
import pytest

from chassis_fmu import program
from tests.commands import CHASSIS

# Requirements in several units, with and without a share, that are met, missed and undefined.
SCENARIO = """
title = "Requirements"
simulation = { stop = 2.0, step = 0.01 }
record = { signals = ["plant:vehicle.yaw_rate", "plant:vehicle.lateral_acceleration"] }
case = [{ name = "plain", title = "Plain & <simple>" }, { name = "other", title = "Other", baseline = "plain" }]
component = [
    { name = "driver", fmu = "Driver", parameters = { maneuver = "ramp_step", "steer.amplitude" = 0.02 } },
    { name = "sensor", fmu = "Sensor", parameters = { "sensor.noise" = 0.002, sample_time = 0.01 } },
    { name = "plant", fmu = "BicycleCar", inputs = { "road_friction.*" = 1.0 } },
]
connection = [
    { from = "driver:driver.steer", to = "sensor:sensor.true_value" },
    { from = "sensor:sensor.measured_value", to = "plant:steer.front" },
]
seeds = { parameter = "sensor:seed", values = [1, 2, 3] }

[sweep]
title = "Speed"
unit = "km/h"
parameter = "driver:speed.initial"
values = [50.0, 90.0]

[[metric]]
name = "yaw_rate"
title = "Yaw rate, peak"
signal = "vehicle.yaw_rate"
kind = "peak"
unit = "deg/s"
max = 5.5
min = 1e-5

[[metric]]
name = "acceleration"
title = "Lateral acceleration, RMS"
signal = "vehicle.lateral_acceleration"
kind = "rms"
digits = 2
max = 1.0
share = 0.5
required_of = ["plain"]
required_by = 'Rule "7"'

[[metric]]
name = "never"
title = "Time to a level that is not reached"
signal = "vehicle.yaw_rate"
kind = "magnitude_crossing"
threshold = 100.0
max = 2.0
required_of = ["other"]

[[metric]]
name = "late"
title = "Mean of the second half"
signal = "vehicle.yaw_rate"
kind = "mean"
window = [1.0, 2.0]

[[metric]]
name = "difference"
title = "Difference from the baseline"
signal = "vehicle.yaw_rate"
kind = "rms"
from_baseline = true
unit = "deg/s"
max = 1e7
required_of = ["other"]

[[metric]]
name = "ratio"
title = "Ratio"
value = "late / yaw_rate"
min = -1e-7
"""


def run(*command: str | Path) -> tuple[int, str]:
    done = subprocess.run(command, cwd=program.ROOT, stdout=subprocess.PIPE, encoding="utf-8", check=False)
    return done.returncode, done.stdout


def requirements(text: str) -> list[str]:
    """Return the lines below the heading, up to an empty line."""
    _, _, rest = text.partition("Requirements\n")
    lines = rest.split("\n\n")[0].strip().splitlines()
    # Notes on shortened runs follow without an empty line.
    return [line for line in lines if not line.startswith("Run with ") and " not evaluated: " not in line]


@pytest.mark.parametrize("options", [(), ("--seeds", "1"), ("--stop", "1.5")])
def test_both_commands_have_the_same_verdicts(options: tuple[str, ...], tmp_path: Path) -> None:
    scenario = tmp_path / "limits.toml"
    scenario.write_text(SCENARIO, encoding="utf-8")
    out, again = tmp_path / "native", tmp_path / "python"
    shared: list[str | Path] = [scenario, *options, "--junit"]
    native, text = run(CHASSIS, "run", "--no-page", *shared, tmp_path / "native.xml", "--out", out)
    python: list[str | Path] = [CHASSIS, "run", *shared, tmp_path / "python.xml", "--out", again]
    code, words = run(*python, "--from-csv", out / "limits")
    # For shortened runs, a requirement is not evaluated, unless a value is already too large.
    is_cut = "--stop" in options
    assert (native, code) == (1, 1)
    lines = requirements(text)
    assert len(lines) == 2 * (2 + 1 + 1 + 1 + 2)
    assert lines == requirements(words)
    documents = [(tmp_path / f"{name}.xml").read_text(encoding="utf-8") for name in ("native", "python")]
    assert documents[0] == documents[1]
    assert ("Not evaluated" in text) == is_cut
    assert "Failed" in text
    relaxed, _ = run(CHASSIS, "run", "--no-page", scenario, *options, "--no-fail", "--out", out)
    assert relaxed == 0


def test_verdicts_are_those_of_the_recorded_rows(tmp_path: Path) -> None:
    """Compare with peak and RMS of each run by NumPy; the printed numbers have four and three digits."""
    scenario = tmp_path / "limits.toml"
    scenario.write_text(SCENARIO, encoding="utf-8")
    _, text = run(CHASSIS, "run", "--no-page", scenario, "--out", tmp_path)
    for case, title in (("plain", "Plain & <simple>"), ("other", "Other")):
        for speed in (50, 90):
            files = [tmp_path / "limits" / "runs" / f"{case}_speed_{speed}_{seed}.csv" for seed in (1, 2, 3)]
            rows = [np.genfromtxt(file, delimiter=",", names=True) for file in files]
            peaks = [np.degrees(np.abs(row["vehicleyaw_rate"]).max()) for row in rows]
            verdict = "Passed" if max(peaks) <= 5.5 else "Failed"
            assert f"{verdict}  Yaw rate, peak, {title}, {speed} km/h: {max(peaks):.3f} °/s in the worst" in text
            rms = [np.sqrt(np.mean(row["vehiclelateral_acceleration"] ** 2)) for row in rows]
            if case == "plain":
                verdict = "Passed" if np.mean(np.array(rms) <= 1.0) >= 0.5 else "Failed"
                assert f"{verdict}  Lateral acceleration, RMS, {title}, {speed} km/h: {max(rms):.2f} m/s²" in text

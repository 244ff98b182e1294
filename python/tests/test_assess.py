"""The page of an assessment. Reference: `assessment.json`, which Rust writes and tests."""

import html
import json
import math
import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest

from chassis_fmu.assess import __main__ as app
from chassis_fmu.assess import charts, report
from chassis_fmu.assess.assessment import AssessmentError, Folder, Row
from chassis_fmu.files.describe import sha256
from chassis_fmu.files.plan import Case
from chassis_fmu.files.results import read_csv
from tests import commands
from tests.page_schema import data_of

ROOT = Path(__file__).parents[2]
FOLDER = Path(os.environ.get("CHASSIS_FMU_DIR") or ROOT / "target" / "fmu")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Assess the car in all maneuvers; the series of sine with dwell ends at the first unstable runs."""
    out = tmp_path_factory.mktemp("assess") / "car"
    command = [sys.executable, "-m", "chassis_fmu", "bench", "run", "EspCar", "--with", "AntilockBraking", "--quick"]
    done = subprocess.run([*command, "--out", str(out)], cwd=ROOT, capture_output=True, encoding="utf-8", check=False)
    # Antilock brakes alone do not prevent the spin in sine with dwell, so a verdict is "failed".
    assert done.returncode == 1, done.stderr
    assert done.stdout.endswith(f"{out / 'index.html'}\n")
    return out


@pytest.fixture(scope="module")
def page(folder: Path) -> str:
    return (folder / "index.html").read_text(encoding="utf-8")


def test_the_page_shows_all_metrics_and_figures(folder: Path, page: str) -> None:
    found = Folder(folder).read()
    for row in found.metrics:
        assert row.title in page
    for fmu in ("EspCar", "BrakeAndDriveActuators", "AntilockBraking"):
        assert sha256(FOLDER / f"{fmu}.fmu") in page
    names = set(re.findall(r'<figure id="([^"]+)">', page))
    # Every figure of the groups of maneuvers is drawn for a car with pedals on a road.
    assert len(names) == sum(len(makes) for makes in charts.CHARTS.values())
    assert names == {path.stem for path in (folder / "figures").glob("*.svg")}
    data = json.loads(re.findall(r'<script type="application/json" id="page-data">(.*?)</script>', page, re.DOTALL)[0])
    assert {figure["name"] for figure in data["figures"]} == names


def test_the_page_has_data_by_the_schema_and_the_seeds(folder: Path, page: str) -> None:
    data = data_of(folder / "index.html")
    assert {panel.get("kind") for figure in data["figures"] for panel in figure["panels"]} == {
        "function",
        "curve",
        "map",
    }
    seeds = {run.parameters["seed"] for run in Folder(folder).read().runs if "seed" in run.parameters}
    assert len(seeds) > 1
    assert f"<dd>{', '.join(f'{seed:g}' for seed in sorted(seeds))}</dd>" in page


def test_the_page_has_the_verdicts_of_both_systems(folder: Path, page: str) -> None:
    """Only with antilock brakes does the car stay within the braking distance of UN R13-H."""
    table = re.findall(r'<table class="verdicts">.*?</table>', page, re.DOTALL)[0]
    (row,) = re.findall(r"<tr>\s*<th>Braking: braking distance.*?</tr>", table, re.DOTALL)
    assert re.findall(r'class="badge [a-z]+">([A-Za-z]+)<', row) == ["Failed", "Passed", "better"]
    found = Folder(folder).read()
    judged = [row for row in found.metrics if row.verdict != "info" or row.verdict_without != "info"]
    assert table.count("<tr>") == 1 + len(judged)
    # The section on the assessed systems, above the verdicts.
    head = html.unescape(page[: page.index('<table class="verdicts">')])
    assert head.index(found.plant["guid"] or "-") < head.index("<th>wheelbase</th>") < head.index("road_height.fl")
    for name, _ in found.data:
        assert report.DATA[name] in head
    assert set(report.DATA) >= {name for name, _ in found.data}


def test_the_page_says_where_systems_were_compared() -> None:
    """Constructed cases: a faster and a slower system, a bound, and a missing value."""
    common = {"definition": "", "unit": "km/h", "suite": "stability", "verdict": "info", "verdict_without": "info"}
    data = {
        **common, "id": "iso3888_1.roll_peak", "title": "Roll", "without": 2.0, "with": 3.0, "change": -25.0,
        "limit": None,
        "judgment": "better", "reason": None, "compared": {"at": 39.7, "at_unit": "km/h", "without": 2.0, "with": 1.5},
    }  # fmt: skip
    cases = (Case("without", "Without", None), Case("with", "With", "without"))
    row = msgspec.convert(data, Row)
    assert report.notes(row, cases) == ["compared at 39.70 km/h: 2.000 and 1.500"]
    none = {"with": None, "change": None, "compared": None, "reason": "it fails at 30 km/h", "judgment": "worse"}
    row = msgspec.convert({**data, **none, "bounds": {"with": "< 30"}}, Row)
    assert (report.value(row, "without"), report.value(row, "with")) == ("2.000", "< 30")
    assert report.notes(row, cases) == ["with controllers: it fails at 30 km/h"]
    lost = {
        "compared": None,
        "judgment": "not_comparable",
        "incomparable": "with controllers: the driver lost the path",
    }
    row = msgspec.convert({**data, **lost}, Row)
    assert report.notes(row, cases) == ["not comparable: with controllers: the driver lost the path"]
    assert report.CHANGES["not_comparable"][1] == "not comparable"


def test_the_page_explains_what_it_counts(page: str) -> None:
    assert re.search(r"<b>\d+</b> passed with controllers</li>", page)
    assert "Unit A: multiples of the amplitude A. A is the steering-wheel angle" in page
    # Inputs that the bench sets, to a signal or to a constant.
    assert "<dt><code>steer.front</code></dt><dd>signal <code>driver.steer</code></dd>" in page
    assert "<dt><code>suspension_force.fl</code></dt><dd>constant 0.0</dd>" in page
    assert [report.is_signal(v) for v in ("driver.steer", "0.5", "-1.0e-3", "true", "Off")] == [True] + 4 * [False]
    captions = re.findall(r"<figcaption>.*?</figcaption>", page)
    assert captions
    assert not any("BrakeAndDriveActuators" in caption for caption in captions)


def test_angles_have_one_notation(folder: Path) -> None:
    panels = [panel for figure in data_of(folder / "index.html")["figures"] for panel in figure["panels"]]
    axes = [panel["y"] for panel in panels]
    assert any(axis["units"][0]["name"] == "°" for axis in axes)
    assert not any("deg" in unit["name"] for axis in axes for unit in axis["units"])
    # Each axis has a title.
    assert all(axis["title"] for panel in panels for axis in (panel["x"], panel["y"]))


def test_the_line_of_regression_gives_the_amplitude(folder: Path) -> None:
    """Reference: the angle at 0.3 g from the evaluator (A_raw), and the recorded signals for the slope."""
    found = Folder(folder).read()
    chart = charts.slowly_increasing_steer(charts.Source(found, Folder(folder), report.systems(found)))
    assert chart is not None
    lines = [line for line in chart.panels[0].lines if line.kind == "reference"]
    assert len(lines) == 4
    run = next(run for run in found.runs if run.name == "slowly_increasing_steer.left")
    x, y = lines[0].x, lines[0].y
    at = math.degrees(float(np.interp(0.3 * 9.81, x, y)))
    assert at == pytest.approx(run.metrics["A_raw"], rel=1e-9)
    # The signals have no noise, so filtering does not change the slope.
    recording = Folder(folder).recording("without", run.name)
    assert recording is not None
    across, wheel = recording.values["vehicle.lateral_acceleration"], recording.values["driver.steering_wheel"]
    assert float(np.interp(0.2 * 9.81, x, y)) == pytest.approx(float(np.interp(0.2 * 9.81, across, wheel)), rel=0.01)


def test_captions_say_the_speed(folder: Path) -> None:
    found = Folder(folder).read()
    source = charts.Source(found, Folder(folder), report.systems(found))
    for makes in charts.CHARTS.values():
        for make in makes:
            chart = make(source)
            assert chart is not None
            assert re.search(r"\d (km/h|mph)", chart.caption), chart.caption


def test_the_page_is_on_the_list_of_results(folder: Path) -> None:
    assert "Test bench: EspCar and BrakeAndDriveActuators, without and with AntilockBraking" in (
        folder.parent / "index.html"
    ).read_text(encoding="utf-8")


def test_the_path_of_the_driver_is_that_of_the_maneuver(folder: Path) -> None:
    """Reference: the path of the single lane change, y = H (q - sin(2 pi q) / (2 pi)), which ends 1.4637 m to the side.

    The deviation in a row is from the preceding step. The error is therefore the vehicle's movement away from the path
    in 1 ms: less than 0.1 mm, because this velocity is below 0.1 m/s at both ends.
    """
    recording = Folder(folder).recording("without", "single_lane_change")
    assert recording is not None
    path = charts._path(recording)
    assert path is not None
    assert path[1][0] == pytest.approx(0.0, abs=1e-4)
    assert path[1][-1] == pytest.approx(1.4637, abs=1e-4)


def test_footprints_have_the_size_of_the_vehicle(folder: Path) -> None:
    """Reference: computed by hand for a vehicle at (10, 2) that points along y."""
    found = Folder(folder).read()
    front, rear, width = (found.datum(name) or 0.0 for name in ("front", "rear", "width"))
    x, y = charts._corners(found, *(np.array([value]) for value in (10.0, 2.0, math.pi / 2)))
    assert list(x[:4]) == pytest.approx([10.0 - width / 2, 10.0 + width / 2, 10.0 + width / 2, 10.0 - width / 2])
    assert list(y[:4]) == pytest.approx([2.0 + front, 2.0 + front, 2.0 - rear, 2.0 - rear])


def test_the_page_of_an_assessment_that_is_there(folder: Path, page: str) -> None:
    code, text = commands.chassis("bench", "run", "EspCar", "--out", folder, "--report-only")
    assert (code, text) == (0, f"{folder / 'index.html'}\n")
    again = (folder / "index.html").read_text(encoding="utf-8")
    # Both pages are equal except for the command.
    assert re.sub(r"<code>chassis bench .*?</code>", "", again) == re.sub(r"<code>chassis bench .*?</code>", "", page)


def test_a_folder_without_an_assessment_is_an_error(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert app.main([str(tmp_path / "nowhere"), "chassis bench run"]) == 1
    assert "nowhere/assessment.json" in capsys.readouterr().err


def test_another_schema_is_an_error(folder: Path, tmp_path: Path) -> None:
    data: dict[str, Any] = json.loads((folder / "assessment.json").read_text(encoding="utf-8"))
    data["schema"] = "chassis-fmu-assessment/2"
    (tmp_path / "assessment.json").write_text(json.dumps(data), encoding="utf-8")
    with pytest.raises(AssessmentError, match="its schema is chassis-fmu-assessment/2"):
        Folder(tmp_path).read()


def test_a_plant_with_few_signals_has_a_page(tmp_path: Path) -> None:
    """The linear bicycle model: no roll, no tire loads, no pedals."""
    out = tmp_path / "bicycle"
    options: list[str | Path] = ["--suite", "handling", "--suite", "stability", "--quick", "--out", out]
    assert commands.chassis("bench", "run", "BicycleCar", *options)[0] in (0, 1)
    text = (out / "index.html").read_text(encoding="utf-8")
    assert "<h1>BicycleCar</h1>" in text
    assert "With controllers" not in text
    assert report.words("j_turn") == "J-turn"


# The car through ISO 3888-2, as the test bench drives it.
LOOP = """
title = "Loop"
reference = "None: a test."
[simulation]
stop = 8.0
step = 0.001
[[component]]
name = "driver"
fmu = "PathDriver"
[component.parameters]
maneuver = 3
"path.vehicle_width" = 1.61
"path.start" = 50.0
"path.overlap" = 2.5
"path.mirror" = MIRROR
"geometry.wheelbase" = 2.34
"vehicle.understeer_gradient" = 0.00187
"steer.ratio" = 16.0
"speed.initial" = 12.5
"speed.control" = true
[[component]]
name = "antilock"
fmu = "AntilockBraking"
inputs = { "target_slip.*" = 0.2, "enable.antilock" = true, "yaw_control_pressure.*" = 0.0 }
[[component]]
name = "actuators"
fmu = "BrakeAndDriveActuators"
[[component]]
name = "plant"
fmu = "EspCar"
parameters = { "vehicle.initial_speed" = 12.5 }
inputs = { "suspension_force.*" = 0.0, "road_height.*" = 0.0, "road_friction.*" = 1.0 }
[[connection]]
from = "driver:driver.steer"
to = "plant:steer.front"
[[case]]
name = "only"
title = "Only"
[record]
signals = ["plant:vehicle.*", "driver:*"]
"""


def test_both_masters_drive_alike_and_to_both_sides(
    tmp_path: Path, run_by_both_masters: Callable[[Path, Path], Path]
) -> None:
    """A mirrored track gives the mirrored run (1e-12 of each peak). The fixture compares the bytes of both masters."""
    scenario = tmp_path / "loop.toml"
    runs = []
    for mirror in ("false", "true"):
        scenario.write_text(LOOP.replace("MIRROR", mirror), encoding="utf-8")
        runs.append(read_csv(run_by_both_masters(scenario, FOLDER)))
    left, right = (run.values for run in runs)
    lateral = ("position_y", "yaw", "yaw_rate", "sideslip", "lateral_acceleration", "lateral_velocity", "steer")
    compared = 0
    for name, values in left.items():
        peak = float(np.abs(values).max())
        if peak == 0.0:
            continue
        is_lateral = name.rpartition(".")[2] in lateral
        if is_lateral or name in ("vehicle.position_x", "vehicle.speed", "driver.throttle"):
            sign = -1.0 if is_lateral else 1.0
            assert float(np.abs(values - sign * right[name]).max()) <= 1e-12 * peak, name
            compared += 1
    assert compared >= 9
    # The vehicle did change lanes.
    assert left["vehicle.position_y"].max() > 2.0


@pytest.mark.parametrize(
    ("arguments", "warning"),
    [
        # In the paper on DualSlidingModeSteering, FuzzyCoordination provides the weights.
        (
            ("RescueVehicle", "--with", "DualSlidingModeSteering"),
            "nothing writes `weight.steering`, which keeps its start value 0.0; "
            "FMUs that write it: `FuzzyCoordination`",
        ),
        # AntilockBraking gets its pressures from DirectYawControl.
        (
            ("EspCar", "--with", "DirectYawControl"),
            "DirectYawControl has no effect: nothing reads its outputs; FMUs that read them: `AntilockBraking`",
        ),
    ],
)
def test_a_controller_that_lacks_another_one_is_named(
    arguments: tuple[str, ...], warning: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    commands.chassis("bench", "run", *arguments, "--quick", "--suite", "rollover", "--no-page", "--out", tmp_path)
    assert f"warning: {warning}" in capfd.readouterr().err

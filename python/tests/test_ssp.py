"""Runs that `chassis export` writes as SSP files, read again: the same components, values, connections and results.

The components keep their order in the file. The plan of an SSP file has the order `auto`; where it gives each
connection the same time as the scenario, the results are bit-identical.
"""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import pytest

from tests.commands import ROOT, chassis

FMUS = Path(os.environ.get("CHASSIS_FMU_DIR") or ROOT / "target" / "fmu")
SCENARIOS = sorted((ROOT / "scenarios").glob("*.toml"))
# Their antilock brakes are in a cycle, which `auto` breaks at another place.
OTHER_ORDER = ("esp_car_braking", "esp_car_steering_braking", "swap_esp_car_antilock")


def plan(*arguments: str | Path) -> dict[str, Any]:
    code, text = chassis("plan", "--json", *arguments)
    assert code == 0
    found: dict[str, Any] = json.loads(text)
    return found


def parts(run: dict[str, Any]) -> list[Any]:
    """Return name, FMU, values, and sources of the inputs of each component."""
    writers = {wire["slot"]: (own["name"], wire["name"]) for own in run["components"] for wire in own["outputs"]}

    def part(own: dict[str, Any]) -> tuple[Any, ...]:
        sources = [(wire["name"], writers[wire["slot"]], wire.get("conversion")) for wire in own["inputs"]]
        fmu = Path(own["fmu"]).name
        return own["name"], fmu, own.get("structure"), own["parameters"], own["constants"], sources

    return sorted((part(own) for own in run["components"]), key=lambda part: str(part[0]))


def timings(found: dict[str, Any], case: str) -> dict[str, Any]:
    wiring = next(wiring for wiring in found["wiring"] if wiring["case"] == case)
    return {f"{i['input']['component']}:{i['input']['variable']}": i["timing"] for i in wiring["inputs"]}


def exported(scenario: Path, case: str, folder: Path) -> Path:
    assert chassis("export", scenario, "--fmus", FMUS, "--case", case, "--out", folder)[0] == 0
    return next(folder.glob("*.ssp"))


def check(scenario: Path, case: str, of_scenario: dict[str, Any], folder: Path) -> bool:
    """Compare the plans of a run and of its export. Returns true if all connections have the same time."""
    package = exported(scenario, case, folder)
    of_package = plan(package)
    run = next(run for run in of_scenario["runs"] if run["case"] == case)
    assert parts(of_package["runs"][0]) == parts(run), (scenario.stem, case)
    for key in ("start", "stop", "step", "steps"):
        assert of_package["simulation"][key] == of_scenario["simulation"][key]
    names = [own["name"] for own in run["components"]]
    assert [own["name"] for own in plan(package, "--order", "sequential")["runs"][0]["components"]] == names
    return timings(of_package, "system") == timings(of_scenario, case)


def test_the_main_scenario_comes_back_with_the_same_bits(tmp_path: Path) -> None:
    scenario = ROOT / "scenarios" / "rescue_vehicle_step_steer.toml"
    shared = ("--no-page", "--no-fail", "--stop", "3", "--out")
    assert check(scenario, "coordination", plan(scenario, "--fmus", FMUS), tmp_path / "ssp")
    package = next((tmp_path / "ssp").glob("*.ssp"))
    assert chassis("run", scenario, "--fmus", FMUS, "--seeds", "1", *shared, tmp_path / "a")[0] == 0
    assert chassis("run", package, *shared, tmp_path / "b")[0] == 0

    def columns(path: Path) -> dict[str, tuple[str, ...]]:
        rows = [line.split(",") for line in path.read_text(encoding="utf-8").splitlines()]
        return dict(zip(rows[0], zip(*rows[1:], strict=True), strict=True))

    first = columns(tmp_path / "a" / scenario.stem / "runs" / "coordination_1.csv")
    again = columns(tmp_path / "b" / package.stem / "runs" / "system.csv")
    assert len(first) == 22
    assert {name: again[name] for name in first} == first


@pytest.mark.nightly
@pytest.mark.parametrize("scenario", SCENARIOS, ids=lambda path: str(path.stem))
def test_every_scenario_comes_back(scenario: Path, tmp_path: Path) -> None:
    of_scenario = plan(scenario, "--fmus", FMUS)
    for case in of_scenario["cases"]:
        has_same_times = check(scenario, case["name"], of_scenario, tmp_path / case["name"])
        assert has_same_times or scenario.stem in OTHER_ORDER, case["name"]

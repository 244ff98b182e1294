"""Requirements as JUnit XML, which continuous integration reads."""

import xml.etree.ElementTree as ET

from msgspec.structs import replace

from chassis_fmu.evaluation.results_table import Numbers, Values
from chassis_fmu.files.plan import Plan
from chassis_fmu.report import junit


def suite(scenario: Plan, values: Values, failures: dict[str, str] | None = None) -> ET.Element:
    failed = failures or {}
    finished = {run.id for run in scenario.runs} - set(failed)
    return ET.fromstring(junit.document(Numbers(scenario, values, finished), failed))


def values_of(scenario: Plan, number: float) -> Values:
    return {("roll_rms", case.name, None, seed): number for case in scenario.cases for seed in scenario.seed_values}


def test_a_requirement_is_a_test_case(scenario: Plan) -> None:
    found = suite(scenario, values_of(scenario, 400.0))
    assert found.attrib == {"name": "trial", "tests": "1", "failures": "0", "errors": "0", "skipped": "0"}
    (case,) = found
    assert case.attrib == {"classname": "trial", "name": "roll_rms.active"}
    assert "required at most 400 ° (Standard <1>)" in (case.findtext("system-out") or "")


def test_what_is_not_met_fails(scenario: Plan) -> None:
    found = suite(scenario, values_of(scenario, 401.0))
    assert (found.get("failures"), found.get("tests")) == ("1", "1")
    failure = found.find("testcase/failure")
    assert failure is not None
    assert "401.00 °" in failure.attrib["message"]


def test_failed_runs_are_errors_and_leave_the_requirement_open(scenario: Plan) -> None:
    run = next(run.id for run in scenario.runs if run.case == "active")
    found = suite(scenario, values_of(scenario, 1.0), {run: "component\x1b plant: fmi2DoStep\nmore"})
    assert [found.get(name) for name in ("tests", "errors", "skipped", "failures")] == ["2", "1", "1", "0"]
    error = found.find("testcase/error")
    assert error is not None
    assert error.attrib["message"] == "component\\u001b plant: fmi2DoStep"
    assert found.find("testcase/skipped") is not None


def test_a_scenario_without_requirements_has_no_test_cases(scenario: Plan) -> None:
    free = replace(scenario, metrics=tuple(replace(metric, requirement=None) for metric in scenario.metrics))
    assert suite(free, values_of(scenario, 1.0)).get("tests") == "0"

"""Reading plans."""

import json
from pathlib import Path

import pytest

from chassis_fmu import plan

HERE = Path(__file__).parent


def test_fields_arrive(scenario: plan.Plan) -> None:
    assert scenario.simulation.rows == 4
    assert [r.stem for r in scenario.runs] == ["passive_1", "passive_2", "active_1", "active_2"]
    component = scenario.run("passive", None, 1).components[1]
    assert component.fmu == HERE / "fmu" / "Plant.fmu"
    assert component.inputs == (plan.Wire(11, "Real", 0),)
    assert scenario.columns[0].display is None
    assert scenario.columns[1].display == plan.Conversion("deg", 57.29577951308232, 0.0)
    assert scenario.run("active", None, 2).columns == (None, 1)


def test_outputs_that_nothing_reads_are_grouped(scenario: plan.Plan) -> None:
    assert scenario.unread == (
        plan.Unread("source", ("idle", "spare"), ("passive",)),
        plan.Unread("source", ("idle",), ("active",)),
    )


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"format": 1}, "plan format 1, expected 3"),
        ({"simulation": None}, "unexpected type"),
        ({"cases": [{"name": "a"}]}, "no field 'title'"),
    ],
)
def test_what_is_not_a_plan_is_refused(change: dict[str, object], message: str) -> None:
    data = json.loads((HERE / "plan.json").read_text(encoding="utf-8"))
    with pytest.raises(plan.PlanError, match=message):
        plan.parse(json.dumps(data | change), HERE)


def test_text_that_is_not_json_is_refused() -> None:
    with pytest.raises(plan.PlanError, match="not JSON"):
        plan.parse("Compiling host v0.1.0", HERE)

"""Reading plans."""

import json
from pathlib import Path

import pytest

import plan_types
from chassis_fmu.files import plan
from chassis_fmu.report import page
from tests.commands import chassis

HERE = Path(__file__).parent


def test_fields_arrive(scenario: plan.Plan) -> None:
    assert scenario.simulation.rows == 4
    assert [r.stem for r in scenario.runs] == ["passive_1", "passive_2", "active_1", "active_2"]
    component = scenario.run("passive", None, 1).components[1]
    assert component.fmu == HERE / "fmu" / "Plant.fmu"
    assert component.inputs == (plan.Wire("speed", 11, "Real", 0),)
    assert scenario.columns[0].shown == plan.Conversion("1")
    assert scenario.columns[1].shown == plan.Conversion("deg", 57.29577951308232, 0.0)
    assert scenario.run("active", None, 2).columns == (None, 1)


def test_outputs_that_nothing_reads_are_grouped(scenario: plan.Plan) -> None:
    assert page.unread(scenario) == {("source", ("idle", "spare")): ["passive"], ("source", ("idle",)): ["active"]}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"format": 1}, "plan format 1, expected 9"),
        ({"simulation": None}, r"expected fields: .*`\$.simulation`"),
        ({"cases": [{"name": "a"}]}, r"missing required field `title` - at `\$.cases\[0\]`"),
        ({"name_": "b"}, "unknown field `name_`"),
    ],
)
def test_what_is_not_a_plan_is_rejected(change: dict[str, object], message: str) -> None:
    data = json.loads((HERE / "plan.json").read_text(encoding="utf-8"))
    with pytest.raises(plan.PlanError, match=message):
        plan.Plan.parse(json.dumps(data | change), HERE)


def test_text_that_is_not_json_is_rejected() -> None:
    with pytest.raises(plan.PlanError, match="not JSON"):
        plan.Plan.parse("Compiling host v0.1.0", HERE)


def test_the_types_are_those_of_the_command() -> None:
    """If this test fails, run `scripts/plan_types.py`; its docstring contains the command."""
    code, text = chassis("schema", "plan")
    assert code == 0
    assert Path(plan.__file__).read_text(encoding="utf-8") == plan_types.python(json.loads(text))

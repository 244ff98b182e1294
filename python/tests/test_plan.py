"""Reading plans."""

import json
from pathlib import Path
from typing import Any

import msgspec
import pytest

from chassis_fmu.files import plan
from tests.commands import chassis

HERE = Path(__file__).parent


def test_fields_arrive(scenario: plan.Plan) -> None:
    assert scenario.simulation.rows == 4
    assert [r.stem for r in scenario.runs] == ["passive_1", "passive_2", "active_1", "active_2"]
    component = scenario.run("passive", None, 1).components[1]
    assert component.fmu == HERE / "fmu" / "Plant.fmu"
    assert component.inputs == (plan.Wire(11, "Real", 0, "speed"),)
    assert scenario.columns[0].shown == plan.Conversion("1")
    assert scenario.columns[1].shown == plan.Conversion("deg", 57.29577951308232, 0.0)
    assert scenario.run("active", None, 2).columns == (None, 1)


def test_outputs_that_nothing_reads_are_grouped(scenario: plan.Plan) -> None:
    assert scenario.unread == (
        plan.Unread("source", ("idle", "spare"), ("passive",)),
        plan.Unread("source", ("idle",), ("active",)),
    )


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"format": 1}, "plan format 1, expected 7"),
        ({"simulation": None}, r"expected fields: .*`\$.simulation`"),
        ({"cases": [{"name": "a"}]}, r"missing required field `title` - at `\$.cases\[0\]`"),
        ({"name_": "b"}, "unknown field `name_`"),
    ],
)
def test_what_is_not_a_plan_is_rejected(change: dict[str, object], message: str) -> None:
    data = json.loads((HERE / "plan.json").read_text(encoding="utf-8"))
    with pytest.raises(plan.PlanError, match=message):
        plan.parse(json.dumps(data | change), HERE)


def test_text_that_is_not_json_is_rejected() -> None:
    with pytest.raises(plan.PlanError, match="not JSON"):
        plan.parse("Compiling host v0.1.0", HERE)


def shape(schema: Any, defined: dict[str, Any]) -> Any:
    """Return what a JSON Schema accepts, without texts, names of types and ranges of numbers."""

    def of(part: Any) -> Any:
        return shape(part, defined)

    def union(shapes: Any) -> Any:
        flat = [s for one in shapes for s in (one if isinstance(one, frozenset) else [one])]
        return flat[0] if len(set(flat)) == 1 else frozenset(flat)

    if "$ref" in schema:
        return of(defined[schema["$ref"].rpartition("/")[2]])
    if "allOf" in schema:
        (only,) = schema["allOf"]
        return of(only)
    if "const" in schema:
        return ("text", schema["const"])
    if "enum" in schema:
        return union(("text", word) for word in schema["enum"])
    if "anyOf" in schema and "properties" in schema:
        # The fields of one of several objects beside those that all have: msgspec has one object with all of them.
        alternatives = [defined[p["$ref"].rpartition("/")[2]] if "$ref" in p else p for p in schema["anyOf"]]
        optional = {name: value for part in alternatives for name, value in part["properties"].items()}
        return of({"type": "object", "properties": schema["properties"] | optional, "required": schema["required"]})
    if "anyOf" in schema or "oneOf" in schema:
        parts = schema.get("anyOf") or schema["oneOf"]
        if all(len(part.get("properties", ())) == 1 for part in parts):
            # One of several properties: msgspec has them as one object without required ones.
            fields = {name: of(value) for part in parts for name, value in part["properties"].items()}
            return ("object", frozenset(fields.items()), frozenset())
        return union(of(part) for part in parts)
    if isinstance(schema["type"], list):
        return union(of(schema | {"type": name}) for name in schema["type"])
    if schema["type"] == "array":
        items = schema.get("prefixItems") or [schema["items"]]
        length = len(items) if "prefixItems" in schema else schema.get("maxItems")
        return ("array", union(of(item) for item in items), length)
    if schema["type"] == "object":
        if "properties" not in schema:
            return ("map", of(schema["additionalProperties"]))
        required = frozenset(schema.get("required", ()))
        properties = {name: of(value) for name, value in schema["properties"].items()}
        # What may be missing is null in Python.
        cleaned = {
            name: value if name in required or not isinstance(value, frozenset) else union(value - {"null"})
            for name, value in properties.items()
        }
        return ("object", frozenset(cleaned.items()), required)
    return schema["type"]


def test_the_types_are_those_of_the_command() -> None:
    code, text = chassis("schema", "plan")
    assert code == 0
    theirs = json.loads(text)
    (ours,), defined = msgspec.json.schema_components(
        [plan.Plan], schema_hook=lambda _: {"type": "string"}, ref_template="#/$defs/{name}"
    )
    expected = {name: shape(value, theirs["$defs"]) for name, value in theirs["properties"].items()}
    found = {name: shape(value, defined) for name, value in defined["Plan"]["properties"].items()}
    assert ours == {"$ref": "#/$defs/Plan"}
    assert found == expected
    assert set(theirs["required"]) == set(defined["Plan"]["required"]) == set(expected)

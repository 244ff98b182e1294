"""The JSON Schemas accept all shipped files and reject mistakes, according to an independent validator."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import jsonschema
import pytest

from chassis_fmu.program import PACKAGE

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

ROOT = Path(__file__).parents[2]
FILES = [
    *(("scenario", path) for path in sorted((ROOT / "scenarios").rglob("*.toml"))),
    *(("study", path) for path in sorted((ROOT / "studies").glob("*.toml"))),
    *(("vehicle", path) for path in sorted((ROOT / "crates/fmu-assess/src/vehicles").glob("*.toml"))),
]


def schema(kind: str) -> Any:
    return json.loads((PACKAGE / "schemas" / f"{kind}.json").read_text(encoding="utf-8"))


@pytest.mark.parametrize(("kind", "path"), FILES, ids=lambda value: getattr(value, "stem", value))
def test_shipped_files_fit(kind: str, path: Path) -> None:
    jsonschema.validate(tomllib.loads(path.read_text(encoding="utf-8")), schema(kind), jsonschema.Draft7Validator)


@pytest.mark.parametrize(
    ("kind", "text"),
    [
        ("scenario", "titel = 'a'"),
        ("scenario", "[simulation]\nstop = '20'\nstep = 0.1"),
        ("scenario", "[[figure]]\nname = 'a'\ntitle = 'A'\nkind = 'tmie'"),
        ("study", "title = 'a'\nscenario = 's.toml'\nmethod = 'sample'\n[[vary]]\nname = 'x'\ndistribution = 'gauss'"),
        ("study", "title = 'a'\nscenario = 's.toml'\nmethod = 'optimize'\nrans = 3"),
        ("vehicle", "[vehicle]\nmass = 'heavy'"),
    ],
)
def test_mistakes_do_not_fit(kind: str, text: str) -> None:
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(tomllib.loads(text), schema(kind), jsonschema.Draft7Validator)


def keys(part: Any) -> Iterator[tuple[str, Any]]:
    if isinstance(part, dict):
        if part.get("type") == "object":
            yield from part.get("properties", {}).items()
        for inner in part.values():
            yield from keys(inner)
    elif isinstance(part, list):
        for inner in part:
            yield from keys(inner)


@pytest.mark.parametrize("kind", ["scenario", "study", "vehicle"])
def test_every_key_has_a_description(kind: str) -> None:
    assert [name for name, key in keys(schema(kind)) if not key.get("description")] == []

"""Reads the data of pages and validates it with the schema in `web/`."""

import json
from pathlib import Path
from typing import Any

import jsonschema
from lxml import html

SCHEMA = Path(__file__).parents[2] / "web" / "page-data.schema.json"


def read(text: str) -> dict[str, Any]:
    """Return the data in the text of a page."""
    data: dict[str, Any] = json.loads(text)
    jsonschema.validate(data, json.loads(SCHEMA.read_text(encoding="utf-8")), jsonschema.Draft202012Validator)
    return data


def data_of(page: Path) -> dict[str, Any]:
    """Return the data of a page, and check that each figure has an element with its name."""
    tree = html.document_fromstring(page.read_text(encoding="utf-8"))
    (text,) = tree.xpath("//script[@id='page-data']/text()")
    data = read(text)
    for figure in data["figures"]:
        assert len(tree.xpath(f"//figure[@id='{figure['name']}']/*[local-name()='svg']")) >= 1, figure["name"]
    return data

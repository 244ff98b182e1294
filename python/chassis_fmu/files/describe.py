"""The parts of modelDescription.xml that a report needs."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import fmpy
from fmpy.model_description import ModelDescription

from .plan import Conversion


@dataclass(frozen=True)
class Variable:
    """A variable: its start value (None if it has none), description, and the unit to show it in."""

    start: str | None
    description: str
    unit: Conversion


@dataclass(frozen=True)
class Description:
    """An FMU: its description and its variables by name."""

    text: str
    variables: dict[str, Variable]


def describe(path: Path) -> Description:
    """Read the description of an FMU; empty if the file is unreadable, because a report does not require it."""
    try:
        model = fmpy.read_model_description(str(path), validate=False)
    except Exception:  # fmpy raises bare Exceptions
        return Description("", {})
    shown = display_units(model)
    variables = {}
    for v in model.modelVariables:
        unit = str(_first(v, "unit") or "")
        display = str(_first(v, "displayUnit") or "")
        variables[v.name] = Variable(v.start, v.description or "", shown.get((unit, display), Conversion(unit)))
    return Description(model.description or "", variables)


def display_units(model: ModelDescription) -> dict[tuple[str, str], Conversion]:
    """Return the display units of an FMU, by unit and name."""
    return {
        (unit.name, display.name): Conversion(display.name, float(display.factor or 1.0), float(display.offset or 0.0))
        for unit in model.unitDefinitions
        for display in unit.displayUnits
    }


def sha256(path: Path) -> str:
    """Return the SHA-256 of a file in hexadecimal digits; empty for an unreadable file."""
    try:
        return hashlib.sha256(path.read_bytes()).hexdigest()
    except OSError:
        return ""


def _first(variable: Any, attribute: str) -> object:
    """Return an attribute of a variable, or of its declared type if the variable has none."""
    return getattr(variable, attribute, None) or getattr(variable.declaredType, attribute, None)

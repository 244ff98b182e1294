"""Links from pages to the lab, which replays runs in 3D. docs/guide/src/lab.md describes their format."""

from __future__ import annotations

import base64
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from urllib.parse import urlencode

import msgspec

from ..files.plan import Plan
from ..program import ROOT

# Environment variable with the address of a lab that is hosted elsewhere.
VARIABLE = "CHASSIS_FMU_LAB"
SITE = ROOT / "target" / "lab" / "index.html"

# The lab replays all maneuvers except these: their driver reads a table that only the test bench writes.
NOT_REPLAYED = ("slowly_increasing_steer", "frequency_response")


def address(folder: Path) -> str | None:
    """Return the address of the lab as seen from a page in a folder; None if `scripts/lab` has not built it."""
    hosted = os.environ.get(VARIABLE)
    if hosted:
        return hosted
    if not SITE.is_file():
        return None
    return Path(os.path.relpath(SITE, folder.resolve())).as_posix()


def has(fmu: str) -> bool:
    """Return whether an FMU with this name belongs to the library."""
    return (ROOT / "modelDescription" / f"{fmu}.xml").is_file()


def of_scenario(plan: Plan, folder: Path) -> list[tuple[str, str]]:
    """Return titles and addresses of replays: each case of a library scenario, beside its baseline."""
    site = address(folder)
    if site is None or Path(plan.file).resolve().parent != ROOT / "scenarios":
        return []
    links = []
    for case in plan.cases:
        setup = {"scenario": plan.name, "case": case.name}
        if plan.seeds:
            setup["seed"] = str(plan.seeds[0])
        if case.baseline is not None:
            setup["twin"] = case.baseline
        links.append((case.title, f"{site}#{urlencode(setup)}"))
    return links


def of_system(
    plant: str, controllers: Sequence[str], maneuver: str, values: Mapping[str, float], folder: Path
) -> str | None:
    """Return the address of a replay of a maneuver: the vehicle with controllers, beside the vehicle without them.

    None if there is no lab, or if it cannot replay the maneuver.
    """
    site = address(folder)
    if site is None or maneuver in NOT_REPLAYED:
        return None
    system = {
        "kind": "free",
        "vehicle": plant,
        "controllers": list(controllers),
        "maneuver": maneuver,
        "maneuverValues": dict(values),
        "road": "flat",
        "seed": 1,
    }
    text = base64.urlsafe_b64encode(msgspec.json.encode({"system": system, "values": {}})).decode().rstrip("=")
    return f"{site}#setup={text}"

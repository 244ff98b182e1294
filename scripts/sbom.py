"""Write the bill of materials of the wheel: the crates in its native code and in the program `chassis`."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
ROOTS = ("chassis", "chassis-fmu-native")


def crates(target: str) -> list[dict[str, Any]]:
    """Return the packages that are linked on a target, by name and version."""
    command = ["cargo", "metadata", "--locked", "--format-version", "1", "--filter-platform", target]
    metadata = json.loads(subprocess.check_output(command, cwd=ROOT))
    packages = {package["id"]: package for package in metadata["packages"]}
    nodes = {node["id"]: node for node in metadata["resolve"]["nodes"]}
    found: set[str] = set()
    waiting = [key for key, package in packages.items() if package["name"] in ROOTS]
    while waiting:
        key = waiting.pop()
        macro = any("proc-macro" in part["kind"] for part in packages[key]["targets"])
        if key not in found and not macro:
            found.add(key)
            linked = [dep for dep in nodes[key]["deps"] if any(kind["kind"] is None for kind in dep["dep_kinds"])]
            waiting += [dep["pkg"] for dep in linked]
    return sorted((packages[key] for key in found), key=lambda package: (package["name"], package["version"]))


def component(package: dict[str, Any]) -> dict[str, Any]:
    """Return a package in the format CycloneDX, without paths of this machine."""
    entry = {"type": "library", "name": package["name"], "version": package["version"]}
    if package["license"]:
        entry["licenses"] = [{"expression": package["license"].replace("/", " OR ")}]
    if package["source"]:
        entry["purl"] = f"pkg:cargo/{package['name']}@{package['version']}"
    return entry


def main(path: Path) -> None:
    """Write the file."""
    host = subprocess.check_output(["rustc", "-vV"], encoding="utf-8").partition("host: ")[2].split()[0]
    components = [component(package) for package in crates(host)]
    bom = {"bomFormat": "CycloneDX", "specVersion": "1.6", "version": 1, "components": components}
    path.write_text(json.dumps(bom, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]))

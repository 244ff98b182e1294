"""Write the bill of materials of the wheel: the crates in its native code and in the program `chassis`."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

TREE = "cargo tree --locked --package=chassis --package=chassis-fmu-native --edges=normal,no-proc-macro --prefix=none"
lines = subprocess.check_output([*TREE.split(), "--no-dedupe", "--format={p}\t{l}"], encoding="utf-8").splitlines()
components: list[dict[str, Any]] = []
for line in sorted(set(filter(None, lines))):
    package, license_ = line.split("\t")
    # cargo prints the folder of a local package after the version.
    name, version, *folder = package.split()
    component: dict[str, Any] = {"type": "library", "name": name, "version": version.removeprefix("v")}
    if license_:
        component["licenses"] = [{"expression": license_.replace("/", " OR ")}]
    if not folder:
        component["purl"] = f"pkg:cargo/{name}@{component['version']}"
    components.append(component)
bom = {"bomFormat": "CycloneDX", "specVersion": "1.6", "version": 1, "components": components}
Path(sys.argv[1]).write_text(json.dumps(bom, indent=1) + "\n", encoding="utf-8")

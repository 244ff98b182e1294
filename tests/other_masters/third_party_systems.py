"""Runs the SSP files of other projects and compares each outcome with the table below (docs/masters.md lists them).

    .venv/bin/python tests/other_masters/third_party_systems.py

Clones the projects from GitHub into `target/third_party`, at fixed commits. Folders with a `SystemStructure.ssd` are
zipped first. Prints the systems whose outcome is another one, and fails if there is one.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / "target" / "third_party"
PROJECTS = {
    "libcosim": ("https://github.com/open-simulation-platform/libcosim", "52cc82513d3099df3c1c91eeb980227db52c70cf"),
    "ecos": ("https://github.com/Ecos-platform/ecos", "cdfdeb2cb25db39c867f9e3c922c7ab0b26b76d4"),
    "OMSimulator": ("https://github.com/OpenModelica/OMSimulator", "2940ef11c2316c167bc78618d89de085b7cac52f"),
}
RUNS = "3 rows or more"
NO_BINARY = "no binary for linux64"
MAPPING = "parameter mappings"
EMPTY = "no components"
# Folder of the systems of each project; each system, its outcome (`RUNS`, or a part of the message), more options.
SYSTEMS: dict[tuple[str, str], dict[str, tuple[str, list[str]]]] = {
    ("libcosim", "tests/data/ssp"): {
        "demo/demo.ssp": (RUNS, []),
        "demo": ("fmi2", []),
        "demo/no_algorithm_element": ("fmi2", []),
        "demo/proxy": ("proxyfmu", []),
        "linear_transformation": ("fmi1", []),
    },
    ("ecos", "data/ssp/1.0"): {
        "dp_ship": ("FMI version 1.0", []),
        "quarter_truck": (NO_BINARY, []),
        "quarter_truck/quarter-truck.ssp": (NO_BINARY, []),
    },
    ("OMSimulator", "testsuite/tests/resources"): {
        "LOC": ("LOC", []),
        "LinearTransformation": (RUNS, []),
        "LinearTransformation3": (MAPPING, []),
        "ParkerSimPack": (NO_BINARY, []),
        "acvs_compositeModel": (RUNS, ["--timeout", "20"]),
        "dcmotor": (RUNS, []),
        "embrace": (MAPPING, []),
        "embrace_TwoConf": (MAPPING, []),
        "importExportAllResources": (MAPPING, []),
        "importParameterMapping": (MAPPING, []),
        "importParameterMappingInline": (MAPPING, []),
        "importStartValues": (EMPTY, []),
        "importStartValues1": (EMPTY, []),
        "import_export_parameters1": (RUNS, []),
        "import_export_parameters2": (RUNS, []),
        "import_export_parameters3": (RUNS, []),
        "import_hierarchical_ssv_sources": (MAPPING, []),
        "invalidSSD": (EMPTY, []),
        "invalidSSM": (MAPPING, []),
        "invalidSSV": (EMPTY, []),
        "pwmtest": (NO_BINARY, []),
        "replaceSubmodel4": (MAPPING, []),
        "replaceSubmodel5": (MAPPING, []),
        "toplevelparameter1": (RUNS, []),
        "toplevelparameter2": (RUNS, []),
    },
}


def checkout(project: str, paths: list[str]) -> Path:
    """Return a folder with these paths of a project at its commit."""
    url, commit = PROJECTS[project]
    folder = FOLDER / project
    if not folder.exists():
        subprocess.run(["git", "clone", "--quiet", "--no-checkout", url, folder], check=True)
    subprocess.run(["git", "-C", folder, "checkout", "--quiet", commit, "--", *paths], check=True)
    return folder


def run(path: Path, options: list[str]) -> tuple[bool, str]:
    """Run an SSP file or the folder of one. Return whether it has written results, and what it printed."""
    if path.is_dir():
        name = str(FOLDER / "packed" / path.name)
        path = Path(shutil.make_archive(name, "zip", path)).rename(f"{name}.ssp")
    out = FOLDER / "results"
    shutil.rmtree(out, ignore_errors=True)
    command = ["target/debug/chassis", "run", str(path), "--no-page", "--out", str(out), *options]
    # A file without a stop time needs one.
    for more in [[], ["--stop", "20"]]:
        done = subprocess.run([*command, *more], cwd=ROOT, capture_output=True, text=True, check=False)
        text = " ".join((done.stdout + done.stderr).split())
        if "--stop" not in text:
            break
    rows = [len(file.read_text().splitlines()) - 1 for file in out.rglob("runs/*.csv")]
    return done.returncode == 0 and bool(rows) and min(rows) >= 3, text


def main() -> int:
    """Run all systems; return the number of those with another outcome than expected."""
    (FOLDER / "packed").mkdir(parents=True, exist_ok=True)
    others = ran = 0
    for (project, folder), systems in SYSTEMS.items():
        base = checkout(project, [f"{folder}/{name}" for name in systems]) / folder
        for name, (expected, options) in systems.items():
            is_run, text = run(base / name, options)
            ran += is_run
            if is_run != (expected == RUNS) or (not is_run and expected not in text):
                others += 1
                print(f"{project}, {name}: expected {expected!r}, got: {text[-600:]}")
    total = sum(map(len, SYSTEMS.values()))
    print(f"{ran} of {total} SSP files of {len(PROJECTS)} projects run, {total - ran} are rejected as documented")
    return others


if __name__ == "__main__":
    sys.exit(1 if main() else 0)

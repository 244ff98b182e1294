"""A plan with FMI 2.0 and FMI 3.0 components, in both masters, with FMUs built from C."""

from __future__ import annotations

import csv
import math
import subprocess
import zipfile
from collections.abc import Callable
from pathlib import Path

import fmpy
import pytest

ROOT = Path(__file__).parents[2]
DATA = ROOT / "crates" / "fmu-import" / "tests" / "data"

# x' = -2 x from 1, exactly; y = x + u. The FMI 2.0 component reads the output of the FMI 3.0 component, whose variables
# have types that FMI 2.0 lacks. The array of the FMI 3.0 component is not connected, because the FMPy master does not
# support elements.
SCENARIO = """
title = "Versions"
reference = "None: a test."
[simulation]
stop = 0.3
step = 0.01
[[component]]
name = "new"
fmu = "Decay3"
parameters = { small = -5, wide = 100, label = "v" }
inputs = { u = 0.25, flag = true, mode = "second" }
[[component]]
name = "old"
fmu = "Decay2"
[[connection]]
from = "new:y"
to = "old:u"
[[case]]
name = "only"
title = "Only"
[record]
signals = ["new:y", "x", "y32", "not", "sum", "next", "old:y"]
"""


def test_both_masters_run_components_of_both_versions_alike(
    tmp_path: Path, run_by_both_masters: Callable[[Path, Path], Path]
) -> None:
    for number, platform in ((2, fmpy.platform), (3, fmpy.platform_tuple)):
        library = tmp_path / "Decay.so"
        options = ["-O1", "-shared", "-fPIC", "-fvisibility=hidden", "-ffp-contract=off", f"-DFMI={number}"]
        subprocess.run(["cc", *options, "-o", str(library), str(DATA / "decay.c"), "-lm"], check=True)
        with zipfile.ZipFile(tmp_path / f"Decay{number}.fmu", "w") as file:
            file.write(DATA / f"decay{number}.xml", "modelDescription.xml")
            file.write(library, f"binaries/{platform}/Decay.so")
    scenario = tmp_path / "versions.toml"
    scenario.write_text(SCENARIO, encoding="utf-8")
    with run_by_both_masters(scenario, tmp_path).open(encoding="utf-8") as file:
        row = list(csv.DictReader(file))[-1]
    x = math.exp(-2.0 * 0.3)
    assert float(row["x"]) == pytest.approx(x, abs=1e-14)
    assert float(row["old:y"]) == pytest.approx(2.0 * x + 0.25, abs=1e-14)
    rest = {name: float(row[name]) for name in ("y32", "not", "sum", "next")}
    assert rest == {"y32": 0.125, "not": 0.0, "sum": 95.0, "next": 3.0}

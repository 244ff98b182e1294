"""A system with one small FMU written in C, for tests of studies: y = f(a, b, c) after a step."""

from __future__ import annotations

import os
import subprocess
import sys
import zipfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import fmpy
import msgspec

from chassis_fmu import program
from chassis_fmu.study import app
from tests.commands import unwrapped

SOURCE = Path(__file__).parents[2] / "crates" / "fmu-import" / "tests" / "data" / "stranger.c"

DESCRIPTION = """<?xml version="1.0"?>
<fmiModelDescription fmiVersion="2.0" modelName="Function" guid="Function">
<CoSimulation modelIdentifier="Function" canHandleVariableCommunicationStepSize="true"/>
<UnitDefinitions><Unit name="m"><BaseUnit m="1"/><DisplayUnit name="cm" factor="100"/></Unit></UnitDefinitions>
<ModelVariables>
<ScalarVariable name="a" valueReference="0" causality="parameter" variability="fixed" initial="exact">
<Real start="0" unit="m" min="-10" max="10"/></ScalarVariable>
<ScalarVariable name="b" valueReference="2" causality="parameter" variability="fixed" initial="exact">
<Real start="1"/></ScalarVariable>
<ScalarVariable name="c" valueReference="3" causality="parameter" variability="fixed" initial="exact">
<Real start="0"/></ScalarVariable>
<ScalarVariable name="seed" valueReference="0" causality="parameter" variability="fixed" initial="exact">
<Integer start="0"/></ScalarVariable>
<ScalarVariable name="y" valueReference="1" causality="output"><Real/></ScalarVariable>
<ScalarVariable name="file" valueReference="0" causality="parameter" variability="fixed" initial="exact">
<String start=""/></ScalarVariable>
</ModelVariables>
<ModelStructure><Outputs><Unknown index="5"/></Outputs></ModelStructure>
</fmiModelDescription>
"""

SCENARIO = """title = "A function"
[simulation]
stop = 0.2
step = 0.1
[[component]]
name = "f"
fmu = "Function"
parameters = { a = 1.0, b = 2.0, c = 3.0 }
[[case]]
name = "plain"
title = "Plain"
[[case]]
name = "shifted"
title = "Shifted"
baseline = "plain"
parameters.f = { b = 3.0 }
[record]
signals = ["f:y"]
[[metric]]
name = "y"
title = "Value"
signal = "f:y"
kind = "final"
[[metric]]
name = "twice"
title = "Twice the value"
value = "2 * y"
"""

# Declares a, b and c in the C function.
NAMES = "double a = i->v.real[0], b = i->v.real[2], c = i->v.real[3]; int seed = i->v.integer[0]; (void)seed;"


def build(folder: Path, value: str = "a + 10 * b + 100 * c", before: str = "", name: str = "Function") -> Path:
    """Build an FMU whose output is the C expression `value`, after the statement `before`; returns its folder."""
    fmus = folder / "fmus"
    fmus.mkdir(exist_ok=True)
    library, source = folder / f"{name}.so", folder / f"{name}.c"
    source.write_text(f"#include <math.h>\n#include <signal.h>\n{SOURCE.read_text()}")
    step = f"do {{ {NAMES} {before}; i->v.real[1] = {value}; return 0; }} while (0)"
    options = ["-shared", "-fPIC", "-DSTATES", '-DVERSION="2.0"', f'-DGUID="{name}"', f"-DSTEP={step}"]
    subprocess.run(["cc", *options, "-o", str(library), str(source), "-lm"], check=True)
    with zipfile.ZipFile(fmus / f"{name}.fmu", "w") as file:
        file.writestr("modelDescription.xml", DESCRIPTION.replace("Function", name))
        file.write(library, f"binaries/{fmpy.platform}/{name}.so")
    return fmus


def write(folder: Path, study: str, scenario: str = SCENARIO) -> Path:
    (folder / "function.toml").write_text(scenario)
    path = folder / "study.toml"
    path.write_text(f'title = "A study"\nscenario = "function.toml"\n{study}')
    return path


def vary(name: str, variable: str, distribution: str) -> str:
    """Return the TOML text of a factor."""
    return f'[[vary]]\nname = "{name}"\nvariable = "{variable}"\n{distribution}\n'


def request(arguments: Sequence[str], folder: Path) -> subprocess.CompletedProcess[bytes]:
    """Call `chassis study` such that it prints its request to Python."""
    python = folder / "python"
    python.write_text("#!/bin/sh\nexec cat\n")
    python.chmod(0o755)
    command = [str(program.find()), "study", *arguments]
    environment = {**os.environ, "CHASSIS_PYTHON": str(python)}
    return subprocess.run(command, capture_output=True, env=environment, check=False)


def start(arguments: Sequence[str], folder: Path, **options: Any) -> subprocess.Popen[Any]:
    """Start Python with the request of `chassis study`."""
    path = folder / "request.json"
    path.write_bytes(request(arguments, folder).stdout)
    with path.open("rb") as given:
        return subprocess.Popen([sys.executable, "-m", "chassis_fmu.study"], stdin=given, **options)


def carry_out(arguments: Sequence[str]) -> int:
    """Run a study like `chassis study`, but in this process; returns the exit code."""
    done = request(arguments, Path(arguments[0]).parent)
    if done.returncode:
        print(unwrapped(done.stderr.decode()), file=sys.stderr)
        return done.returncode
    return app.carry_out(msgspec.json.decode(done.stdout, type=app.Request, dec_hook=lambda of, value: of(value)))

"""Every packed FMU passes the validators that importers use, without an error or a warning.

References: FMPy's validation of the model description, the XML schema of FMI 2.0 that FMPy ships, the schema and rules
of the FMU manipulation toolbox (`fmutool -check`), and fmi-sim, an importer written in Rust, whose runs must agree with
FMPy's. docs/validators.md describes validators that are run manually.

fmi-sim is not a Python package, so its tests carry the marker `ci`: `.ci/run` installs it and runs them.
CHASSIS_FMI_SIM names the program if it is elsewhere.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import zipfile
from collections.abc import Callable
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.model_description import ModelDescription
from fmpy.validation import validate_fmu
from lxml import etree
from numpy.typing import NDArray

ROOT = Path(__file__).parents[2]
FOLDER = Path(os.environ.get("CHASSIS_FMU_DIR", ROOT / "target" / "fmu"))
FMUS = sorted(FOLDER.glob("*.fmu"))
FMUTOOL = Path(sys.executable).with_name("fmutool")
FMI_SIM = Path(os.environ.get("CHASSIS_FMI_SIM", ROOT / "target" / "tools" / "bin" / "fmi-sim"))

# Duration of the run in which two importers are compared, s.
DURATION = 2.0
# Tolerance relative to the peak of a signal: about a hundred times the measured difference (9e-12, tire forces of
# EspCar). fmi-sim passes t1 - t0 as the step and uses another formula than FMPy to interpolate inputs; both effects are
# differences in the last bit.
TOLERANCE = 1e-9

each_fmu = pytest.mark.parametrize("path", FMUS, ids=lambda path: path.stem)


def test_there_are_fmus() -> None:
    assert FMUS, "run `cargo fmu pack --all`"


def by_schema(path: Path) -> list[str]:
    """Return the violations of the standard's schema in a model description."""
    schema = etree.XMLSchema(etree.parse(Path(fmpy.__file__).parent / "schema" / "fmi2" / "fmi2ModelDescription.xsd"))
    with zipfile.ZipFile(path) as archive:
        schema.validate(etree.fromstring(archive.read("modelDescription.xml")))
    return [str(error) for error in schema.error_log]


def by_fmpy(path: Path) -> list[str]:
    return list(validate_fmu(str(path)))


def by_toolbox(path: Path) -> list[str]:
    """Return the warnings and errors from `fmutool -check`; if it fails without a message, its exit code."""
    done = call(str(FMUTOOL), "-input", str(path), "-check")
    lines = [line for line in done.stdout.splitlines() if not line.startswith("INFO ")]
    return lines or ([f"exit code {done.returncode}"] if done.returncode else [])


def by_fmi_sim(path: Path) -> list[str]:
    """Return the messages of fmi-sim in short runs with each interface of the FMU."""
    description = fmpy.read_model_description(path, validate=False)
    interfaces = {"co-simulation": description.coSimulation, "model-exchange": description.modelExchange}
    # fmi-sim uses the step of the default experiment; a step beyond the end would be an error.
    end = max(0.01, 10.0 * float(description.defaultExperiment.stepSize))
    found = []
    for interface in (name for name, declared in interfaces.items() if declared is not None):
        done = call(str(fmi_sim()), "--model", str(path), "--output-file", os.devnull, interface, "-f", str(end))
        lines = [line for line in done.stdout.splitlines() if not line.startswith("Recorded outputs at time ")]
        found += lines or ([f"exit code {done.returncode}"] if done.returncode else [])
    return found


def call(*command: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, encoding="utf-8", check=False)


def fmi_sim() -> Path:
    assert FMI_SIM.is_file(), f"no fmi-sim at {FMI_SIM}; `cargo install fmi-sim --root target/tools` makes it"
    return FMI_SIM


VALIDATORS = (by_schema, by_fmpy, by_toolbox, pytest.param(by_fmi_sim, marks=pytest.mark.ci))
each_validator = pytest.mark.parametrize("validator", VALIDATORS, ids=lambda validator: validator.__name__)


@each_fmu
@each_validator
def test_nothing_is_found(validator: Callable[[Path], list[str]], path: Path) -> None:
    assert validator(path) == []


# For each validator, a defect that it must find: replaced pattern, replacement, and a part of the report.
DEFECTS: dict[Callable[[Path], list[str]], tuple[str, str, str]] = {
    by_schema: (" modelName=", ' modelMaker="me" modelName=', "modelMaker"),
    by_fmpy: ('(causality="input"[^>]*>\\s*<Real[^>]*?) start="[^"]*"', "\\1", "start"),
    by_toolbox: ('(causality="input"[^>]*>\\s*<Real[^>]*?) start="[^"]*"', "\\1", "a start value is required"),
    # The binary belongs to another description, which only a tool that loads the binary can detect.
    by_fmi_sim: ('guid="\\{', 'guid="{0', "Error instantiating import"),
}


@each_validator
def test_a_defect_is_found(validator: Callable[[Path], list[str]], tmp_path: Path) -> None:
    good, copy, bad = FOLDER / "YawRateReference.fmu", tmp_path / "copy.fmu", tmp_path / "bad.fmu"
    pattern, replacement, words = DEFECTS[validator]
    write_changed(good, copy, "$^", "")
    assert validator(copy) == []
    assert write_changed(good, bad, pattern, replacement) == 1
    assert words in "\n".join(validator(bad))


def write_changed(good: Path, to: Path, pattern: str, replacement: str) -> int:
    """Copy an FMU with the first match in its description replaced, and return the number of replacements."""
    count = 0
    with zipfile.ZipFile(good) as archive, zipfile.ZipFile(to, "w") as changed:
        for name in archive.namelist():
            content = archive.read(name)
            if name == "modelDescription.xml":
                text, count = re.subn(pattern, replacement, content.decode(), count=1)
                content = text.encode()
            changed.writestr(name, content)
    return count


@pytest.mark.ci
@each_fmu
def test_fmi_sim_runs_as_fmpy_does(path: Path, tmp_path: Path) -> None:
    """All inputs change, with the step that the FMU proposes; all outputs are compared at every step."""
    description = fmpy.read_model_description(str(path))
    step = float(description.defaultExperiment.stepSize)
    inputs = waves(description, step)
    given, out = tmp_path / "inputs.csv", tmp_path / "outputs.csv"
    command = [str(fmi_sim()), "--model", str(path), "--output-file", str(out)]
    if inputs is not None:
        assert inputs.dtype.names is not None
        rows = [",".join(inputs.dtype.names), *(",".join(repr(float(x)) for x in row) for row in inputs.tolist())]
        given.write_text("\n".join(rows) + "\n", encoding="utf-8")
        command += ["--input-file", str(given)]
    done = call(*command, "co-simulation", "--step", str(step), "--output-interval", str(step), "-f", str(DURATION))
    assert done.returncode == 0, done.stdout

    names = out.read_text(encoding="utf-8").splitlines()[0].split(",")
    found = np.loadtxt(out, delimiter=",", skiprows=1, converters=number)
    expected = fmpy.simulate_fmu(str(path), input=inputs, stop_time=DURATION, step_size=step, output_interval=step)
    # FMPy puts real columns first, fmi-sim keeps the order of the description.
    assert sorted(names) == sorted(expected.dtype.names)
    assert found.shape == (round(DURATION / step) + 1, len(names)) == (len(expected), len(names))
    for column, name in enumerate(names):
        values = expected[name].astype(float)
        assert np.isfinite(found[:, column]).all(), name
        peak = float(np.abs(values).max()) or 1.0
        assert float(np.abs(found[:, column] - values).max()) / peak < TOLERANCE, name


def number(text: str) -> float:
    """Parse a value from fmi-sim's file, in which Booleans are words."""
    return {"false": 0.0, "true": 1.0}[text] if text in ("false", "true") else float(text)


def waves(description: ModelDescription, step: float) -> NDArray[np.float64] | None:
    """Return inputs about their start values and within their limits, no two equal, at the start of every step.

    Booleans are always true, because the tools can differ in the step in which a discrete input changes.
    """
    inputs = [v for v in description.modelVariables if v.causality == "input"]
    if not inputs:
        return None
    times = np.arange(round(DURATION / step) + 1) * step
    columns = [times]
    for j, variable in enumerate(inputs):
        if variable.type == "Boolean":
            columns.append(np.ones(len(times)))
            continue
        assert variable.type in ("Real", "Float64"), variable.name
        start = float(variable.start)
        wave = start + 0.01 * max(1.0, abs(start)) * np.sin(2.0 * np.pi * (1 + j % 5) * times + 1.3 * j)
        columns.append(np.clip(wave, float(variable.min or -np.inf), float(variable.max or np.inf)))
    signals = np.empty(len(times), dtype=[("time", float), *((v.name, float) for v in inputs)])
    for name, column in zip(signals.dtype.names or (), columns, strict=True):
        signals[name] = column
    return signals


@each_fmu
def test_the_default_experiment_runs(path: Path) -> None:
    """Run a tenth of the experiment, with the step that the FMU proposes; all recorded outputs must be finite."""
    description = fmpy.read_model_description(str(path))
    experiment = description.defaultExperiment
    result = fmpy.simulate_fmu(
        str(path),
        stop_time=float(experiment.stopTime) / 10,
        step_size=float(experiment.stepSize),
        output_interval=float(experiment.stepSize) * 10,
    )
    assert len(result) > 1
    for name in result.dtype.names:
        assert all(abs(value) < float("inf") for value in result[name]), name

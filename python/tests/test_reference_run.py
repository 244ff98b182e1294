"""The reference run inside an FMU, reproduced with fmpy and only the FMU's documentation.

An independent implementation of the model computed `extra/io.github.chassis-fmu/reference.csv`. The documentation
inside the FMU describes the order of calls: set the inputs of a row; read the outputs of a plant before the step, those
of a discrete-time model after the step. Plants are recognized by providesDirectionalDerivative. Empty cells are not
compared.
"""

from __future__ import annotations

import csv
import io
import os
import zipfile
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.fmi2 import FMU2Slave
from fmpy.model_description import ScalarVariable

ROOT = Path(__file__).parents[2]
FOLDER = Path(os.environ.get("CHASSIS_FMU_DIR") or ROOT / "target" / "fmu")
ENTRY = "extra/io.github.chassis-fmu/reference.csv"

# Time between rows without a time column (s).
STEP = 0.001

# Largest error relative to the peak of a column. The 8 significant digits of the file give an error of up to 5e-8; in
# runs without jumps, the errors of both integrations are below 1e-9. The rest is a margin for columns that are small
# differences of large numbers, such as accelerations.
TOLERANCE = 1e-6

# Smallest peak of a column, so that columns that are zero up to rounding pass.
FLOOR = 1e-6


# Smallest number of values in each column of outputs, for a meaningful comparison.
FEWEST = 30

MODELS = sorted(path.parent for top in ("fmu-plant", "fmu-controllers") for path in ROOT.glob(f"{top}/*/Cargo.toml"))


def fmu_of(package: Path) -> Path:
    return FOLDER / f"{''.join(word.capitalize() for word in package.name.split('-'))}.fmu"


def test_all_models_are_found() -> None:
    assert len(MODELS) == len(list((ROOT / "modelDescription").glob("*.xml"))) > 20


@pytest.mark.parametrize("package", MODELS, ids=lambda package: package.name)
def test_every_fmu_has_the_reference_run_of_its_package(package: Path) -> None:
    path = fmu_of(package)
    assert path.exists(), f"{path} does not exist: run `cargo fmu pack --all`"
    with zipfile.ZipFile(path) as archive:
        assert ENTRY in archive.namelist(), f"{path.name} has no reference run"
        assert archive.read(ENTRY) == (package / "reference.csv").read_bytes(), f"{path.name} is not up to date"


def write(slave: FMU2Slave, variable: ScalarVariable, value: float) -> None:
    if variable.type == "Real":
        slave.setReal([variable.valueReference], [value])
    elif variable.type == "Boolean":
        slave.setBoolean([variable.valueReference], [bool(value)])
    else:
        slave.setInteger([variable.valueReference], [int(value)])


def read(slave: FMU2Slave, variable: ScalarVariable) -> float:
    get = {"Real": slave.getReal, "Boolean": slave.getBoolean, "Integer": slave.getInteger}[variable.type]
    return float(get([variable.valueReference])[0])


@pytest.mark.parametrize("path", [fmu_of(package) for package in MODELS], ids=lambda path: path.stem)
def test_an_fmu_reproduces_its_reference_run(path: Path, tmp_path: Path) -> None:
    fmpy.extract(str(path), str(tmp_path))
    description = fmpy.read_model_description(str(tmp_path))
    text = (tmp_path / ENTRY).read_text(encoding="utf-8")
    names, *rows = csv.reader(io.StringIO(text))
    values = np.array([[cell or "nan" for cell in row] for row in rows], dtype=float)
    variables = {v.name: v for v in description.modelVariables}
    unknown = set(names) - {"time"} - set(variables)
    assert not unknown, f"columns that are no variables: {sorted(unknown)}"
    inputs = [i for i, n in enumerate(names) if n != "time" and variables[n].causality == "input"]
    outputs = [i for i, n in enumerate(names) if n != "time" and variables[n].causality == "output"]
    assert outputs
    times = values[:, names.index("time")] if "time" in names else np.arange(len(values)) * STEP
    assert np.isfinite(values[:, inputs]).all(), "inputs have a number in every row"
    plant = description.coSimulation.providesDirectionalDerivative

    slave = FMU2Slave(
        guid=description.guid,
        unzipDirectory=str(tmp_path),
        modelIdentifier=description.coSimulation.modelIdentifier,
        instanceName=path.stem,
    )
    slave.instantiate()
    found = []
    try:
        slave.setupExperiment(startTime=float(times[0]))
        slave.enterInitializationMode()
        slave.exitInitializationMode()
        for time, row in zip(times.tolist(), values.tolist(), strict=True):
            for i in inputs:
                write(slave, variables[names[i]], row[i])
            if plant:
                found.append([read(slave, variables[names[i]]) for i in outputs])
            slave.doStep(currentCommunicationPoint=time, communicationStepSize=STEP)
            if not plant:
                found.append([read(slave, variables[names[i]]) for i in outputs])
        slave.terminate()
    finally:
        slave.freeInstance()

    expected = values[:, outputs]
    given = np.isfinite(expected)
    assert (given.sum(axis=0) >= FEWEST).all()
    peak = np.maximum(np.abs(np.where(given, expected, 0.0)).max(axis=0), FLOOR)
    # A result that is not a number makes the comparison false.
    error = np.where(given, np.abs(np.array(found) - expected), 0.0).max(axis=0) / peak
    worst = {names[i]: e for i, e in zip(outputs, error.tolist(), strict=True) if not e <= TOLERANCE}
    assert not worst, f"error over peak: {worst}"

"""Every packed FMU passes the validators that importers use.

References: the rules of FMPy (its validation of the model description), and the XML schema of FMI 2.0 that FMPy ships.
"""

from __future__ import annotations

import os
import zipfile
from pathlib import Path

import fmpy
import pytest
from fmpy.validation import validate_fmu
from lxml import etree

ROOT = Path(__file__).parents[2]
FOLDER = Path(os.environ.get("CHASSIS_FMU_DIR", ROOT / "target" / "fmu"))
FMUS = sorted(FOLDER.glob("*.fmu"))


def test_there_are_fmus() -> None:
    assert FMUS, "run `cargo fmu pack --all`"


@pytest.mark.parametrize("path", FMUS, ids=lambda path: path.stem)
def test_fmpy_has_nothing_to_say(path: Path) -> None:
    assert validate_fmu(str(path)) == []


@pytest.mark.parametrize("path", FMUS, ids=lambda path: path.stem)
def test_the_schema_of_the_standard_holds(path: Path) -> None:
    schema = etree.XMLSchema(etree.parse(Path(fmpy.__file__).parent / "schema" / "fmi2" / "fmi2ModelDescription.xsd"))
    with zipfile.ZipFile(path) as archive:
        description = etree.fromstring(archive.read("modelDescription.xml"))
    schema.assertValid(description)


@pytest.mark.parametrize("path", FMUS, ids=lambda path: path.stem)
def test_the_default_experiment_runs(path: Path) -> None:
    """A tenth of it, with the step that the FMU proposes; all recorded outputs have to be finite."""
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

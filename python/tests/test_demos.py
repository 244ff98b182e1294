"""The runs in the model pictures use existing variables of the packed FMUs, and each plot has one unit."""

from __future__ import annotations

import os
from pathlib import Path

import fmpy
import pytest

from model_pictures import demos, pictures

FOLDER = Path(os.environ.get("CHASSIS_FMU_DIR") or Path(__file__).parents[2] / "target" / "fmu")


@pytest.mark.parametrize("name", demos.DEMOS)
def test_a_demo_fits_its_fmu(name: str) -> None:
    path = FOLDER / f"{name}.fmu"
    assert path.exists(), f"run `cargo fmu pack {name}`"
    description = fmpy.read_model_description(str(path))
    demo = demos.DEMOS[name]
    assert {demos.variable(description, n).causality for n in demo.inputs} <= {"input"}
    assert {demos.variable(description, n).causality for n in demo.outputs} == {"output"}
    assert {demos.variable(description, n).causality for n in demo.parameters} <= {"parameter"}
    assert len({pictures.shown_unit(description, n).unit for n in demo.outputs}) == 1

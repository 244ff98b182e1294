"""Directional and adjoint derivatives of every continuous-time FMI 3.0 FMU, in model exchange.

References: adjoint derivatives are the transpose of directional derivatives, and both agree with central differences of
the values of the same FMU. The FMUs are those of `test_fmi3.py`.
"""

from __future__ import annotations

import os
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.model_description import ModelDescription, ModelVariable
from numpy.typing import NDArray

Array = NDArray[np.float64]

pytestmark = pytest.mark.ci

FOLDER = Path(os.environ.get("CHASSIS_FMU3_DIR", Path(__file__).parents[2] / "target" / "fmu3"))
DESCRIPTIONS = {path: fmpy.read_model_description(str(path)) for path in sorted(FOLDER.glob("*.fmu"))}
# The differences are those of scalars.
CONTINUOUS = [
    path
    for path, description in DESCRIPTIONS.items()
    if description.numberOfContinuousStates > 0 and not any(v.dimensions for v in description.modelVariables)
]

# Tolerance relative to the largest derivative. Both derivatives sum the same products, of which only one is not zero.
TRANSPOSED = 1e-14
# Step of the central differences, in nominal values. The error of a difference is the third derivative times the square
# of the step, plus the rounding of the values, 1e-16, divided by the step.
STEP = 1e-5
DIFFERENCES = 1e-6
ROUNDING = 1e-10


def test_there_are_vehicles() -> None:
    assert {"RescueVehicle", "HeavyVehicle", "EspCar", "HydroPneumaticHalfCar"} <= {path.stem for path in CONTINUOUS}


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("path", CONTINUOUS, ids=lambda path: path.stem)
def test_derivatives_are_those_of_the_equations(path: Path, seed: int) -> None:
    """Compare at random states and inputs near the start values."""
    description = DESCRIPTIONS[path]
    derivatives = [unknown.variable for unknown in description.derivatives]
    states = [variable.derivative for variable in derivatives]
    inputs = [v for v in description.modelVariables if v.causality == "input" and v.type == "Float64"]
    outputs = [v for v in description.modelVariables if v.causality == "output" and v.type == "Float64"]
    knowns = [*states, *inputs]
    unknowns = [*derivatives, *(v for v in outputs if v not in states)]
    rows, columns = [v.valueReference for v in unknowns], [v.valueReference for v in knowns]
    nominal = np.array([nominal_of(v) for v in knowns])

    instance = started(path, description)
    random = np.random.default_rng(seed)
    point = np.array(instance.getFloat64(columns)) + 0.01 * nominal * random.uniform(-1.0, 1.0, len(knowns))
    instance.setFloat64(columns, list(point))
    # Event mode updates the frozen relations to the new point.
    instance.enterEventMode()
    instance.updateDiscreteStates()
    instance.enterContinuousTimeMode()
    directional = np.array([instance.getDirectionalDerivative(rows, [column], [1.0]) for column in columns]).T
    adjoint = np.array([instance.getAdjointDerivative([row], columns, [1.0], len(columns)) for row in rows])
    greatest = np.abs(directional).max()
    assert np.abs(adjoint - directional).max() <= TRANSPOSED * greatest
    # Use one direction that changes all knowns, and one seed for all unknowns.
    direction, weights = random.uniform(-1.0, 1.0, len(knowns)) * nominal, random.uniform(-1.0, 1.0, len(rows))
    forward = np.array(instance.getDirectionalDerivative(rows, columns, list(direction)))
    backward = np.array(instance.getAdjointDerivative(rows, columns, list(weights), len(columns)))
    scale = np.abs(weights) @ np.abs(directional) @ np.abs(direction)
    assert abs(weights @ forward - backward @ direction) <= TRANSPOSED * scale

    values = np.abs(instance.getFloat64(rows))
    scaled = np.abs(directional) * nominal
    for j, column in enumerate(columns):
        sides = []
        for change in (STEP, -STEP):
            instance.setFloat64([column], [point[j] + change * nominal[j]])
            sides.append(np.array(instance.getFloat64(rows)))
        instance.setFloat64([column], [point[j]])
        difference = (sides[0] - sides[1]) / (2.0 * STEP)
        tolerance = DIFFERENCES * scaled.max(axis=1) + ROUNDING * (1.0 + values)
        wrong = np.abs(difference - directional[:, j] * nominal[j]) > tolerance
        assert not wrong.any(), (knowns[j].name, [unknowns[i].name for i in np.flatnonzero(wrong)])
    instance.freeInstance()


def nominal_of(variable: ModelVariable) -> float:
    return float(variable.nominal or 1.0)


def started(path: Path, description: ModelDescription) -> fmpy.fmi3.FMU3Model:
    instance = fmpy.instantiate_fmu(str(fmpy.extract(str(path))), description, "ModelExchange")
    instance.enterInitializationMode(startTime=0.0)
    instance.exitInitializationMode()
    instance.updateDiscreteStates()
    instance.enterContinuousTimeMode()
    return instance

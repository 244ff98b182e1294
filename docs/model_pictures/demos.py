"""The results in the pictures of the models: short runs with simple inputs.

The picture of a model without an entry shows its reference run if this has a time column, otherwise no result.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
from fmpy.model_description import ModelDescription, ScalarVariable
from numpy.typing import NDArray

STEP = 0.001

Array = NDArray[np.floating[Any]]
Signal = float | Callable[[Array], Array]


@dataclass(frozen=True)
class Demo:
    """A run of one FMU: inputs over time (s), parameters, and the drawn outputs, which have the same unit."""

    title: str
    stop: float
    outputs: tuple[str, ...]
    inputs: Mapping[str, Signal] = field(default_factory=dict)
    parameters: Mapping[str, float] = field(default_factory=dict)


def through(*points: tuple[float, float]) -> Callable[[Array], Array]:
    """Return the piecewise linear function through points (time, value)."""
    times, values = zip(*points, strict=True)
    return lambda t: np.interp(t, times, values)


def wave(amplitude: float, frequency: float) -> Callable[[Array], Array]:
    """Return a sine wave; the frequency is in Hz."""
    return lambda t: amplitude * np.sin(2.0 * np.pi * frequency * t)


def wave_rate(amplitude: float, frequency: float) -> Callable[[Array], Array]:
    """Return the derivative of `wave`."""
    return lambda t: 2.0 * np.pi * frequency * amplitude * np.cos(2.0 * np.pi * frequency * t)


DEG = np.pi / 180.0
KMH = 1.0 / 3.6

# The body rolls while the wheels stay on a flat road.
SWAY: Mapping[str, Signal] = {"body.roll": wave(2.0 * DEG, 0.5), "body.roll_rate": wave_rate(2.0 * DEG, 0.5)}

DEMOS: Mapping[str, Demo] = {
    "RescueVehicle": Demo(
        "Turn at 35 km/h: 6° at the front axle",
        4.0,
        ("body.roll", "vehicle.sideslip"),
        {"driver.speed": 35.0 * KMH, "steer.front": through((0.5, 0.0), (0.8, 6.0 * DEG))},
    ),
    "Road": Demo(
        "Road of class C at 36 km/h",
        5.0,
        ("road_height.fl", "road_height.fr"),
        {"vehicle.speed": 10.0},
    ),
    "Driver": Demo(
        "Double lane change",
        12.0,
        ("driver.steer",),
        parameters={"maneuver": 3},
    ),
    "PathDriver": Demo(
        "Fishhook of 270° at the steering wheel",
        8.0,
        ("driver.steer",),
        {"body.roll_rate": through((1.0, 0.0), (1.3, 0.4), (1.6, 0.0))},
        {"maneuver": 7, "steer.wheel_rate": 720.0 * DEG},
    ),
    "BicycleCar": Demo(
        "Step of the steering angle by 0.02 rad at 80 km/h",
        3.0,
        ("vehicle.yaw_rate", "body.roll_rate"),
        {"driver.speed": 80.0 * KMH, "steer.front": through((1.0, 0.0), (1.1, 0.02))},
    ),
    "DualSlidingModeSteering": Demo(
        "Turn at 35 km/h with a yaw rate that lags behind",
        4.0,
        ("steer.front", "steer.middle", "steer.rear"),
        {
            "vehicle.speed": 35.0 * KMH,
            "weight.steering": 1.0,
            "driver.steer": through((0.5, 0.0), (2.0, 8.0 * DEG)),
            "vehicle.yaw_rate": through((0.8, 0.0), (2.4, 0.26)),
        },
    ),
    "FuzzyCoordination": Demo(
        "Steering demand from 0 to 32° at 35 km/h",
        10.0,
        ("weight.integrated", "weight.roll", "weight.steering"),
        {"vehicle.speed": 35.0 * KMH, "driver.steer": through((0.0, 0.0), (10.0, 32.0 * DEG))},
    ),
    "IntegratedLqrSuspension": Demo(
        "Body swaying by 2° at 0.5 Hz",
        4.0,
        ("integrated_force.fl", "integrated_force.fr"),
        SWAY,
    ),
    "RollLqrSuspension": Demo(
        "Body swaying by 2° at 0.5 Hz",
        4.0,
        ("roll_force.fl", "roll_force.fr"),
        SWAY,
    ),
    "SuspensionMixer": Demo(
        "Shares pass from one law to the other",
        4.0,
        ("suspension_force.fl", "suspension_force.fr"),
        {
            "weight.integrated": through((1.0, 1.0), (3.0, 0.0)),
            "weight.roll": through((1.0, 0.0), (3.0, 1.0)),
            "integrated_force.fl": wave(2000.0, 2.0),
            "integrated_force.fr": wave(2000.0, 2.0),
            "roll_force.fl": wave(-4000.0, 0.5),
            "roll_force.fr": wave(4000.0, 0.5),
        },
    ),
}


def variable(description: ModelDescription, name: str) -> ScalarVariable:
    """Return the variable with a name.

    Raises LookupError if the FMU has no such variable.
    """
    for found in description.modelVariables:
        if found.name == name:
            return found
    raise LookupError(f"{description.modelName} has no variable {name}")


def run(demo: Demo, fmu: Path, description: ModelDescription) -> tuple[Array, dict[str, Array]]:
    """Run a demo and return times and drawn outputs; inputs without a signal keep their start values."""
    for name in (*demo.inputs, *demo.parameters, *demo.outputs):
        variable(description, name)
    times = np.arange(round(demo.stop / STEP) + 1) * STEP
    starts = {v.name: float(v.start) for v in description.modelVariables if v.causality == "input"}
    signals: dict[str, Signal] = {**starts, **demo.inputs}
    inputs = np.zeros(len(times), dtype=[(name, float) for name in ("time", *signals)])
    inputs["time"] = times
    for name, signal in signals.items():
        inputs[name] = signal(times) if callable(signal) else signal
    rows = fmpy.simulate_fmu(
        str(fmu),
        fmi_type="CoSimulation",
        stop_time=demo.stop,
        output_interval=STEP,
        start_values=dict(demo.parameters),
        input=inputs,
        output=list(demo.outputs),
    )
    return rows["time"], {name: rows[name] for name in demo.outputs}

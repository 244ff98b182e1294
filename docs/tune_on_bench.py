"""Tune parameters of controllers on the test bench, and write them to modelDescription/parameters/bench_*.ssv.

`.venv/bin/python docs/tune_on_bench.py [NAME...]`, after `scripts/setup --all` and `scripts/build`; each tuning
takes up to an hour. The requirements apply to the unchanged vehicle and to other conditions, such as a slippery road.
The search (Optuna, tree-structured Parzen estimator) has a fixed seed: the same FMUs give the same values.
"""

from __future__ import annotations

import argparse
import re
import subprocess
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

import optuna
from fmpy import read_model_description

from chassis_fmu.assess.assessment import Assessment, Folder
from chassis_fmu.program import ROOT
from chassis_fmu.scenario import worker_program

SEED = 1
PARAMETERS = ROOT / "modelDescription" / "parameters"

# As a limit, `WITHOUT` stands for the value of the system without controllers. A value that misses it by up to the
# share `SAME` passes, because the bench calls it *same*.
WITHOUT = "without"
SAME = 0.01

# Weight of a missed requirement, relative to the goals.
WEIGHT = 10.0

# Cost of a metric without a value: as if it missed its limit by this share.
NO_NUMBER = 1.0

# Significant digits of the written values; more have no visible effect on the bench.
DIGITS = 3


@dataclass(frozen=True)
class Requirement:
    """A lower or upper limit for a metric: a number, or `WITHOUT`."""

    metric: str
    least: float | str | None = None
    most: float | str | None = None

    def missed_by(self, found: Assessment) -> float:
        """Return by how much the metric misses the limit, relative to the limit; 0 if it meets the limit."""
        row = found.by_name[self.metric]
        bound = self.least if self.least is not None else self.most
        limit = row.without if bound == WITHOUT else bound
        if limit is None:
            # The system without controllers fails at its lowest speed or amplitude, so there is nothing to reach.
            return 0.0
        if isinstance(limit, str):
            raise ValueError(f"{self.metric} has no limit")
        if row.with_ is None:
            return NO_NUMBER
        beyond = float(row.with_) - limit
        allowed = SAME if bound == WITHOUT else 0.0
        return max(0.0, (beyond if self.least is None else -beyond) / abs(limit) - allowed)


@dataclass(frozen=True)
class Tuning:
    """A search: bounds of parameters (`component.parameter`), or a list of choices, and the requirements.

    Bounds above 0 are searched on a logarithmic scale.
    """

    plant: str
    controllers: Sequence[str]
    suites: Sequence[str]
    bounds: Mapping[str, tuple[float, float] | list[int]]
    requirements: Sequence[Requirement]
    goals: Mapping[str, float]
    """Metrics to improve beyond the requirements, each with the value that is worth 1; negative if lower is better."""
    trials: int
    conditions: Mapping[str, Sequence[str]]
    """Further conditions to which the requirements apply: titles and values (`--set`)."""
    also_from: Mapping[str, float] | None = None
    """Second starting point of the search, after the values of the paper."""


CAR_BY_HAND = {
    "direct_yaw_control.moment.deadband": 5600.0,
    "direct_yaw_control.moment.limit": 12000.0,
    "direct_yaw_control.reaching.rate": 11.6,
    "direct_yaw_control.switching.gain": 1.99,
    "direct_yaw_control.switching.boundary_layer": 0.107,
    "direct_yaw_control.reference.time_constant": 0.0844,
    "direct_yaw_control.pressure.limit": 2.9,
}
CAR = Tuning(
    "EspCar",
    ("DirectYawControl", "AntilockBraking"),
    ("stability",),
    {
        "direct_yaw_control.moment.deadband": (50.0, 10000.0),
        "direct_yaw_control.moment.limit": (500.0, 15000.0),
        "direct_yaw_control.reaching.rate": (0.5, 20.0),
        "direct_yaw_control.switching.gain": (0.05, 3.0),
        "direct_yaw_control.switching.boundary_layer": (0.02, 1.0),
        "direct_yaw_control.reference.time_constant": (0.02, 0.3),
        "direct_yaw_control.pressure.limit": (1.0, 8.0),
    },
    (
        Requirement("sine_with_dwell.yaw_rate_ratio_1s", most=0.35),
        Requirement("sine_with_dwell.yaw_rate_ratio_1_75s", most=0.20),
        Requirement("sine_with_dwell.lateral_displacement", least=1.83),
        Requirement("iso3888_1.max_entry_speed", least=WITHOUT),
        Requirement("iso3888_2.max_entry_speed", least=WITHOUT),
    ),
    {"iso3888_2.max_entry_speed": 100.0},
    40,
    {},
    CAR_BY_HAND,
)

TUNINGS = {
    "bench_esp_car": CAR,
    "bench_esp_car_friction": replace(
        CAR,
        bounds={**CAR.bounds, "direct_yaw_control.surface.weight.sideslip": (-0.03, 0.01)},
        conditions={
            f"friction {mu} instead of 0.77": (f"esp_car:tire.friction={mu}", f"direct_yaw_control:tire.friction={mu}")
            for mu in (0.6, 0.9)
        },
        also_from={**CAR_BY_HAND, "direct_yaw_control.surface.weight.sideslip": -0.0107},
    ),
    "bench_rescue_vehicle": Tuning(
        "RescueVehicle",
        (
            "FuzzyCoordination",
            "DualSlidingModeSteering",
            "IntegratedLqrSuspension",
            "RollLqrSuspension",
            "SuspensionMixer",
        ),
        ("stability",),
        {
            "dual_sliding_mode_steering.reference.model": [0, 1],
            "dual_sliding_mode_steering.reference.time_constant": (0.02, 1.0),
            "dual_sliding_mode_steering.reaching.rate.sideslip": (0.1, 10.0),
            "dual_sliding_mode_steering.reaching.rate.yaw_rate": (0.1, 10.0),
            "dual_sliding_mode_steering.surface.integral_gain.yaw_rate": (0.01, 3.0),
            "dual_sliding_mode_steering.steer.rate_limit.front": (0.05, 1.0),
            "dual_sliding_mode_steering.steer.rate_limit.rear": (0.02, 1.0),
            "dual_sliding_mode_steering.steer.angle_limit.rear": (0.01, 0.56),
        },
        (
            # Required here, although no regulation requires it of this vehicle.
            Requirement("sine_with_dwell.stable", least=1.0),
            Requirement("iso3888_1.max_entry_speed", least=WITHOUT),
            Requirement("iso3888_2.max_entry_speed", least=WITHOUT),
        ),
        {"iso3888_1.max_entry_speed": 100.0, "iso3888_2.max_entry_speed": 100.0},
        60,
        {
            "friction 0.5 instead of 0.7": ("rescue_vehicle:tire.friction=0.5",),
            "a mass of 30 t instead of 36 t": ("rescue_vehicle:vehicle.mass=30000.0",),
        },
        # Result of an earlier search with the unchanged vehicle only.
        {
            "dual_sliding_mode_steering.reference.model": 1,
            "dual_sliding_mode_steering.reference.time_constant": 0.0224,
            "dual_sliding_mode_steering.reaching.rate.sideslip": 0.555,
            "dual_sliding_mode_steering.reaching.rate.yaw_rate": 7.24,
            "dual_sliding_mode_steering.surface.integral_gain.yaw_rate": 0.139,
            "dual_sliding_mode_steering.steer.rate_limit.front": 0.907,
            "dual_sliding_mode_steering.steer.rate_limit.rear": 0.432,
            "dual_sliding_mode_steering.steer.angle_limit.rear": 0.124,
        },
    ),
    "bench_heavy_vehicle": Tuning(
        "HeavyVehicle",
        ("YawRateReference", "ActiveFrontSteering", "AllWheelSteering"),
        ("stability", "rollover"),
        {
            "active_front_steering.pid.proportional_gain": (0.02, 2.0),
            "active_front_steering.pid.integral_gain": (0.02, 10.0),
            "active_front_steering.pid.derivative_gain": (0.001, 0.2),
            "active_front_steering.fuzzy.proportional_scale": (0.0005, 0.5),
            "all_wheel_steering.pid.proportional_gain": (0.03, 20.0),
            "all_wheel_steering.pid.integral_gain": (0.03, 100.0),
            "all_wheel_steering.pid.derivative_gain": (0.001, 1.0),
            "all_wheel_steering.fuzzy.proportional_scale": (0.005, 5.0),
        },
        (
            Requirement("iso3888_1.max_entry_speed", least=WITHOUT),
            Requirement("fishhook.load_transfer_peak", most=WITHOUT),
            Requirement("j_turn.load_transfer_peak", most=WITHOUT),
        ),
        {"iso3888_1.max_entry_speed": 100.0},
        100,
        {
            "lateral tire forces reduced to 80 %": ("heavy_vehicle:tire.force_scale=0.8",),
            "a body of 15 t instead of 20 t": ("heavy_vehicle:body.mass=15000.0",),
        },
    ),
    "bench_hydro_pneumatic_half_car": Tuning(
        "HydroPneumaticHalfCar",
        ("ComfortSlidingMode", "HandlingSlidingMode", "SuspensionSwitch"),
        ("ride",),
        {
            "comfort_sliding_mode.surface.weight.wheel_height": (-5.0, 0.0),
            "comfort_sliding_mode.surface.weight.wheel_velocity": (-0.1, 0.03),
            "comfort_sliding_mode.surface.weight.heave": (0.2, 10.0),
            "comfort_sliding_mode.reaching.rate": (2.0, 30.0),
            "comfort_sliding_mode.switching.boundary_layer": (0.001, 0.1),
            "comfort_sliding_mode.allocation.right_to_left_ratio": (0.2, 1.2),
        },
        (
            Requirement("ride.c.dynamic_load_coefficient", most=WITHOUT),
            Requirement("ride.c.suspension_travel_rms", most=0.03),
        ),
        {"ride.c.heave_weighted": -1.0},
        200,
        {"a body of 1,300 kg instead of 1,525 kg": ("hydro_pneumatic_half_car:body.mass=1300.0",)},
    ),
}


def rounded(value: float) -> float:
    return float(f"{value:.{DIGITS}g}")


def driven(out: Path, plant: str, controllers: Sequence[str], more: Sequence[str]) -> Assessment:
    """Drive a vehicle through the maneuvers of the bench, and return the assessment."""
    command = [str(worker_program()), "bench", "run", plant, "--no-page", "--out", str(out)]
    command += ["--fmus", str(ROOT / "target" / "fmu"), *more]
    command += [part for name in controllers for part in ("--with", name)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, encoding="utf-8", check=False)
    if done.returncode not in (0, 1):
        raise SystemExit(done.stderr)
    return Folder(out).read()


def assessed(tuning: Tuning, values: Mapping[str, float], condition: Sequence[str]) -> Assessment:
    """Drive the maneuvers with the given parameter values, in a condition (`--set`)."""
    settings = [*condition, *(f"{name.replace('.', ':', 1)}={value!r}" for name, value in values.items())]
    more = [part for suite in tuning.suites for part in ("--suite", suite)]
    more += [part for setting in settings for part in ("--set", setting)]
    with tempfile.TemporaryDirectory() as folder:
        return driven(Path(folder), tuning.plant, tuning.controllers, more)


def missed(tuning: Tuning, found: Assessment) -> float:
    """Return the cost of the missed requirements."""
    return WEIGHT * sum(requirement.missed_by(found) for requirement in tuning.requirements)


def reached(tuning: Tuning, found: Assessment) -> float:
    """Return the worth of the values that the goals reach."""
    worth = 0.0
    for name, unit in tuning.goals.items():
        value = found.by_name[name].with_
        if value is not None:
            worth += float(value) / unit
        elif unit < 0.0:
            worth -= NO_NUMBER
    return worth


def of_the_paper(tuning: Tuning) -> dict[str, Any]:
    """Return the start values of the tuned parameters, limited to the bounds: the first point of the search."""
    values: dict[str, Any] = {}
    for controller in tuning.controllers:
        component = re.sub(r"(?<!^)(?=[A-Z])", "_", controller).lower()
        description = read_model_description(ROOT / "target" / "fmu" / f"{controller}.fmu")
        values |= {f"{component}.{variable.name}": variable.start for variable in description.modelVariables}
    found: dict[str, Any] = {}
    for name, bound in tuning.bounds.items():
        start = values[name]
        found[name] = int(start) if isinstance(bound, list) else min(max(float(start), bound[0]), bound[1])
    return found


def search(tuning: Tuning) -> optuna.study.Study:
    """Search for the values with the lowest cost."""

    def objective(trial: optuna.trial.Trial) -> float:
        values: dict[str, Any] = {}
        for name, bound in tuning.bounds.items():
            if isinstance(bound, list):
                values[name] = trial.suggest_categorical(name, bound)
            else:
                values[name] = rounded(trial.suggest_float(name, *bound, log=bound[0] > 0.0))
        found = assessed(tuning, values, ())
        cost = missed(tuning, found) - reached(tuning, found)
        complete = [other.value for other in study.get_trials(states=(optuna.trial.TrialState.COMPLETE,))]
        for step, condition in enumerate(tuning.conditions.values()):
            # Conditions can only add to the cost, so a trial that is already worse than the best one can stop.
            trial.report(cost, step)
            if complete and cost > min(value for value in complete if value is not None):
                raise optuna.TrialPruned
            cost += missed(tuning, assessed(tuning, values, condition))
        return cost

    optuna.logging.set_verbosity(optuna.logging.WARNING)
    study = optuna.create_study(sampler=optuna.samplers.TPESampler(seed=SEED))
    study.enqueue_trial(of_the_paper(tuning))
    if tuning.also_from is not None:
        study.enqueue_trial(dict(tuning.also_from))
    study.optimize(objective, tuning.trials, show_progress_bar=True)
    return study


def parameter_set(name: str, tuning: Tuning, values: Mapping[str, Any]) -> str:
    lines = []
    for parameter, value in values.items():
        kind, text = ("Integer", str(value)) if isinstance(value, int) else ("Real", repr(rounded(value)))
        lines.append(f'    <ssv:Parameter name={quoteattr(parameter)}><ssv:{kind} value="{text}"/></ssv:Parameter>')
    controllers = ", ".join(tuning.controllers)
    return "\n".join(
        [
            '<?xml version="1.0" encoding="UTF-8"?>',
            f"<!-- Tuned on the test bench by docs/tune_on_bench.py: {tuning.plant} with {controllers}.",
            "     The values are not those of the paper; docs/assessments.md compares both. -->",
            '<ssv:ParameterSet xmlns:ssv="http://ssp-standard.org/SSP1/SystemStructureParameterValues"',
            f'                  version="1.0" name="{name}" description="Tuned on the test bench">',
            "  <ssv:Parameters>",
            *lines,
            "  </ssv:Parameters>",
            "</ssv:ParameterSet>",
            "",
        ]
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"tunings to run: {', '.join(TUNINGS)} (default: all)")
    names = parser.parse_args().names or list(TUNINGS)
    unknown = [name for name in names if name not in TUNINGS]
    if unknown:
        parser.error(f"unknown tuning {unknown[0]}; choose from {', '.join(TUNINGS)}")
    for name in names:
        tuning = TUNINGS[name]
        study = search(tuning)
        if study.best_trial.number == 0:
            print(f"{name}: found no better values than those of the paper (cost {study.best_value:.4f})")
            continue
        path = PARAMETERS / f"{name}.ssv"
        path.write_text(parameter_set(name, tuning, study.best_params), encoding="utf-8")
        print(f"{path.relative_to(ROOT)}: cost {study.best_value:.4f} in trial {study.best_trial.number}")


if __name__ == "__main__":
    main()

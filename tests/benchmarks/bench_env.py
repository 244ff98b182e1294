"""Compare the speed of gymnasium environments: `scripts/bench env`.

`chassis_fmu.Env` and fmugym step the same FMU alternately. fmugym steps a single FMU, without a master; the scenario
therefore contains only this FMU, too.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np

import chassis_fmu as cf
from chassis_fmu.program import ROOT

OBSERVED = ["vehicle.yaw_rate", "vehicle.sideslip"]
STEER = np.array([0.01])
FOLDER = ROOT / "target" / "bench"
ROUNDS = 5

SCENARIO = """
title = "The car alone"
[simulation]
stop = 5.0
step = 0.001
[[component]]
name = "plant"
fmu = "EspCar"
{inputs}
[[case]]
name = "alone"
title = "Alone"
[record]
signals = ["plant:vehicle.yaw_rate", "plant:vehicle.sideslip"]
"""


def scenario(fmu: Path) -> Path:
    """Write a scenario with only the FMU, all inputs at their start values."""
    import fmpy

    inputs = [v for v in fmpy.read_model_description(fmu).modelVariables if v.causality == "input"]
    values = ", ".join(f'"{v.name}" = {v.start if v.type == "Real" else v.start.lower()}' for v in inputs)
    path = FOLDER / "car.toml"
    path.write_text(SCENARIO.format(inputs=f"inputs = {{ {values} }}"), encoding="utf-8")
    return path


def ours(fmu: Path, period: float) -> Any:
    act = {"plant:steer.front": (-0.3, 0.3)}
    return cf.Env(cf.Scenario(scenario(fmu)), act=act, observe=OBSERVED, reward=OBSERVED[0], period=period)


def theirs(fmu: Path, period: float) -> Any:
    from fmugym.fmugym import FMUGym  # type: ignore[import-not-found]
    from fmugym.fmugym_config import FMUGymConfig, VarSpace  # type: ignore[import-not-found]

    class Car(FMUGym):  # type: ignore[misc]
        def _noisy_init(self) -> dict[str, float]:
            return {}

        def compute_reward(self, obs: Any, _info: Any) -> float:
            return float(obs[0])

    act, observe, random = VarSpace("act"), VarSpace("observe"), VarSpace("random")
    act.add_var_box("steer.front", -0.3, 0.3)
    for name in OBSERVED:
        observe.add_var_box(name, -10.0, 10.0)
    return Car(FMUGymConfig(str(fmu), 0.0, 5.0, 0.001, period, inputs=act, outputs=observe, random_vars=random))


def steps(env: Any, count: int) -> float:
    env.reset()
    begin = time.perf_counter()
    for _ in range(count):
        env.step(STEER)
    return count / (time.perf_counter() - begin)


def resets(env: Any, count: int) -> float:
    """Return the time of a reset, s."""
    begin = time.perf_counter()
    for _ in range(count):
        env.reset()
    return (time.perf_counter() - begin) / count


def main() -> None:
    argparse.ArgumentParser(
        prog="scripts/bench env", description="Compare the speed of gymnasium environments."
    ).parse_args()
    FOLDER.mkdir(parents=True, exist_ok=True)
    fmu = ROOT / "target" / "fmu" / "EspCar.fmu"
    print(f"gymnasium {gymnasium.__version__}; the fastest of {ROUNDS} episodes each, alternating")
    print("| period, s | chassis_fmu, steps/s | fmugym, steps/s | ratio | reset, ms | fmugym, ms |")
    print("|---|---|---|---|---|---|")
    for period in (0.001, 0.01):
        environments = [make(fmu, period) for make in (ours, theirs)]
        count = round(4.9 / period)
        rounds = ([steps(env, count) for env in environments] for _ in range(ROUNDS))
        ours_, theirs_ = (max(rates) for rates in zip(*rounds, strict=True))
        times = [1e3 * resets(env, 20) for env in environments]
        print(f"| {period} | {ours_:.0f} | {theirs_:.0f} | {ours_ / theirs_:.2f} | {times[0]:.3f} | {times[1]:.1f} |")


if __name__ == "__main__":
    main()

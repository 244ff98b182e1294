"""Sobol indices of the braking distance for parameters of the antilock brakes, with SALib."""

import numpy as np
from SALib.analyze import sobol as analysis
from SALib.sample import sobol as design

import chassis_fmu as cf

names = ["antilock:pressure.rise_rate", "antilock:pressure.fall_rate", "antilock:slip.band"]  # MPa/s, MPa/s, 1
bounds = [[5.0, 60.0], [20.0, 120.0], [0.005, 0.05]]
problem = {"num_vars": 3, "names": names, "bounds": bounds}
brake = cf.Scenario("scenarios/esp_car_braking.toml")
# 16 keeps this example short; reliable indices need about 1024.
samples = design.sample(problem, 16, calc_second_order=False, seed=1)
values = [dict(zip(names, row.tolist(), strict=True)) for row in samples]
outcomes = brake.run_many(values, case="individual", point="flat", workers=2)
distances = np.array([brake.numbers(outcome)["distance"] for outcome in outcomes])
found = analysis.analyze(problem, distances, calc_second_order=False, seed=1)
for name, first, total in zip(names, found["S1"], found["ST"], strict=True):
    print(f"{name}: first-order index {first:.3f}, total index {total:.3f}")

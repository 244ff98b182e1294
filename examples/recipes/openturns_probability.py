"""The probability that the car needs more than 21.8 m to stop, with OpenTURNS (`pip install openturns`)."""

import openturns as ot

import chassis_fmu as cf

brake = cf.Scenario("scenarios/esp_car_braking.toml")


def distances(points: ot.Sample) -> list[list[float]]:
    """Return the braking distances in m for rise rates (MPa/s) and slip bands (1)."""
    values = [{"antilock:pressure.rise_rate": rise, "antilock:slip.band": band} for rise, band in points]
    outcomes = brake.run_many(values, case="individual", point="flat", workers=2)
    return [[brake.numbers(outcome)["distance"] or 0.0] for outcome in outcomes]


ot.RandomGenerator.SetSeed(1)
law = ot.JointDistribution([ot.Normal(20.0, 4.0), ot.Uniform(0.01, 0.03)])
sample = ot.PythonFunction(2, 1, func_sample=distances)(law.getSample(64))
print(f"mean {sample.computeMean()[0]:.3f} m, probability {1 - sample.computeEmpiricalCDF([21.8]):.3f}")

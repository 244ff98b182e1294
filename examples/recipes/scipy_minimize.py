"""A local minimum of the braking distance over the slip band of the antilock brakes, with scipy.optimize."""

from scipy.optimize import minimize_scalar

import chassis_fmu as cf

brake = cf.Scenario("scenarios/esp_car_braking.toml")


def distance(band: float) -> float:
    """Return the braking distance in m; NaN if the car does not stop."""
    number = brake.run({"antilock:slip.band": float(band)}, case="individual", point="flat")["distance"]
    return float("nan") if number is None else number


found = minimize_scalar(distance, bounds=(0.002, 0.05), method="bounded", options={"maxiter": 15})
print(f"{found.fun:.3f} m with a slip band of {found.x:.4f} after {found.nfev} runs")

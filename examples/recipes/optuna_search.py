"""The shortest braking distance of the antilock brakes, with Optuna."""

import optuna

import chassis_fmu as cf

brake = cf.Scenario("scenarios/esp_car_braking.toml")


def distance(trial: optuna.Trial) -> float:
    """Return the braking distance in m."""
    rise = trial.suggest_float("antilock:pressure.rise_rate", 5.0, 60.0)  # MPa/s
    fall = trial.suggest_float("antilock:pressure.fall_rate", 20.0, 120.0)  # MPa/s
    values = {"antilock:pressure.rise_rate": rise, "antilock:pressure.fall_rate": fall}
    return brake.run(values, case="individual", point="flat")["distance"] or float("nan")


search = optuna.create_study(sampler=optuna.samplers.TPESampler(seed=1))
search.optimize(distance, n_trials=20)
print(f"{search.best_value:.3f} m with {search.best_params}")

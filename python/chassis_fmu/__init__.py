"""Vehicles and chassis controllers as FMUs: run scenarios natively, vary them, control them, trim and linearize FMUs.

    import chassis_fmu as cf

    loop = cf.Scenario("scenarios/esp_car_braking.toml")
    loop.run({"antilock:pressure.rise_rate": 30.0}, case="individual")

Names are loaded on first use. `Env` needs gymnasium, and `linearize` needs control.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .comparison import compare
    from .env import Env
    from .linear import SteadyState, linearize, trim
    from .scenario import Outcome, RunError, Scenario, ScenarioError, fmus

__all__ = [
    "Env",
    "Outcome",
    "RunError",
    "Scenario",
    "ScenarioError",
    "SteadyState",
    "compare",
    "fmus",
    "linearize",
    "trim",
]

_MODULES = {"Env": "env", "compare": "comparison", "SteadyState": "linear", "linearize": "linear", "trim": "linear"}


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    value = getattr(import_module(f".{_MODULES.get(name, 'scenario')}", __name__), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})

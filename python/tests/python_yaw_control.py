"""A yaw control in a few lines of Python, with the signals of the FMU `DirectYawControl`.

`pythonfmu build -f python_yaw_control.py -d my_fmus` builds `my_fmus/PythonYawControl.fmu`.
"""

from __future__ import annotations

from functools import partial

from pythonfmu import Boolean, Fmi2Causality, Fmi2Slave, Fmi2Variability, Real

WHEELS = ("fl", "fr", "rl", "rr")


class PythonYawControl(Fmi2Slave):
    """A yaw moment proportional to the difference from the yaw rate of a steady turn at this steering angle."""

    description = "Yaw moment proportional to the yaw rate error, made by the brakes of one side"

    def __init__(self, **arguments: object) -> None:
        super().__init__(**arguments)
        # The data of EspCar: lengths (m), stability factor (s2/m2), friction limit (m/s2), brake gain (m3).
        self.wheelbase, self.track, self.wheel_radius = 2.34, 1.36, 0.29
        self.stability_factor = 7.99903e-4
        self.friction_limit = 0.85 * 0.77 * 9.81
        self.brake_gain = {"f": 1.6748e-4, "r": 6.6396e-5}
        # The only tunable parameter, N.m per rad/s.
        self.gain = 60e3
        self.values: dict[str, float] = {}
        self.is_enabled = False
        enable = Boolean(
            "enable.yaw_control",
            causality=Fmi2Causality.input,
            variability=Fmi2Variability.discrete,
            getter=lambda: self.is_enabled,
            setter=lambda value: setattr(self, "is_enabled", value),
        )
        self.register_variable(enable, nested=False)
        for name in ("driver.steer", "vehicle.speed", "vehicle.sideslip", "vehicle.yaw_rate"):
            self._real(name, Fmi2Causality.input)
        for name in ("demand.yaw_moment", "reference.yaw_rate", "reference.sideslip"):
            self._real(name, Fmi2Causality.output)
        for wheel in WHEELS:
            self._real(f"yaw_control_pressure.{wheel}", Fmi2Causality.output)

    def _real(self, name: str, causality: Fmi2Causality) -> None:
        self.values[name] = 0.0
        variable = Real(
            name,
            causality=causality,
            variability=Fmi2Variability.continuous,
            getter=partial(self.values.__getitem__, name),
            setter=partial(self.values.__setitem__, name),
        )
        self.register_variable(variable, nested=False)

    def do_step(self, current_time: float, step_size: float) -> bool:  # noqa: ARG002
        """Compute the outputs from the inputs; they are held until the next step."""
        v = self.values
        speed = max(v["vehicle.speed"], 3.0)
        target = speed * v["driver.steer"] / (self.wheelbase * (1.0 + self.stability_factor * speed**2))
        limit = self.friction_limit / speed
        target = min(max(target, -limit), limit)
        moment = self.gain * (target - v["vehicle.yaw_rate"]) if self.is_enabled else 0.0
        v["reference.yaw_rate"], v["demand.yaw_moment"] = target, moment
        for wheel in WHEELS:
            braked = moment > 0.0 if wheel.endswith("l") else moment < 0.0
            pressure = self.wheel_radius * abs(moment) / (self.track * self.brake_gain[wheel[0]]) * 1e-6
            v[f"yaw_control_pressure.{wheel}"] = min(pressure, 8.0) if braked else 0.0
        return True

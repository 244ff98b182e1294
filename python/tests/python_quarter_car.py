"""The quarter car of `examples/quarter-car` in Python, for `scripts/bench exporters`.

`pythonfmu build -f python_quarter_car.py -d my_fmus` builds `my_fmus/PythonQuarterCar.fmu`.
"""

from __future__ import annotations

from pythonfmu import Fmi2Causality, Fmi2Slave, Real

State = tuple[float, float, float, float]


class PythonQuarterCar(Fmi2Slave):
    """Body and wheel on a spring, a damper and a tire, with an actuator between them."""

    description = "Quarter car, one Runge-Kutta step per communication step"

    def __init__(self, **arguments: object) -> None:
        super().__init__(**arguments)
        for name in ("z_r", "f_a"):
            setattr(self, name, 0.0)
            self.register_variable(Real(name, causality=Fmi2Causality.input))
        for name in ("z_s", "v_s", "z_u", "v_u", "a_s"):
            setattr(self, name, 0.0)
            self.register_variable(Real(name, causality=Fmi2Causality.output))

    def derivatives(self, x: State) -> State:
        """Return the rates of body height, body velocity, wheel height and wheel velocity."""
        z_s, v_s, z_u, v_u = x
        f = 20_000.0 * (z_s - z_u) + 1_500.0 * (v_s - v_u) - self.f_a
        return v_s, -f / 400.0, v_u, (f - 180_000.0 * (z_u - self.z_r)) / 40.0

    def do_step(self, _time: float, step_size: float) -> bool:
        """Advance by one step of the classical Runge-Kutta method."""
        h = step_size
        x = (self.z_s, self.v_s, self.z_u, self.v_u)

        def along(k: State, part: float) -> State:
            return (x[0] + part * k[0], x[1] + part * k[1], x[2] + part * k[2], x[3] + part * k[3])

        k1 = self.derivatives(x)
        k2 = self.derivatives(along(k1, 0.5 * h))
        k3 = self.derivatives(along(k2, 0.5 * h))
        k4 = self.derivatives(along(k3, h))
        new = [x[i] + h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]) for i in range(4)]
        self.z_s, self.v_s, self.z_u, self.v_u = new
        self.a_s = self.derivatives((new[0], new[1], new[2], new[3]))[1]
        return True

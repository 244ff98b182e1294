"""Optimal lane change: CasADi imports SingleTrack.fmu as model exchange and IPOPT finds the steering.

    python lane_change.py SingleTrack.fmu --plot lane_change.png

The README states the problem. To solve another problem, copy and adapt `solve`.
"""

from __future__ import annotations

import argparse
import tempfile
from dataclasses import dataclass
from pathlib import Path

import casadi
import fmpy
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Collocation points per interval. The error is of order 6 in the length of the intervals.
DEGREE = 3


@dataclass(frozen=True)
class Problem:
    """A lane change from straight ahead to straight ahead."""

    # Lateral distance (m) and duration (s).
    width: float = 3.5
    duration: float = 3.0
    # Intervals with a constant steering rate.
    intervals: int = 60
    # Largest lateral acceleration (m/s2), steering angle (rad) and steering rate (rad/s).
    acceleration: float = 2.5
    steer: float = 0.1
    rate: float = 0.5


@dataclass(frozen=True)
class Solution:
    """The optimal steering and the motion that follows from it."""

    # Starts and ends of the intervals (s), states there (one row each), steering rates in between (rad/s).
    times: Array
    states: Array
    rates: Array
    # Lateral acceleration at the starts of the intervals (m/s2).
    accelerations: Array
    # Integral of the squared steering rate (rad2/s).
    cost: float
    iterations: int


def import_fmu(path: Path, folder: Path) -> tuple[casadi.Function, list[str]]:
    """Return (x, u) -> (derivatives of x, outputs), and the names of the states."""
    fmpy.extract(str(path), str(folder))
    model = casadi.DaeBuilder("model", str(folder), {})
    # Forward mode is off: in CasADi 3.8.2, a direction whose seeds are all zero returns the result of the previous
    # direction. Derivatives then come from the Jacobian, which consists of directional derivatives of the FMU.
    equations = model.create("equations", ["x", "u"], ["ode", "y"], {"enable_forward": False})
    acceleration = model.y().index("lateral_acceleration")
    x, u = casadi.MX.sym("x", model.nx()), casadi.MX.sym("u", model.nu())
    derivatives, outputs = equations(x, u)
    return casadi.Function("plant", [x, u], [derivatives, outputs[acceleration]]), model.x()


def solve(plant: casadi.Function, names: list[str], problem: Problem) -> Solution:
    """Minimize the integral of the squared steering rate, by direct collocation."""
    count, step = problem.intervals, problem.duration / problem.intervals
    points = casadi.collocation_points(DEGREE, "legendre")
    # Derivatives at the points and value at the end of an interval, from the values at its start and at the points.
    slopes, end, _ = casadi.collocation_coeff(points)
    states, steer = len(names), names.index("steer")

    task = casadi.Opti()
    # IPOPT converges better with variables of magnitude 1.
    scale = np.array([{"y": 1.0, "lateral_velocity": 1.0}.get(name, 0.1) for name in names])
    starts = casadi.repmat(casadi.DM(scale), 1, count + 1) * task.variable(states, count + 1)
    inner = [casadi.repmat(casadi.DM(scale), 1, count) * task.variable(states, count) for _ in range(DEGREE)]
    rates = 0.1 * task.variable(1, count)

    many = plant.map(count)
    values = [starts[:, :-1], *inner]
    for j in range(DEGREE):
        derivatives, acceleration = many(inner[j], rates)
        expected = sum(slopes[i, j] * value for i, value in enumerate(values))
        task.subject_to(casadi.vec((expected - step * derivatives) / scale) == 0.0)
        task.subject_to(task.bounded(-problem.acceleration, casadi.vec(acceleration), problem.acceleration))
    _, acceleration = many(starts[:, :-1], rates)
    task.subject_to(task.bounded(-problem.acceleration, casadi.vec(acceleration), problem.acceleration))
    ends = end[0] * values[0] + sum(end[i + 1] * value for i, value in enumerate(inner))
    task.subject_to(casadi.vec((ends - starts[:, 1:]) / scale) == 0.0)

    task.subject_to(starts[:, 0] == 0.0)
    task.subject_to(starts[:, -1] == casadi.DM([problem.width if name == "y" else 0.0 for name in names]))
    task.subject_to(task.bounded(-problem.steer, casadi.vec(starts[steer, :]), problem.steer))
    task.subject_to(task.bounded(-problem.rate, casadi.vec(rates), problem.rate))
    task.minimize(step * casadi.sumsqr(rates))

    task.solver("ipopt", {"print_time": False, "ipopt.print_level": 0, "ipopt.sb": "yes", "ipopt.tol": 1e-9})
    result = task.solve()
    x, u = np.array(result.value(starts)), np.array(result.value(rates)).ravel()
    _, acceleration = many(x[:, :-1], u[np.newaxis, :])
    return Solution(
        times=step * np.arange(count + 1, dtype=np.float64),
        states=x.T,
        rates=u,
        accelerations=np.array(acceleration).ravel(),
        cost=step * float(u @ u),
        iterations=int(result.stats()["iter_count"]),
    )


def replay(path: Path, solution: Solution) -> Array:
    """Run the FMU in co-simulation with the optimal steering and return its states at the times of the solution."""
    description = fmpy.read_model_description(str(path))
    states = [derivative.variable.derivative.valueReference for derivative in description.derivatives]
    rate = next(v.valueReference for v in description.modelVariables if v.name == "steer_rate")
    unpacked = fmpy.extract(str(path))
    instance = fmpy.instantiate_fmu(unpacked, description, "CoSimulation")
    instance.setupExperiment(startTime=0.0)
    instance.enterInitializationMode()
    instance.exitInitializationMode()
    rows = [instance.getReal(states)]
    for (start, stop), value in zip(
        zip(solution.times[:-1].tolist(), solution.times[1:].tolist(), strict=True),
        solution.rates.tolist(),
        strict=True,
    ):
        instance.setReal([rate], [value])
        instance.doStep(start, stop - start)
        rows.append(instance.getReal(states))
    instance.terminate()
    instance.freeInstance()
    return np.array(rows)


def plot(solution: Solution, problem: Problem, replayed: Array, names: list[str], path: Path) -> None:
    """Draw lateral position, lateral acceleration and steering angle over time."""
    import matplotlib as mpl

    mpl.use("agg")
    from matplotlib import pyplot

    figure, (upper, middle, lower) = pyplot.subplots(3, 1, sharex=True, figsize=(7.0, 7.0), layout="constrained")
    y, steer = names.index("y"), names.index("steer")
    upper.plot(solution.times, solution.states[:, y], label="CasADi, model exchange")
    upper.plot(solution.times, replayed[:, y], "--", label="FMPy, co-simulation")
    upper.set_ylabel("lateral position (m)")
    upper.legend()
    middle.plot(solution.times[:-1], solution.accelerations)
    for bound in (-problem.acceleration, problem.acceleration):
        middle.axhline(bound, color="gray", linestyle=":")
    middle.set_ylabel("lateral acceleration (m/s²)")
    lower.plot(solution.times, np.degrees(solution.states[:, steer]))
    lower.set_ylabel("steering angle (deg)")
    lower.set_xlabel("time (s)")
    figure.savefig(path, dpi=100)
    pyplot.close(figure)


def main() -> None:
    """Solve, replay, print a table and draw."""
    parser = argparse.ArgumentParser(description="Compute an optimal lane change with CasADi and SingleTrack.fmu")
    parser.add_argument("fmu", type=Path, help="SingleTrack.fmu, packed by `cargo fmu pack single-track`")
    parser.add_argument(
        "--plot", type=Path, default=Path("lane_change.png"), help="picture to write (default: lane_change.png)"
    )
    arguments = parser.parse_args()
    problem = Problem()
    with tempfile.TemporaryDirectory() as folder:
        plant, names = import_fmu(arguments.fmu, Path(folder))
        solution = solve(plant, names, problem)
        # The functions of the FMU are released before its folder is removed.
        del plant
    replayed = replay(arguments.fmu, solution)
    plot(solution, problem, replayed, names, arguments.plot)
    y, steer = names.index("y"), names.index("steer")
    for name, value, unit in (
        ("final lateral position", f"{solution.states[-1, y]:.6f}", "m"),
        ("the same, replayed in co-simulation", f"{replayed[-1, y]:.6f}", "m"),
        ("peak lateral acceleration", f"{np.abs(solution.accelerations).max():.3f}", "m/s2"),
        ("peak steering angle", f"{np.degrees(np.abs(solution.states[:, steer]).max()):.3f}", "deg"),
        ("peak steering rate", f"{np.degrees(np.abs(solution.rates).max()):.2f}", "deg/s"),
        ("iterations of IPOPT", str(solution.iterations), ""),
    ):
        print(f"{name:<36} {value:>10} {unit}".rstrip())


if __name__ == "__main__":
    main()

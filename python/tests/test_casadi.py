"""CasADi imports the continuous-time FMUs as model exchange, and finds an optimal lane change with one of them.

References: FMPy for the derivatives, `cargo fmu linearize` for the matrices at the same operating point, and for the
lane change Pontryagin's necessary conditions, solved by scipy with equations that are implemented here.
"""

from __future__ import annotations

import importlib.util
import json
import re
import subprocess
import sys
import tempfile
from ctypes import c_double
from functools import partial
from pathlib import Path
from types import ModuleType
from typing import Any

import fmpy
import numpy as np
import pytest
from fmpy.model_description import ModelDescription
from numpy.typing import NDArray

from tests.commands import CARGO_FMU, patience

Array = NDArray[np.float64]

pytestmark = pytest.mark.ci

ROOT = Path(__file__).parents[2]
# All continuous-time models, except LookupTable and AllTypes: they have no equations to linearize.
PACKAGES = (
    "esp-car",
    "heavy-vehicle",
    "hydro-pneumatic-half-car",
    "rescue-vehicle",
    "bicycle-car",
    "brake-and-drive-actuators",
    "actuator",
    "bouncing-ball",
    "dc-motor",
    "heat-exchanger",
    "quarter-car",
    "robertson",
    "single-track",
    "van-der-pol",
)
# Tolerance relative to the largest element of a matrix. Both tools return values from the same function of the FMU.
TOLERANCE = 1e-10


def name_of(package: str) -> str:
    return "".join(word.capitalize() for word in package.split("-"))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("fmus")
    command = [*CARGO_FMU, "pack", *PACKAGES, "--out", str(folder)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, encoding="utf-8", check=False)
    assert done.returncode == 0, done.stderr
    return folder


def operating_point(description: ModelDescription, unpacked: str) -> tuple[dict[str, float], Array]:
    """Return the changes from the start values (0.01 of the nominal values, some negative), and all states."""
    states = [derivative.variable.derivative for derivative in description.derivatives]
    inputs = [v for v in description.modelVariables if v.causality == "input" and v.type == "Real"]
    moved = {}
    for k, variable in enumerate([*inputs, *(v for v in states if v.initial == "exact")]):
        value = float(variable.start) + float(variable.nominal or 1.0) * (0.01, 0.02, -0.005, 0.015, -0.01)[k % 5]
        low, high = (None if limit is None else float(limit) for limit in (variable.min, variable.max))
        moved[variable.name] = min(max(value, -np.inf if low is None else low), np.inf if high is None else high)
    instance = fmpy.instantiate_fmu(unpacked, description, "ModelExchange")
    instance.setupExperiment(startTime=0.0)
    by_name = {v.name: v.valueReference for v in description.modelVariables}
    instance.setReal([by_name[name] for name in moved], list(moved.values()))
    instance.enterInitializationMode()
    instance.exitInitializationMode()
    values = (c_double * len(states))()
    instance.getContinuousStates(values, len(states))
    instance.freeInstance()
    return moved, np.array(values)


def derivatives_by_fmpy(description: ModelDescription, unpacked: str, moved: dict[str, float]) -> Array:
    instance = fmpy.instantiate_fmu(unpacked, description, "ModelExchange")
    instance.setupExperiment(startTime=0.0)
    by_name = {v.name: v.valueReference for v in description.modelVariables}
    instance.setReal([by_name[name] for name in moved], list(moved.values()))
    instance.enterInitializationMode()
    instance.exitInitializationMode()
    instance.newDiscreteStates()
    instance.enterContinuousTimeMode()
    values = (c_double * description.numberOfContinuousStates)()
    instance.getDerivatives(values, len(values))
    instance.freeInstance()
    return np.array(values)


@pytest.mark.parametrize("package", PACKAGES)
def test_derivatives_and_jacobians_are_those_of_the_fmu(folder: Path, package: str) -> None:
    """Excludes outputs that are not real, because CasADi 3.8 reads them with fmi2GetReal."""
    import casadi

    path = folder / f"{name_of(package)}.fmu"
    description = fmpy.read_model_description(str(path))
    unpacked = str(fmpy.extract(str(path)))
    moved, states = operating_point(description, unpacked)
    command = [*CARGO_FMU, "linearize", str(path), "--json"]
    command += [argument for name, value in moved.items() for argument in ("--set", f"{name}={value!r}")]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, encoding="utf-8", check=False)
    assert done.returncode == 0, done.stderr
    expected = json.loads(done.stdout)

    model = casadi.DaeBuilder("model", unpacked, {})
    assert model.provides_directional_derivatives()
    # Relations stay frozen as they are after initialization.
    for name, value in moved.items():
        model.set(name, value)
    types = {v.name: v.type for v in description.modelVariables}
    are_real = all(types[name] == "Real" for name in model.y())
    outputs = ["y"] if are_real else []
    assert sorted(model.x()) == sorted(expected["states"])
    assert sorted(model.u()) == sorted(expected["inputs"])
    inputs = np.array([moved[name] for name in model.u()])
    # CasADi uses its own order of states.
    order = [v.variable.derivative.name for v in description.derivatives]
    x = states[[order.index(name) for name in model.x()]]

    found = np.array(model.create("f", ["x", "u"], ["ode"])(x, inputs)).ravel()
    by_fmpy = derivatives_by_fmpy(description, unpacked, moved)[[order.index(name) for name in model.x()]]
    assert (found == by_fmpy).all()

    blocks = [f"jac_{f}_{v}" for f in ("ode", *outputs) for v in ("x", "u")]
    matrices = model.create("J", ["x", "u"], blocks)(x, inputs)
    rows = {"ode": expected["states"], "y": expected["outputs"]}
    names = {"ode": model.x(), "y": model.y()}
    columns = {"x": (expected["states"], model.x()), "u": (expected["inputs"], model.u())}
    for block, matrix, letter in zip(blocks, matrices, "ABCD", strict=False):
        _, function, variable = block.split("_")
        theirs, ours = columns[variable]
        wanted: Array = np.array(expected[letter], dtype=float).reshape(len(rows[function]), len(theirs))
        wanted = wanted[[rows[function].index(name) for name in names[function]]]
        wanted = wanted[:, [theirs.index(name) for name in ours]]
        differences = np.abs(np.array(casadi.DM(matrix)) - wanted)
        assert differences.max(initial=0.0) <= TOLERANCE * np.abs(wanted).max(initial=0.0), block


# Lane change ----------------------------------------------------------------------------------------------------------

EXAMPLE = ROOT / "examples" / "single-track" / "lane_change.py"
NAMES = ("y", "yaw", "lateral_velocity", "yaw_rate", "steer")


@pytest.fixture(scope="module")
def example() -> ModuleType:
    spec = importlib.util.spec_from_file_location("lane_change", EXAMPLE)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    # Dataclasses look up their module in sys.modules.
    sys.modules["lane_change"] = module
    spec.loader.exec_module(module)
    return module


def solve(example: ModuleType, folder: Path, **problem: float) -> tuple[Any, Any]:
    """Return a problem with changed values, and its solution."""
    task = example.Problem(**problem)
    plant, names = example.import_fmu(folder / "SingleTrack.fmu", Path(tempfile.mkdtemp()))
    assert tuple(names) == NAMES
    return task, example.solve(plant, names, task)


def test_the_lane_change_keeps_its_limits(example: ModuleType, folder: Path) -> None:
    """Tolerance of the limits: 1e-8 of their size, as for IPOPT. The acceleration reaches its limit between two rows.

    Tolerance of the run in co-simulation: the collocation has order 6, so its error in an interval is (0.05 s times
    6.5/s)^6 / 100,800 = 1e-8 of the states. IPOPT stops at 1e-9. 60 intervals add up to less than 1e-6.
    """
    problem, solution = solve(example, folder)
    steer = solution.states[:, NAMES.index("steer")]
    assert 0.999 < np.abs(solution.accelerations).max() / problem.acceleration < 1.0 + 1e-7
    assert np.abs(steer).max() <= problem.steer
    assert np.abs(solution.rates).max() <= problem.rate
    replayed = example.replay(folder / "SingleTrack.fmu", solution)
    assert np.abs(replayed - solution.states).max() < 1e-6
    assert replayed[-1] == pytest.approx([problem.width, 0.0, 0.0, 0.0, 0.0], abs=1e-6)


def equations(x: Array, rate: Array) -> tuple[Array, Array]:
    """Return the derivatives from the README's equations and their Jacobian, for many states at once."""
    speed, mass, inertia, front, rear, stiffness, friction = 25.0, 1500.0, 2500.0, 1.2, 1.4, (100e3, 110e3), 0.8
    _, yaw, v, r, steer = x
    zero, one = np.zeros_like(yaw), np.ones_like(yaw)
    slips = (steer - (v + front * r) / speed, -(v - rear * r) / speed)
    limits = [friction * mass * 9.81 * arm / (front + rear) for arm in (rear, front)]
    shares = [np.tanh(c * slip / limit) for c, slip, limit in zip(stiffness, slips, limits, strict=True)]
    f, b = (limit * share for limit, share in zip(limits, shares, strict=True))
    df, db = (c * (1.0 - share**2) for c, share in zip(stiffness, shares, strict=True))
    derivatives = np.array(
        [
            speed * np.sin(yaw) + v * np.cos(yaw),
            r,
            (f + b) / mass - speed * r,
            (front * f - rear * b) / inertia,
            rate,
        ]
    )
    by_v = (-(df + db) / speed / mass, -(front * df - rear * db) / speed / inertia)
    by_r = ((-front * df + rear * db) / speed / mass - speed, -(front**2 * df + rear**2 * db) / speed / inertia)
    jacobian = np.array(
        [
            [zero, speed * np.cos(yaw) - v * np.sin(yaw), np.cos(yaw), zero, zero],
            [zero, zero, zero, one, zero],
            [zero, zero, by_v[0], by_r[0], df / mass],
            [zero, zero, by_v[1], by_r[1], front * df / inertia],
            [zero, zero, zero, zero, zero],
        ]
    )
    return derivatives, jacobian


def test_the_lane_change_is_optimal(example: ModuleType, folder: Path) -> None:
    """Reference: Pontryagin's conditions, w = -p_steer / 2 and p' = -(df/dx)^T p, as a boundary value problem.

    In CasADi, the steering rate is constant in each interval of length h, so the cost is higher by h^2/12 times the
    integral of w'^2, plus terms of order h^4. Tolerance: (h times 2 pi / 1.5 s)^2 = 4 %, the size of these terms.
    """
    from scipy.integrate import solve_bvp

    problem, solution = solve(example, folder, acceleration=100.0)

    def motion(_: Array, z: Array) -> Array:
        derivatives, jacobian = equations(z[:5], -0.5 * z[9])
        return np.vstack([derivatives, -np.einsum("ijk,ik->jk", jacobian, z[5:])])

    target = np.array([problem.width, 0.0, 0.0, 0.0, 0.0])
    # The width grows from 0 in small steps; each solution is the initial guess for the next.
    times, z = np.linspace(0.0, problem.duration, 41), np.zeros((10, 41))

    def ends(width: float, start: Array, end: Array) -> Array:
        return np.concatenate([start[:5], end[:5] - width * target / problem.width])

    for width in np.linspace(0.25, 1.0, 4) * problem.width:
        found = solve_bvp(motion, partial(ends, width), times, z, tol=1e-8, max_nodes=20_000)
        assert found.success, found.message
        times, z = found.x, found.y
    fine = np.linspace(0.0, problem.duration, 20_001)
    rate = -0.5 * found.sol(fine)[9]
    slope = -0.5 * found.sol(fine, 1)[9]
    least, bent = (float(np.sum((v[1:] ** 2 + v[:-1] ** 2) / 2.0 * np.diff(fine))) for v in (rate, slope))
    step = problem.duration / problem.intervals
    assert (solution.cost - least) / (step**2 / 12.0 * bent) == pytest.approx(1.0, abs=0.05)


def test_the_example_prints_its_table_and_draws(folder: Path, tmp_path: Path) -> None:
    picture = tmp_path / "lane_change.png"
    command = [sys.executable, str(EXAMPLE), str(folder / "SingleTrack.fmu"), "--plot", str(picture)]
    done = subprocess.run(command, capture_output=True, encoding="utf-8", check=False, timeout=patience(60))
    assert done.returncode == 0, done.stderr
    table = dict(re.findall(r"^(.*?) {2,}(\S+)", done.stdout, re.MULTILINE))
    assert float(table["final lateral position"]) == pytest.approx(3.5, abs=1e-6)
    assert float(table["the same, replayed in co-simulation"]) == pytest.approx(3.5, abs=1e-5)
    assert float(table["peak lateral acceleration"]) == pytest.approx(2.5, abs=1e-3)
    assert 0 < int(table["iterations of IPOPT"]) < 100
    assert picture.stat().st_size > 10_000
    readme = EXAMPLE.with_name("README.md").read_text(encoding="utf-8")
    for line in done.stdout.splitlines():
        if not line.startswith("iterations"):
            assert line in readme, line

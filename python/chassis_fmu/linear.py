"""Steady states of FMUs, and their linear models for python-control."""

from __future__ import annotations

import base64
import json
import subprocess
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .program import python_library
from .scenario import ScenarioError, Value, fmus, worker_program

if TYPE_CHECKING:
    import control


@dataclass(frozen=True)
class SteadyState:
    """A steady state of an FMU: values by name, in the units of the FMU."""

    fmu: str
    states: dict[str, float]
    """All states. The states in `drifting` and `undetermined` have their start values."""
    inputs: dict[str, float]
    """The free inputs."""
    starts: dict[str, Value]
    """Start values that put the FMU into the steady state: given parameters and inputs, states at rest, free inputs."""
    held: tuple[str, ...]
    """States whose values were given."""
    drifting: tuple[str, ...]
    """States that only integrate other states, such as position and heading."""
    undetermined: tuple[str, ...]
    """States that the equations leave open: the steady state is one of many."""
    residual: float
    """Largest derivative of the states at rest, relative to the nominal value of the state (1/s)."""
    growth: float | None
    """Largest real part of the poles of the states at rest (1/s): stable below 0. None if unknown."""


def trim(
    fmu: str | Path,
    values: Mapping[str, Value] | None = None,
    *,
    free: Sequence[str] | None = None,
    timeout: float = 60.0,
) -> SteadyState:
    """Find the steady state of an FMU at an operating point, by Newton's method on its exact Jacobian.

    `fmu` is the name of one of `fmus()`, or the path of any FMU with directional derivatives. `values` is the operating
    point in the units of the FMU: parameters, inputs, and states that are held. `free` lists inputs that share one
    value, which the search determines; the default for a plant with pedals is its drive torques, with the speed held.
    `timeout` limits the duration of the search (s).

    All derivatives vanish, to 1e-10 of the nominal value per second, except those of states that only integrate other
    states. `cargo fmu trim` executes the FMU in a separate process. Raises `ScenarioError` if the FMU is not found or
    if a state cannot be at rest; the message names the state.
    """
    found = _find(fmu)
    steady = _command("trim", found, values, [] if free is None else ["--free", ",".join(free)], timeout)
    with_role = {state["name"]: state["role"] for state in steady["states"]}
    return SteadyState(
        fmu=steady["fmu"],
        states={state["name"]: state["value"] for state in steady["states"]},
        inputs={entry["name"]: entry["value"] for entry in steady["inputs"]},
        starts=steady["starts"],
        held=tuple(name for name, role in with_role.items() if role == "held"),
        drifting=tuple(name for name, role in with_role.items() if role == "drifts"),
        undetermined=tuple(steady["undetermined"]),
        residual=steady["residual"],
        growth=steady["growth"],
    )


def linearize(
    fmu: str | Path,
    values: Mapping[str, Value] | None = None,
    *,
    trim: bool = False,
    free: Sequence[str] | None = None,
    timeout: float = 60.0,
) -> control.StateSpace:
    """Linearize an FMU at an operating point: x' = A x + B u, y = C x + D u.

    `fmu` is the name of one of `fmus()`, or the path of any FMU with directional derivatives. `values` is the operating
    point: parameters, inputs and states in the units of the FMU; all other variables have their start values.
    `timeout` limits the duration (s). With `trim`, the operating point is the steady state that the function `trim`
    finds for `values` and `free`.

    States, inputs and outputs have the names and units of the FMU. Dots become underscores, because python-control
    does not allow them: `vehicle.yaw_rate` is `vehicle_yaw_rate`. `cargo fmu linearize` executes the FMU in a separate
    process and computes the matrices. Raises `ScenarioError` if the FMU is not found or cannot be linearized.
    """
    try:
        import control
    except ImportError as error:
        raise ImportError("linearize needs python-control; install it with `pip install control`") from error

    found = _find(fmu)
    if free is not None and not trim:
        raise ValueError("`free` needs `trim=True`")
    options = ["--trim"] if trim else []
    options += [] if free is None else ["--free", ",".join(free)]
    model = _command("linearize", found, values, options, timeout)
    sizes = {name: len(model[name]) for name in ("states", "inputs", "outputs")}
    n, m, p = sizes.values()
    shapes = {"A": (n, n), "B": (n, m), "C": (p, n), "D": (p, m)}
    matrices = [np.array(model[name], dtype=np.float64).reshape(shape) for name, shape in shapes.items()]
    names = {kind: _names(model[kind], found) for kind in sizes}
    return control.StateSpace(*matrices, name=model["fmu"], **names)


def _command(
    name: str, fmu: Path, values: Mapping[str, Value] | None, options: Sequence[str], timeout: float
) -> dict[str, Any]:
    """Return the JSON that a `cargo fmu` command prints for an FMU with these values."""
    command: list[str | Path] = [worker_program(), name, fmu, "--json", "--timeout", repr(timeout), *options]
    command += [part for key, value in (values or {}).items() for part in ("--set", f"{key}={_text(value)}")]
    library = python_library()
    if library is not None:
        command += ["--libpython", library]
    done = subprocess.run(command, capture_output=True, encoding="utf-8", check=False)
    if done.returncode != 0:
        raise ScenarioError(f"{fmu}: {done.stderr.strip()}")
    printed: dict[str, Any] = json.loads(done.stdout)
    return printed


def _find(fmu: str | Path) -> Path:
    known = fmus()
    if isinstance(fmu, str) and fmu in known:
        return known[fmu]
    path = Path(fmu)
    if not path.is_file():
        names = ", ".join(known) or "none; `scripts/build` packs them"
        raise ScenarioError(f"{fmu}: neither a file nor one of the FMUs of the library ({names})")
    return path.resolve()


def _text(value: Value) -> str:
    if isinstance(value, bytes):
        return base64.b64encode(value).decode()
    return str(value).lower() if isinstance(value, bool) else str(value)


def _names(signals: Sequence[str], fmu: Path) -> list[str]:
    names = [signal.replace(".", "_") for signal in signals]
    double = next((signal for signal, name in zip(signals, names, strict=True) if names.count(name) > 1), None)
    if double is not None:
        raise ScenarioError(
            f"{fmu}: two signals would be named `{double.replace('.', '_')}`, because python-control does not allow "
            "dots; use the matrices from `cargo fmu linearize --json`"
        )
    return names

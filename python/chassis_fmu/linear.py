"""Linear models of FMUs, for python-control."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from . import libpython
from .scenario import ScenarioError, Value, fmus, worker_program

if TYPE_CHECKING:
    import control


def linearize(
    fmu: str | Path, values: Mapping[str, Value] | None = None, *, timeout: float = 60.0
) -> control.StateSpace:
    """Linearize an FMU at an operating point: x' = A x + B u, y = C x + D u.

    `fmu` is the name of one of `fmus()`, or the path of any FMU with directional derivatives. `values` is the operating
    point: parameters, inputs and states in the units of the FMU; all else is at its start value. `timeout` is the
    longest time for the linearization (s).

    States, inputs and outputs have their names and units in the FMU, but python-control allows no dots:
    `vehicle.yaw_rate` is `vehicle_yaw_rate`. The FMU is executed in a process of its own, by `cargo fmu linearize`, and
    the numbers are those of the command. Raises `ScenarioError` if the FMU is not found or cannot be linearized.
    """
    try:
        import control
    except ImportError as error:
        raise ImportError("linearize needs python-control; install it with `pip install control`") from error

    found = _find(fmu)
    command: list[str | Path] = [worker_program(), "linearize", found, "--json", "--timeout", repr(timeout)]
    command += [part for name, value in (values or {}).items() for part in ("--set", f"{name}={_text(value)}")]
    library = libpython.find()
    if library is not None:
        command += ["--libpython", library]
    done = subprocess.run(command, capture_output=True, encoding="utf-8", check=False)
    if done.returncode != 0:
        raise ScenarioError(f"{found}: {done.stderr.strip()}")
    model = json.loads(done.stdout)
    sizes = {name: len(model[name]) for name in ("states", "inputs", "outputs")}
    n, m, p = sizes.values()
    shapes = {"A": (n, n), "B": (n, m), "C": (p, n), "D": (p, m)}
    matrices = [_matrix(model[name], shape) for name, shape in shapes.items()]
    names = {kind: _names(model[kind], found) for kind in sizes}
    return control.StateSpace(*matrices, name=model["fmu"], **names)


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
    return str(value).lower() if isinstance(value, bool) else str(value)


def _matrix(rows: Sequence[Sequence[float]], shape: tuple[int, int]) -> object:
    import numpy as np

    return np.array(rows, dtype=np.float64).reshape(shape)


def _names(signals: Sequence[str], fmu: Path) -> list[str]:
    names = [signal.replace(".", "_") for signal in signals]
    double = next((signal for signal, name in zip(signals, names, strict=True) if names.count(name) > 1), None)
    if double is not None:
        raise ScenarioError(
            f"{fmu}: two signals would be named `{double.replace('.', '_')}`, because python-control allows no dots; "
            "use the matrices of `cargo fmu linearize --json`"
        )
    return names

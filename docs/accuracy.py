"""Compare couplings by accuracy and time, and write docs/accuracy.png and the last section of docs/coupling.md.

Call `PYTHONPATH=python .venv/bin/python docs/accuracy.py` after `scripts/setup --all` and `scripts/build`, while the
machine does nothing else. The FMUs of the oscillator are those of python/tests/test_rates.py.
"""

from __future__ import annotations

import re
import shutil
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa
from matplotlib.figure import Figure

import chassis_fmu as cf
from chassis_fmu.program import ROOT
from tests import test_rates

HEADING = "## Accuracy and computing time"
REPETITIONS = 3
STEPS = (0.01, 0.005, 0.002, 0.001, 0.0005)
TOLERANCES = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6)
# Scenario and case of each vehicle.
VEHICLES = {
    "Rescue vehicle": ("rescue_vehicle_step_steer", "coordination"),
    "Heavy truck": ("heavy_vehicle_control", "controlled"),
    "Car": ("esp_car_step_steer", "coordination"),
    "Half car": ("hydro_pneumatic_jturn_random", "switched"),
}
STOP, ROWS, REFERENCE = 4.0, 0.001, 0.0000625


@dataclass(frozen=True)
class Coupling:
    """Keys of [simulation], and the steps or tolerances to try."""

    title: str
    keys: str
    sizes: Sequence[float]
    is_controlled: bool = False

    def simulation(self, size: float, rows: float) -> tuple[str, int]:
        """Return the keys, and the number of steps between two rows."""
        if self.is_controlled:
            return f"step = {rows}\n{self.keys}error_control = {{ tolerance = {size} }}", 1
        return f"step = {size}\n{self.keys}", round(rows / size)


LINEAR = 'extrapolation = "linear"\n'
ITERATE = "iterate = { tolerance = 1e-10, limit = 50 }\n"
OSCILLATOR = (
    Coupling("fixed step", "", STEPS),
    Coupling("fixed step, linear", LINEAR, STEPS),
    Coupling("fixed step, linear, iterated", LINEAR + ITERATE, STEPS),
    Coupling("error control", "", TOLERANCES, is_controlled=True),
    Coupling("error control, linear", LINEAR, TOLERANCES, is_controlled=True),
)
OF_VEHICLES = (
    Coupling("fixed step", "", (0.001, 0.0005, 0.00025, 0.000125)),
    Coupling("error control", "", TOLERANCES[:4], is_controlled=True),
)


@dataclass(frozen=True)
class Point:
    """A run: its step or tolerance, its error, and its computing time, s."""

    size: float
    error: float
    seconds: float


def simulated(
    file: Path, fmus: Path, case: str, stop: float | None = None, repetitions: int = REPETITIONS
) -> tuple[pa.Table, float]:
    """Return the signals of a run, and its shortest computing time, s."""
    system, times = cf.Scenario(file, fmus=[fmus], stop=stop), []
    for _ in range(repetitions):
        began = time.process_time()
        table = system.simulate(case=case)
        times.append(time.process_time() - began)
    return table, min(times)


def oscillator(folder: Path) -> dict[str, list[Point]]:
    """Run two coupled masses; the error is the largest one of a position, relative to its amplitude."""
    for name in ("S1", "S2"):
        test_rates.build(folder, name)

    def point(coupling: Coupling, size: float) -> Point:
        keys, every = coupling.simulation(size, 0.02)
        record = f'"s1:x1"]\nevery = {every}\n#'
        file = test_rates.write(folder / "oscillator.toml", f"stop = 2.0\n{keys}", {"S1": "", "S2": ""}, record)
        table, seconds = simulated(file, folder, "only")
        values = table.column(1).to_numpy()
        error = np.abs(values - test_rates.exact(table["time"].to_numpy())).max() / 0.1
        return Point(size, float(error), seconds)

    return {c.title: [point(c, size) for size in c.sizes] for c in OSCILLATOR}


def vehicle(scenario: str, case: str, folder: Path) -> dict[str, list[Point]]:
    """Run a vehicle; the error is the RMS difference from a run with small steps, relative to the range.

    It is the mean over all recorded signals that change.
    """
    text = (ROOT / "scenarios" / f"{scenario}.toml").read_text(encoding="utf-8")
    file, fmus = folder / "scenarios" / f"{scenario}.toml", ROOT / "target" / "fmu"

    def run(coupling: Coupling, size: float, repetitions: int = REPETITIONS) -> tuple[pa.Table, float]:
        keys, every = coupling.simulation(size, ROWS)
        changed = re.sub(r"(?m)^step = .*$", keys, text, count=1)
        file.write_text(re.sub(r"(?m)^\[record\]$", f"[record]\nevery = {every}", changed), encoding="utf-8")
        return simulated(file, fmus, case, STOP, repetitions)

    def columns(table: pa.Table) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
        return np.array([table.column(i).to_numpy().astype(float) for i in range(1, table.num_columns)])

    exact = columns(run(OF_VEHICLES[0], REFERENCE, 1)[0])
    ranges = np.ptp(exact, axis=1)

    def point(coupling: Coupling, size: float) -> Point:
        table, seconds = run(coupling, size)
        errors = np.sqrt(np.mean((columns(table) - exact) ** 2, axis=1))[ranges > 0] / ranges[ranges > 0]
        return Point(size, float(errors.mean()), seconds)

    return {c.title: [point(c, size) for size in c.sizes] for c in OF_VEHICLES}


def picture(found: dict[str, dict[str, list[Point]]]) -> Figure:
    """Draw the error over the computing time for each system."""
    figure = Figure(figsize=(9.6, 6.0), layout="constrained")
    axes = list(figure.subplots(2, 3).flat)
    for ax, (title, couplings) in zip(axes, found.items(), strict=False):
        for number, (name, points) in enumerate(couplings.items()):
            drawn = [p for p in points if p.error > 0]
            color = "C3" if name == "error control" else f"C{number}"
            ax.semilogy(
                [1000 * p.seconds for p in drawn], [p.error for p in drawn], "o-", label=name, color=color, ms=4
            )
        ax.set(title=title, xlabel="Computing time (ms)", ylabel="Error", xlim=(0, None), ylim=(1e-12, 1))
        ax.grid(alpha=0.3)
    axes[-1].axis("off")
    axes[-1].legend(*axes[0].get_legend_handles_labels(), loc="center", frameon=False)
    return figure


def size(coupling: str, value: float) -> str:
    return f"tolerance {value:.0e}" if "control" in coupling else f"step {1000 * value:g} ms"


def section(found: dict[str, dict[str, list[Point]]], text: Callable[[Point], str]) -> str:
    """Return the table of all runs."""
    lines = ["| system | coupling | runs: error in computing time |", "|---|---|---|"]
    for title, couplings in found.items():
        for name, points in couplings.items():
            runs = "; ".join(f"{size(name, p.size)}: {text(p)}" for p in points)
            lines.append(f"| {title} | {name} | {runs} |")
    return "\n".join(lines)


def main() -> None:
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        # Scenarios include files and read parameter sets by relative paths.
        shutil.copytree(ROOT / "scenarios", folder / "scenarios")
        (folder / "modelDescription").symlink_to(ROOT / "modelDescription")
        found = {"Two masses": oscillator(folder)}
        for title, (scenario, case) in VEHICLES.items():
            print(title)
            found[title] = vehicle(scenario, case, folder)
    picture(found).savefig(ROOT / "docs" / "accuracy.png", dpi=110)
    table = section(found, lambda p: f"{p.error:.1e} in {1000 * p.seconds:.0f} ms")
    path = ROOT / "docs" / "coupling.md"
    before, heading, rest = path.read_text(encoding="utf-8").partition(HEADING)
    prose, _, _ = rest.partition("| system |")
    path.write_text(f"{before}{heading or HEADING}{prose}{table}\n", encoding="utf-8")


if __name__ == "__main__":
    main()

"""Rates of components and slopes of inputs in both masters, which must write the same bytes.

Reference: an independent master with exact components (oscillator of two masses, and a control loop with several
rates); the oscillator without a division into components, by its eigenvalues.
"""

from __future__ import annotations

import json
import re
import subprocess
import zipfile
from collections.abc import Callable
from pathlib import Path

import fmpy
import fmpy.fmi2
import numpy as np
import pytest
from numpy.typing import NDArray

from tests.commands import ROOT, chassis, unwrapped

SOURCE = ROOT / "crates" / "fmu-system" / "tests" / "data" / "coupled.c"
FLAGS = 'canHandleVariableCommunicationStepSize="true" canInterpolateInputs="true" canGetAndSetFMUstate="true"'
# Inputs, and outputs with their variability.
MODELS = {
    "S1": (["force"], {"x1": "continuous", "v1": "continuous"}),
    "S2": (["x1", "v1"], {"force": "continuous", "x2": "continuous", "v2": "continuous"}),
    "Plant": (["u"], {"y": "continuous"}),
    "Sensor": (["y"], {"sensor_y": "discrete"}),
    "Controller": (["sensor_y"], {"u": "discrete"}),
}

Both = Callable[[Path, Path], Path]
Array = NDArray[np.float64]


def build(folder: Path, name: str) -> None:
    inputs, outputs = MODELS[name]
    # FMPy loads all functions of co-simulation.
    functions = sorted(set(re.findall(r"\bfmi2[A-Z]\w+", Path(fmpy.fmi2.__file__).read_text())))
    weak = '__attribute__((weak, visibility("default")))'
    (folder / "lacking.c").write_text(
        "".join(f"{weak} int {function}(void) {{ return 3; }}\n" for function in functions)
    )
    library = folder / f"{name}.so"
    options = ["-O2", "-fPIC", "-shared", "-fvisibility=hidden", f"-DMODEL={name.upper()}", f'-DGUID="{name}"']
    subprocess.run(["cc", *options, "-o", library, SOURCE, folder / "lacking.c", "-lm"], check=True)
    variable = (
        '<ScalarVariable name="{}" valueReference="{}" causality="{}" variability="{}"><Real {}/></ScalarVariable>'
    )
    variables = [variable.format(name, k, "input", "continuous", 'start="0"') for k, name in enumerate(inputs)]
    variables += [variable.format(n, k, "output", kind, "") for k, (n, kind) in enumerate(outputs.items(), 2)]
    variables.append(variable.format("limit", 7, "parameter", "fixed", 'start="1e9"'))
    every = " ".join(str(k + 1) for k in range(len(inputs)))
    unknowns = "".join(
        f'<Unknown index="{len(inputs) + 1 + k}" dependencies="{every if output == "force" else ""}"/>'
        for k, output in enumerate(outputs)
    )
    text = (
        f'<?xml version="1.0"?><fmiModelDescription fmiVersion="2.0" modelName="{name}" guid="{name}">'
        f'<CoSimulation modelIdentifier="{name}" {FLAGS}/><ModelVariables>{"".join(variables)}</ModelVariables>'
        f"<ModelStructure><Outputs>{unknowns}</Outputs></ModelStructure></fmiModelDescription>"
    )
    with zipfile.ZipFile(folder / f"{name}.fmu", "w") as file:
        file.writestr("modelDescription.xml", text)
        file.write(library, f"binaries/{fmpy.platform}/{name}.so")


@pytest.fixture(scope="module")
def fmus(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("fmus")
    for name in MODELS:
        build(folder, name)
    return folder


def write(path: Path, simulation: str, components: dict[str, str], record: str, more: str = "") -> Path:
    text = f'title = "Rates"\n[simulation]\n{simulation}\n'
    text += "".join(f'[[component]]\nname = "{n.lower()}"\nfmu = "{n}"\n{keys}\n' for n, keys in components.items())
    path.write_text(f'{text}{more}[[case]]\nname = "only"\ntitle = "Only"\n[record]\nsignals = [{record}]\n')
    return path


def table(path: Path) -> dict[str, Array]:
    names, *rows = [line.split(",") for line in path.read_text().splitlines()]
    return dict(zip(names, np.array(rows, dtype=float).T, strict=True))


def exact(times: Array) -> Array:
    """Return x1 of the oscillator."""
    a = np.array([[0, 1, 0, 0], [-400, -0.7, 300, 0.2], [0, 0, 0, 1], [150, 0.1, -250, -0.35]])
    values, vectors = np.linalg.eig(a)
    weights = np.linalg.solve(vectors, np.array([0.1, 0, 0, 0]))
    return np.real((vectors[0] * weights) @ np.exp(np.outer(values, times)))


@pytest.mark.parametrize(
    ("keys", "s1", "s2", "error"),
    [
        ("step = 0.001", "every = 4", "", 0.0245107597),
        ('step = 0.001\norder = "jacobi"', "every = 4", "", 0.0433950482),
        ("step = 0.001", "", "every = 4", 0.0466680507),
        ("step = 0.004", "", "substeps = 4", 0.0208340469),
        ('step = 0.005\nextrapolation = "linear"', "", "", 0.00232883341),
        ('step = 0.005\nextrapolation = "linear"\norder = "jacobi"', "", "", 0.00738730783),
        # A line has the same value at the start of a substep in both masters.
        ('step = 0.005\nextrapolation = "linear"\nstep_argument = "difference"', "", "substeps = 3", 0.00232883341),
    ],
)
def test_the_oscillator(
    keys: str, s1: str, s2: str, error: float, tmp_path: Path, fmus: Path, run_by_both_masters: Both
) -> None:
    """The largest error of x1 is that of cosimulation.md, section 3."""
    file = write(tmp_path / "o.toml", f"stop = 2.0\n{keys}", {"S1": s1, "S2": s2}, '"x1", "force"')
    rows = table(run_by_both_masters(file, fmus))
    assert np.abs(rows["x1"] - exact(rows["time"])).max() == pytest.approx(error, abs=1e-8)


@pytest.mark.parametrize(
    ("order", "components", "y"),
    [
        ("sequential", ["Sensor", "Controller", "Plant"], 0.560529534927151),
        ("sequential", ["Plant", "Sensor", "Controller"], 0.551862572426624),
        ("jacobi", ["Plant", "Sensor", "Controller"], 0.573550438328035),
    ],
)
def test_a_loop_with_three_rates(
    order: str, components: list[str], y: float, tmp_path: Path, fmus: Path, run_by_both_masters: Both
) -> None:
    every = {"Sensor": "every = 2", "Controller": "every = 10", "Plant": ""}
    keys = f'stop = 0.05\nstep = 0.001\norder = "{order}"'
    file = write(tmp_path / "loop.toml", keys, {name: every[name] for name in components}, '"y"')
    assert table(run_by_both_masters(file, fmus))["y"][37] == pytest.approx(y, abs=1e-9)


def test_conversions_and_a_rate_that_does_not_divide_the_run(
    tmp_path: Path, fmus: Path, run_by_both_masters: Both
) -> None:
    """Both masters convert values and slopes, and shorten the last step of a slow component."""
    more = '[[connection]]\nfrom = "s1:x1"\nto = "s2:x1"\nfactor = 1.5\noffset = 0.25\n'
    keys = 'stop = 0.2\nstep = 0.01\nextrapolation = "linear"'
    file = write(tmp_path / "factor.toml", keys, {"S1": "every = 3", "S2": ""}, '"x1", "v1", "force"', more)
    rows = table(run_by_both_masters(file, fmus))
    # Between the steps of a slow component, the bus interpolates its outputs.
    assert rows["v1"][2] - rows["v1"][1] == pytest.approx(rows["v1"][3] - rows["v1"][2], rel=1e-12)
    assert rows["v1"][4] - rows["v1"][3] != pytest.approx(rows["v1"][3] - rows["v1"][2], rel=1e-3)


@pytest.mark.parametrize("keys", ["iterate = {}", "error_control = {}"])
def test_fmpy_refuses_what_only_the_native_master_does(
    keys: str, tmp_path: Path, fmus: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    file = write(tmp_path / "o.toml", f"stop = 0.1\nstep = 0.01\n{keys}", {"S1": "", "S2": ""}, '"x1"')
    code, out = chassis("run", file, "--engine", "fmpy", "--fmus", fmus, "--out", tmp_path / "out", "--no-page")
    found = unwrapped(out + capfd.readouterr().err)
    assert code != 0
    assert f"only the native master executes a scenario with `{keys.split()[0]}`; leave out --engine fmpy" in found


def test_the_numbers_of_steps_are_reported(tmp_path: Path, fmus: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """Steps that are the smallest are a warning; a run that fails has its numbers, too."""
    out = tmp_path / "out"
    keys = "stop = 0.1\nstep = 0.01\nerror_control = { tolerance = 1e-9, min_step = 0.005 }"
    file = write(tmp_path / "least.toml", keys, {"S1": "", "S2": ""}, '"x1"')
    code, text = chassis("run", file, "--fmus", fmus, "--out", out, "--no-page")
    found = unwrapped(text + capfd.readouterr().err)
    assert code == 0
    assert "20 steps accepted, 0 rejected; sizes from 0.005 s to 0.005 s" in found
    assert "warning: 20 steps of the size `min_step` have an error above the tolerance" in found
    # The component could make a step of 1e-6 s, but 1/1024 of 0.01 s is the limit.
    limit = {"S1": "", "S2": "parameters = { limit = 1e-6 }"}
    file = write(tmp_path / "none.toml", "stop = 0.1\nstep = 0.01", limit, '"x1"')
    code, text = chassis("run", file, "--fmus", fmus, "--out", out, "--no-page")
    assert code == 1
    (status,) = json.loads((out / "none" / "runs" / "status.json").read_text())["runs"]
    assert (status["status"], status["end"], status["steps"]["rejected"]) == ("discarded", 0.0, 1)


@pytest.mark.parametrize("more", ["", '\nstep_argument = "difference"'])
def test_a_linear_series_is_followed_to_its_jump(
    more: str, tmp_path: Path, fmus: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "force.csv").write_text("time,force\n0,0\n0.35,8\n0.4,8\n0.4,-2\n1,5\n")
    keys = 'stop = 1.0\nstep = 0.1\nextrapolation = "linear"' + more
    file = write(tmp_path / "series.toml", keys, {"S1": "substeps = 2"}, '"x1"')
    files = []
    for engine in ("native", "fmpy"):
        options = ("--inputs", tmp_path / "force.csv", "--engine", engine, "--out", tmp_path / engine, "--no-page")
        code, out = chassis("run", file, "--fmus", fmus, *options)
        assert code == 0, out + capfd.readouterr().err
        files.append((tmp_path / engine / "series" / "runs" / "only.csv").read_bytes())
    assert files[0] == files[1]


def test_both_masters_estimate_the_same_coupling_error(tmp_path: Path, fmus: Path) -> None:
    """Oscillator, S1 first, h = 4 ms: the numbers of cosimulation.md, section 4."""
    more = '[[metric]]\nname = "x1_rms"\ntitle = "x1"\nkind = "rms"\nsignal = "x1"\n'
    file = write(tmp_path / "o.toml", "stop = 2.0\nstep = 0.004", {"S1": "", "S2": ""}, '"x1", "force"', more)
    texts = []
    for engine in ("native", "fmpy"):
        out = tmp_path / engine
        chassis("run", file, "--fmus", fmus, "--engine", engine, "--converge", "--no-page", "--out", out)
        texts.append((out / "o" / "converge.json").read_text())
    assert texts[0] == texts[1]
    (metric,) = json.loads(texts[0])["runs"][0]["metrics"]
    assert metric["values"] == pytest.approx([0.0467855072, 0.0432679473, 0.0417106402], rel=1e-9)
    assert (metric["class"], metric["order"]) == ("regular", pytest.approx(1.17552152, rel=1e-8))
    assert metric["relative"] == pytest.approx(0.134914796, rel=1e-8)

"""Algebraic loops at the start: both masters solve them with the same bits."""

import math
import subprocess
import zipfile
from collections.abc import Callable
from pathlib import Path

import fmpy
import pytest

from tests.commands import chassis, unwrapped
from tests.test_fmpy import MISSING, SOURCE

DESCRIPTION = """<?xml version="1.0"?>
<fmiModelDescription fmiVersion="2.0" modelName="{name}" guid="{name}">
<CoSimulation modelIdentifier="{name}" canHandleVariableCommunicationStepSize="true"
 providesDirectionalDerivative="{derivatives}"/>
<ModelVariables>
<ScalarVariable name="u" valueReference="0" causality="input"><Real start="0"/></ScalarVariable>
<ScalarVariable name="y" valueReference="1" causality="output"><Real/></ScalarVariable>
{boolean}</ModelVariables>
<ModelStructure><Outputs><Unknown index="2" dependencies="{inputs}"/></Outputs>
<InitialUnknowns><Unknown index="2" dependencies="{inputs}"/></InitialUnknowns></ModelStructure>
</fmiModelDescription>
"""

BOOLEAN = """<ScalarVariable name="b" valueReference="0" causality="input" variability="discrete">
<Boolean start="false"/></ScalarVariable>
"""

SCENARIO = """title = "Loop"
[simulation]
stop = 0.2
step = 0.1
[[component]]
name = "a"
fmu = "A"
[[component]]
name = "b"
fmu = "B"
[[connection]]
from = "a:y"
to = "b:u"
[[connection]]
from = "b:y"
to = "a:u"
[[case]]
name = "only"
title = "Only"
[record]
signals = ["a:y", "b:y"]
"""

# Besides `u`, the component b reads `y` as a Boolean.
WITH_BOOLEAN = SCENARIO.replace(
    "[[case]]",
    """[[connection]]
from = "a:y"
to = "b:b"
[[case]]""",
)


# u^3 + 2 u - 4 = 0, and u^3 + 0.3375 u - 3.375 = 0.
ROOT = math.sqrt(4 + 8 / 27)
SECOND_ROOT = math.sqrt(1.6875**2 + 0.1125**3)
# The second function, which is discarded above 1.55. Newton's first step ends at 10.
PARTLY_DEFINED = "u > 1.55 ? 0. / 0. : 1 + 0.9 * u - u * u * u / 3.375"
SECOND = (SECOND_ROOT + 1.6875) ** (1 / 3) - (SECOND_ROOT - 1.6875) ** (1 / 3)


def build(
    folder: Path, name: str, value: str, slope: str | None, end: str | None = None, has_boolean: bool = False
) -> None:
    """Build an FMU with the output `value`, a function of `u`, and its derivative `slope`.

    With `end`, the output has this value from the end of the initialization on. With `has_boolean`, the FMU has the
    input `b`, which formulas have as BOOLEAN.
    """
    library, source = folder / f"{name}.so", folder / f"{name}.c"
    stubs = "\n".join(f"EXPORT int fmi2{function}(void) {{ return 3; }}" for function in MISSING.split())
    source.write_text(f"{SOURCE.read_text()}\n{stubs}\n")
    # The derivative in the source is real[2].
    discard = "if (i->v.real[1] != i->v.real[1]) return 2;" if value == PARTLY_DEFINED else ""
    follow = f"{{ double u = i->v.real[0]; i->v.real[1] = {value}; i->v.real[2] = u * 0 + {slope or 0}; {discard} }}"
    last = follow if end is None else f"i->v.real[1] = {end}"
    macros = [f"-DFOLLOW={follow}", f"-DEXIT={last}", f"-DSTEP={{ {follow} return 0; }}"]
    macros.append("-DBOOLEAN=i->v.boolean[0]")
    options = ["-shared", "-fPIC", "-ffp-contract=off", "-DSTATES", '-DVERSION="2.0"', f'-DGUID="{name}"', *macros]
    subprocess.run(["cc", *options, "-o", library, source], check=True)
    with zipfile.ZipFile(folder / f"{name}.fmu", "w") as file:
        boolean, inputs = (BOOLEAN, "1 3") if has_boolean else ("", "1")
        derivatives = "false" if slope is None else "true"
        text = DESCRIPTION.format(name=name, derivatives=derivatives, boolean=boolean, inputs=inputs)
        file.writestr("modelDescription.xml", text)
        file.write(library, f"binaries/{fmpy.platform}/{name}.so")


@pytest.mark.parametrize(
    ("value", "slope", "expected"),
    [
        ("0.5 * u + 1", "0.5", 2.0),
        ("0.5 * u + 1", None, 2.0),
        ("-3 * u + 4", "-3", 1.0),
        (PARTLY_DEFINED, "0.9 - u * u / 1.125", SECOND),
        (PARTLY_DEFINED, None, SECOND),
        ("2 - 0.5 * u * u * u", "-1.5 * u * u", (2 + ROOT) ** (1 / 3) - (ROOT - 2) ** (1 / 3)),
    ],
)
def test_both_masters_solve_a_loop_with_the_same_bits(
    value: str,
    slope: str | None,
    expected: float,
    tmp_path: Path,
    run_by_both_masters: Callable[[Path, Path], Path],
) -> None:
    """The solutions of u = f(u) are closed forms, for the cubic that of Cardano.

    The tolerance is that of a solution, 1e-9, which the other function can enlarge.
    """
    build(tmp_path, "A", value, slope)
    build(tmp_path, "B", "u", None if slope is None else "1")
    scenario = tmp_path / "loop.toml"
    scenario.write_text(SCENARIO)
    rows = run_by_both_masters(scenario, tmp_path).read_text().splitlines()
    assert [float(cell) for cell in rows[1].split(",")] == pytest.approx([0.0, expected, expected], rel=1e-8)


@pytest.mark.parametrize("slope", ["0.25", None])
def test_both_masters_convert_in_a_loop(
    slope: str | None, tmp_path: Path, run_by_both_masters: Callable[[Path, Path], Path]
) -> None:
    """The equations are y = 0.25 z + 1, z = 2 y + 1."""
    build(tmp_path, "A", "0.25 * u + 1", slope)
    build(tmp_path, "B", "u", None if slope is None else "1")
    scenario = tmp_path / "loop.toml"
    scenario.write_text(SCENARIO.replace('to = "b:u"', 'to = "b:u"\nfactor = 2.0\noffset = 1.0'))
    rows = run_by_both_masters(scenario, tmp_path).read_text().splitlines()
    assert [float(cell) for cell in rows[1].split(",")] == pytest.approx([0.0, 2.5, 6.0], rel=1e-8)


def test_both_masters_solve_a_loop_with_a_boolean(
    tmp_path: Path, run_by_both_masters: Callable[[Path, Path], Path]
) -> None:
    """The equations are y = 0.5 z + 0.4, z = y + (1 if y > 0.5 else 0); the Boolean is first false, with y = 0.8."""
    build(tmp_path, "A", "0.5 * u + 0.4", None)
    build(tmp_path, "B", "u + BOOLEAN", None, has_boolean=True)
    scenario = tmp_path / "loop.toml"
    scenario.write_text(WITH_BOOLEAN)
    rows = run_by_both_masters(scenario, tmp_path).read_text().splitlines()
    assert [float(cell) for cell in rows[1].split(",")] == pytest.approx([0.0, 1.8, 2.8], rel=1e-8)


@pytest.mark.parametrize("engine", ["native", "fmpy"])
def test_a_loop_that_does_not_settle_is_named(engine: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """The equations are y = z, z = 0 if y > 0.5 else 1."""
    build(tmp_path, "A", "u", None)
    build(tmp_path, "B", "!BOOLEAN", None, has_boolean=True)
    scenario = tmp_path / "loop.toml"
    scenario.write_text(WITH_BOOLEAN)
    code, out = chassis("run", scenario, "--engine", engine, "--fmus", tmp_path, "--out", tmp_path / "out", "--no-page")
    assert code == 1
    found = unwrapped(out + capfd.readouterr().err)
    assert "does not settle: a:y -> b:u -> b:y -> a:u; signals that are not Real change in each of 10 rounds" in found


@pytest.mark.parametrize("engine", ["native", "fmpy"])
@pytest.mark.parametrize(("value", "residual"), [("u + 1", "residual 1"), ("0 * u / 0", "values that are not finite")])
def test_a_loop_without_a_solution_is_named(
    engine: str, value: str, residual: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    build(tmp_path, "A", value, "1")
    build(tmp_path, "B", "u", "1")
    scenario = tmp_path / "loop.toml"
    scenario.write_text(SCENARIO)
    code, out = chassis("run", scenario, "--engine", engine, "--fmus", tmp_path, "--out", tmp_path / "out", "--no-page")
    assert code == 1
    found = unwrapped(out + capfd.readouterr().err)
    expected = "the algebraic loop at the start has no solution (singular Jacobian): a:y -> b:u -> b:y -> a:u; "
    assert f"{expected}{residual} after 5 fixed-point iterations; break it with a delay" in found


@pytest.mark.parametrize("engine", ["native", "fmpy"])
@pytest.mark.parametrize(("end", "is_named"), [("3.0", True), ("2.5000001", False)])
def test_a_change_at_the_end_of_initialization_is_a_warning(
    engine: str, end: str, is_named: bool, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """The limit is 1e-6 of the value."""
    build(tmp_path, "A", "2.5", None, end)
    build(tmp_path, "B", "u", None)
    scenario = tmp_path / "loop.toml"
    scenario.write_text(SCENARIO)
    code, out = chassis("run", scenario, "--engine", engine, "--fmus", tmp_path, "--out", tmp_path / "out", "--no-page")
    assert code == 0
    found = unwrapped(out + capfd.readouterr().err)
    assert ("output `y` changes from 2.5 to 3.0 at the end of initialization" in found) == is_named

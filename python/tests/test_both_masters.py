"""Clocks and arrays of FMI 3.0 in both masters, which must write the same bytes.

The FMUs are `Clocks` of `test_fmi3.py` and one of the tests of the native master, which rejects illegal calls.
"""

from __future__ import annotations

import csv
import json
import math
import os
import re
import shutil
import subprocess
import zipfile
from collections.abc import Callable
from pathlib import Path

import fmpy.fmi3
import pytest

from tests.commands import ROOT, chassis

pytestmark = pytest.mark.ci

FOLDER3 = Path(os.environ.get("CHASSIS_FMU3_DIR", ROOT / "target" / "fmu3"))

Both = Callable[[Path, Path], Path]
each_order = pytest.mark.parametrize("order", ["sequential", "jacobi"])


def write(path: Path, stop: float, step: float, order: str, rest: str) -> Path:
    head = f'title = "Clocks"\nsimulation = {{ stop = {stop}, step = {step}, order = "{order}" }}\n'
    path.write_text(f'{head}case = [{{ name = "only", title = "Only" }}]\nrecord = {{ signals = ["*"] }}\n{rest}')
    return path


def table(path: Path) -> list[dict[str, float]]:
    names, *rows = [line.split(",") for line in path.read_text().splitlines()]
    return [dict(zip(names, map(float, row), strict=True)) for row in rows]


def build(name: str, fmu: str, folder: Path) -> None:
    """Make an FMU from a source of the tests in Rust, with the functions that it lacks but FMPy loads."""
    data = ROOT / "crates" / "fmu-system" / "tests" / "data"
    names = sorted(set(re.findall(r"def (fmi3\w+)\(", Path(fmpy.fmi3.__file__).read_text())))
    weak = '__attribute__((weak, visibility("default")))'
    (folder / "lacking.c").write_text("".join(f"{weak} int {function}(void) {{ return 3; }}\n" for function in names))
    compiler, library = shutil.which("cc"), folder / "library.so"
    assert compiler is not None
    options = ["-O1", "-fPIC", "-shared", "-fvisibility=hidden", "-o", library]
    sources = [data / f"{name}.c", folder / "lacking.c"]
    subprocess.run(list(map(str, [compiler, *options, *sources, "-lm"])), check=True)
    with zipfile.ZipFile(folder / f"{fmu}.fmu", "w") as archive:
        archive.write(data / f"{name}.xml", "modelDescription.xml")
        archive.write(library, f"binaries/{fmpy.platform_tuple}/{fmu}{fmpy.sharedLibraryExtension}")


@each_order
@pytest.mark.parametrize("step", [0.4, 2.5])
def test_connected_clocks_tick_at_the_same_times(
    order: str, step: float, tmp_path: Path, run_by_both_masters: Both
) -> None:
    """The n-th tick of one adds n to the sum of two.

    outClock ticks with every fifth tick of all clocks: in one at 4 s and 8 s, in alone, where it activates inClock2, at
    4 s and 7 s. inClock3 ticks at 4 s, after inClock1. A recorded clock is 1 if it has ticked since the row before.
    """
    of = {name: f'[[component]]\nname = "{name}"\nfmu = "Clocks"\n' for name in ("three", "two", "one", "alone")}
    ends = {"one:inClock1": "two:inClock2", "one:inClock1Ticks": "two:input2", "one:outClock": "three:inClock2"}
    ends |= {"alone:outClock": "alone:inClock2", "alone:inClock1Ticks": "alone:input2"}
    text = "".join(of.values()).replace('"three"\n', '"three"\ninputs = { input2 = 3 }\n')
    text = text.replace('"one"\n', '"one"\ninputs = { input2 = 0 }\n')
    text += "".join(f'[[connection]]\nfrom = "{start}"\nto = "{end}"\n' for start, end in ends.items())
    scenario = write(tmp_path / "clocks.toml", 10.0, step, order, text)
    before = 0
    for row in table(run_by_both_masters(scenario, FOLDER3))[1:]:
        # A tick at the end of a step belongs to the next one.
        seconds = math.ceil(row["time"] - 1e-9)
        is_after_3 = seconds > 4
        assert [row[f"one:{name}"] for name in ("inClock1Ticks", "inClock3Ticks")] == [seconds, is_after_3]
        assert [row["two:inClock2Ticks"], row["two:result2"]] == [seconds, seconds * (seconds + 1) / 2]
        assert row["result2"] == 3 * (is_after_3 + (seconds > 8))
        for name, times in {"one:outClock": (4, 8), "alone:outClock": (4, 7)}.items():
            assert row[name] == any(before <= time < seconds for time in times)
        before = seconds
        assert row["alone:result2"] == 5 * is_after_3 + 8 * (seconds > 7)


@each_order
def test_an_output_clock_ticks_at_the_end_of_a_step(order: str, tmp_path: Path, run_by_both_masters: Both) -> None:
    """The clock ticks after the initialization and at the end of the first step at or after multiples of 0.25 s."""
    build("clocks", "Crossing", tmp_path)
    components = [f'[[component]]\nname = "{name}"\nfmu = "Crossing"\n' for name in ("counter", "source")]
    ends = {"source:crossing": "counter:trigger", "source:time_out": "counter:value"}
    wires = [f'[[connection]]\nfrom = "{start}"\nto = "{end}"\n' for start, end in ends.items()]
    text = "".join([*components, "inputs = { value = 0.0 }\n", *wires])
    path = run_by_both_masters(write(tmp_path / "crossing.toml", 1.0, 0.1, order, text), tmp_path)
    rows = table(path)
    for before, row in zip([{"count": 0.0}, *rows], rows, strict=False):
        crossings = math.floor(row["time"] / 0.25 + 1e-9)
        assert row["count"] == 1.0 + crossings
        assert row["source:crossing"] == row["count"] - before["count"]
        assert row["last"] == pytest.approx(math.ceil(2.5 * crossings - 1e-9) * 0.1, abs=1e-12)


def test_elements_of_arrays_are_set_connected_and_recorded(tmp_path: Path, run_by_both_masters: Both) -> None:
    """By the source of the FMU: g = 2 f, no = not b, v = -w, eo = e, uo = up, ys is xs reversed; ls: lengths."""
    build("arrays", "Arrays", tmp_path)
    inputs = 'm = [[11, 12, 13], [21, 22, 23]], f = [0.5, -0.25], "b[2]" = true, w = [9007199254740993, -1, 3]'
    inputs += ', s = 1, q = 2, x = "Zm9v", xs = ["AAE=", ""]'
    parameters = '"k[2,1]" = 5.5, e = [3, -4], "names[2]" = "longer", up = "18446744073709551615"'
    text = f'[[component]]\nname = "a"\nfmu = "Arrays"\ninputs = {{ {inputs} }}\nparameters = {{ {parameters} }}\n'
    text += '[[component]]\nname = "b"\nfmu = "Arrays"\ninputs = { s = 1, q = 0, x = "", "m[2,3]" = -1 }\n'
    ends = {"t[3,2]": "m[1,1]", "g": "f", "no": "b", "v": "w", "ys": "xs"}
    text += "".join(f'[[connection]]\nfrom = "a:{start}"\nto = "b:{end}"\n' for start, end in ends.items())
    path = run_by_both_masters(write(tmp_path / "arrays.toml", 0.3, 0.1, "sequential", text), tmp_path)
    with path.open() as file:
        *_, last = csv.DictReader(file)
    expected = {"g[1]": "1.0", "g[2]": "-0.5", "no[1]": "1.0", "no[2]": "0.0", "v[1]": "-9007199254740993"}
    expected |= {"b:g[1]": "2.0", "b:no[2]": "1.0", "b:v[1]": "9007199254740993", "eo[2]": "-4.0"}
    expected |= {
        "ls[1]": "1.0",
        "ls[2]": "6.0",
        "b:ls[2]": "2.0",
        "uo": "18446744073709551615",
        "ys[2]": "AAE=",
        "b:ys[1]": "AAE=",
    }
    assert {name: last[name] for name in expected} == expected


def test_both_masters_estimate_the_same_error_of_the_step(tmp_path: Path) -> None:
    """The numbers of `--converge` are those of bit-identical runs with h, h/2, h/4 and the other order."""
    scenario = ROOT / "scenarios" / "esp_car_step_steer.toml"
    options = ("--converge", "--no-page", "--no-warnings", "--no-fail", "--step", "0.004", "--stop", "2")
    found = []
    for engine in ("native", "fmpy"):
        assert chassis("run", scenario, *options, "--engine", engine, "--out", tmp_path / engine)[0] == 0
        found.append((tmp_path / engine / scenario.stem / "converge.json").read_text())
    assert found[0] == found[1]
    assert any(signal["error"] for _, signal in json.loads(found[0])["runs"][0]["signals"])

"""Runs by FMPy with an FMU, built from C, that crashes, exits or hangs in one of its runs; reports from CSV files."""

from __future__ import annotations

import json
import platform
import signal
import subprocess
import sys
import zipfile
from pathlib import Path
from typing import Any

import fmpy
import pytest

from chassis_fmu.files import results
from tests.commands import until

ROOT = Path(__file__).parents[2]
SOURCE = ROOT / "crates" / "fmu-import" / "tests" / "data" / "stranger.c"

DESCRIPTION = """<?xml version="1.0"?>
<fmiModelDescription fmiVersion="2.0" modelName="Ramp" guid="Ramp"><CoSimulation modelIdentifier="Ramp"/>
<ModelVariables>
<ScalarVariable name="x" valueReference="1" causality="output"><Real/></ScalarVariable>
<ScalarVariable name="u" valueReference="0" causality="input"><Real start="0"/></ScalarVariable>
<ScalarVariable name="gain" valueReference="2" causality="parameter" variability="fixed">
<Real start="1"/></ScalarVariable>
</ModelVariables>
<ModelStructure><Outputs><Unknown index="1"/></Outputs></ModelStructure></fmiModelDescription>
"""

SCENARIO = """
title = "Ramp"
simulation = { stop = 0.3, step = 0.1 }
record = { signals = ["ramp:x"] }
component = [{ name = "ramp", fmu = "Ramp", inputs = { u = 2.0 } }]
[[case]]
name = "bad"
title = "Bad"
parameters.ramp = { gain = 1.0 }
[[case]]
name = "good"
title = "Good"
parameters.ramp = { gain = 0.5 }
"""

# Functions that fmpy requires; in this FMU, they return an error.
MISSING = (
    "SetDebugLogging CancelStep GetStatus GetRealStatus GetIntegerStatus GetBooleanStatus GetStringStatus "
    "SetRealInputDerivatives GetRealOutputDerivatives"
)
# A condition in C: a step of the case `bad` after a time.
BAD = "t > {} && i->v.real[2] == 1"


def build(folder: Path, step: str, declarations: str = "") -> Path:
    """Build an integrator whose steps begin with the C statement `step`, and a scenario with two cases."""
    (folder / "ramp.toml").write_text(SCENARIO, encoding="utf-8")
    library, source = folder / "Ramp.so", folder / "ramp.c"
    stubs = "\n".join(f"EXPORT int fmi2{name}(void) {{ return 3; }}" for name in MISSING.split())
    source.write_text(f"{SOURCE.read_text()}\n{stubs}\n{declarations}\n")
    options = ["-shared", "-fPIC", "-DSTATES", '-DVERSION="2.0"', '-DGUID="Ramp"', f"-DSTEP={step}"]
    subprocess.run(["cc", *options, "-o", str(library), str(source)], check=True)
    path = folder / "Ramp.fmu"
    with zipfile.ZipFile(path, "w") as file:
        file.writestr("modelDescription.xml", DESCRIPTION)
        file.write(library, f"binaries/{fmpy.platform}/Ramp.so")
    return path


def command(folder: Path, *options: str | Path) -> list[str | Path]:
    call: list[str | Path] = [sys.executable, "-m", "chassis_fmu", "run", folder / "ramp.toml", "--fmus", folder]
    return [*call, "--out", folder / "out", *options]


def run(folder: Path, *options: str | Path) -> tuple[dict[str, Any], str]:
    """Return the status of each run, and the messages of the command."""
    done = subprocess.run(
        command(folder, *(options or ("--engine", "fmpy", "--no-page"))),
        cwd=ROOT,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        encoding="utf-8",
        check=False,
    )
    path = folder / "out" / "ramp" / "runs" / "status.json"
    assert path.exists(), done.stdout
    found = {status["run"]: status for status in json.loads(path.read_text(encoding="utf-8"))["runs"]}
    assert done.returncode == (1 if {s["status"] for s in found.values()} - {"completed"} else 0), done.stdout
    return found, done.stdout


def rows(folder: Path, name: str) -> results.Recording:
    return results.read_csv(folder / "out" / "ramp" / "runs" / f"{name}.csv")


@pytest.mark.parametrize(
    ("end", "expected"),
    [
        ("exit(0)", "the process ended (exit code 0)"),
        ("abort()", "the process ended (signal 6, SIGABRT)"),
        ("*(volatile int *)8 = 1", "the process ended (signal 11, SIGSEGV)"),
        ("for (;;) sleep(1)", "not done after 2 s (--timeout), stopped"),
    ],
)
def test_an_fmu_costs_its_run_only(tmp_path: Path, end: str, expected: str) -> None:
    build(tmp_path, f"if ({BAD.format(0.05)}) {{ {end}; }}")
    found, _ = run(tmp_path, "--engine", "fmpy", "--no-page", "--timeout", "2")
    bad, good = found["bad"], found["good"]
    assert expected in bad["message"]
    assert "fmi2DoStep" in bad["message"]
    assert good["status"] == "completed"
    # Exact up to the rounding of three sums.
    assert rows(tmp_path, "good").values["x"][-1] == pytest.approx(0.3, abs=1e-15)
    # Rows before the failure are kept and marked, and do not count as a complete run.
    assert len(rows(tmp_path, "bad").times) == 2
    assert [bad[key] for key in ("status", "file", "end", "at", "component")] == ["failed", "bad.csv", 0.1, 0.1, "ramp"]
    taken, _ = run(tmp_path, "--from-csv", tmp_path / "out" / "ramp")
    assert taken["bad"] == bad


@pytest.mark.parametrize(("code", "expected"), [(2, "discarded"), (3, "failed"), (-1, "failed")])
def test_a_discarded_step_is_told_apart_from_an_error(tmp_path: Path, code: int, expected: str) -> None:
    build(tmp_path, f"if ({BAD.format(0.05)}) return {code};")
    found, _ = run(tmp_path)
    assert {name: status["status"] for name, status in found.items()} == {"bad": expected, "good": "completed"}
    assert "fmi2DoStep" in found["bad"]["message"]
    assert f"status {code} (" in found["bad"]["message"]
    assert found["bad"]["end"] == 0.1


def test_rows_of_earlier_runs_are_replaced_by_those_that_are_taken(tmp_path: Path) -> None:
    build(tmp_path, "")
    run(tmp_path)
    assert len(rows(tmp_path, "bad").times) == 4
    build(tmp_path, f"if ({BAD.format(0.05)}) return 3;")
    source = tmp_path / "source" / "ramp" / "runs"
    run(tmp_path)
    source.parent.mkdir(parents=True)
    (tmp_path / "out" / "ramp" / "runs").rename(source)
    build(tmp_path, "")
    run(tmp_path)
    taken, _ = run(tmp_path, "--from-csv", source)
    out = tmp_path / "out" / "ramp" / "runs"
    for name in ("bad.csv", "good.csv", "status.json"):
        assert (out / name).read_bytes() == (source / name).read_bytes()
    # If a file is missing, the rows of an earlier run do not replace it.
    (source / "bad.csv").unlink()
    taken, _ = run(tmp_path, "--from-csv", source)
    assert not (out / "bad.csv").exists()
    assert taken["bad"]["file"] is None
    # The same applies to a file that cannot be read.
    (source / "good.csv").unlink()
    taken, said = run(tmp_path, "--from-csv", source)
    assert "has no results for ramp" in said
    assert {status["status"] for status in taken.values()} == {"failed"}
    assert not (out / "good.csv").exists()


def test_rows_that_are_taken_are_checked(tmp_path: Path) -> None:
    build(tmp_path, "")
    run(tmp_path)
    # If the files are read from the results folder itself, they are kept.
    out = tmp_path / "out" / "ramp" / "runs"
    (tmp_path / "link").symlink_to(out)
    before = {path.name: path.read_bytes() for path in out.iterdir()}
    run(tmp_path, "--from-csv", tmp_path / "link")
    assert {path.name: path.read_bytes() for path in out.iterdir()} == before
    source = tmp_path / "source"
    source.mkdir()
    (source / "good.csv").write_bytes(before["good.csv"])
    for text, message in (
        ("time,x\n0.0,1.0\n", "bad.csv has 1 rows, expected 4"),
        ("time,y\n0.0,1.0\n", "bad.csv has no column x"),
        ("time,x\n0.0,1.0\n0.1,1.0\n0.2,NaN\n0.3,1.0\n", "bad.csv contains a value that is not finite"),
    ):
        (source / "bad.csv").write_text(text, encoding="utf-8")
        taken, _ = run(tmp_path, "--from-csv", source)
        assert (taken["bad"]["status"], taken["bad"]["message"]) == ("failed", message)
        assert taken["good"]["status"] == "completed"


# On other systems, a daemon can leave the process group that ends with its worker (docs/guide/src/untrusted.md). All CI
# tiers run on Linux, so CI never skips the test.
@pytest.mark.skipif(sys.platform != "linux", reason="only Linux has supervisors")
@pytest.mark.parametrize("end", ["", "abort()", "for (;;) sleep(1)"])
def test_what_an_fmu_starts_ends_with_its_run(tmp_path: Path, end: str) -> None:
    # A daemon: a process in another session, whose parent has exited.
    note = tmp_path / "number"
    writing = f'FILE *f = fopen("{note}.part", "w"); fprintf(f, "%d", getpid()); fclose(f);'
    start = f'{writing} rename("{note}.part", "{note}"); sleep(300);'
    daemon = f"if (fork() == 0) {{ setsid(); if (fork() == 0) {{ {start} }} _exit(0); }}"
    daemon += f' while (access("{note}", 0)) usleep(1000);'
    build(tmp_path, f"if ({BAD.format(0.15)}) {{ {daemon} {end}; }}")
    found, said = run(tmp_path, "--engine", "fmpy", "--no-page", "--timeout", "2")
    assert {name for name, status in found.items() if status["status"] == "failed"} == ({"bad"} if end else set())
    assert "a process that an FMU had started (" in said
    assert not is_alive(note.read_text())


def test_the_rounding_mode_of_an_fmu_stays_its_own(tmp_path: Path) -> None:
    # FE_UPWARD of <fenv.h>; the times are start + k step, rounded to the nearest number, and the stop time.
    upward = {"x86_64": 0x800, "aarch64": 0x400000}[platform.machine()]
    build(tmp_path, f"int fesetround(int); fesetround({upward})")
    _, said = run(tmp_path)
    assert "fmi2DoStep changes the rounding mode" in said
    assert list(rows(tmp_path, "good").times) == [0.0, 0.1, 0.2, 0.3]


def test_an_archive_with_backslashes_is_unpacked(tmp_path: Path) -> None:
    fmu = build(tmp_path, "")
    with zipfile.ZipFile(fmu) as archive:
        entries = {name.replace("/", "\\"): archive.read(name) for name in archive.namelist()}
    with zipfile.ZipFile(fmu, "w") as archive:
        for name, content in entries.items():
            archive.writestr(name, content)
    found, _ = run(tmp_path)
    assert {status["status"] for status in found.values()} == {"completed"}


def test_a_library_that_does_not_load_in_time_is_named(tmp_path: Path) -> None:
    build(tmp_path, "", "__attribute__((constructor)) static void begin(void) { for (;;) sleep(1); }")
    found, _ = run(tmp_path, "--engine", "fmpy", "--no-page", "--timeout", "2")
    for status in found.values():
        assert "Ramp.fmu" in status["message"]
        assert "not done after 2 s (--timeout), stopped" in status["message"]


def is_alive(process: str) -> bool:
    """Return whether a process is running; false for a zombie."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(") ")[2][0] != "Z"
    except OSError:
        return False


# `is_alive` needs /proc to distinguish a zombie from a running process. All CI tiers run on Linux, so CI never skips
# the test.
@pytest.mark.skipif(sys.platform != "linux", reason="looks at /proc")
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT, signal.SIGHUP, signal.SIGKILL])
def test_an_end_by_signal_leaves_no_process(tmp_path: Path, number: int) -> None:
    note = tmp_path / "number"
    writing = f'{{ FILE *f = fopen("{note}.part", "w"); fprintf(f, "%d", getpid()); fclose(f);'
    build(tmp_path, f'{writing} rename("{note}.part", "{note}"); }} for (;;) sleep(1)')
    call = command(tmp_path, "--engine", "fmpy", "--no-page", "--timeout", "600", "--jobs", "1")
    # Tests that run in the background can inherit ignored signals.
    with subprocess.Popen(
        ["env", "--default-signal", *call], cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    ) as process:
        until(note.exists, "the note")
        worker = note.read_text()
        assert is_alive(worker)
        process.send_signal(number)
        process.wait()
    until(lambda: not is_alive(worker), "the end of the worker")

"""Runs in processes of their own, of an FMU built from C that crashes, exits or hangs in one of them."""

from __future__ import annotations

import platform
import signal
import subprocess
import sys
import zipfile
from pathlib import Path

import fmpy
import pytest
from msgspec.structs import replace

from chassis_fmu.execution import batch
from chassis_fmu.files import results
from chassis_fmu.files.plan import Component, Plan, Setting, Wire
from tests.commands import until

SOURCE = Path(__file__).parents[2] / "crates" / "fmu-import" / "tests" / "data" / "stranger.c"

DESCRIPTION = """<?xml version="1.0"?>
<fmiModelDescription fmiVersion="2.0" modelName="Ramp" guid="Ramp"><CoSimulation modelIdentifier="Ramp"/>
<ModelVariables><ScalarVariable name="x" valueReference="1" causality="output"><Real/></ScalarVariable></ModelVariables>
<ModelStructure/></fmiModelDescription>
"""


# Functions that fmpy looks for and this FMU lacks.
MISSING = (
    "SetDebugLogging CancelStep GetStatus GetRealStatus GetIntegerStatus GetBooleanStatus GetStringStatus "
    "SetRealInputDerivatives GetRealOutputDerivatives"
)


def build(folder: Path, step: str, declarations: str = "") -> Path:
    """Build the integrator whose steps begin with a statement in C."""
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


def planned(scenario: Plan, fmu: Path) -> Plan:
    """Return a plan with a run `good` (gain 0.5) and a run `bad` (gain 1)."""
    runs = []
    for name, gain in (("bad", 1.0), ("good", 0.5)):
        gains = (Setting("gain", "Real", 2, gain),)
        inputs = (Setting("u", "Real", 0, 2.0),)
        component = Component("ramp", fmu, "2.0", "Ramp", "Ramp", gains, inputs, (), (Wire("y", 1, "Real", 0),))
        runs.append(replace(scenario.runs[0], id=name, components=(component,), series=(), slots=1, columns=(0, None)))
    return replace(scenario, runs=tuple(runs))


@pytest.mark.parametrize(
    ("end", "expected"),
    [
        ("exit(0)", "the process ended (exit code 0)"),
        ("abort()", "the process ended (signal 6, SIGABRT)"),
        ("*(volatile int *)8 = 1", "the process ended (signal 11, SIGSEGV)"),
        ("for (;;) sleep(1)", "not done after 2 s (--timeout), stopped"),
    ],
)
def test_an_fmu_costs_its_run_only(scenario: Plan, tmp_path: Path, end: str, expected: str) -> None:
    plan = planned(scenario, build(tmp_path, f"if (t > 0.05 && i->v.real[2] == 1) {{ {end}; }}"))
    outcome = batch.execute(plan, tmp_path / "unpacked", tmp_path / "runs", 2, 2.0)
    assert outcome.failures == {"bad": f"component ramp, fmi2DoStep at t = 0.1 s: {expected}"}
    # exact but for the rounding of three sums
    recording = results.read_csv(tmp_path / "runs" / "good.csv")
    assert recording.values[scenario.columns[0].name][-1] == pytest.approx(0.3, abs=1e-15)
    # The rows before the failure are kept, marked, and not taken for those of a whole run.
    assert len(results.read_csv(tmp_path / "runs" / "bad.csv").times) == 2
    bad = batch.read_statuses(tmp_path / "runs")["bad"]
    assert (bad.status, bad.file, bad.end, bad.at, bad.component) == ("failed", "bad.csv", 0.1, 0.1, "ramp")
    taken = batch.take(plan, tmp_path / "runs", tmp_path / "runs")
    assert taken.failures == outcome.failures


@pytest.mark.parametrize(("code", "expected"), [(2, "discarded"), (3, "failed")])
def test_a_discarded_step_is_told_apart_from_an_error(scenario: Plan, tmp_path: Path, code: int, expected: str) -> None:
    plan = planned(scenario, build(tmp_path, f"if (t > 0.05 && i->v.real[2] == 1) return {code};"))
    outcome = batch.execute(plan, tmp_path / "unpacked", tmp_path / "runs", 2, 60.0)
    assert set(outcome.failures) == {"bad"}
    statuses = batch.read_statuses(tmp_path / "runs")
    assert (statuses["good"].status, statuses["bad"].status) == ("completed", expected)


def test_rows_of_earlier_runs_are_replaced_by_those_that_are_taken(scenario: Plan, tmp_path: Path) -> None:
    source, out = tmp_path / "source", tmp_path / "out"
    batch.execute(planned(scenario, build(tmp_path, "")), tmp_path / "unpacked", out, 2, 60.0)
    assert len(results.read_csv(out / "bad.csv").times) == scenario.simulation.rows
    plan = planned(scenario, build(tmp_path, "if (t > 0.05 && i->v.real[2] == 1) return 3;"))
    batch.execute(plan, tmp_path / "unpacked", source, 2, 60.0)
    batch.take(plan, source, out)
    kept = source / "bad.csv"
    assert (out / "bad.csv").read_bytes() == kept.read_bytes()
    assert batch.read_statuses(out) == batch.read_statuses(source)
    # Rows that are not there any more are not those of the earlier run.
    batch.execute(planned(scenario, build(tmp_path, "")), tmp_path / "unpacked", out, 2, 60.0)
    kept.unlink()
    batch.take(plan, source, out)
    assert not (out / "bad.csv").exists()
    assert batch.read_statuses(out)["bad"].file is None
    # Neither are those of a run that cannot be read.
    batch.execute(planned(scenario, build(tmp_path, "")), tmp_path / "unpacked", out, 2, 60.0)
    (source / "good.csv").unlink()
    assert set(batch.take(plan, source, out).failures) == {"bad", "good"}
    assert not (out / "good.csv").exists()


def test_rows_that_are_taken_from_their_own_folder_stay(scenario: Plan, tmp_path: Path) -> None:
    plan = planned(scenario, build(tmp_path, ""))
    batch.execute(plan, tmp_path / "unpacked", tmp_path / "runs", 2, 60.0)
    (tmp_path / "link").symlink_to(tmp_path / "runs")
    assert not batch.take(plan, tmp_path / "link", tmp_path / "runs").failures


# Elsewhere a daemon leaves the process group that ends with its worker (docs/guide/src/untrusted.md). All tiers of CI
# run on Linux, so the test is never skipped there.
@pytest.mark.skipif(sys.platform != "linux", reason="only Linux has supervisors")
@pytest.mark.parametrize("end", ["", "abort()", "for (;;) sleep(1)"])
def test_what_an_fmu_starts_ends_with_its_run(scenario: Plan, tmp_path: Path, end: str) -> None:
    # A daemon: in another session, without its parent.
    note = tmp_path / "number"
    writing = f'FILE *f = fopen("{note}.part", "w"); fprintf(f, "%d", getpid()); fclose(f);'
    start = f'{writing} rename("{note}.part", "{note}"); sleep(300);'
    daemon = f"if (fork() == 0) {{ setsid(); if (fork() == 0) {{ {start} }} _exit(0); }}"
    daemon += f' while (access("{note}", 0)) usleep(1000);'
    plan = planned(scenario, build(tmp_path, f"if (t > 0.15 && i->v.real[2] == 1) {{ {daemon} {end}; }}"))
    outcome = batch.execute(replace(plan, runs=plan.runs[:1]), tmp_path / "unpacked", tmp_path / "runs", 1, 2.0)
    assert set(outcome.failures) == ({"bad"} if end else set())
    assert "that an FMU had started (a copy of " in "".join(outcome.warnings["bad"])
    assert not is_alive(note.read_text())


def test_the_rounding_mode_of_an_fmu_stays_its_own(scenario: Plan, tmp_path: Path) -> None:
    # FE_UPWARD of <fenv.h>; the times are start + k step, rounded to the nearest number.
    upward = {"x86_64": 0x800, "aarch64": 0x400000}[platform.machine()]
    plan = planned(scenario, build(tmp_path, f"int fesetround(int); fesetround({upward})"))
    outcome = batch.execute(plan, tmp_path / "unpacked", tmp_path / "runs", 1, 60.0)
    assert not outcome.failures
    assert "fmi2DoStep changes the rounding mode" in "".join(outcome.warnings["good"])
    times = results.read_csv(tmp_path / "runs" / "good.csv").times
    simulation = scenario.simulation
    step = simulation.every * simulation.step
    assert list(times) == [simulation.start + k * step for k in range(simulation.rows)]


def test_a_status_that_is_none_of_fmi_is_an_error(scenario: Plan, tmp_path: Path) -> None:
    plan = planned(scenario, build(tmp_path, "if (t > 0.15 && i->v.real[2] == 1) return -1;"))
    outcome = batch.execute(plan, tmp_path / "unpacked", tmp_path / "runs", 1, 60.0)
    assert set(outcome.failures) == {"bad"}
    assert "fmi2DoStep" in outcome.failures["bad"]
    assert "status -1 (unknown)" in outcome.failures["bad"]


def test_an_archive_with_backslashes_is_unpacked(scenario: Plan, tmp_path: Path) -> None:
    fmu = build(tmp_path, "")
    with zipfile.ZipFile(fmu) as archive:
        entries = {name.replace("/", "\\"): archive.read(name) for name in archive.namelist()}
    with zipfile.ZipFile(fmu, "w") as archive:
        for name, content in entries.items():
            archive.writestr(name, content)
    assert not batch.execute(planned(scenario, fmu), tmp_path / "unpacked", tmp_path / "runs", 1, 60.0).failures


def test_a_library_that_does_not_load_in_time_is_named(scenario: Plan, tmp_path: Path) -> None:
    fmu = build(tmp_path, "", "__attribute__((constructor)) static void begin(void) { for (;;) sleep(1); }")
    expected = "component ramp, loading or fmi2Instantiate: not done after 2 s (--timeout), stopped"
    outcome = batch.execute(planned(scenario, fmu), tmp_path / "unpacked", tmp_path / "runs", 2, 2.0)
    assert outcome.failures == {"bad": expected, "good": expected}


def is_alive(process: str) -> bool:
    """Whether a process is there and not only waits for its end to be noticed."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(") ")[2][0] != "Z"
    except OSError:
        return False


PROGRAM = """
import dataclasses, signal, sys
from pathlib import Path
sys.path[:0] = {paths!r}
from chassis_fmu.execution import batch
from chassis_fmu.files import plan
from test_batch import planned
if __name__ == "__main__":
    # Whoever runs the tests may have asked to ignore these, as nohup and background jobs of a shell do.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    signal.signal(signal.SIGHUP, signal.SIG_DFL)
    scenario = plan.Plan.parse(Path({plan!r}).read_text(), Path("."))
    batch.execute(planned(scenario, Path({fmu!r})), Path({folder!r}), Path({out!r}), 1, 600.0)
"""


# `is_alive` needs /proc to tell a process that has ended from one that still runs. All tiers of CI run on Linux, so the
# test is never skipped there.
@pytest.mark.skipif(sys.platform != "linux", reason="looks at /proc")
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT, signal.SIGHUP, signal.SIGKILL])
def test_an_end_by_signal_leaves_no_process(tmp_path: Path, number: int) -> None:
    note = tmp_path / "number"
    writing = f'{{ FILE *f = fopen("{note}.part", "w"); fprintf(f, "%d", getpid()); fclose(f);'
    fmu = build(tmp_path, f'{writing} rename("{note}.part", "{note}"); }} for (;;) sleep(1)')
    here = Path(__file__).parent
    values = {"paths": [str(here.parent), str(here)], "plan": str(here / "plan.json"), "fmu": str(fmu)}
    program = tmp_path / "program.py"
    program.write_text(PROGRAM.format(**values, folder=str(tmp_path / "unpacked"), out=str(tmp_path / "runs")))
    with subprocess.Popen([sys.executable, str(program)], stderr=subprocess.DEVNULL) as process:
        until(note.exists, "the note")
        worker = note.read_text()
        assert is_alive(worker)
        process.send_signal(number)
        process.wait()
    until(lambda: not is_alive(worker), "the end of the worker")

"""`scripts/run`, `scripts/study` and `scripts/assess` in a temporary project, with mocks of the called programs."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
DEFAULT = "scenarios/rescue_vehicle_step_steer.toml"


@pytest.fixture
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Make a project that is set up, with mock programs that record their arguments."""
    folder = tmp_path / "project"
    (folder / "scripts").mkdir(parents=True)
    for name in ("run", "study", "assess", "build"):
        shutil.copy(ROOT / "scripts" / name, folder / "scripts" / name)
    programs = [(".venv/bin/chassis", "chassis of .venv"), ("bin/cargo", "cargo"), ("target/debug/chassis", "chassis")]
    programs.append(("target/debug/cargo-fmu", "cargo-fmu"))
    for path, name in (("scripts/setup", "setup"), *programs):
        file = folder / path
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(f"#!/bin/sh\nprintf '%s\\n' \"{name} $*\" >> '{folder}/log'\n")
        file.chmod(0o755)
    for path in ("pyproject.toml", "bin/cargo-zigbuild"):
        (folder / ".venv" / path).touch(0o755)
    monkeypatch.setenv("PATH", f"{folder}/bin{os.pathsep}{os.environ['PATH']}")
    return folder


def calls(project: Path, *command: str) -> tuple[str, list[str]]:
    """Return the messages of a launcher and the calls that it makes."""
    inside = project / "inside"
    inside.mkdir(exist_ok=True)
    log = project / "log"
    log.unlink(missing_ok=True)
    done = subprocess.run(
        [project / "scripts" / command[0], *command[1:]], cwd=inside, capture_output=True, encoding="utf-8", check=False
    )
    assert done.returncode == 0, done.stderr
    assert not done.stdout
    lines = log.read_text().replace(f"{project}/", "").splitlines()
    return done.stderr, [line.strip() for line in lines]


@pytest.mark.parametrize(
    ("arguments", "needed"),
    [
        (("my.toml",), "inside/my.toml"),
        (("my.toml", "--no-page"), "inside/my.toml"),
        (("--no-page", "my.toml"), "inside/my.toml"),
        (("--stop", "3", "my.toml", "--no-page"), "inside/my.toml"),
        (("without_suffix", "--no-page"), "inside/without_suffix"),
    ],
)
def test_a_scenario_may_stand_anywhere(project: Path, arguments: tuple[str, ...], needed: str) -> None:
    messages, found = calls(project, "run", *arguments)
    assert f"chassis pack {needed}" in found
    assert found[-1] == f"chassis of .venv run {' '.join(arguments)}"
    assert Path(needed).name in messages


def test_without_arguments_the_main_scenario_runs_through_fmpy(project: Path) -> None:
    _, found = calls(project, "run")
    assert f"chassis pack {DEFAULT}" in found
    assert found[-1] == f"chassis of .venv run {DEFAULT} --engine fmpy"


def test_a_study_may_stand_anywhere(project: Path) -> None:
    for arguments in (("my.toml", "--runs", "3"), ("--runs", "3", "my.toml"), ("--merge", "my.toml")):
        _, found = calls(project, "study", *arguments)
        assert "chassis pack inside/my.toml" in found
        assert found[-1] == f"chassis of .venv study {' '.join(arguments)}"


def test_without_the_linker_of_portable_fmus_they_are_for_this_machine(project: Path) -> None:
    (project / ".venv" / "bin" / "cargo-zigbuild").unlink()
    assert f"chassis pack {DEFAULT} --no-portable" in calls(project, "run")[1]
    assert "cargo-fmu fmu pack --all --no-portable" in calls(project, "assess", "EspCar")[1]


def test_all_fmus_are_packed_without_a_file(project: Path) -> None:
    messages, found = calls(project, "assess", "EspCar", "--quick")
    assert "cargo-fmu fmu pack --all" in found
    assert found[-1] == "chassis of .venv bench run EspCar --quick"
    assert "the FMUs of this project" in messages


@pytest.mark.parametrize(("launcher", "verb"), [("run", "run"), ("study", "study"), ("assess", "bench run")])
def test_help_builds_nothing_that_is_there(project: Path, launcher: str, verb: str) -> None:
    for option in ("-h", "--help"):
        _, found = calls(project, launcher, option)
        assert found == [f"chassis of .venv {verb} {option}"]
    (project / ".venv" / "pyproject.toml").unlink()
    assert calls(project, launcher, "--help")[1] == ["setup", f"chassis of .venv {verb} --help"]

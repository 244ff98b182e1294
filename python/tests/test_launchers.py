"""`scripts/run`, `scripts/study` and `scripts/assess` in a folder of their own, with stand-ins for what they call."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from chassis_fmu import app
from chassis_fmu.study import app as study

ROOT = Path(__file__).parents[2]
DEFAULT = "scenarios/rescue_vehicle_step_steer.toml"


@pytest.fixture
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Make a project that is set up: its programs note their arguments."""
    folder = tmp_path / "project"
    (folder / "scripts").mkdir(parents=True)
    for name in ("run", "study", "assess", "build"):
        shutil.copy(ROOT / "scripts" / name, folder / "scripts" / name)
    programs = (".venv/bin/python", "python"), ("bin/cargo", "cargo"), ("target/release/chassis", "chassis")
    for path, name in (("scripts/setup", "setup"), *programs):
        file = folder / path
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(f"#!/bin/sh\nprintf '%s\\n' \"{name} $*\" >> '{folder}/log'\n")
        file.chmod(0o755)
    (folder / ".venv" / "pyproject.toml").touch()
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
        ((), DEFAULT),
        (("--native",), DEFAULT),
        (("--stop", "3"), DEFAULT),
        (("my.toml",), "inside/my.toml"),
        (("my.toml", "--native"), "inside/my.toml"),
        (("--native", "my.toml"), "inside/my.toml"),
        (("--stop", "3", "my.toml", "--native"), "inside/my.toml"),
        (("without_suffix", "--native"), "inside/without_suffix"),
    ],
)
def test_a_scenario_may_stand_anywhere(project: Path, arguments: tuple[str, ...], needed: str) -> None:
    messages, found = calls(project, "run", *arguments)
    assert f"chassis pack {needed}" in found
    assert found[-1] == f"python scripts/cosim.py {' '.join(arguments)}".strip()
    assert Path(needed).name in messages
    options = app.arguments(arguments)
    assert options.scenario.name == Path(needed).name


def test_a_study_may_stand_anywhere(project: Path) -> None:
    for arguments in (("my.toml", "--runs", "3"), ("--runs", "3", "my.toml"), ("merge", "my.toml")):
        _, found = calls(project, "study", *arguments)
        assert "chassis pack inside/my.toml" in found
        assert found[-1] == f"python scripts/study.py {' '.join(arguments)}"


def test_all_fmus_are_packed_without_a_file(project: Path) -> None:
    messages, found = calls(project, "assess", "EspCar", "--quick")
    assert "cargo fmu pack --all" in found
    assert "the FMUs of this project" in messages


def test_a_page_needs_no_fmus(project: Path) -> None:
    for arguments in (("--page", "results/assess_EspCar"), ("--page=results/assess_EspCar",)):
        _, found = calls(project, "assess", *arguments)
        assert found == ["setup", f"python scripts/assess.py {' '.join(arguments)}"]


@pytest.mark.parametrize(("launcher", "script"), [("run", "cosim"), ("study", "study"), ("assess", "assess")])
def test_help_builds_nothing(project: Path, launcher: str, script: str) -> None:
    for option in ("-h", "--help"):
        _, found = calls(project, launcher, option)
        assert found == [f"python scripts/{script}.py {option}"]
    (project / ".venv" / "pyproject.toml").unlink()
    assert calls(project, launcher, "--help")[1] == ["setup", f"python scripts/{script}.py --help"]


def test_usage_names_the_launcher(capsys: pytest.CaptureFixture[str]) -> None:
    for arguments, name in ((app.arguments, "scripts/run"), (study.arguments, "scripts/study")):
        with pytest.raises(SystemExit):
            arguments(["--help"])
        assert capsys.readouterr().out.startswith(f"usage: {name} ")


def test_usage_names_the_module() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "chassis_fmu.study", "--help"], capture_output=True, encoding="utf-8", check=True
    )
    assert done.stdout.startswith("usage: python -m chassis_fmu.study ")


def test_a_tuning_study_may_stand_after_options(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "tuning.toml"
    path.write_text('method = "optimize"\n')
    assert study.main(["--runs", "3", str(path)]) == 2
    assert "is a tuning study" in capsys.readouterr().err

"""`chassis run --engine fmpy` with damaged FMUs: a message and exit code 1, no traceback, no temporary files."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.commands import patience

ROOT = Path(__file__).parents[2]
FOLDER = Path(os.environ.get("CHASSIS_FMU_DIR") or ROOT / "target" / "fmu")
NAME = "RescueVehicle"

Entries = dict[str, bytes]


def _library(entries: Entries) -> str:
    return next(name for name in entries if name.startswith("binaries/"))


def _other_platform(entries: Entries) -> None:
    entries["binaries/amiga68k/RescueVehicle.library"] = entries.pop(_library(entries))


def _text(entries: Entries) -> None:
    entries[_library(entries)] = b"this is no library"


def _half(entries: Entries) -> None:
    entries[_library(entries)] = entries[_library(entries)][: len(entries[_library(entries)]) // 2]


def _entities(entries: Entries) -> None:
    declaration = b'<!DOCTYPE l [<!ENTITY l0 "ha"><!ENTITY l1 "&l0;&l0;">]>\n<fmiModelDescription'
    xml = entries["modelDescription.xml"]
    entries["modelDescription.xml"] = xml.replace(b"<fmiModelDescription", declaration, 1)


def _way_out(entries: Entries) -> None:
    entries["../evil"] = b"x"


def _wild_guid(entries: Entries) -> None:
    # The FMU repeats an unknown GUID in its message. U+009B starts a terminal control sequence.
    xml = entries["modelDescription.xml"].decode()
    entries["modelDescription.xml"] = xml.replace('guid="{', 'guid="{\x9b5m', 1).encode()


ENTRIES: list[tuple[Callable[[Entries], None], str]] = [
    (_other_platform, "RescueVehicle.fmu: no binary for "),
    (_text, "loading: RescueVehicle.fmu: Failed to load shared library"),
    (_half, "is damaged or truncated"),
    (_entities, "document type declaration"),
    (_way_out, "not a path within the archive"),
    (_wild_guid, "{\\u009b5m"),
]


def _cosim(fmu: bytes, folder: Path) -> tuple[int, str]:
    """Run the reference scenario with this file as the vehicle. Returns the exit code and all output."""
    fmus, temporary = folder / "fmus", folder / "temporary"
    fmus.mkdir()
    temporary.mkdir()
    (fmus / f"{NAME}.fmu").write_bytes(fmu)
    command = [
        *(sys.executable, "-m", "chassis_fmu", "run", "--engine", "fmpy"),
        str(ROOT / "scenarios/rescue_vehicle_step_steer.toml"),
    ]
    command += [
        "--fmus",
        str(fmus),
        "--fmus",
        str(FOLDER),
        "--stop",
        "0.1",
        "--seeds",
        "1",
        "--out",
        str(folder / "out"),
    ]
    environment = {**os.environ, "TMPDIR": str(temporary), "COLUMNS": "1000"}
    done = subprocess.run(
        command, cwd=ROOT, env=environment, capture_output=True, text=True, timeout=patience(300), check=False
    )
    assert list(temporary.iterdir()) == [], "temporary files are left"
    assert not list(folder.rglob("evil")), "a file was written outside"
    assert not list((folder / "out").rglob("runs/*.csv")), "a run with a damaged FMU has results"
    assert not re.search(r"[\x00-\x08\x0b-\x1f\x7f-\x9f]", done.stdout + done.stderr), "a terminal would obey"
    # Messages are wrapped at arbitrary places.
    return done.returncode, " ".join((done.stdout + done.stderr).replace("\u2502", " ").split())


@pytest.mark.parametrize(("change", "expected"), ENTRIES)
def test_a_damaged_entry_is_rejected(change: Callable[[Entries], None], expected: str, tmp_path: Path) -> None:
    with zipfile.ZipFile(FOLDER / f"{NAME}.fmu") as archive:
        entries = {name: archive.read(name) for name in archive.namelist()}
    change(entries)
    damaged = tmp_path / "damaged.zip"
    with zipfile.ZipFile(damaged, "w") as archive:
        for name, content in entries.items():
            archive.writestr(name, content)
    code, said = _cosim(damaged.read_bytes(), tmp_path)
    assert code == 1
    assert expected in said
    assert "Traceback" not in said


@pytest.mark.parametrize("share", [0.0, 0.5, 0.99])
def test_a_file_that_is_cut_off_is_rejected(share: float, tmp_path: Path) -> None:
    fmu = (FOLDER / f"{NAME}.fmu").read_bytes()
    code, said = _cosim(fmu[: int(share * len(fmu))], tmp_path)
    assert code == 1
    assert f"{NAME}.fmu: not a readable archive" in said
    assert "Traceback" not in said

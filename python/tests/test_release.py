"""`scripts/release` with a mock of cargo that writes two small files instead of FMUs."""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
CARGO = """#!/bin/sh
# scripts/setup builds the Python package with the real one.
[ "$1" = fmu ] || exec '{cargo}' "$@"
printf '%s\\n' "$*" >> '{log}'
test ! -e '{failing}' || exit 1
while [ "$1" != --out ]; do shift; done
mkdir -p "$2"
printf 'first' > "$2/A.fmu"
printf 'second' > "$2/B.fmu"
"""


@pytest.fixture
def cargo(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Put a mock `cargo` on the path. It records the arguments of `cargo fmu`, and fails if `failing` exists."""
    log = tmp_path / "log"
    script = tmp_path / "bin" / "cargo"
    script.parent.mkdir()
    script.write_text(CARGO.format(cargo=shutil.which("cargo"), log=log, failing=tmp_path / "failing"))
    script.chmod(0o755)
    monkeypatch.setenv("PATH", f"{script.parent}{os.pathsep}{os.environ['PATH']}")
    return log


def release(folder: Path, *arguments: str, code: int = 0) -> str:
    command = [str(ROOT / "scripts" / "release"), *arguments]
    done = subprocess.run(command, cwd=folder, capture_output=True, encoding="utf-8", check=False)
    assert done.returncode == code, done.stderr
    return done.stdout + done.stderr


def test_checksums_and_platforms(tmp_path: Path, cargo: Path) -> None:
    output = release(tmp_path, "--out", "relative")
    sums = (tmp_path / "relative" / "SHA256SUMS").read_text(encoding="ascii").splitlines()
    # The format of sha256sum: digest, two spaces, name.
    expected = [
        f"{hashlib.sha256(text).hexdigest()}  {name}" for name, text in [("A.fmu", b"first"), ("B.fmu", b"second")]
    ]
    assert sums == expected
    assert "2 FMUs for linux64,win64,aarch64-linux" in output
    call = cargo.read_text(encoding="utf-8")
    assert call.startswith("fmu pack --all --platforms linux64,win64,aarch64-linux --portable --out ")


def test_other_platforms(tmp_path: Path, cargo: Path) -> None:
    release(tmp_path, "--out", str(tmp_path / "out"), "--platforms", "win64")
    assert "--platforms win64 --out" in cargo.read_text(encoding="utf-8")


def test_replaces_an_earlier_release_only(tmp_path: Path, cargo: Path) -> None:
    out = tmp_path / "out"
    out.mkdir()
    (out / "Old.fmu").write_text("old")
    (out / "SHA256SUMS").write_text("old")
    (tmp_path / "failing").touch()
    release(tmp_path, "--out", str(out), code=1)
    assert sorted(p.name for p in out.iterdir()) == ["Old.fmu", "SHA256SUMS"]
    (tmp_path / "failing").unlink()
    release(tmp_path, "--out", str(out))
    assert sorted(p.name for p in out.iterdir()) == ["A.fmu", "B.fmu", "SHA256SUMS"]

    cargo.unlink()
    (out / "notes.txt").write_text("mine")
    assert "contains notes.txt" in release(tmp_path, "--out", str(out), code=1)
    assert not cargo.exists()
    assert sorted(p.name for p in out.iterdir()) == ["A.fmu", "B.fmu", "SHA256SUMS", "notes.txt"]


def test_unknown_arguments(tmp_path: Path) -> None:
    assert "unknown argument '--fast'" in release(tmp_path, "--fast", code=2)
    assert "--out needs a value" in release(tmp_path, "--out", code=2)

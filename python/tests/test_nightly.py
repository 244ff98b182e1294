"""`scripts/nightly` in a temporary repository, with a mock for the part `windows`."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

ROOT = Path(__file__).parents[2]
RECORD = """# Nightly tests

| part | date | commit | duration | result |
|---|---|---|---|---|
| fuzz | | | | |
| windows | | | | |
"""
ROW = r"\| windows \| \d{4}-\d\d-\d\d \| (\S+) \| \d+ min \| (.*) \|"


def run(folder: Path, *command: str, code: int = 0) -> str:
    done = subprocess.run(command, cwd=folder, capture_output=True, encoding="utf-8", check=False)
    assert done.returncode == code, done.stdout + done.stderr
    return done.stdout.strip()


def repository(folder: Path) -> Path:
    """Make a repository with the script, its record, and a part that passes."""
    silent = "#!/bin/sh\n"
    well = f"{silent}echo '= all well ='\n"
    for name, text in [("scripts/setup", silent), ("scripts/build", silent), ("tests/nightly/windows", well)]:
        file = folder / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text)
        file.chmod(0o755)
    shutil.copy(ROOT / "scripts" / "nightly", folder / "scripts" / "nightly")
    (folder / "docs").mkdir()
    (folder / "docs" / "nightly.md").write_text(RECORD)
    (folder / ".gitignore").write_text("target\n")
    run(folder, "git", "init", "--quiet")
    run(folder, "git", "add", ".")
    run(folder, "git", "-c", "user.name=A", "-c", "user.email=a@example.org", "commit", "--quiet", "-m", "first")
    return folder


def row(folder: Path) -> tuple[str, str]:
    match = re.search(ROW, (folder / "docs" / "nightly.md").read_text())
    assert match, (folder / "docs" / "nightly.md").read_text()
    return match[1], match[2]


def test_a_part_that_passes_replaces_its_row(tmp_path: Path) -> None:
    folder = repository(tmp_path)
    commit = run(folder, "git", "rev-parse", "--short", "HEAD")
    run(folder, "scripts/nightly", "windows")
    assert row(folder) == (commit, "all well")
    assert "| fuzz | | | | |\n" in (folder / "docs" / "nightly.md").read_text()


def test_only_changes_outside_the_record_are_dirty(tmp_path: Path) -> None:
    folder = repository(tmp_path)
    commit = run(folder, "git", "rev-parse", "--short", "HEAD")
    (folder / "docs" / "nightly.md").write_text(RECORD.replace("| fuzz | |", "| fuzz | 2026-11-22 |"))
    run(folder, "scripts/nightly", "windows")
    assert row(folder)[0] == commit
    with (folder / "scripts" / "build").open("a") as file:
        file.write("true\n")
    run(folder, "scripts/nightly", "windows")
    assert row(folder)[0] == f"{commit}-dirty"


def test_a_part_that_fails_is_not_recorded(tmp_path: Path) -> None:
    folder = repository(tmp_path)
    (folder / "tests" / "nightly" / "windows").write_text("#!/bin/sh\nexit 3\n")
    run(folder, "scripts/nightly", "windows", code=1)
    assert (folder / "docs" / "nightly.md").read_text() == RECORD

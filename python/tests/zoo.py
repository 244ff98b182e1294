"""FMUs with the habits of other tools, from tests/zoo/zoo.c."""

from __future__ import annotations

import re
import subprocess
import zipfile
from pathlib import Path

import fmpy

ZOO = Path(__file__).parents[2] / "tests" / "zoo"


def pack(
    folder: Path,
    habit: str = "none",
    *,
    at: float = 1e9,
    name: str = "Zoo",
    identifier: str = "Zoo",
    file: str = "none",
    fmi: int = 2,
    edits: dict[str, str] | None = None,
) -> Path:
    """Build `NAME.fmu` in a folder; its parameters `habit`, `at` and `file` start with these values."""
    source = ZOO / "zoo.c"
    habits = re.findall(r"^    habit_(\w+),", source.read_text(), re.MULTILINE)
    values = {
        "@IDENTIFIER@": identifier,
        "@HABITS@": "".join(f'<Item name="{item}" value="{i}"/>' for i, item in enumerate(habits)),
        "@HABIT@": str(habits.index(habit)),
        "@AT@": repr(at),
        "@FILE@": file,
    }
    description = (ZOO / f"zoo{fmi}.xml").read_text()
    for old, new in {**values, **(edits or {})}.items():
        assert old in description, old
        description = description.replace(old, new)
    library = folder / f"{name}.so"
    options = ["-O1", "-shared", "-fPIC", "-fvisibility=hidden", "-ffp-contract=off", f"-DFMI={fmi}"]
    options += [f"-DHABIT=habit_{habit}", f"-DAT={at!r}", f'-DTARGET="{file}"']
    subprocess.run(["cc", *options, "-o", str(library), str(source), "-lm", "-pthread"], check=True)
    path = folder / f"{name}.fmu"
    platform = fmpy.platform if fmi == 2 else fmpy.platform_tuple
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", description)
        archive.write(library, f"binaries/{platform}/{identifier}{fmpy.sharedLibraryExtension}")
    library.unlink()
    return path

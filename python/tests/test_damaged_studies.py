"""Random mistakes in study files always give a message that names the file, never another exception.

The committed studies are changed at random, with fixed seeds. `tests/tests/damaged.rs` does the same with tuning
studies and scenarios; `test_study.py` tests the messages for particular mistakes.
"""

from __future__ import annotations

import random
from pathlib import Path

import pytest

from chassis_fmu.scenario import default_folder
from chassis_fmu.study import design, file
from chassis_fmu.study.file import StudyError
from chassis_fmu.study.job import Job

ROOT = Path(__file__).parents[2]
STUDIES = [path for path in sorted((ROOT / "studies").glob("*.toml")) if "[[vary]]" in path.read_text(encoding="utf-8")]
CHANGES = 60
# Designs with more samples are not tried here.
MANY = 10_000

# The values in `damaged.rs`, which Python cannot import, and lists, which only these studies can contain.
VALUES = (
    *(
        "0",
        "-1",
        "1e308",
        "-1e308",
        "5e-324",
        "nan",
        "inf",
        "-inf",
        "9223372036854775807",
        "1e-9",
        "true",
        "1979-05-27",
    ),
    *('""', '"x"', "[]", '[1, "a"]', "{}", '"\\u0000"', "[[[[]]]]", "[0.5, 0.5]", "[nan]", '["EspCar", "Road"]'),
)


def damage(text: str, chance: random.Random) -> str:
    """Return a text with one to three mistakes."""
    lines = text.splitlines()
    for _ in range(chance.randint(1, 3)):
        at = chance.randrange(len(lines))
        line = lines[at]
        kind = chance.randrange(7)
        if kind == 0 and len(lines) > 1:
            del lines[at]
        elif kind == 1:
            lines.insert(at, line)
        elif kind == 2:
            del lines[at + 1 :]
        elif kind == 3:
            lines[at] = lines[chance.randrange(len(lines))]
        elif kind == 4:
            place = chance.randrange(len(line) + 1)
            lines[at] = line[:place] + chance.choice("\0\ufeff[*:\U0001f697") + line[place:]
        elif "=" in line:
            # Replace a value, possibly with a value of another type.
            lines[at] = f"{line.partition('=')[0]}= {chance.choice(VALUES)}"
    return "\n".join(lines)


@pytest.mark.parametrize("path", STUDIES, ids=lambda path: path.stem)
def test_damaged_studies_are_rejected_with_a_message(path: Path, tmp_path: Path) -> None:
    text = path.read_text(encoding="utf-8").replace("../scenarios", (ROOT / "scenarios").as_posix())
    chance = random.Random(STUDIES.index(path))
    messages = []
    target = tmp_path / "study.toml"
    for _ in range(CHANGES):
        target.write_text(damage(text, chance), encoding="utf-8")
        try:
            study = file.read(target, [default_folder()])
            job = Job(study, target, [default_folder()])
            if not study.is_adaptive and (study.runs or 0) <= MANY and all((f.count or 0) <= MANY for f in study.vary):
                values = design.values(study, design.shares(study))
                assert len(values) == len(study.vary)
                job.task(0, dict(zip((f.name for f in study.vary), (of[0] for of in values), strict=True)))
        except StudyError as error:
            messages.append(str(error))
    assert all("study.toml" in message or message.startswith("runs is") for message in messages)
    # The files contain little that is optional, so most changes are mistakes.
    assert len(messages) > CHANGES // 2

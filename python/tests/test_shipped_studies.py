"""The studies in this repository run, with few samples, and `docs/study_results.py` writes its page from them."""

from __future__ import annotations

from pathlib import Path

import pytest
from tqdm import tqdm

import study_results
from chassis_fmu.scenario import default_folder
from chassis_fmu.study import execute, file
from chassis_fmu.study.engines import Nothing
from chassis_fmu.study.execute import WHOLE, Folder
from chassis_fmu.study.job import Job
from chassis_fmu.study.statistics import Numbers
from tests import commands

pytestmark = pytest.mark.ci

STUDIES = Path(__file__).parents[2] / "studies"
# The page's description of the first factor: the distribution in the study file, with the unit of the variable.
MASS = {
    "robust_esp_car": "mass: uniform, min 1100, max 1600 kg;",
    "robust_heavy_vehicle": "mass: uniform, min 14000, max 22000 kg;",
    "robust_hydro_pneumatic": "mass: uniform, min 0.8, max 1.2 times the scenario's own value;",
    "robust_rescue_vehicle": "mass: uniform, min 28000, max 38000 kg;",
}


def carry_out(name: str, out: Path, runs: int) -> Numbers:
    """Run a study with few samples, even if its requirements fail, and read its rows."""
    path = STUDIES / f"{name}.toml"
    code, _ = commands.chassis("study", path, "--runs", str(runs), "--no-fail", "--out", out)
    assert code == 0
    folders = [default_folder()]
    job = Job(file.read(path, folders, runs), path, folders)
    engine = Nothing(job, 1, 60.0)
    done = execute.run(job, Folder(out / name), engine, WHOLE, execute.Progress(tqdm(disable=True)), resume=True)
    assert {row.status for row in done.rows.values()} == {"ok"}
    return Numbers(job, done.values, done.rows)


@pytest.mark.parametrize("name", study_results.ROBUST)
def test_robustness(name: str, tmp_path: Path) -> None:
    of = carry_out(name, tmp_path, 2)
    assert of.count == 2
    lines = list(study_results.robust(name, of))
    assert lines[1] == f"`studies/{name}.toml`, 2 samples, {2 * len(of.job.cells)} runs, of which 0 failed.\n"
    assert lines[2].startswith(f"Varied: {MASS[name]}")
    rows = lines[lines.index(study_results.COLUMNS) + 2 : -1]
    assert len(rows) == len(of.shares()) > 0


def test_sensitivity(tmp_path: Path) -> None:
    name = study_results.SENSITIVITY
    of = carry_out(name, tmp_path, 8)
    # Saltelli's design without second order: N (d + 2) samples.
    factors = len(of.job.study.vary)
    assert of.count == 8 * (factors + 2)
    lines = list(study_results.sensitivity(name, of))
    assert sum(line.startswith("| ") for line in lines) == (1 + factors) * len(of.job.metrics) * len(of.job.cells)


@pytest.mark.parametrize(
    "path", [p for p in sorted(STUDIES.glob("*.toml")) if "[[vary]]" not in p.read_text()], ids=lambda p: p.stem
)
def test_tuning(path: Path, tmp_path: Path) -> None:
    assert commands.chassis("study", path, "--budget", "3", "--out", tmp_path)[0] == 0
    assert (tmp_path / path.stem / "index.html").is_file()

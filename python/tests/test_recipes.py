"""The recipes for other Python packages are executed as they are."""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
RECIPES = sorted((ROOT / "examples/recipes").glob("*.py"))

# What each prints in its last line: the optimizers find shorter distances than the 21.748 m of the scenario.
LAST = {
    "env_cross_entropy": "generation 5: best return -0.00",
    "openturns_probability": "mean 21.",
    "optuna_search": "21.",
    "salib_sobol": "antilock:slip.band: first-order index ",
    "scipy_minimize": "21.7",
}


@pytest.mark.ci
@pytest.mark.parametrize("recipe", RECIPES, ids=lambda recipe: recipe.stem)
def test_recipes_run(recipe: Path) -> None:
    done = subprocess.run([sys.executable, recipe], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[-1].startswith(LAST[recipe.stem]), done.stdout


@pytest.mark.parametrize("recipe", RECIPES, ids=lambda recipe: recipe.stem)
def test_recipes_are_short(recipe: Path) -> None:
    assert len(recipe.read_text(encoding="utf-8").splitlines()) <= 20

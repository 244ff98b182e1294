"""Comparison of signals. Reference: tests/references/comparison, metrics computed by NumPy."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import chassis_fmu as cf

CASES = json.loads((Path(__file__).parents[2] / "tests/references/comparison/metrics.json").read_text())


@pytest.mark.parametrize("name", CASES)
def test_the_metrics_of_the_reference_are_met(name: str) -> None:
    case = CASES[name]
    options: dict[str, Any] = {"max_shift": case["options"].get("max_shift")}
    if tolerance := case["options"].get("tolerance"):
        options["tolerance"] = (tolerance.get("absolute", 0.0), tolerance.get("relative", 0.0))
    if tube := case["options"].get("tube"):
        options["tube"] = (tube["width"], tube["height"])
    found = cf.compare((case["time"], case["simulated"]), (case["time"], case["measured"]), **options)
    # The tolerance of the reference.
    expected = {
        key: value if value is None else pytest.approx(value, rel=1e-9, abs=1e-9)
        for key, value in case["expected"].items()
    }
    assert found == expected


def test_a_tube_may_be_relative_and_a_window_limits_the_samples() -> None:
    times = np.arange(11.0)
    found = cf.compare((times, times + 1.5), (times, times), window=(1.0, 10.0), tube=0.1)
    # The extents of the ramp in the window are 9 s and 9: the tube ends 1.8 above it, 0.9 at its end.
    assert (found["samples"], found["tube_exit"]) == (10.0, 10.0)
    assert found["tube_share"] == pytest.approx(0.9)
    assert found["tube_excess"] == pytest.approx(0.6, abs=1e-12)


@pytest.mark.parametrize(
    ("signal", "message"),
    [
        (([0.0, 1.0], [1.0]), r"measured must be two arrays of one length, got \(2,\) and \(1,\)"),
        (([1.0, 0.0], [1.0, 1.0]), "measured must have finite values at times that do not fall"),
        (([0.0, 1.0], [1.0, np.nan]), "measured must have finite values"),
    ],
)
def test_what_is_not_a_signal_is_an_error(signal: tuple[list[float], list[float]], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        cf.compare(([0.0, 1.0], [0.0, 1.0]), signal)

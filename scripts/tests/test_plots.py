"""Figures: what decimation keeps, and that files repeat."""

import dataclasses

import numpy as np

from chassis_fmu import metrics, plots
from chassis_fmu.plan import Figure, Plan, Point, Sweep
from chassis_fmu.results import Recording


def test_decimation_keeps_ends_and_extremes() -> None:
    times = np.arange(20011) * 0.001
    values = np.sin(times) + np.random.default_rng(1).normal(0.0, 0.1, len(times))
    values[12345] = 9.0
    values[20009] = -9.0
    t, v = plots.decimate(times, values, 100)
    assert len(t) <= 2 * 101 + 2
    assert np.all(np.diff(t) > 0.0)
    assert (t[0], t[-1]) == (times[0], times[-1])
    assert (v.max(), v.min()) == (9.0, -9.0)
    assert np.isin(v, values).all()


def test_short_lines_stay_whole() -> None:
    times = np.arange(100) * 0.1
    t, v = plots.decimate(times, times, 50)
    assert t is times
    assert v is times


def test_noise_is_told_from_motion() -> None:
    times = np.arange(2000) * 0.01
    assert not plots.is_noisy(np.sin(times))
    assert not plots.is_noisy(np.where(times < 5.0, 0.0, 1.0))
    assert plots.is_noisy(np.random.default_rng(1).normal(size=2000))


def recordings() -> dict[plots.Key, Recording]:
    times = np.arange(4) * 0.1
    return {
        ("passive", None): Recording(times, {"body.roll": times, "source.count": times * 10.0}),
        ("active", None): Recording(times, {"body.roll": times * 0.5}),
    }


def test_a_figure_is_a_function_of_the_data(scenario: Plan) -> None:
    first = plots.draw(scenario, scenario.figures[0], recordings(), [])
    second = plots.draw(scenario, scenario.figures[0], recordings(), [])
    assert first is not None
    assert first == second
    assert first.png.startswith(b"\x89PNG")
    assert "<dc:date>" not in first.svg


def test_a_figure_without_data_is_left_out(scenario: Plan) -> None:
    assert plots.draw(scenario, scenario.figures[0], {}, []) is None


def test_a_sweep_shows_ours_and_the_papers(scenario: Plan) -> None:
    swept = dataclasses.replace(
        scenario, points=(Point("slow", "5 km/h", 5.0), Point("fast", "35 km/h", 35.0)), sweep=Sweep("Speed", "km/h")
    )
    figure = Figure("speeds", "Speeds", "sweep", (), (0, 1), None, None, None)
    values: dict[tuple[str, str, str | None, int | None], float] = {
        ("roll_rms", c.name, p, s): 1.0 + i for c in swept.cases for i, p in enumerate(("slow", "fast")) for s in (1, 2)
    }
    drawing = plots.draw(swept, figure, {}, metrics.table(swept, values))
    assert drawing is not None
    assert plots.PALETTE[1] in drawing.svg

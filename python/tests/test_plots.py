"""Pictures of figures: their content, and reproducible files."""

import numpy as np
import pytest
from msgspec.structs import replace

from chassis_fmu.evaluation import metrics
from chassis_fmu.evaluation.results_table import Numbers
from chassis_fmu.files.plan import Figure, Plan, Point, Sweep
from chassis_fmu.files.results import Recording
from chassis_fmu.report import figures, plots
from chassis_fmu.report.figures import Key, Recordings
from chassis_fmu.report.panels import Panel, decimate


def test_decimation_keeps_ends_and_extremes() -> None:
    times = np.arange(20011) * 0.001
    values = np.sin(times) + np.random.default_rng(1).normal(0.0, 0.1, len(times))
    values[12345] = 9.0
    values[20009] = -9.0
    t, v = decimate(times, values, 100)
    assert len(t) <= 2 * 101 + 2
    assert np.all(np.diff(t) > 0.0)
    assert (t[0], t[-1]) == (times[0], times[-1])
    assert (v.max(), v.min()) == (9.0, -9.0)
    assert np.isin(v, values).all()


def test_short_lines_stay_whole() -> None:
    times = np.arange(100) * 0.1
    t, v = decimate(times, times, 50)
    assert t is times
    assert v is times


def test_noise_is_told_from_motion() -> None:
    times = np.arange(2000) * 0.01
    assert not plots.is_noisy(np.sin(times))
    assert not plots.is_noisy(np.where(times < 5.0, 0.0, 1.0))
    assert plots.is_noisy(np.random.default_rng(1).normal(size=2000))


def recordings() -> dict[Key, Recording]:
    times = np.arange(4) * 0.1
    return {
        ("passive", None): Recording(times, {"body.roll": times, "source.count": times * 10.0}),
        ("active", None): Recording(times, {"body.roll": times * 0.5}),
    }


def panels(plan: Plan, figure: Figure, found: dict[Key, Recording], numbers: Numbers | None = None) -> list[Panel]:
    shown = Recordings(plan)
    shown.first = found
    return figures.panels(plan, figure, shown, numbers or Numbers(plan, {}))


def draw(plan: Plan, figure: Figure, found: dict[Key, Recording], numbers: Numbers | None = None) -> plots.Drawing:
    return plots.draw(plan.cases, figure, panels(plan, figure, found, numbers))


def test_a_figure_is_a_function_of_the_data(scenario: Plan) -> None:
    first = draw(scenario, scenario.figures[0], recordings())
    second = draw(scenario, scenario.figures[0], recordings())
    assert first == second
    assert first.png.startswith(b"\x89PNG")
    assert "<dc:date>" not in first.svg


def test_a_figure_without_data_is_left_out(scenario: Plan) -> None:
    assert not panels(scenario, scenario.figures[0], {})


def test_a_window_after_the_end_of_a_run_leaves_a_panel_empty(scenario: Plan) -> None:
    later = replace(scenario.figures[0], window=(5.0, 6.0), levels=())
    drawing = draw(scenario, later, recordings())
    assert plots.PALETTE[0] not in drawing.svg


def test_states_have_whole_ticks(scenario: Plan) -> None:
    times = np.arange(4) * 0.1
    figure = replace(scenario.figures[0], columns=(0,), levels=(), unit=None)
    name = scenario.columns[0].name

    def labels(states: list[float]) -> list[str]:
        drawing = draw(scenario, figure, {("passive", None): Recording(times, {name: np.array(states)})})
        return [t for t in ("1.5", "2.5") if f"<!-- {t} -->" in drawing.svg]

    assert labels([1.0, 1.0, 3.0, 3.0]) == []
    assert labels([1.0, 1.1, 3.0, 3.0]) == ["1.5", "2.5"]


def test_a_sweep_shows_ours_and_the_papers(scenario: Plan) -> None:
    swept = replace(
        scenario,
        points=(Point("slow", "5 km/h", 5.0, None), Point("fast", "35 km/h", 35.0, None)),
        sweep=Sweep("Speed", "km/h", None),
    )
    first = scenario.figures[0]
    figure = replace(
        first, name="speeds", title="Speeds", kind="sweep", columns=(), metrics=(0, 1), window=None, levels=()
    )
    values: dict[tuple[str, str, str | None, int | None], float] = {
        ("roll_rms", c.name, p, s): 1.0 + i for c in swept.cases for i, p in enumerate(("slow", "fast")) for s in (1, 2)
    }
    drawing = draw(swept, figure, {}, Numbers(swept, values))
    assert plots.PALETTE[1] in drawing.svg


def test_a_figure_shows_its_cases_and_levels(scenario: Plan) -> None:
    first = scenario.figures[0]
    both = draw(scenario, first, recordings())
    one = draw(scenario, replace(first, cases=("active",)), recordings())
    assert plots.PALETTE[0] in both.svg
    assert plots.PALETTE[0] not in one.svg
    assert "A &lt;level&gt;" in one.svg
    bare = draw(scenario, replace(first, levels=()), recordings())
    assert "A &lt;level&gt;" not in bare.svg


def test_levels_are_in_panels_of_their_unit(scenario: Plan) -> None:
    """A level in the unit of the first signal must not appear in the panel of a signal with another unit."""
    other = replace(scenario.columns[1], unit="N", display_unit=None, factor=1.0, offset=0.0)
    plan = replace(scenario, columns=(scenario.columns[0], other))
    figure = replace(plan.figures[0], columns=(0, 1), unit=None)
    assert figure.levels
    assert [panel.levels for panel in panels(plan, figure, recordings())] == [figure.levels, ()]


def test_separate_cases_have_panels_of_their_own(scenario: Plan) -> None:
    first = scenario.figures[0]
    overlaid = draw(scenario, first, recordings())
    separate = draw(scenario, replace(first, separate=True), recordings())
    # Two signals, one of which exists in one case only.
    assert overlaid.svg.count('<g id="axes_') == 2
    assert separate.svg.count('<g id="axes_') == 3
    assert "Active &lt;fast&gt;" in separate.svg
    assert "legend" not in separate.svg


def test_a_signal_stands_dashed_beside_others(scenario: Plan) -> None:
    bare = replace(scenario.figures[0], columns=(1,), levels=())
    for separate in (False, True):
        figure = replace(bare, separate=separate)
        plain = draw(scenario, figure, recordings())
        beside = draw(scenario, replace(figure, against=0), recordings())
        assert "stroke-dasharray" not in plain.svg
        # One dashed line is for the only case that has the signal, the other one is in the legend.
        assert beside.svg.count("stroke-dasharray") == 2
    assert figures.columns_of(scenario, replace(bare, against=0)) == {0, 1}


def test_spectra_are_taken_in_the_unit_shown(scenario: Plan) -> None:
    figure = replace(scenario.figures[0], kind="spectrum", cases=("active",), window=None, levels=())
    noisy = replace(scenario, figures=(figure,))
    times = np.arange(900) * 0.1
    values = np.random.default_rng(1).normal(size=900)
    recording = Recording(times, {"body.roll": values})
    assert figures.estimates_of(noisy, noisy.runs[0], recording) == {}
    spectra = figures.estimates_of(noisy, noisy.runs[2], recording)
    # Only the recorded signal has a spectrum.
    assert list(spectra) == [("roll", 1)]
    _, densities = metrics.spectrum(times, values)
    assert spectra["roll", 1][1] == pytest.approx(densities * 57.29577951308232**2, rel=1e-12)
    shown = Recordings(noisy)
    assert figures.panels(noisy, figure, shown, Numbers(noisy, {})) == []
    # A logarithmic axis cannot show a signal that is always zero.
    still = Recordings(noisy)
    still.add(noisy.runs[2], Recording(times, {"body.roll": np.zeros(900)}))
    assert figures.panels(noisy, figure, still, Numbers(noisy, {})) == []
    shown.add(noisy.runs[2], recording)
    assert (
        plots.PALETTE[1]
        in plots.draw(noisy.cases, figure, figures.panels(noisy, figure, shown, Numbers(noisy, {}))).svg
    )


def test_units_of_densities() -> None:
    assert figures.density_unit("m/s2") == "(m/s²)²/Hz"
    assert figures.density_unit("deg") == "(°)²/Hz"
    assert figures.density_unit("1") == "1/Hz"


def test_a_metric_is_drawn_over_a_growing_window(scenario: Plan) -> None:
    figure = replace(scenario.figures[0], kind="running", columns=(), metrics=(0,), levels=(), window=None)
    assert figures.columns_of(scenario, figure) == {1}
    drawing = draw(scenario, figure, recordings())
    assert plots.PALETTE[0] in drawing.svg
    assert plots.PALETTE[1] in drawing.svg
    assert not panels(scenario, figure, {})


def test_panels_are_titled_in_words(scenario: Plan) -> None:
    figure = replace(scenario.figures[0], columns=(1,), levels=())
    long = replace(scenario.columns[1], description="Height of the body over its rest " * 6)
    for column in (scenario.columns[1], long):
        named = replace(scenario, columns=(scenario.columns[0], column))
        drawing = draw(named, figure, recordings())
        # matplotlib writes the text of a title as a comment before its outlines.
        assert "<!-- body.roll -->" not in drawing.svg
        assert f"<!-- {column.description[:6]}" in drawing.svg


def test_signals_over_another_signal(scenario: Plan) -> None:
    figure = replace(scenario.figures[0], kind="xy", columns=(1,), over=0, levels=(), window=None)
    (panel,) = panels(scenario, figure, recordings())
    # A case without the abscissa's signal has no curve.
    (line,) = panel.lines
    assert panel.kind == "curve"
    np.testing.assert_array_equal(line.x, np.arange(4) * 0.1 * 10.0)
    np.testing.assert_array_equal(line.y, np.arange(4) * 0.1)
    (panel,) = panels(scenario, replace(figure, equal_axes=True), recordings())
    assert panel.kind == "map"
    assert plots.PALETTE[0] in plots.draw(scenario.cases, figure, [panel]).svg


def test_a_curve_keeps_its_extremes_in_both_directions() -> None:
    angle = np.linspace(0.0, 40.0, 9001)
    x, y = decimate(np.cos(angle) * angle, np.sin(angle) * angle, 100, is_curve=True)
    assert len(x) <= 410
    for kept, all_of in ((x, np.cos(angle) * angle), (y, np.sin(angle) * angle)):
        assert (kept.min(), kept.max()) == (all_of.min(), all_of.max())


def test_transfer_functions_have_gain_phase_and_coherence(scenario: Plan) -> None:
    figure = replace(
        scenario.figures[0], kind="transfer", columns=(1,), over=0, levels=(), window=None, band=(0.5, 4.0)
    )
    plan = replace(scenario, figures=(figure,))
    times = np.arange(900) * 0.1
    given = np.random.default_rng(1).normal(size=900)
    shown = Recordings(plan)
    assert figures.columns_of(plan, figure) == {0, 1}
    for run in plan.runs[:2]:
        shown.add(run, Recording(times, {"source.count": given, "body.roll": 0.5 * given}))
    found = figures.panels(plan, figure, shown, Numbers(plan, {}))
    assert [panel.title.rsplit(": ")[-1] for panel in found] == ["gain", "phase", "coherence"]
    # The center is half of the range, in degrees.
    for panel, expected in zip(found, (0.5 * 57.29577951308232, 0.0, 1.0), strict=True):
        (line,) = panel.lines
        np.testing.assert_allclose(line.y, expected, rtol=1e-9, atol=1e-9)
        assert line.x.min() >= 0.5
        assert line.x.max() <= 4.0
    assert plots.PALETTE[0] in plots.draw(plan.cases, figure, found).svg


def metric_values(plan: Plan) -> Numbers:
    values: dict[tuple[str, str, str | None, int | None], float] = {}
    for case in plan.cases:
        for seed in plan.seeds:
            values["roll_rms", case.name, None, seed] = 2.0 * seed
            values["count_final", case.name, None, seed] = 10.0 - seed
    return Numbers(plan, values)


def test_distributions_are_cumulative(scenario: Plan) -> None:
    figure = replace(scenario.figures[0], kind="distribution", columns=(), metrics=(0,), levels=(), window=None)
    (panel,) = panels(scenario, figure, {}, metric_values(scenario))
    for line in panel.lines:
        assert (line.x.tolist(), line.y.tolist(), line.steps, line.marks) == ([2.0, 4.0], [0.5, 1.0], True, True)
    assert plots.PALETTE[1] in plots.draw(scenario.cases, figure, [panel]).svg
    assert panels(scenario, figure, {}) == []


def test_scatter_plots_have_a_point_for_each_run(scenario: Plan) -> None:
    figure = replace(scenario.figures[0], kind="scatter", columns=(), metrics=(0,), over=1, levels=(), window=None)
    (panel,) = panels(scenario, figure, {}, metric_values(scenario))
    for line in panel.lines:
        assert (line.x.tolist(), line.y.tolist(), line.apart) == ([8.0, 9.0], [4.0, 2.0], True)
    assert plots.PALETTE[1] in plots.draw(scenario.cases, figure, [panel]).svg


def test_a_second_axis_and_equal_scales(scenario: Plan) -> None:
    figure = replace(scenario.figures[0], columns=(1,), right=0, separate=True, same_scale=True, levels=(), window=None)
    found = panels(scenario, figure, recordings())
    assert [panel.y.range for panel in found] == [found[0].y.range] * 2
    low, high = found[0].y.range or (0.0, 0.0)
    # The larger signal goes from 0 to 0.3 rad.
    assert low < 0.0
    assert 0.3 < high * 0.017453292519943295 < 0.35
    beside = [line for line in found[0].lines if line.right]
    assert [line.title for line in beside] == [found[0].right.title if found[0].right else ""]
    assert plots.draw(scenario.cases, figure, found).png

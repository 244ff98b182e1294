"""The data of a page follow the schema in `web/`, and their numbers agree with the recordings."""

import base64
import json
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace
from numpy.typing import NDArray

from chassis_fmu.evaluation.results_table import Numbers
from chassis_fmu.files.plan import Conversion, Plan
from chassis_fmu.files.results import Recording
from chassis_fmu.report import figures, page_data
from chassis_fmu.report.figures import Recordings
from chassis_fmu.report.panels import Axis, Line, Panel
from tests import commands
from tests.page_schema import SCHEMA, data_of, read


def numbers(data: dict[str, Any], column: dict[str, Any]) -> NDArray[np.float64]:
    """Decode a column according to the schema."""
    words = np.frombuffer(zlib.decompress(base64.b64decode(data["block"])), "<u2")
    own = np.cumsum(words[column["at"] : column["at"] + column["count"]], dtype=np.uint16)
    values = column["first"] + column["step"] * own.astype(np.float64)
    values = 10.0**values if column["log"] else values
    return np.where(own == page_data.MISSING, np.nan, values)


def of_panel(scenario: Plan, *lines: Line, log: bool = False) -> dict[str, Any]:
    x, y = Axis("Time", (Conversion("s"),)), Axis("", (Conversion("m"),), log=log)
    return read(page_data.of_plan(scenario, [(scenario.figures[0], [Panel("Height", "", x, y, lines)])]))


def first_line(data: dict[str, Any]) -> dict[str, Any]:
    line: dict[str, Any] = data["figures"][0]["panels"][0]["lines"][0]
    return line


def test_numbers_are_rounded_to_parts_of_their_range(scenario: Plan) -> None:
    times = np.arange(1000) * 0.1
    values = np.random.default_rng(1).normal(size=1000)
    values[7] = np.nan
    data = of_panel(scenario, Line("run", "A", times, values))
    line = first_line(data)
    # Times are on the grid of the recording, so only the last digits can differ.
    np.testing.assert_allclose(numbers(data, line["x"]), times, rtol=1e-13)
    # Rounding error: half a step.
    half = 0.5 * np.ptp(values[np.isfinite(values)]) / page_data.LARGEST
    np.testing.assert_allclose(numbers(data, line["y"]), values, atol=half * (1.0 + 1e-9))


def test_states_and_switches_are_exact(scenario: Plan) -> None:
    values = np.array([0.0, 1.0, 1.0, 3.0, -2.0, 60000.0])
    data = of_panel(scenario, Line("run", "A", np.arange(6) * 0.1, values))
    np.testing.assert_array_equal(numbers(data, first_line(data)["y"]), values)


def test_logarithmic_axes_keep_the_digits_of_small_numbers(scenario: Plan) -> None:
    values = np.logspace(-12.0, 3.0, 500)
    data = of_panel(scenario, Line("run", "A", np.arange(500) * 0.1, values), log=True)
    # 15 decades in 65534 steps: half a step is a factor of 10**(15 / 65534 / 2).
    limit = 10.0 ** (15.0 / page_data.LARGEST / 2.0) - 1.0
    np.testing.assert_allclose(numbers(data, first_line(data)["y"]), values, rtol=limit * 1.001)


def test_a_constant_and_an_empty_line_have_columns(scenario: Plan) -> None:
    nothing = np.zeros(0)
    data = of_panel(scenario, Line("run", "A", np.arange(3) * 0.1, np.full(3, 0.3)), Line("run", "B", nothing, nothing))
    lines = data["figures"][0]["panels"][0]["lines"]
    np.testing.assert_allclose(numbers(data, lines[0]["y"]), 0.3, rtol=1e-15)
    assert lines[1]["x"]["count"] == 0


def test_no_text_ends_the_script(scenario: Plan) -> None:
    text = page_data.of_plan(replace(scenario, cases=(replace(scenario.cases[0], title="</script><!--"),)), [])
    assert "<" not in text
    assert read(text)["cases"][0]["title"] == "</script><!--"


@pytest.mark.parametrize("seeds", [1, 3])
def test_the_figures_of_a_scenario_follow_the_schema(scenario: Plan, seeds: int) -> None:
    times = np.arange(4) * 0.1
    swept = replace(scenario, seeds=tuple(range(1, seeds + 1)))
    runs = [replace(swept.runs[0], id=f"{c.name}#{s}", case=c.name, seed=s) for c in swept.cases for s in swept.seeds]
    swept = replace(swept, runs=tuple(runs))
    recordings = Recordings(swept)
    for run in runs:
        recordings.add(run, Recording(times, {"body.roll": times * (run.seed or 0), "source.count": times}))
    # The window of the figure leaves out the first row.
    times = times[1:]
    found = [(figure, figures.panels(swept, figure, recordings, Numbers(swept, {}))) for figure in swept.figures]
    data = read(page_data.of_plan(swept, found))
    roll = next(p for f in data["figures"] for p in f["panels"] if p["title"] == "Roll angle")
    assert [unit["name"] for unit in roll["y"]["units"]] == ["°", "rad"]
    assert roll["y"]["title"] == "Roll angle"
    means = [line for line in roll["lines"] if line["kind"] == "mean"]
    assert len(means) == (0 if seeds == 1 else 2)
    if seeds > 1:
        # Mean and sample standard deviation of 1, 2 and 3.
        np.testing.assert_allclose(numbers(data, means[0]["y"]), 2.0 * times, atol=1e-5)
        np.testing.assert_allclose(numbers(data, means[0]["spread"]), times, atol=1e-5)
        files = [line["file"] for line in roll["lines"] if line["case"] == "active" and line["kind"] == "run"]
        assert files == ["runs/active_1.csv", "runs/active_2.csv", "runs/active_3.csv"]
        assert [line["seed"] for line in roll["lines"] if line["case"] == "active"] == [1, None, 2, 3]


def test_the_page_of_a_linear_model_has_the_bode_plot_of_numpy(tmp_path: Path) -> None:
    source, target = "steer.front", "vehicle.yaw_rate"
    fmu = str(SCHEMA.parents[1] / "target/fmu/EspCar.fmu")
    outputs = [argument for name in ("json", "html") for argument in ("--out", f"{tmp_path}/car.{name}")]
    code, _ = commands.cargo_fmu("linearize", fmu, "--bode", f"{source}:{target}", *outputs)
    assert code == 0
    data = data_of(tmp_path / "car.html")
    assert [figure["name"] for figure in data["figures"]] == ["poles", "bode_1"]
    gain, phase = (panel["lines"][0] for panel in data["figures"][1]["panels"])
    frequencies = numbers(data, gain["x"])
    linear = json.loads((tmp_path / "car.json").read_text(encoding="utf-8"))
    i, o = linear["inputs"].index(source), linear["outputs"].index(target)
    a, b, c, d = (np.array(linear[name]) for name in "ABCD")
    eye = np.eye(len(a))
    states = [np.linalg.solve(2j * np.pi * frequency * eye - a, b[:, i]) for frequency in frequencies]
    response = np.array([c[o] @ x + d[o, i] for x in states])
    # The tolerance covers rounding to 16 bits: of the gain's logarithm (a few decades), of the phase (a few
    # hundred degrees), and of the frequency.
    np.testing.assert_allclose(numbers(data, gain["y"]), np.abs(response), rtol=2e-3)
    np.testing.assert_allclose(numbers(data, phase["y"]), np.degrees(np.unwrap(np.angle(response))), atol=0.1)


def test_centers_of_cells_are_exact_and_their_values_rounded() -> None:
    x, y = np.repeat([0.5, 1.0, 1.5], 2), np.tile([30.0, 32.5], 3)
    z = np.random.default_rng(2).normal(size=6)
    z[4] = np.nan
    axes = (
        Axis("Angle", (Conversion("deg"),)),
        Axis("Speed", (Conversion("km/h"),)),
        Axis("Roll", (Conversion("deg"),)),
    )
    line_of_cells = Line("run", "Roll", x, y, z=z)
    panel = Panel("Roll", "", axes[0], axes[1], (line_of_cells,), kind="heat", z=axes[2])
    data = read(page_data.render([], [], [("map", [panel])]))
    (panel_data,) = data["figures"][0]["panels"]
    line = panel_data["lines"][0]
    assert (panel_data["kind"], panel_data["z"]["title"]) == ("heat", "Roll")
    # Small multiples of the smallest distance, which are exact up to floating-point errors.
    np.testing.assert_allclose(numbers(data, line["x"]), x, rtol=1e-14)
    np.testing.assert_allclose(numbers(data, line["y"]), y, rtol=1e-14)
    # Rounding error: half a step.
    half = 0.5 * np.ptp(z[np.isfinite(z)]) / page_data.LARGEST
    np.testing.assert_allclose(numbers(data, line["z"]), z, atol=half * (1.0 + 1e-9))


def test_of_many_seeds_the_first_ones_are_lines(scenario: Plan) -> None:
    count = figures.MOST_SEEDS + 5
    plan = replace(scenario, seeds=tuple(range(1, count + 1)))
    runs = [
        replace(plan.runs[0], id=f"{case.name}#{seed}", case=case.name, seed=seed)
        for case in plan.cases
        for seed in plan.seeds
    ]
    plan = replace(plan, runs=tuple(runs))
    recordings = Recordings(plan)
    times = np.arange(2000) * 0.1
    for run in plan.runs:
        noise = np.random.default_rng(run.seed).normal(size=2000)
        recordings.add(run, Recording(times, {"body.roll": noise, "source.count": noise}))
    figure = next(figure for figure in plan.figures if figure.kind == "time")
    panels = figures.panels(plan, figure, recordings, Numbers(plan, {}))
    lines = [line for line in panels[0].lines if line.case == plan.cases[0] and line.kind == "run"]
    assert [line.seed for line in lines] == list(plan.seeds[: figures.MOST_SEEDS])
    # All seeds together have as many samples as FEW_SEEDS seeds.
    most = 2 * figures.FEW_BUCKETS * figures.FEW_SEEDS + 2 * figures.MOST_SEEDS * 2
    assert sum(len(line.x) for line in lines[1:]) <= most
    # Mean and deviation use all seeds.
    assert any(line.title.endswith(f"mean of {count}") for line in panels[0].lines)

"""Reports of tuning studies: histories to Parquet, the plot, the page, the command."""

from __future__ import annotations

import itertools
import json
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet
import pytest
from matplotlib.figure import Figure
from matplotlib.text import Text

from chassis_fmu import tuning
from tests.page_schema import data_of

HISTORY = """evaluation,generation,a:x,"b:y, z",objective,feasible,reason
1,0,0.1,1e-300,1000000.0,false,"constraint one, or so"
2,0,0.2,2.0,4.0,true,
3,1,0.30000000000000004,3.0,5.0,true,
4,1,0.4,4.0,3.0,true,
5,2,0.5,5.0,9.0,true,
"""


def summary() -> dict[str, Any]:
    parameter = {"symbol": None, "unit": "rad/s2", "min": 0.0, "max": 5.0, "log": False}
    method = {"seed": 1, "settings": {"population": 2, "step_size": None}, "end": "budget", "generations": 2}
    best = {"evaluation": 4, "generation": 1, "values": [0.4, 4.0], "objective": 3.0}
    return {
        "format": 3,
        "fmus": ["nowhere/Plant.fmu"],
        "name": "trial",
        "title": "Trial <1>",
        "description": "One.\n\nTwo.",
        "reference": "",
        "scenario": "scenarios/trial.toml",
        "runs": ["one#1", "one#2"],
        "duration": 2.0,
        "budget": 4,
        "target": None,
        "penalty": 1e6,
        "parameters": [{**parameter, "name": "a:x", "symbol": "x_1"}, {**parameter, "name": "b:y, z", "unit": None}],
        "constraints": [["one_two", "x_1 > 0"]],
        "limits": [{"signal": "body.roll", "magnitude": 3.0}],
        "terms": [
            {"signal": "body.roll", "kind": "mean_square", "window": [0.0, 1.5], "weight": 0.5, "reference": 1.0}
        ],
        "judged": {"weights": [1.0], "lambda_max": 1.0, "index": 0.0, "ratio": 0.0},
        "baseline": {"title": "As in the scenario", "values": [0.15, None], "objective": 3.25, "reason": None},
        "comparisons": [
            {"title": "Paper's", "values": {"a:x": 0.25}, "objective": 3.5, "reason": None},
            {"title": "Wild", "values": {}, "objective": 1e6, "reason": "run one: it flew away"},
        ],
        "methods": [
            {
                **method,
                "name": "pacsa",
                "title": "PACSA",
                "group": "PACSA",
                "kind": "pacsa",
                "evaluations": 4,
                "infeasible": 1,
                "best": best,
            },
            {
                **method,
                "name": "lost",
                "title": "Lost",
                "group": "Lost",
                "kind": "ga",
                "evaluations": 1,
                "infeasible": 1,
                "best": None,
            },
        ],
        "best": "pacsa",
        "improved": True,
    }


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    out = tmp_path / "out" / "trial"
    for method in ("pacsa", "lost"):
        (out / method).mkdir(parents=True)
        (out / method / "history.csv").write_text(HISTORY)
    (out / "summary.json").write_text(json.dumps(summary()))
    return out


def test_the_histories_become_one_table(folder: Path) -> None:
    tuning.report(folder, "chassis study trial.toml")
    table = pyarrow.parquet.read_table(folder / "history.parquet")
    # Rows beyond the budget are left out.
    assert table["method"].to_pylist() == ["pacsa"] * 4 + ["lost"]
    assert table["a:x"].to_pylist()[:4] == [0.1, 0.2, 0.1 + 0.2, 0.4]
    assert table["b:y, z"].to_pylist()[0] == 1e-300
    assert table["feasible"].to_pylist()[:2] == [False, True]
    assert table["reason"].to_pylist()[:2] == ["constraint one, or so", ""]
    assert table.schema.field("a:x").metadata == {b"unit": b"rad/s2"}


def test_the_best_so_far_ignores_what_is_not_feasible(folder: Path) -> None:
    study = tuning.parse((folder / "summary.json").read_text())
    table = tuning.read_history(study, folder)
    np.testing.assert_array_equal(tuning.best_so_far(table, "pacsa"), [np.nan, 4.0, 4.0, 3.0])
    np.testing.assert_array_equal(tuning.best_so_far(table, "lost"), [np.nan])


def test_the_median_of_seeds() -> None:
    nan = np.nan
    np.testing.assert_array_equal(tuning.median([np.array([nan, 3.0, 2.0])]), [nan, 3.0, 2.0])
    # A curve that has ended keeps its last value; a curve without a value counts as infinite.
    curves = [np.array([nan, 9.0, 1.0]), np.array([4.0]), np.array([6.0, 5.0, 5.0])]
    np.testing.assert_array_equal(tuning.median(curves), [6.0, 5.0, 4.0])
    np.testing.assert_array_equal(tuning.median(curves[:2]), [nan, 6.5, 2.5])


def test_seeds_of_a_method_stand_together(folder: Path) -> None:
    raw = summary()
    second = {"name": "pacsa_2", "title": "PACSA, seed 2", "seed": 2, "evaluations": 5}
    better = {"evaluation": 5, "generation": 2, "values": [0.5, 5.0], "objective": 2.0}
    raw["methods"].append({**raw["methods"][0], **second, "best": better})
    (folder / "summary.json").write_text(json.dumps(raw))
    (folder / "pacsa_2").mkdir()
    (folder / "pacsa_2" / "history.csv").write_text(HISTORY.replace("9.0,true", "2.0,true"))
    study = tuning.parse((folder / "summary.json").read_text())
    assert [(g.title, len(g.methods)) for g in study.groups] == [("PACSA", 2), ("Lost", 1)]
    assert study.groups[0].objectives == [2.0, 3.0]
    assert study.groups[0].best == study.methods[2].best
    assert study.groups[1].best is None
    tuning.report(folder, "c")
    assert f'href="{folder.name}/index.html"' in (folder.parent / "index.html").read_text()
    page = (folder / "index.html").read_text()
    for text in ("thick lines: their median", "PACSA, best to worst", "For several seeds, the best result is shown."):
        assert text in page, text


@pytest.fixture
def canvas(monkeypatch: pytest.MonkeyPatch) -> Figure:
    """Return the matplotlib figure that a function draws on."""
    canvas = Figure(figsize=(8.4, 4.2), layout="constrained")
    monkeypatch.setattr(tuning, "Figure", lambda **_: canvas)
    return canvas


@pytest.mark.parametrize(
    ("objectives", "labels", "lines"),
    [
        # The curve goes from 4 to 3: levels up to 4.5 are lines, higher ones have an arrow.
        ({"Near": 4.5, "Far": 4.6}, ["Far: 4.6\N{NO-BREAK SPACE}\N{UPWARDS ARROW}", "Near: 4.5"], [4.5, 3.25]),
        ({"Better": 0.5}, ["Better: 0.5"], [3.25, 0.5]),
    ],
)
def test_values_to_compare_with_are_drawn_or_named(
    folder: Path, canvas: Figure, objectives: dict[str, float], labels: list[str], lines: list[float]
) -> None:
    raw = summary()
    raw["comparisons"] = [{"title": t, "values": {}, "objective": v, "reason": None} for t, v in objectives.items()]
    study = tuning.parse(json.dumps(raw))
    found = tuning.convergence(study, tuning.read_history(study, folder))
    assert found is not None
    tuning.draw(found)
    (ax,) = canvas.axes
    texts = [text.get_text() for text in ax.texts]
    assert [t for t in texts if not t.startswith("As in the scenario")] == labels
    assert [np.asarray(line.get_ydata())[0] for line in ax.lines[1:]] == lines


def test_names_of_levels_do_not_overlap(folder: Path, canvas: Figure) -> None:
    raw = summary()
    levels = {"Passive": 3.3, "Table 5, PACSA": 3.31, "A name that takes more than one line": 3.32, "Far": 90.0}
    raw["comparisons"] = [{"title": t, "values": {}, "objective": v, "reason": None} for t, v in levels.items()]
    study = tuning.parse(json.dumps(raw))
    found = tuning.convergence(study, tuning.read_history(study, folder))
    assert found is not None
    tuning.draw(found)
    canvas.draw_without_rendering()
    boxes = [Text.get_window_extent(text) for text in canvas.axes[0].texts]
    assert len(boxes) == 5
    assert not any(one.overlaps(other) for one, other in itertools.combinations(boxes, 2))
    assert all(canvas.bbox.x0 <= box.x0 and box.x1 <= canvas.bbox.x1 for box in boxes)


def test_labels_are_moved_as_little_as_needed() -> None:
    np.testing.assert_allclose(tuning.spread([0.9, 0.5, 0.1], [0.1, 0.1, 0.1]), [0.9, 0.5, 0.1])
    np.testing.assert_allclose(tuning.spread([0.5, 0.5, 0.1], [0.1, 0.1, 0.1]), [0.55, 0.45, 0.1])
    # A joined block can touch the next one.
    np.testing.assert_allclose(tuning.spread([0.5, 0.5, 0.41], [0.1, 0.1, 0.1]), [0.57, 0.47, 0.37])
    # Labels at the ends stay within the plot.
    line = tuning.LINE
    np.testing.assert_allclose(tuning.spread([1.0, 1.0], [line, line]), [1.0, 1.0 - line])
    np.testing.assert_allclose(tuning.spread([0.0, 0.0], [line, line]), [line, 0.0], atol=1e-15)


def test_the_axis_shows_where_the_methods_differ() -> None:
    # The first evaluations and a level far above do not determine the axis.
    curve = np.array([np.nan, 50.0, *[2.0] * 28, 1.0])
    scale = tuning.Scale.of([[curve]], [1.2, 40.0])
    assert not scale.logarithmic
    np.testing.assert_allclose([scale.bottom, scale.top, scale.reach], [0.94, 2.06, 2.5])
    # Over decades, the same applies to logarithms.
    curve = np.repeat([100.0, 1.0], 40)
    scale = tuning.Scale.of([[curve]], [0.0, 0.1])
    assert scale.logarithmic
    np.testing.assert_allclose([scale.bottom, scale.top], [0.1 * 10**-0.18, 10**2.18])
    np.testing.assert_allclose([scale.share(0.0), scale.share(scale.bottom), scale.share(scale.top)], [0.0, 0.0, 1.0])
    # A constant objective still gives an axis.
    scale = tuning.Scale.of([[np.array([0.0])]], [])
    assert scale.bottom < 0.0 < scale.top


def test_the_page_says_if_nothing_improved(folder: Path) -> None:
    sentence = "No method improved on the scenario's own values."
    tuning.report(folder, "c")
    assert sentence not in (folder / "index.html").read_text()
    (folder / "summary.json").write_text(json.dumps({**summary(), "improved": False}))
    tuning.report(folder, "c")
    assert sentence in (folder / "index.html").read_text()


def test_the_page_says_what_was_found(folder: Path) -> None:
    tuning.report(folder, "chassis study trial.toml")
    page = (folder / "index.html").read_text()
    for text in (
        "Trial &lt;1&gt;",
        "<svg role=",
        "Paper&#39;s",
        "As in the scenario</th>",
        '<td class="number">0.15</td>',
        '<code class="name">body.<wbr>roll</code>',
        "Wild is not feasible: run one: it flew away.",
        "x_1, rad/s²",
        "<code>x_1 &gt; 0</code>",
        "0 to 1.5 s",
        "consistency ratio 0.0000",
        "population 2</small>",
    ):
        assert text in page, text
    assert "#0072b2" not in page.split("</style>")[1], "colors follow the theme"


def test_the_page_has_data_by_the_schema_and_definitions(folder: Path) -> None:
    tuning.report(folder, "chassis study trial")
    data = data_of(folder / "index.html")
    assert [figure["name"] for figure in data["figures"]] == ["convergence"]
    raw = summary()
    texts = tuning.definitions({**raw, "rows": [1001] * len(raw["terms"])})
    assert len(texts) == len(raw["terms"])
    page = (folder / "index.html").read_text(encoding="utf-8")
    assert page.count('<details class="definition">') == len(texts)
    for term, text in zip(raw["terms"], texts, strict=True):
        assert term["signal"] in text
        assert "(1 001 rows)" in text


def test_reports_repeat_to_the_byte(folder: Path) -> None:
    def contents() -> dict[str, bytes]:
        tuning.report(folder, "c")
        return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}

    first = contents()
    assert first == contents()
    assert {"figures/convergence.svg", "figures/convergence.png", "index.html", "history.parquet"} < set(first)


def test_without_anything_feasible_there_is_a_page_but_no_plot(folder: Path) -> None:
    raw = summary()
    raw["methods"] = raw["methods"][1:]
    (folder / "summary.json").write_text(json.dumps(raw))
    tuning.report(folder, "c")
    assert not (folder / "figures").exists()
    assert '<svg role="img"' not in (folder / "index.html").read_text()


@pytest.mark.parametrize(
    ("file", "content", "message"),
    [
        ("summary.json", "{", "not a summary of a study"),
        ("summary.json", '{"format": 1}', "summary of format 1, this version reads 3: --resume"),
        ("summary.json", '{"format": 3}', "not a summary of a study: .*missing required field"),
        ("pacsa/history.csv", HISTORY.replace("0.2,", "a,"), "cannot read the history"),
    ],
)
def test_damaged_results_are_clear_errors(folder: Path, file: str, content: str, message: str) -> None:
    (folder / file).write_text(content)
    with pytest.raises(tuning.StudyError, match=message):
        tuning.report(folder, "c")


def test_the_page_is_made_after_the_study(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert tuning.main([str(folder), "chassis study studies/trial.toml --budget 9"]) == 0
    assert capsys.readouterr().out.strip() == str(folder / "index.html")
    assert "chassis study studies/trial.toml --budget 9</code>" in (folder / "index.html").read_text()


def test_a_folder_without_a_study_is_an_error(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert tuning.main([str(tmp_path), "chassis study"]) == 1
    assert "summary.json" in capsys.readouterr().err

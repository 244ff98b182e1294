"""The page of a study: the numbers in its tables and figures agree with `runs.parquet`."""

from __future__ import annotations

import base64
import itertools
import json
import re
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet
import pytest
import SALib.analyze.sobol
import scipy.stats
from lxml import html
from numpy.typing import NDArray

from tests import study_system
from tests.study_system import SCENARIO, build, vary, write

Array = NDArray[np.float64]

UNIFORM = 'distribution = "uniform"\nmin = 0.0\nmax = 1.0'
THREE = "".join(vary(name, f"f:{variable}", UNIFORM) for name, variable in zip("pqr", "abc", strict=True))
PLAIN = 'cases = ["plain"]\n'
DIGITS = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻", "0123456789-")


class Page:
    """The page of a study and its rows."""

    def __init__(self, folder: Path, study: str, scenario: str = SCENARIO) -> None:
        out = folder / "out"
        path = write(folder, study, scenario)
        assert study_system.carry_out([str(path), "--fmus", str(folder / "fmus"), "--out", str(out)]) == 0
        self.folder = out / "study"
        text = (self.folder / "index.html").read_text()
        self._tree = html.document_fromstring(text)
        self._data = json.loads(re.findall(r'id="page-data">(.*?)</script>', text, re.DOTALL)[0])
        block = zlib.decompress(base64.b64decode(self._data["block"]))
        self._words = np.frombuffer(block, "<u2")
        self._table = pyarrow.parquet.read_table(self.folder / "runs.parquet")

    def column(self, name: str, case: str = "plain", **factors: object) -> Array:
        """Return a column of the runs of a case with the given values of factors."""
        chosen = [r for r in self._table.to_pylist() if r["case"] == case]
        return np.array([r[name] for r in chosen if all(r[k] == v for k, v in factors.items())], np.float64)

    def table(self, title: str, section: str = "Value") -> list[Any]:
        """Return the rows of the table below a heading, in the section of a metric."""
        (found,) = self._tree.xpath(f'//section[h2="{section}"]/h3[.="{title}"]/following-sibling::div[1]//tbody')
        rows: list[Any] = found.xpath("./tr")
        return rows

    def check_tables(self) -> int:
        """Check that each row of a table has a cell for each heading; return the number of tables."""
        tables = self._tree.xpath("//table[thead]")
        for table in tables:
            (head,) = table.xpath("./thead/tr")
            for row in table.xpath("./tbody/tr"):
                assert len(cells(row)) == len(cells(head)), (cells(head), cells(row))
        return len(tables)

    def panels(self, figure: str) -> dict[tuple[str, str], dict[str, Any]]:
        """Return the panels of a figure by title and note, and check that page and folder contain its picture."""
        (drawn,) = self._tree.xpath(f'//figure[@id="{figure}"]')
        assert drawn.xpath('.//*[local-name()="svg"]//*[local-name()="path"]')
        assert (self.folder / "figures" / f"{figure}.svg").is_file()
        (of,) = [f for f in self._data["figures"] if f["name"] == figure]
        return {(p["title"], p["note"]): p for p in of["panels"]}

    def cases(self, figure: str | None = None) -> list[dict[str, Any]]:
        """Return the cases of the page, or those of a figure with its own cases."""
        return [case for case in self._data["cases"] if case.get("figure") == figure]

    def values(self, column: dict[str, Any]) -> Array:
        """Return the numbers of a column of the page's data (`web/page-data.schema.json`)."""
        assert not column["log"]
        words = np.cumsum(self._words[column["at"] : column["at"] + column["count"]], dtype=np.uint16)
        assert 65535 not in words
        found: Array = column["first"] + column["step"] * words.astype(np.float64)
        return found


def number(text: str) -> float:
    mantissa, _, exponent = text.replace("−", "-").partition("×10")
    return float(f"{mantissa}e{exponent.translate(DIGITS)}" if exponent else mantissa)


def numbers(text: str) -> list[float]:
    """Return the numbers in a cell such as `1.2 to 3.4`."""
    return [number(part) for part in re.split(r" to | of |, ", text.replace(" %", ""))]


def cells(row: Any) -> list[str]:
    return [cell.text_content() for cell in row.xpath("./th | ./td")]


def bars(row: Any) -> list[tuple[str, float, float]]:
    """Return class, left end and right end (percent) of the bars in a table row."""
    found = []
    for bar in row.xpath(".//span/i"):
        ends = re.fullmatch(r"left:([\d.]+)%?;right:([\d.]+)%", bar.get("style"))
        assert ends is not None
        found.append((bar.get("class"), float(ends[1]), 100.0 - float(ends[2])))
    return found


def near(expected: object, digits: int) -> Any:
    """Return expected numbers with the tolerance of rounding to significant digits: half a unit of the last digit."""
    return pytest.approx(expected, rel=0.5 * 10.0 ** (1 - digits) * 1.001, abs=1e-12)


def is_drawn(page: Page, line: dict[str, Any], x: Array, y: Array) -> None:
    """Check the points of a line; numbers in the page have 16 bits."""
    for name, expected in (("x", x), ("y", y)):
        found = page.values(line[name])
        assert found == pytest.approx(expected, rel=1e-12, abs=0.51 / 65534 * float(np.ptp(expected)))


def by_abscissa(x: Array, y: Array) -> tuple[Array, Array]:
    """Return points sorted by abscissa, as in a figure."""
    order = np.argsort(x, kind="stable")
    return x[order], y[order]


def test_sobol_indices_and_their_bars(tmp_path: Path) -> None:
    """Reference: the formulas of the estimators (Saltelli et al., 2010; Jansen, 1999); the intervals are SALib's."""
    build(tmp_path, "a + 10 * b * c")
    page = Page(tmp_path, f'method = "sensitivity"\nanalysis = "sobol"\nruns = 64\n{PLAIN}{THREE}')
    y = page.column("y")
    a, *exchanged, b = y.reshape(64, 5).T
    variance = np.var(np.concatenate((a, b)))
    first = {n: float(np.mean((b - y.mean()) * (e - a)) / variance) for n, e in zip("pqr", exchanged, strict=True)}
    total = {n: float(0.5 * np.mean((a - e) ** 2) / variance) for n, e in zip("pqr", exchanged, strict=True)}
    problem = {"num_vars": 3, "names": [*"pqr"], "bounds": [[0.0, 1.0]] * 3}
    of = SALib.analyze.sobol.analyze(problem, y, calc_second_order=False, seed=1)
    rows = page.table("Share of the variance (Sobol): first-order and total index: Plain")
    assert [cells(row)[0] for row in rows] == sorted("pqr", key=lambda name: -total[name])
    halves = {n: (float(of["S1_conf"][i]), float(of["ST_conf"][i])) for i, n in enumerate("pqr")}
    # The scale of the bars ends at the largest end of an interval, at least at 1.
    scale = max(1.0, *(total[n] + halves[n][1] for n in "pqr"))
    for row in rows:
        name, one, interval, whole, whole_interval, _ = cells(row)
        ends = [first[name] - halves[name][0], first[name] + halves[name][0]]
        whole_ends = [total[name] - halves[name][1], total[name] + halves[name][1]]
        assert number(one) == near(first[name], 3)
        assert numbers(interval) == near(ends, 3)
        assert number(whole) == near(total[name], 3)
        assert numbers(whole_interval) == near(whole_ends, 3)
        places = np.clip(100.0 * np.array([first[name], *ends, total[name], *whole_ends]) / scale, 0.0, 100.0)
        kinds, starts, stops = zip(*bars(row), strict=True)
        assert kinds == ("first", "interval", "total", "interval")
        # Rounded to two decimals.
        assert starts == pytest.approx([0.0, places[1], 0.0, places[4]], abs=0.0051)
        assert stops == pytest.approx([places[0], places[2], places[3], places[5]], abs=0.0051)


def test_elementary_effects_and_their_bars(tmp_path: Path) -> None:
    """Reference: M. D. Morris (1991), the effects of changing one factor along trajectories of four samples."""
    build(tmp_path, "a + 10 * b * c")
    page = Page(tmp_path, f'method = "sensitivity"\nanalysis = "morris"\nruns = 16\n{PLAIN}{THREE}')
    y = page.column("y").reshape(16, 4)
    x = np.stack([page.column(name) for name in "pqr"]).reshape(3, 16, 4)
    effects: dict[str, list[float]] = {name: [] for name in "pqr"}
    for trajectory in range(16):
        for step in range(3):
            moved = np.diff(x[:, trajectory, step : step + 2], axis=1)[:, 0]
            (at,) = np.flatnonzero(moved)
            change = y[trajectory, step + 1] - y[trajectory, step]
            effects["pqr"[at]].append(float(change / moved[at]))
    size = {name: float(np.mean(np.abs(of))) for name, of in effects.items()}
    spread = {name: float(np.std(of, ddof=1)) for name, of in effects.items()}
    rows = page.table("Elementary effects (Morris): Plain")
    assert [cells(row)[0] for row in rows] == sorted("pqr", key=lambda name: -size[name])
    longest = max(numbers(cells(row)[2])[1] for row in rows)
    for row in rows:
        name, value, interval, sigma, _ = cells(row)
        # The clipped ends of the shares change an effect by a relative 1e-6.
        assert number(value) == near(size[name], 3)
        # All effects of `a` are 1.
        assert number(sigma) == (near(spread[name], 3) if name != "p" else pytest.approx(0.0, abs=1e-5))
        (kind, start, stop), (_, *ends) = bars(row)
        assert (kind, start) == ("first", 0.0)
        # The page states the ends of the intervals with three digits.
        assert stop == pytest.approx(100.0 * size[name] / longest, abs=1.0)
        assert ends == pytest.approx([100.0 * end / longest for end in numbers(interval)], abs=1.0)
        # The interval is symmetric about the mean, with 1.96 standard errors to each side. A bootstrap with 1,000
        # resamples has a deviation of 2 %. If a factor interacts with others, its effects depend on few levels, so the
        # tolerance is 25 %.
        half = 1.96 * float(np.std(np.abs(effects[name]), ddof=1)) / 4.0
        low, high = numbers(interval)
        assert 0.5 * (low + high) == pytest.approx(size[name], rel=0.005)
        assert 0.5 * (high - low) == pytest.approx(half, rel=0.25, abs=1e-5)


# The first value of the signal is c; later values are larger. If c rises, the minimum rises and the last value falls.
FIRST = '[[metric]]\nname = "first"\ntitle = "First"\nsignal = "f:y"\nkind = "min"\n'
CONFLICT = "2 - c + a * a"


def test_the_scatter_matrix_has_every_pair(tmp_path: Path) -> None:
    build(tmp_path, CONFLICT)
    page = Page(tmp_path, f'method = "sample"\nruns = 30\nmetrics = ["y", "first"]\n{THREE}', SCENARIO + FIRST)
    panels = page.panels("scatter_matrix")
    titles = {"p": "p", "q": "q", "r": "r", "y": "Value", "first": "First"}
    pairs = [*[("p", "q"), ("p", "r"), ("q", "r")], *[(f, m) for m in ("y", "first") for f in "pqr"], ("y", "first")]
    assert list(panels) == [(f"{titles[up]} over {titles[across]}", "") for across, up in pairs]
    for (across, up), panel in zip(pairs, panels.values(), strict=True):
        lines = [line for line in panel["lines"] if line["kind"] == "run"]
        # All cases have the same samples, so factors need one line only.
        assert len(lines) == (1 if up in "pqr" else 2)
        for line, case in zip(lines, ("plain", "shifted"), strict=False):
            is_drawn(page, line, *by_abscissa(page.column(across, case), page.column(up, case)))
            assert line["apart"]


def test_an_optimization_of_one_of_two_metrics_has_a_pareto_front(tmp_path: Path) -> None:
    build(tmp_path, CONFLICT)
    study = f'method = "optimize"\nruns = 40\nmetrics = ["y", "first"]\n{PLAIN}{THREE}'
    study += '[search]\nmetric = "y"\ndirection = "minimize"\n'
    page = Page(tmp_path, study, SCENARIO + FIRST)
    points = [*zip(page.column("y"), page.column("first"), strict=True)]
    # Pareto front, by definition: no point is at least as good in both metrics and better in one.
    front = sorted(
        (y, first) for y, first in points if not any(v <= y and w <= first and (v, w) != (y, first) for v, w in points)
    )
    assert 3 < len(front) < 40
    panel = page.panels("scatter_matrix")["First over Value", ""]
    (line,) = [line for line in panel["lines"] if line["kind"] == "reference"]
    assert line["title"] == "Pareto front"
    is_drawn(page, line, *np.array(front).T)


def test_choices_are_compared(tmp_path: Path) -> None:
    """Reference: means and intervals from SciPy, for pairs of runs with the same values."""
    build(tmp_path)
    build(tmp_path, "a + 10 * b + 100.2 * c - 1", name="Other")
    law = '[[vary]]\nname = "law"\nfmu = "f"\nvalues = ["Function", "Other"]\n'
    page = Page(tmp_path, f'method = "sample"\nruns = 25\n{law}{THREE}')
    # Each FMU has its own color and switch, and the points of its runs.
    titles = [f"{case}, {name}" for case in ("Plain", "Shifted") for name in ("Function", "Other")]
    assert [(case["title"], case["color"]) for case in page.cases()] == [(t, i) for i, t in enumerate(titles)]
    lines = page.panels("y_factors")["Value over p", ""]["lines"]
    assert [(line["title"], line["x"]["count"]) for line in lines] == [(title, 25) for title in titles]
    for case, title in (("plain", "Plain"), ("shifted", "Shifted")):
        first, second = (page.column("y", case, law=name) for name in ("Function", "Other"))
        assert len(first) == len(second) == 25
        rows = page.table(f"By choice: {title}")
        for row, name, y in zip(rows, ("Function", "Other"), (first, second), strict=True):
            shown = cells(row)
            assert shown[:3] == ["law", name, "25"]
            assert number(shown[3]) == near(y.mean(), 4)
            assert numbers(shown[4]) == near([*scipy.stats.ttest_1samp(y, 0.0).confidence_interval(0.95)], 4)
        assert cells(rows[0])[5:] == ["", "", "", ""]
        against, difference, interval, lower = cells(rows[1])[5:]
        of = scipy.stats.ttest_rel(second, first).confidence_interval(0.95)
        assert against == "Function"
        assert number(difference) == near(np.mean(second - first), 4)
        assert numbers(interval) == near([of.low, of.high], 4)
        count = int(np.sum(second < first))
        assert numbers(lower) == [count, 25, pytest.approx(4.0 * count)]
        # The FMUs differ by 0.2 c - 1, which is below zero for all samples.
        assert count == 25
        assert rows[1].xpath('./td[@class="number strong"]')


@pytest.mark.parametrize("method", ["sweep", "sample"])
def test_tables_of_choices_have_intervals_only_with_a_probability(tmp_path: Path, method: str) -> None:
    build(tmp_path)
    build(tmp_path, "a + 10 * b + 100.2 * c - 1", name="Other")
    law = '[[vary]]\nname = "law"\nfmu = "f"\nvalues = ["Function", "Other"]\n'
    requirement = '[[requirement]]\nmetric = "y"\nmax = 1000.0\n'
    factor = vary("p", "f:a", "values = [0.0, 1.0, 3.0]") if method == "sweep" else vary("p", "f:a", UNIFORM)
    page = Page(
        tmp_path, f'method = "{method}"\n{"runs = 6" if method == "sample" else ""}\n{law}{factor}{requirement}'
    )
    assert page.check_tables() > 5
    rows = page.table("By choice: Plain")
    (note,) = rows[0].xpath('ancestor::div[1]/following-sibling::p[@class="note"][1]')
    text = note.text_content()
    if method == "sample":
        assert len(cells(rows[1])) == 9
        assert "(Student)" in text
        assert "Bold" in text
    else:
        # Columns: factor, choice, runs, mean, against, difference, share.
        assert len(cells(rows[1])) == 7
        assert cells(rows[1])[:3] == ["law", "Other", "3"]
        assert cells(rows[1])[4] == "Function"
        assert not rows[1].xpath('./td[contains(@class, "strong")]')
        assert "interval" not in text
        assert "(Student)" not in text


def test_main_effects_are_means_over_the_other_factors(tmp_path: Path) -> None:
    build(tmp_path, "a + 10 * b * c")
    levels = {"p": [1.0, 2.0, 4.0], "q": [0.0, 3.0], "r": [1.0, 2.0]}
    study = 'method = "sweep"\n' + "".join(
        vary(name, f"f:{variable}", f"values = {levels[name]}") for name, variable in zip("pqr", "abc", strict=True)
    )
    page = Page(tmp_path, study)
    panels = page.panels("y_factors")
    assert list(panels) == [(f"Value over {name}", "") for name in "pqr"]
    # By hand: the means of p, q and r are 7/3, 3/2 and 3/2.
    expected = {
        "p": [p + 22.5 for p in levels["p"]],
        "q": [7.0 / 3.0 + 15.0 * q for q in levels["q"]],
        "r": [7.0 / 3.0 + 15.0 * r for r in levels["r"]],
    }
    for name, of in levels.items():
        means = np.array([page.column("y", "plain", **{name: level}).mean() for level in of])
        assert means == pytest.approx(expected[name], rel=1e-14)
        lines = panels[f"Value over {name}", ""]["lines"]
        assert [line["title"] for line in lines] == ["Plain", "Shifted"]
        for line, case in zip(lines, ("plain", "shifted"), strict=True):
            means = np.array([page.column("y", case, **{name: level}).mean() for level in of])
            is_drawn(page, line, np.array(of), means)
    # The tornado shows the same means at the ends, sorted by the size of the change.
    rows = page.table("Effect of the factors: Plain")
    assert [cells(row)[0] for row in rows] == ["q", "r", "p (m)"]
    for row in rows:
        name, low, high, ends, difference, _ = cells(row)
        first, last = expected[name[0]][0], expected[name[0]][-1]
        assert (number(low), number(high)) == (levels[name[0]][0], levels[name[0]][-1])
        assert numbers(ends) == near([first, last], 4)
        assert number(difference) == near(last - first, 4)


def test_a_histogram_and_a_cumulative_distribution(tmp_path: Path) -> None:
    build(tmp_path, "a * a + b * c")
    requirement = '[[requirement]]\nmetric = "y"\nmax = 1.5\nshare = 0.1\n'
    page = Page(tmp_path, f'method = "sample"\nruns = 50\n{THREE}{requirement}')
    panels = page.panels("y_distribution")
    cumulative, histogram = panels.values()
    cases = ("plain", "shifted")
    everything = np.concatenate([page.column("y", case) for case in cases])
    # The number of bins is the root of the number of runs; they cover the range of all cases.
    edges = np.linspace(everything.min(), everything.max(), 11)
    for panel in (cumulative, histogram):
        assert [line["title"] for line in panel["lines"]] == ["Plain", "Shifted", "limit 1.5"]
        assert set(page.values(panel["lines"][2]["x"])) == {1.5}
    for at, case in enumerate(cases):
        y = np.sort(page.column("y", case))
        shares = [float(np.mean((low <= y) & (y < high))) for low, high in itertools.pairwise(edges)]
        # The last bin includes its upper end.
        shares[-1] += float(np.mean(y == edges[-1]))
        assert sum(shares) == pytest.approx(1.0, rel=1e-14)
        is_drawn(page, histogram["lines"][at], np.repeat(edges, 2), np.array([0.0, *np.repeat(shares, 2), 0.0]))
        steps = np.repeat(np.arange(51) / 50.0, 2)[1:-1]
        is_drawn(page, cumulative["lines"][at], np.repeat(y, 2), steps)


def test_recorded_runs_have_colors_and_values_of_their_own(tmp_path: Path) -> None:
    build(tmp_path)
    factor = vary("p", "f:a", 'distribution = "log_uniform"\nmin = 0.01\nmax = 10.0')
    page = Page(tmp_path, f'method = "sample"\nruns = 12\n{PLAIN}{factor}[series]\nmetric = "y"\nworst = 3\n')
    runs = page.cases("histories")
    assert [run["color"] for run in runs] == [0, 1, 2]
    values = page.column("p")
    worst = sorted(np.argsort(-page.column("y"))[:3])
    for run, sample in zip(runs, worst, strict=True):
        title, factors = run["title"].split(": ")
        assert title == f"Plain, sample {sample}"
        assert number(factors.split()[1]) == near(values[sample], 3)
    (panel,) = page.panels("histories").values()
    assert [line["case"] for line in panel["lines"]] == [run["name"] for run in runs]
    # Factors with a logarithmic distribution have logarithmic axes.
    assert page.panels("y_factors")["Value over p", ""]["x"]["log"]

"""The page: all text is escaped, nothing is loaded from elsewhere, every identifier is unique."""

import dataclasses

import numpy as np
import pytest
from lxml import html
from msgspec.structs import replace

from chassis_fmu.evaluation.grading import Status
from chassis_fmu.evaluation.results_table import Numbers, Verdict
from chassis_fmu.files.plan import Plan, Point, Run, Solver
from chassis_fmu.files.results import Recording
from chassis_fmu.report import figures, page, page_data, plots

NO_FIGURES = '{"format":1,"figures":[]}'
CONTEXT = page.Context("fmpy <1>", "scripts/run scenarios/trial.toml --stop 3", "in & out.csv")


@pytest.fixture
def text(scenario: Plan) -> str:
    times = np.arange(4) * 0.1
    recordings = figures.Recordings(scenario)
    recordings.first = {
        ("passive", None): Recording(times, {"body.roll": times, "source.count": times}),
        ("active", None): Recording(times, {"body.roll": times * 0.5}),
    }
    values: dict[tuple[str, str, str | None, int | None], float] = {
        ("roll_rms", c.name, None, s): 2.0 + s for c in scenario.cases for s in (1, 2)
    }
    numbers = Numbers(scenario, values, verdicts=[Verdict(Status.PASSED, "4.00 °, required <1>")])
    wanted = [*scenario.figures, replace(scenario.figures[0], name="again")]
    found = [(f, panels) for f in wanted if (panels := figures.panels(scenario, f, recordings, numbers))]
    assert len(found) == 2
    drawings = [plots.draw(scenario.cases, figure, panels) for figure, panels in found]
    return page.render(
        numbers, drawings, page_data.of_plan(scenario, found), {"active#2": "component <plant>: fmi2DoStep"}, CONTEXT
    )


def test_everything_is_escaped(text: str) -> None:
    for raw in ("<trial>", "<i>with", "<fast>", "<RMS>", "<angle>", "<rolls>", "<roll>", "<plant>", "fmpy <1>"):
        assert raw not in text
    for shown in (
        "A &lt;trial&gt; &amp; its &#34;plan&#34;",
        "Active &lt;fast&gt;",
        "in &amp; out.csv",
        "By &amp; large.",
    ):
        assert shown in text
    assert 'aria-label="Roll &lt;angle&gt;"' in text


def test_a_shortened_run_says_so(scenario: Plan, text: str) -> None:
    assert "apply to the whole scenario" not in text
    short = dataclasses.replace(CONTEXT, shortened="--stop 3 --seeds 1")
    tree = html.document_fromstring(page.render(Numbers(scenario, {}), [], NO_FIGURES, {}, short))
    assert "--stop 3 --seeds 1" in tree.xpath("string(//header)")


def test_steps_and_solvers_are_shown(scenario: Plan) -> None:
    run = scenario.runs[0]
    solver = Solver("rosenbrock", 1e-7)
    component = replace(run.components[0], integration=solver)
    runs = (replace(run, components=(component, *run.components[1:])), *scenario.runs[1:])
    steps = page.Steps(accepted=1905, rejected=51, inaccurate=2, smallest=0.000471, largest=0.00432)
    plan = replace(scenario, runs=runs)
    context = page.Context("native", "chassis run trial.toml", steps={run.id: steps})
    text = page.render(Numbers(plan, {}), [], NO_FIGURES, {}, context)
    counts = "1905 accepted, 51 rejected; from 0.471 to 4.32 ms; 2 are the smallest, with an error above the tolerance"
    assert f"<dt>Steps</dt><dd>{counts}</dd>" in text
    assert f"<dt>Solver <small>{component.name}</small></dt><dd>Rosenbrock (RODAS), tolerance 1e-07</dd>" in text


def test_warnings_and_unread_outputs_are_shown(text: str) -> None:
    assert "`gain` of `source` has no effect &amp; &lt;so&gt; on" in text
    assert "<dt>source <small>passive</small></dt><dd>idle, spare</dd>" in text
    assert "<dt>source <small>active</small></dt><dd>idle</dd>" in text


def test_the_recorded_signals_are_linked(scenario: Plan) -> None:
    context = dataclasses.replace(CONTEXT, files=("runs/a b_1.csv", "runs/a b_1.parquet"))
    tree = html.document_fromstring(page.render(Numbers(scenario, {}), [], NO_FIGURES, {}, context))
    assert tree.xpath("//ul[@class='files']//a/@href") == ["runs/a%20b_1.csv", "runs/a%20b_1.parquet"]


def test_nothing_is_requested(text: str) -> None:
    tree = html.document_fromstring(text)
    # The scripts and their data are embedded in the page.
    assert {str(v) for v in tree.xpath("//script/@*")} == {"application/json", "page-data"}
    assert not tree.xpath("//script[@src] | //link | //img | //iframe | //object | //*[@src]")
    # Links lead to files beside the page, or to the index in the parent folder.
    links = {str(v) for v in tree.xpath("//@href | //@*[name() = 'xlink:href']") if not str(v).startswith("#")}
    assert links == {"table.csv", "table.md", "../index.html"}
    assert "@import" not in text
    assert all(part.startswith("#") for part in text.split("url(")[1:])


def test_identifiers_are_unique(text: str) -> None:
    identifiers = html.document_fromstring(text).xpath("//@id")
    assert len(identifiers) > 50
    assert len(identifiers) == len(set(identifiers))


def test_references_inside_the_figures_hold(text: str) -> None:
    tree = html.document_fromstring(text)
    identifiers = {str(i) for i in tree.xpath("//@id")}
    used = {part[1 : part.index(")")] for part in text.split("url(")[1:]}
    used |= {str(v)[1:] for v in tree.xpath("//@*[name() = 'xlink:href']")}
    assert used <= identifiers


def test_colors_follow_the_theme(text: str) -> None:
    svg = text[text.index("<svg") :]
    assert plots.INK not in svg
    assert "var(--ink)" in svg
    assert "var(--series-0)" in svg
    assert "<?xml" not in text
    assert "<metadata>" not in text


def test_the_parts_are_there(text: str) -> None:
    tree = html.document_fromstring(text)
    assert tree.xpath("string(//h1)") == 'A <trial> & its "plan"'
    assert [p.text for p in tree.xpath("//p[@class='lead']")] == [
        "First paragraph <i>with markup</i>.",
        "Second paragraph.",
    ]
    assert len(tree.xpath("//table[@class='headline seeds']/tbody")) == 2
    assert len(tree.xpath("//table[@class='headline seeds']/tbody/tr")) == 4
    # 3 compared with 3 is no change, but the paper reports a change.
    assert tree.xpath("string(//article[@class='not_reproduced']/span)") == "Not reproduced"
    assert tree.xpath("string(//article/p[@class='claim'])") == "Less <roll>, by 25.0 %"
    assert "0.0 %, paper −25.0 %" in tree.xpath("string(//ul[@class='checks'])")
    badges = tree.xpath("//table[@class='headline seeds']//span[@class='badge']/text()")
    assert badges == ["Not reproduced", "Not reproduced"]
    # The legend before the findings defines their badges.
    assert tree.xpath("//dl[@class='legend']/dt/span/text()") == ["Not reproduced"]
    assert "the opposite sign" in tree.xpath("string(//dl[@class='legend']/dd)")
    assert text.index('<dl class="legend">') < text.index("<table")
    assert "1 not reproduced" in " ".join(tree.xpath("string(//ul[@class='facts'])").split())
    assert len(tree.xpath("//figure//svg")) == 2
    # Labels replace the head of the table, which is hidden in a narrow window.
    assert {*tree.xpath("//table[@class='components']//td[contains(@class, 'number')]/@data-label")} == {
        "Default",
        "Here",
    }
    assert not tree.xpath("//table[@class='components']//td[contains(@class, 'number')][not(@data-label)]")
    assert tree.xpath("//table[@class='guids']//code/text()") == ["{22}", "{11}"]
    assert "1 of 4 runs failed" in text


def test_a_page_without_anything_optional(scenario: Plan) -> None:
    bare = replace(
        scenario,
        description="",
        reference="",
        metrics=(),
        figures=(),
        findings=(),
        seeds=(),
        runs=scenario.runs[:1],
        warnings=(),
        wiring=(),
    )
    bare = replace(bare, runs=(replace(bare.runs[0], seed=None),))
    tree = html.document_fromstring(
        page.render(Numbers(bare, {}), [], NO_FIGURES, {}, page.Context("native", "scripts/run"))
    )
    assert [h.text for h in tree.xpath("//h2")] == ["Components in execution order", "How it was run"]


def test_components_are_in_the_order_of_every_run(scenario: Plan) -> None:
    """The first case leaves out a component between the other two, and one before them."""
    run = scenario.runs[0]
    component = run.components[0]

    def of(names: str) -> Run:
        return replace(run, components=tuple(replace(component, name=name) for name in names))

    assert page.order_of([of("ac"), of("abc"), of("dac")]) == ["d", "a", "b", "c"]
    assert page.order_of([of("bc"), of("ab")]) == ["a", "b", "c"]
    assert page.order_of([of("abc")]) == ["a", "b", "c"]


def test_badges_of_requirements_are_explained(scenario: Plan) -> None:
    for verdict, expected in (
        (Status.FAILED, "Failed: the metric is outside the limits, or has no value, for some run and seed"),
        (Status.OPEN, "Not evaluated: a run failed"),
    ):
        ((status, meaning),) = page.verdict_meanings(Numbers(scenario, {}, verdicts=[Verdict(verdict, "")]))
        assert f"{status.title}: {meaning}".startswith(expected)


def test_parameters_are_said_once_or_by_case_or_by_point(scenario: Plan) -> None:
    first = scenario.runs[0]
    plant = first.components[1]
    gain = plant.parameters[0]
    points = (Point("slow", "Slow", 1.0, None), Point("fast", "Fast", 2.0, None))

    def swept(by_case: dict[str, float], by_point: dict[str, float]) -> tuple[tuple[str, str], ...]:
        runs = tuple(
            replace(
                first,
                id=f"{c.name}@{p.name}",
                case=c.name,
                point=p.name,
                components=(
                    replace(
                        plant,
                        parameters=(replace(gain, value=by_case[c.name] + by_point[p.name]),),
                    ),
                ),
            )
            for c in scenario.cases
            for p in points
        )
        sections = page.components(replace(scenario, runs=runs, points=points))
        shown: tuple[tuple[str, str], ...] = sections[0]["parameters"][0][3]
        return shown

    same = {"passive": 1.0, "active": 1.0}
    assert swept(same, {"slow": 0.0, "fast": 0.0}) == (("", "1"),)
    assert swept({"passive": 1.0, "active": 2.0}, {"slow": 0.0, "fast": 0.0}) == (
        ("Passive", "1"),
        ("Active <fast>", "2"),
    )
    assert swept(same, {"slow": 1.0, "fast": 2.0}) == (("Slow", "2"), ("Fast", "3"))
    assert len(swept({"passive": 1.0, "active": 2.0}, {"slow": 1.0, "fast": 2.0})) == 4


def test_requirements_definitions_and_hashes_are_on_the_page(text: str) -> None:
    tree = html.document_fromstring(text)
    (requirement,) = tree.xpath("//ul[contains(@class, 'verdicts')]/li")
    assert requirement.get("class") == "passed"
    assert "4.00 °, required <1>" in requirement.text_content()
    assert "Passed: the metric is within the limits for every run and seed.</p>" in text
    definition = tree.xpath("string(//details[@class='definition']/small)")
    # The window contains four rows from 0 to 0.3 s.
    expected = (
        "square root of the mean of the squares of x: body.roll, times 57.2958; rows from 0 s to 0.3 s (4 rows); in °"
    )
    assert definition == expected

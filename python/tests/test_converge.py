"""The section on the error of the communication step, from a file like those of `chassis run --converge`."""

from typing import Any

from lxml import html

from chassis_fmu.evaluation.results_table import Numbers
from chassis_fmu.files.plan import Plan
from chassis_fmu.report import page

ASSESSMENT = {"values": [2.0, 1.5, None], "class": "regular", "order": 1.5, "limit": 1.0, "error": 1.0, "relative": 0.5}
METRIC = {
    **ASSESSMENT,
    "metric": "roll_rms",
    "verdict": "roll_rms <changes> by 50 %",
    "above_limit": True,
    "recommended_step": 0.0005,
    "recording": None,
    "other_order": 2.1,
    "order_change": -0.05,
    "order_matters": False,
    "sample_times": None,
}
RUN = {
    "run": "active#1",
    "metrics": [METRIC],
    "signals": [["x", {"d12": 0.0, "d24": 0.25, "order": None, "error": 0.25, "relative": 0.125}]],
    "sample_times": {"plant": 0.001, "law": None},
    "notes": ["`law` updates once"],
}


def section(scenario: Plan, runs: list[dict[str, Any]]) -> Any:
    found = {
        "steps": [0.004, 0.002, 0.001],
        "order": "sequential",
        "other_order": "jacobi",
        "limit": 0.01,
        "runs": runs,
    }
    context = page.Context("native", "chassis run trial.toml --converge", converge=found)
    text = page.render(Numbers(scenario, {}), [], '{"format":1,"figures":[]}', {}, context)
    assert "<changes>" not in text
    return html.document_fromstring(text).xpath("//section[h2 = 'Coupling error']")[0]


def texts(row: Any) -> list[str]:
    return [" ".join(cell.text_content().split()) for cell in row.xpath("./th | ./td")]


def test_numbers_are_those_of_the_file(scenario: Plan) -> None:
    found = section(scenario, [RUN])
    assert "with the order jacobi; h is 4 ms" in found.text_content()
    metrics, signals = found.xpath(".//tbody")
    (row,) = metrics.xpath("./tr")
    assert texts(row)[0].endswith("roll_rms <changes> by 50 %; recommended step: 0.5 ms")
    assert texts(row)[1:] == ["2.000", "1.500", "–", "regular", "1.500", "50.0 %", "–", "−5.00 %"]
    assert len(row.xpath(".//span[@class = 'badge failed']")) == 1
    assert [texts(row) for row in signals.xpath("./tr")] == [["x", "0.000", "0.2500", "–", "0.2500", "12.5 %"]]
    assert found.xpath(".//p[@class = 'note']/text()") == ["law updates once", "Sample times: plant 1 ms, law –"]


def test_the_effect_of_sample_times_has_a_row(scenario: Plan) -> None:
    fine = {**METRIC, "above_limit": False, "order_matters": True, "recommended_step": None, "sample_times": ASSESSMENT}
    found = section(scenario, [{**RUN, "metrics": [fine], "notes": [], "sample_times": {}, "signals": []}, RUN])
    first, second = found.xpath("./details/div/table/tbody/tr[1]")[0], found.xpath(".//tbody[1]/tr[2]")[0]
    assert texts(first)[-1] == "−5.00 % matters"
    assert not first.xpath(".//span[contains(@class, 'badge')]")
    assert texts(second) == [
        "Effect of the controllers' sample times",
        "2.000",
        "1.500",
        "–",
        "regular",
        "1.500",
        "50.0 %",
        "",
        "",
    ]
    assert [summary.text for summary in found.xpath("./details/summary")] == ["active#1", "active#1"]

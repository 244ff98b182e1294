"""Numbers and tables as text."""

import csv
import dataclasses
import io
import re

import pytest
from msgspec.structs import replace

from chassis_fmu.evaluation.results_table import Numbers, Row, Statistic
from chassis_fmu.files.plan import Plan
from chassis_fmu.report import tables


@pytest.mark.parametrize(
    ("value", "digits", "text"),
    [
        (None, 2, "–"),
        (3.14159, 2, "3.14"),
        (-3.14159, None, "−3.142"),
        (22.4, None, "22.40"),
        (12345.6, None, "12346"),
        (0.0, None, "0.000"),
        (2.5e-6, None, "2.5×10⁻⁶"),
        (-0.0001, 2, "0.00"),
        (8.001e88, 3, "8.001×10⁸⁸"),
    ],
)
def test_numbers(value: float | None, digits: int | None, text: str) -> None:
    assert tables.number(value, digits) == text


@pytest.mark.parametrize(
    ("value", "text"), [(None, "–"), (-12.44, "−12.4 %"), (0.04, "0.0 %"), (5.0, "+5.0 %"), (699.7, "+700 %")]
)
def test_changes(value: float | None, text: str) -> None:
    assert tables.signed(value) == text


@pytest.mark.parametrize(
    ("value", "text"), [(0.5, "0.5"), (-250000.0, "−250000"), (1.0e6, "1×10⁶"), (-2.5e-9, "−2.5×10⁻⁹")]
)
def test_any_size(value: float, text: str) -> None:
    assert tables.scientific(value) == text


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (86.0, "86.0"),
        (86.34, "86.3"),
        (99.96, "100"),
        (-0.5, "−0.500"),
        (0.0, "0"),
        (12345.0, "12300"),
        (1e-5, "1×10⁻⁵"),
    ],
)
def test_digits_of_cells(value: float, text: str) -> None:
    assert tables.significant(value, 3) == text


@pytest.mark.parametrize(
    ("unit", "text"),
    [
        ("rad/s2", "rad/s²"),
        ("N.m", "N·m"),
        ("1", ""),
        ("deg", "°"),
        ("km/h", "km/h"),
        ("deg/s", "°/s"),
        ("degC", "degC"),
        ("m3", "m³"),
    ],
)
def test_units(unit: str, text: str) -> None:
    assert tables.pretty_unit(unit) == text


def test_spreads() -> None:
    assert tables.spread(Statistic(0.06194, 0.00161, 8), 4) == "0.0619 ± 0.0016"
    assert tables.spread(Statistic(0.06194, None, 1), 4) == "0.0619"
    assert tables.spread(Statistic(0.06194, 0.0, 8), 4) == "0.0619"
    assert tables.spread(Statistic(22.4, 0.512, 8), None) == "22.40 ± 0.51"
    assert tables.spread(Statistic(22.4, 0.512, 5), None, 8) == "22.40 ± 0.51 (5 of 8)"
    assert tables.spread(Statistic(22.4, 0.512, 8), None, 8) == "22.40 ± 0.51"
    assert tables.spread_percent(Statistic(-12.34, 0.12, 8)) == "−12.3 ± 0.1 %"
    assert tables.spread_percent(Statistic(-12.34, 0.0, 8)) == "−12.3 %"
    assert tables.spread_percent(Statistic(919.8, 183.8, 8)) == "+920 ± 184 %"
    # A baseline close to zero, such as a change from 0.011 to 0.137: exact digits would be meaningless.
    assert tables.spread_percent(Statistic(1143.0, 183.8, 8)) == "over +1000 %"
    assert tables.spread_percent(Statistic(3.2e9, 1.1e9, 8)) == "over +1000 %"
    assert tables.signed(-2e4) == "over −1000 %"


@pytest.mark.parametrize(
    ("ours", "paper", "words"),
    [
        (-12.4, -30.0, "same direction, smaller change"),
        (-28.0, -30.0, "same direction, similar change"),
        (-60.0, -30.0, "same direction, larger change"),
        (12.0, -30.0, "opposite direction"),
        (0.1, -23.0, "no change here"),
        (-5.0, 0.1, "no change in the paper"),
        (0.0, 0.0, "no change in both"),
    ],
)
def test_remarks(scenario: Plan, ours: float, paper: float, words: str) -> None:
    cell = Row(scenario.metrics[0], "active", None, Statistic(3.3, None, 1), Statistic(ours, None, 1), 3.0, paper)
    assert tables.remark(cell) == f"+10.0 % from the paper's value; {words}"


def test_a_change_within_the_spread_is_none(scenario: Plan) -> None:
    cell = Row(scenario.metrics[0], "active", None, Statistic(3.0, 0.1, 8), Statistic(-2.0, 2.5, 8), None, -30.0)
    assert tables.remark(cell) == "no change here"


def cells(scenario: Plan) -> list[Row]:
    values: dict[tuple[str, str, str | None, int | None], float] = {
        ("roll_rms", "passive", None, 1): 1 / 3,
        ("roll_rms", "active", None, 1): 0.25,
    }
    return Numbers(scenario, values).table()


def test_the_machine_table_keeps_all_digits(scenario: Plan) -> None:
    rows = list(csv.DictReader(io.StringIO(tables.machine(cells(scenario)))))
    assert float(rows[0]["ours"]) == 1 / 3
    assert rows[0]["change_percent"] == ""
    assert float(rows[1]["change_percent"]) == pytest.approx(-25.0)
    assert rows[1]["title"] == "Roll angle <RMS>"
    assert rows[3]["ours"] == ""


def test_tables_for_people(scenario: Plan) -> None:
    lines = tables.console(scenario, cells(scenario)).splitlines()
    assert lines[0].split() == ["Metric", "Case", "Paper", "Ours", "Change,", "paper", "Change,", "ours", "Badge"]
    assert "Active <fast>" in lines[3]
    assert lines[3].count("−25.0 %") == 2
    markdown = re.sub(" +", " ", tables.markdown(scenario, cells(scenario)))
    assert "| Roll angle <RMS> (°) | Passive | 4.00 | 0.33 (1 of 2) | – | – | Not reproduced |" in markdown
    assert (
        "| Roll angle <RMS> (°) | Active <fast> | 3.00 | 0.25 (1 of 2) | −25.0 % | −25.0 % | Reproduced |" in markdown
    )


def test_columns_that_would_be_empty_are_left_out(scenario: Plan) -> None:
    own = replace(scenario, metrics=tuple(replace(m, paper=None) for m in scenario.metrics))
    lines = tables.console(own, cells(own)).splitlines()
    assert lines[0].split() == ["Metric", "Case", "Ours", "Change,", "ours"]
    alone = [r for r in cells(own) if r.case == "passive"]
    assert tables.markdown(own, alone).splitlines()[2].split() == ["|", "Metric", "|", "Case", "|", "Ours", "|"]


def test_a_baseline_next_to_nothing_is_explained(scenario: Plan) -> None:
    assert tables.NEGLIGIBLE not in tables.console(scenario, cells(scenario))
    said = [dataclasses.replace(c, negligible=True, change=None) for c in cells(scenario)]
    assert tables.console(scenario, said).rstrip().endswith(tables.NEGLIGIBLE)
    assert tables.NEGLIGIBLE in tables.markdown(scenario, said)


def test_origins_are_in_the_machine_table(scenario: Plan) -> None:
    said = [dataclasses.replace(c, origin="predicted") for c in cells(scenario)[:1]]
    row = next(csv.DictReader(io.StringIO(tables.machine(said))))
    assert (row["origin"], row["badge"]) == ("predicted", "not_reproduced")

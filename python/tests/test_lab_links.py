"""Links from pages to the lab. Reference: the format in docs/guide/src/lab.md."""

from __future__ import annotations

import base64
import json
import re
from pathlib import Path
from urllib.parse import parse_qs, urlsplit

import pytest
from lxml import html
from msgspec.structs import replace

from chassis_fmu.evaluation.results_table import Numbers
from chassis_fmu.files.plan import Case, Plan
from chassis_fmu.program import ROOT
from chassis_fmu.report import lab, page

HOSTED = "https://example.org/lab/index.html"


@pytest.fixture
def hosted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(lab.VARIABLE, HOSTED)


def test_a_lab_that_is_not_built_has_no_links(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.delenv(lab.VARIABLE, raising=False)
    monkeypatch.setattr(lab, "SITE", tmp_path / "lab" / "index.html")
    assert lab.address(tmp_path) is None
    assert lab.of_system("EspCar", [], "braking", {}, tmp_path) is None


def test_a_lab_that_is_built_is_seen_from_the_page(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.delenv(lab.VARIABLE, raising=False)
    site = tmp_path / "target" / "lab" / "index.html"
    site.parent.mkdir(parents=True)
    site.write_text("", encoding="utf-8")
    monkeypatch.setattr(lab, "SITE", site)
    page = tmp_path / "results" / "step_steer"
    page.mkdir(parents=True)
    assert lab.address(page) == "../../target/lab/index.html"


@pytest.mark.usefixtures("hosted")
def test_a_setup_is_readable(tmp_path: Path) -> None:
    link = lab.of_system("EspCar", ["DirectYawControl"], "iso3888_2", {"speed": 14.2}, tmp_path)
    assert link is not None
    site, _, setup = link.partition("#setup=")
    assert site == HOSTED
    assert "=" not in setup
    decoded = json.loads(base64.urlsafe_b64decode(setup + "=" * (-len(setup) % 4)))
    assert decoded == {
        "system": {
            "kind": "free",
            "vehicle": "EspCar",
            "controllers": ["DirectYawControl"],
            "maneuver": "iso3888_2",
            "maneuverValues": {"speed": 14.2},
            "road": "flat",
            "seed": 1,
        },
        "values": {},
    }


@pytest.mark.usefixtures("hosted")
def test_only_maneuvers_of_the_lab_have_links(tmp_path: Path) -> None:
    """Reference: the maneuvers in the lab's source, and the maneuvers of the test bench."""
    source = (ROOT / "crates" / "fmu-assess" / "src" / "single.rs").read_text(encoding="utf-8")
    of_lab = set(re.findall(r'Maneuver \{\s+id: "(\w+)"', source))
    bench = (ROOT / "crates" / "fmu-assess" / "src" / "maneuvers.rs").read_text(encoding="utf-8")
    of_bench = set(re.findall(r'Maneuver::new\(\s*"(\w+)"', bench))
    assert of_lab == of_bench | {"free"}
    for name in (*of_bench, *lab.NOT_REPLAYED):
        link = lab.of_system("EspCar", [], name, {}, tmp_path)
        assert (link is not None) == (name in of_lab), name


@pytest.mark.usefixtures("hosted")
def test_cases_are_replayed_beside_their_baseline(scenario: Plan, tmp_path: Path) -> None:
    cases = (Case("a", "A & B", None), Case("b", "B", "a"))
    plan = replace(scenario, file=str(ROOT / "scenarios" / "x.toml"), cases=cases, seeds=(3, 4))
    found = lab.of_scenario(plan, tmp_path)
    assert [title for title, _ in found] == ["A & B", "B"]
    fragments = [parse_qs(urlsplit(link).fragment) for _, link in found]
    assert fragments[0] == {"scenario": [plan.name], "case": ["a"], "seed": ["3"]}
    assert fragments[1] == {"scenario": [plan.name], "case": ["b"], "seed": ["3"], "twin": ["a"]}
    # The lab contains only the scenarios of the library.
    assert lab.of_scenario(replace(plan, file=str(tmp_path / "x.toml")), tmp_path) == []


@pytest.mark.usefixtures("hosted")
def test_the_page_of_a_scenario_links_to_its_cases(scenario: Plan, tmp_path: Path) -> None:
    plan = replace(scenario, file=str(ROOT / "scenarios" / "x.toml"))
    context = page.Context("fmpy", "scripts/run", replays=tuple(lab.of_scenario(plan, tmp_path)))
    tree = html.document_fromstring(page.render(Numbers(plan, {}), [], '{"format":1,"figures":[]}', {}, context))
    links = tree.xpath("//p[@class='replays']/a/@href")
    assert len(links) == len(plan.cases)
    assert all(link.startswith(HOSTED + "#scenario=") for link in links)

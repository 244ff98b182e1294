"""Pages of studies: their data follow the schema, and their metrics have definitions."""

from pathlib import Path

from lxml import html

from tests import study_system
from tests.page_schema import data_of
from tests.study_system import build, vary, write

UNIFORM = 'distribution = "uniform"\nmin = 0.0\nmax = 1.0'


def test_the_page_of_a_study_has_data_by_the_schema_and_definitions(tmp_path: Path) -> None:
    build(tmp_path)
    study = write(tmp_path, 'method = "sample"\nruns = 20\n' + vary("p", "f:a", UNIFORM) + vary("q", "f:c", UNIFORM))
    assert study_system.carry_out([str(study), "--fmus", str(tmp_path / "fmus"), "--out", str(tmp_path / "out")]) == 0
    page = tmp_path / "out" / "study" / "index.html"
    data = data_of(page)
    assert {figure["name"] for figure in data["figures"]} >= {"y_distribution", "y_factors"}
    tree = html.document_fromstring(page.read_text(encoding="utf-8"))
    definitions = [
        " ".join(small.text_content().split()) for small in tree.xpath("//details[@class='definition']/small")
    ]
    # One definition for each metric: one is computed from a signal, one from the other metric.
    assert len(definitions) == 2
    assert "x: y; rows from 0 s to 0.2 s (3 rows)" in definitions[0]
    assert definitions[1] == "2 * y, computed from the metrics of the same run"
    assert tree.xpath("//table[contains(@class, 'results')]")

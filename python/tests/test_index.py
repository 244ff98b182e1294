"""The page that links all result pages in a folder."""

from pathlib import Path

from lxml import html

from chassis_fmu.report import index


def test_all_pages_are_linked_by_name_with_their_badges(tmp_path: Path) -> None:
    for name in ("b study", "a", "c", "without a page"):
        (tmp_path / name).mkdir()
    # A page from another version or another program.
    (tmp_path / "c" / "index.html").write_text("<p>page</p>")
    (tmp_path / "c" / "page.json").write_text('{"title": "C", "badges": 7}')
    entry = index.Entry("A <b>", "Table 1", {"reproduced": 3, "refuted": 1})
    assert index.write(tmp_path / "a", "<p>page</p>", entry).read_text(encoding="utf-8") == "<p>page</p>"
    index.write(tmp_path / "b study", "<p>page</p>", index.Entry("Study"))
    text = (tmp_path / "index.html").read_text(encoding="utf-8")
    assert "<b>Table" not in text
    tree = html.document_fromstring(text)
    links = tree.xpath("//ul[@class='pages']//a")
    assert [(a.get("href"), a.text) for a in links] == [
        ("a/index.html", "A <b>"),
        ("b%20study/index.html", "Study"),
        ("c/index.html", "c"),
    ]
    badges = [" ".join(li.xpath("string()").split()) for li in tree.xpath("//ul[@class='facts']/li")]
    assert badges == ["3 reproduced", "1 own result, does not hold"]
    index.write(tmp_path / "a", "<p>page</p>", entry)
    assert (tmp_path / "index.html").read_text(encoding="utf-8") == text

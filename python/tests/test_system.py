"""The picture of a system: boxes in order of execution, numbers of connections, their times and loops."""

from pathlib import Path

from lxml import html
from msgspec.structs import replace

from chassis_fmu.evaluation.results_table import Numbers
from chassis_fmu.files.plan import (
    Component,
    Connected,
    Linear,
    Loop,
    Origin,
    Plan,
    Signal,
    Simulation,
    Timing,
    TypeChange,
    Wiring,
)
from chassis_fmu.report import page, system

TIMES = Simulation(0.0, 1.0, 0.1, 10, "sequential", 1)
CONTEXT = page.Context("native", "chassis run trial.toml")


def connected(
    source: str,
    reader: str,
    timing: Timing | None,
    conversion: Linear | None = None,
    type_change: TypeChange | None = None,
) -> Connected:
    output, signal = (Signal(*name.split(":")) for name in (source, reader))
    origin = Origin(output=output) if timing else Origin(file=output.variable)
    return Connected(signal, origin, type_change, conversion, timing)


def components(*names: str) -> list[Component]:
    return [Component(name, Path(), "2.0", "", "", (), (), (), ()) for name in names]


def wiring(case: str = "active") -> Wiring:
    inputs = (
        connected("source:x", "plant:x", "on_time"),
        connected("source:v", "plant:v", "on_time"),
        connected("source:<on>", "plant:level", "early", None, "boolean_to_real"),
        connected("plant:force", "source:force", "held", Linear(0.001, -5.0)),
        connected(":road", "plant:road", None),
        Connected(Signal("plant", "fixed"), Origin(), None, None, None),
    )
    loop = Loop(False, "source:x -> plant:x -> plant:force -> source:force", ("plant:force -> source:force",))
    return Wiring(case, inputs, (), (loop,))


def test_connections_are_bundled_by_pair_and_time() -> None:
    found = system._system(components("source", "plant"), wiring(), TIMES)
    assert found.boxes == ("input file", "source", "plant")
    assert [(b.source, b.reader, b.timing, b.signals, b.in_loop) for b in found.bundles] == [
        ("input file", "plant", "file", (("road", ""),), False),
        ("source", "plant", "on_time", (("x", ""), ("v", "")), True),
        ("source", "plant", "early", (("<on> → level", "Boolean to Real: 0 or 1"),), False),
        ("plant", "source", "held", (("force", "× 0.001 − 5"),), True),
    ]


def test_numbers_are_in_the_row_of_the_source_and_the_column_of_the_reader() -> None:
    links = (connected("c1:y", "c7:u", "on_time"), connected("c9:y", "c7:v", "held"), connected("c9:y", "c3:u", "late"))
    found = system._system(components(*(f"c{i}" for i in range(12))), Wiring("", links, (), ()), TIMES)
    centers = {box: found.place(box) for box in found.boxes}
    for bundle, x, y, side in found.numbers():
        assert abs(x - centers[bundle.reader][0]) <= 10.0
        assert abs(y - centers[bundle.source][1]) <= 10.0
        assert side == (1 if bundle.timing == "on_time" else -1)
        # Neither the number nor the line in its column is on another box.
        assert all(abs(x - across) > found.half for box, (across, _) in centers.items() if box != bundle.reader)


def test_rates_are_listed() -> None:
    own = components("source", "plant", "sensor")
    rates = (replace(own[0], every=10), replace(own[1], substeps=4), own[2])
    assert system._system(rates, wiring(), TIMES).rates == (("source", "1 per 10"), ("plant", "4 per 1"))


def test_the_meaning_of_held_values_depends_on_the_coupling() -> None:
    lines = system._system(components("source", "plant"), wiring(), replace(TIMES, extrapolation="linear"))
    assert lines.times["held"][1] == "the value from the start of a step is extrapolated over the step"


def test_the_picture_is_on_the_page(scenario: Plan) -> None:
    runs = tuple(replace(run, components=scenario.runs[0].components) for run in scenario.runs)
    both = (replace(wiring("passive"), loops=()), wiring())
    text = page.render(
        Numbers(replace(scenario, runs=runs, wiring=both), {}), [], '{"format":1,"figures":[]}', {}, CONTEXT
    )
    assert "<on>" not in text
    section = html.document_fromstring(text).xpath("//section[h2 = 'System']")[0]
    first, second = section.xpath(".//svg[@role = 'img']")
    assert first.get("aria-label") == "3 components and their connections, Passive"
    assert [t.strip() for t in first.xpath("./text/text()")] == ["input file", "source", "plant"]
    assert [t.strip() for t in second.xpath("./g/text/text()")] == ["1", "2 ↻", "1", "1 ↻"]
    assert "force -> source:force; broken by values from the start of the step: plant:force" in section.text_content()
    assert [b.text for b in section.xpath(".//ul[@class = 'times'][1]//b")][:2] == ["2 on time", "1 held"]
    # The same as tables, for those who do not see the picture: the converted connections, and all.
    rows = [len(body.xpath("./tr")) for body in section.xpath(".//tbody")]
    assert rows == [2, 4, 2, 4]


def test_inputs_without_connections_have_no_picture(scenario: Plan) -> None:
    assert not system.systems(scenario)

"""Pictures of models: grouped ports, line breaks, reproducible files."""

import dataclasses
import zipfile
from pathlib import Path

import numpy as np
import pytest

from model_pictures import demos, pictures
from model_pictures.pictures import Block, Port, Result

WHEELS = ("fl", "fr", "ml", "mr", "rl", "rr")


def block() -> Block:
    times = np.arange(1001) * 0.001
    lines = {"body.roll": np.sin(7.0 * times), "body.pitch": np.cos(7.0 * times)}
    return Block(
        name="TestVehicle",
        description="A block with one port, one family and a result of two lines, for the test of the drawing",
        folder="fmu-plant",
        inputs=(Port("driver.speed"), Port("road_height.*", 6)),
        outputs=(Port("body.roll"), Port("body.pitch")),
        result=Result("A sine", "deg", times, lines),
    )


def test_drawing_twice_gives_equal_bytes() -> None:
    first = pictures.draw(block())
    assert first == pictures.draw(block())
    assert first.startswith(b"\x89PNG")
    # Text chunks could contain program names or dates.
    assert not any(chunk in first for chunk in (b"tEXt", b"iTXt", b"zTXt", b"tIME"))


@pytest.mark.parametrize("change", [{"result": None}, {"inputs": ()}, {"outputs": ()}, {"description": ""}])
def test_a_block_may_lack_a_part(change: dict[str, object]) -> None:
    assert pictures.draw(dataclasses.replace(block(), **change)) != pictures.draw(block())  # type: ignore[arg-type]


def test_families_are_one_line() -> None:
    names = ["driver.speed", *(f"steer.{a}" for a in ("front", "rear")), *(f"road_height.{w}" for w in WHEELS)]
    expected = (Port("driver.speed"), Port("steer.front"), Port("steer.rear"), Port("road_height.*", 6))
    assert pictures.ports(names) == expected


def test_many_ports_are_grouped_by_their_beginning() -> None:
    names = [f"body.quantity_{i}" for i in range(9)] + [f"tire.quantity_{i}" for i in range(5)] + ["switch.mode"]
    found = pictures.ports(names)
    assert found == (Port("body.*", 9), *(Port(f"tire.quantity_{i}") for i in range(5)), Port("switch.mode"))


def test_ports_that_do_not_fit_are_counted() -> None:
    found = pictures.ports([f"group_{i}.value" for i in range(20)])
    assert len(found) == pictures.MOST_LINES
    assert found[-1] == Port("+ 9 more")


def test_lines_are_as_few_as_fit_and_about_equal() -> None:
    text = "one two three four five six seven"
    narrow = pictures.wrap(text, 11.0, 120.0)
    lines = pictures.balanced(text, 11.0, 120.0)
    assert " ".join(lines) == text
    assert len(lines) == len(narrow)
    assert max(map(len, lines)) <= max(map(len, narrow))


def test_large_and_small_values_get_a_power_of_ten() -> None:
    result = Result("Pulses", "N", np.arange(2.0), {"a": np.array([0.0, 2.5e7]), "b": np.array([-1e6, 0.0])})
    scaled = pictures.scaled(result)
    assert scaled.unit == "10⁶ N"
    assert scaled.lines["a"].tolist() == [0.0, 25.0]
    assert scaled.lines["b"].tolist() == [-1.0, 0.0]
    small = Result("Small", "", np.arange(2.0), {"a": np.array([0.0, 2.5e-4])})
    assert pictures.scaled(small).unit == "10⁻⁶"
    for kept in (0.0, 0.05, 9999.0):
        same = Result("Same", "m", np.arange(2.0), {"a": np.array([0.0, kept])})
        assert pictures.scaled(same) is same


def test_empty_cells_of_a_reference_run_are_left_out(tmp_path: Path) -> None:
    fmu = tmp_path / "a.fmu"
    with zipfile.ZipFile(fmu, "w") as archive:
        rows = "time,level,rate\n0,1,0\n0.1,1,\n0.2,1,3\n"
        archive.writestr("extra/io.github.chassis-fmu/reference.csv", rows)
    found = pictures._reference(fmu, ["level", "rate"])
    assert found is not None
    times, lines = found
    assert list(times) == [0.0, 0.2]
    assert {name: list(values) for name, values in lines.items()} == {"rate": [0.0, 3.0]}


def test_inputs_of_demos() -> None:
    times = np.array([0.0, 1.5, 3.0])
    assert demos.through((1.0, 0.0), (2.0, 4.0))(times).tolist() == [0.0, 2.0, 4.0]
    step = 1e-6
    slope = (demos.wave(2.0, 0.5)(times + step) - demos.wave(2.0, 0.5)(times - step)) / (2.0 * step)
    # The error of the central difference is mostly rounding, 1e-16 / 1e-6.
    np.testing.assert_allclose(slope, demos.wave_rate(2.0, 0.5)(times), atol=1e-8)

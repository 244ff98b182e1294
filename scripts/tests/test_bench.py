"""What `scripts/bench masters` runs and prints; nothing is timed here."""

from __future__ import annotations

from pathlib import Path

import bench_masters


def test_commands_differ_in_the_master_only() -> None:
    timed = bench_masters.commands(Path("a.toml"), Path("out"), ["--stop", "8"])
    native, page, fmpy = timed.values()
    assert native == ["cargo", "fmu", "run", "a.toml", "--stop", "8", "--out", "out/native"]
    assert [word for word in page if word != "--native"][:-1] == fmpy[:-1]
    assert "--native" in page


def test_table_has_the_ratio_of_medians() -> None:
    lines = bench_masters.table({"native": [2.0, 9.0, 1.0], "fmpy": [20.0, 19.0, 30.0]}).splitlines()
    assert lines[0].split() == ["median", "fastest", "slowest", "ratio"]
    assert lines[1].split() == ["native", "2.0", "s", "1.0", "s", "9.0", "s", "1.0"]
    assert lines[2].split() == ["fmpy", "20.0", "s", "19.0", "s", "30.0", "s", "10.0"]

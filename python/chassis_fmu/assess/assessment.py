"""Reads the assessment that `chassis bench run` writes: `assessment.json`, and the signals of its runs as CSV."""

from __future__ import annotations

from functools import cached_property
from pathlib import Path
from typing import Any, Literal, TypeAlias

import msgspec

from ..files.results import Recording, ResultsError, read_csv

SCHEMA = "chassis-fmu-assessment/1"

Name: TypeAlias = Literal["without", "with"]
Suite: TypeAlias = Literal["handling", "stability", "rollover", "braking", "ride"]
Number: TypeAlias = float | bool | None


class AssessmentError(Exception):
    """The folder contains no assessment that this version can read."""


Table: TypeAlias = dict[str, Any]
"""Parts of the file that the page shows unchanged."""


class _OfManeuver(msgspec.Struct, frozen=True, rename={"name": "id"}):
    """An item that belongs to a maneuver; its name begins with the maneuver's name."""

    name: str

    @property
    def maneuver(self) -> str:
        """The maneuver's name, the first part of the item's name."""
        return self.name.partition(".")[0]


class Run(_OfManeuver, frozen=True):
    """A run, and the metrics of its evaluator."""

    suite: Suite
    system: Name
    parameters: dict[str, float]
    flags: tuple[str, ...]
    error: str | None
    metrics: dict[str, Any]


class Row(_OfManeuver, frozen=True, rename={"with_": "with"}):
    """A metric, with its values for both systems."""

    title: str
    definition: str
    unit: str
    suite: Suite
    without: Number
    with_: Number
    change: float | None
    judgment: Literal["better", "same", "worse", "not_comparable"] | None
    verdict: Literal["pass", "fail", "info", "comparison", "dropped", "error"]
    verdict_without: str
    limit: Table | None
    """Minimum `min`, maximum `max`, or `is` for a Boolean that must be true; its `source`."""
    reason: str | None
    reason_without: str | None = None
    words: dict[Name, str] = {}
    bounds: dict[Name, str] = {}
    """Bound for a missing number, such as `< 30`."""
    compared: Table | None = None
    """Numbers of both systems at the highest speed or largest amplitude that both can drive."""
    incomparable: str | None = None


class Assessment(msgspec.Struct, frozen=True, rename={"with_": "with"}, dict=True):
    """The content of `assessment.json`."""

    schema: str
    plant: Table
    base: tuple[Table, ...]
    with_: tuple[Table, ...]
    set: tuple[Table, ...]
    vehicle: Table
    driver: dict[str, float | None]
    systems: tuple[Name, ...]
    unwritten: dict[str, dict[str, str]]
    idle: tuple[str, ...]
    assumed: dict[str, str]
    runs: tuple[Run, ...]
    metrics: tuple[Row, ...]
    dropped: tuple[Table, ...]
    tracks: dict[str, tuple[tuple[float, float, float, float], ...]]
    weighting: tuple[tuple[float, ...], tuple[float, ...]] | None

    @cached_property
    def by_name(self) -> dict[str, Row]:
        """The metrics by their names."""
        return {row.name: row for row in self.metrics}

    @property
    def data(self) -> list[tuple[str, Table]]:
        """The known vehicle data, with sources."""
        return [(name, value) for name, value in self.vehicle.items() if isinstance(value, dict)]

    def datum(self, name: str) -> float | None:
        """Return the value of one of the vehicle data."""
        return next((datum["value"] for known, datum in self.data if known == name), None)

    def runs_of(self, maneuver: str, system: str) -> list[Run]:
        """Return the runs of a maneuver, in their order."""
        return [run for run in self.runs if run.maneuver == maneuver and run.system == system]


class Folder:
    """The folder of an assessment."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._recordings: dict[tuple[str, str], Recording | None] = {}

    def read(self) -> Assessment:
        """Read the assessment.

        Raises AssessmentError if there is none that this version can read.
        """
        path = self.path / "assessment.json"
        try:
            found = msgspec.json.decode(path.read_bytes(), type=Assessment)
        except (OSError, msgspec.MsgspecError) as error:
            raise AssessmentError(f"{path}: {error}; `chassis bench run` writes it") from error
        if found.schema != SCHEMA:
            raise AssessmentError(f"{path}: its schema is {found.schema}, expected {SCHEMA}")
        return found

    def recording(self, system: str, run: str) -> Recording | None:
        """Return the signals of a run; None if they were not recorded.

        Raises AssessmentError for a file that cannot be read.
        """
        key = (system, run)
        if key not in self._recordings:
            path = self.path / "runs" / system / f"{run}.csv"
            try:
                self._recordings[key] = read_csv(path) if path.is_file() else None
            except ResultsError as error:
                raise AssessmentError(str(error)) from error
        return self._recordings[key]

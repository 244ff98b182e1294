"""Figures of studies and assessments, which no scenario declares. Their files are in a folder beside the page."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import markupsafe

from ..files.plan import Case
from . import page_data, plots, rendering
from .panels import Panel


@dataclass(frozen=True)
class Chart:
    """A figure with its caption and data."""

    figure: plots.Picture
    caption: str
    panels: list[Panel]
    cases: Sequence[Case] | None = None
    """Cases of this figure, which then has separate case switches; None for the cases of the page."""


class Drawings:
    """The figures of a page: pictures in a folder, and the data that makes them interactive."""

    def __init__(self, cases: Sequence[Case], folder: Path) -> None:
        self._cases = cases
        self._folder = folder
        self._drawn: list[Chart] = []

    def draw(self, chart: Chart) -> tuple[Chart, markupsafe.Markup]:
        """Draw a figure and write its files; returns the figure and its picture for the page."""
        made = plots.draw(chart.cases or self._cases, chart.figure, chart.panels)
        made.write(self._folder)
        self._drawn.append(chart)
        return chart, rendering.inline_svg(made)

    @property
    def interactive(self) -> page_data.Interactive:
        """The interactive parts of all figures drawn so far."""
        figures = [(chart.figure.name, chart.panels) for chart in self._drawn]
        own = {chart.figure.name: chart.cases for chart in self._drawn if chart.cases}
        return page_data.Interactive.of(page_data.render(self._cases, [], figures, own=own))

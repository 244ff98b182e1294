"""Renders the templates of the pages.

Jinja escapes all text from scenarios and FMUs; only the SVG pictures of this package are inserted unescaped.
"""

from __future__ import annotations

import importlib.metadata
import platform
import re
import zlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import jinja2
import markupsafe

from ..files.plan import Case
from . import page_data, plots
from .panels import Chart

# The style sheet is in the parent folder, because `cargo fmu linearize` uses it, too.
HERE = Path(__file__).parent


def render(template: str, **values: Any) -> str:
    """Return the page of a template. The values also contain the versions of the programs that make the page."""
    python = f"{platform.python_version()} on {platform.system()} {platform.machine()}"
    versions = (("Chassis FMU", importlib.metadata.version("chassis-fmu")), ("Python", python))
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader([HERE / "templates", HERE.parent]),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
    )
    return environment.get_template(template).render(values, versions=versions)


class Drawings:
    """The figures of a page that no scenario declares: pictures in a folder, and the data of interactive plots."""

    def __init__(self, cases: Sequence[Case], folder: Path) -> None:
        self._cases = cases
        self._folder = folder
        self._drawn: list[Chart] = []

    def draw(self, chart: Chart) -> tuple[Chart, markupsafe.Markup]:
        """Draw a figure and write its files; returns the figure and its picture for the page."""
        made = plots.draw(chart.cases or self._cases, chart, chart.panels)
        made.write(self._folder)
        self._drawn.append(chart)
        return chart, inline_svg(made)

    @property
    def interactive(self) -> page_data.Interactive:
        """The interactive parts of all figures drawn so far."""
        figures = [(chart.name, chart.panels) for chart in self._drawn]
        own = {chart.name: chart.cases for chart in self._drawn if chart.cases}
        return page_data.Interactive.of(page_data.render(self._cases, [], figures, own=own))


def paragraphs(text: str) -> list[str]:
    """Split a description at its empty lines."""
    return [" ".join(p.split()) for p in re.split(r"\n\s*\n", text) if p.strip()]


def inline_svg(drawing: plots.Drawing) -> markupsafe.Markup:
    """Prepare the picture of a figure for the page, with identifiers that are unique in it."""
    name = f"f{zlib.crc32(drawing.figure.name.encode()):x}"
    used = set(re.findall(r'(?:href="|url\()#([^")]+)', drawing.svg))
    svg = re.sub(r' id="([^"]+)"', lambda m: f' id="{name}-{m[1]}"' if m[1] in used else "", drawing.svg)
    svg = re.sub(r'href="#([^"]+)"', rf'href="#{name}-\1"', svg)
    svg = re.sub(r"url\(#([^)]+)\)", rf"url(#{name}-\1)", svg)
    svg = re.sub(r"\d+\.\d{3,}", shortened, re.sub(r">\s+<", "><", svg))
    return themed_svg(svg, drawing.figure.title)


def shortened(number: re.Match[str]) -> str:
    """Round a coordinate to what can be seen; small factors keep four digits."""
    value = float(number[0])
    return f"{value:.4g}" if value < 1 else f"{value:.2f}".rstrip("0").rstrip(".")


def themed_svg(svg: str, label: str) -> markupsafe.Markup:
    """Prepare an SVG for the page: with the colors of the theme, scaled to the width of the page."""
    svg = re.sub(r"<metadata>.*?</metadata>|<!--.*?-->|\s+", " ", svg[svg.index("<svg") :], flags=re.DOTALL)
    themed = {plots.INK: "ink", plots.MUTED: "muted", plots.GRID: "grid", plots.PAPER: "card"}
    themed |= {color: f"series-{i}" for i, color in enumerate(plots.PALETTE)}
    svg = re.sub("|".join(themed), lambda m: f"var(--{themed[m[0]]})", svg)
    svg = re.sub(r"<svg[^>]*>", lambda m: re.sub(r'\s(width|height)="[^"]*"', "", m[0]), svg, count=1)
    return markupsafe.Markup(svg.replace("<svg", f'<svg role="img" aria-label="{markupsafe.escape(label)}"', 1))

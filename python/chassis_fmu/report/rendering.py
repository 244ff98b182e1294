"""Renders the templates of the pages.

Jinja escapes all text from scenarios and FMUs; only the SVG pictures of this package are inserted unescaped.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import jinja2
import markupsafe

from . import plots

# The style sheet is in the parent folder, because `cargo fmu linearize` uses it, too.
HERE = Path(__file__).parent


def render(template: str, **values: Any) -> str:
    """Return the page of a template."""
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader([HERE / "templates", HERE.parent]),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
    )
    return environment.get_template(template).render(values)


def paragraphs(text: str) -> list[str]:
    """Split a description at its empty lines."""
    return [" ".join(p.split()) for p in re.split(r"\n\s*\n", text) if p.strip()]


def inline_svg(drawing: plots.Drawing) -> markupsafe.Markup:
    """Prepare the picture of a figure for the page, with identifiers that are unique in it."""
    name = re.sub(r"[^A-Za-z0-9_-]", "-", drawing.figure.name)
    svg = re.sub(r'\bid="([^"]+)"', rf'id="{name}-\1"', drawing.svg)
    svg = re.sub(r'href="#([^"]+)"', rf'href="#{name}-\1"', svg)
    return themed_svg(re.sub(r"url\(#([^)]+)\)", rf"url(#{name}-\1)", svg), drawing.figure.title)


def themed_svg(svg: str, label: str) -> markupsafe.Markup:
    """Prepare an SVG for the page: with the colors of the theme, scaled to the width of the page."""
    svg = re.sub(r"<metadata>.*?</metadata>|<!--.*?-->|\n *", " ", svg[svg.index("<svg") :], flags=re.DOTALL)
    themed = {plots.INK: "ink", plots.MUTED: "muted", plots.GRID: "grid", plots.PAPER: "card"}
    themed |= {color: f"series-{i}" for i, color in enumerate(plots.PALETTE)}
    svg = re.sub("|".join(themed), lambda m: f"var(--{themed[m[0]]})", svg)
    svg = re.sub(r"<svg[^>]*>", lambda m: re.sub(r'\s(width|height)="[^"]*"', "", m[0]), svg, count=1)
    return markupsafe.Markup(svg.replace("<svg", f'<svg role="img" aria-label="{markupsafe.escape(label)}"', 1))

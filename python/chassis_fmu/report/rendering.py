"""Renders the templates of the pages.

Jinja escapes all text from scenarios and FMUs; only the SVG pictures of this package are inserted unescaped.
"""

from __future__ import annotations

import re
import zlib
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

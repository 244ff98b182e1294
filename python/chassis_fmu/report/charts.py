"""Figures that no scenario declares: of studies and assessments."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ..files.plan import Case, Figure
from .figures import Panel


@dataclass(frozen=True)
class Chart:
    """A figure with what one sees."""

    figure: Figure
    caption: str
    panels: list[Panel]


def figure(name: str, title: str, kind: str, cases: Sequence[Case]) -> Figure:
    """Return the plan's notion of a figure, for those who draw it."""
    return Figure(
        name=name,
        title=title,
        kind=kind,  # type: ignore[arg-type]
        cases=tuple(c.name for c in cases),
        separate=False,
        columns=(),
        against=None,
        right=None,
        over=None,
        metrics=(),
        same_scale=False,
        equal_axes=False,
        band=None,
        window=None,
        levels=(),
        unit=None,
        factor=1.0,
        offset=0.0,
        caption=None,
    )

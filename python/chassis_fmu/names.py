"""Names that are unknown: what there is instead, and which is the closest."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


def suggestion(name: str, known: Iterable[str]) -> str:
    """Return a question for the closest of the known names, to be appended to a message; empty if none is close."""
    close = difflib.get_close_matches(name.lower(), found := {k.lower(): k for k in known}, 1)
    return f"; did you mean `{found[close[0]]}`?" if close else ""


def any_of(known: Iterable[str]) -> str:
    """List the known names."""
    names = [f"`{name}`" for name in known]
    return f"one of {', '.join(names)}" if names else "none"


def unknown(kind: str, name: str, known: Iterable[str]) -> str:
    """Return the message for an unknown name."""
    names = list(known)
    return f"unknown {kind} `{name}`, expected {any_of(names)}{suggestion(name, names)}"

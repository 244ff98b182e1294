"""Escapes text from FMUs, so it cannot control the terminal. The rules are those of `fmu_import::terminal`."""

from __future__ import annotations

import re

# C0 except tab and line feed, DEL and C1; bidirectional formatting characters; line and paragraph separators.
_CONTROL = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069]")


def escaped(text: object) -> str:
    r"""Return the text with control characters, except tab and line feed, as JSON escapes such as ``\u001b``."""
    return _CONTROL.sub(lambda found: f"\\u{ord(found.group()):04x}", str(text))

"""Text of FMUs on a terminal: names and messages must not control it. The same rules as `fmu_import::terminal`."""

from __future__ import annotations

import re

# C0 but line feed and tab, DEL and C1; marks, embeddings, overrides and isolates of bidirectional text; separators.
_CONTROL = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069]")


def escaped(text: object) -> str:
    r"""Return the text with control characters but line feeds and tabs as ``\u001b``, the notation of JSON."""
    return _CONTROL.sub(lambda found: f"\\u{ord(found.group()):04x}", str(text))

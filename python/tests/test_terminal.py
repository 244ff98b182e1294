"""Text from FMUs cannot control the terminal."""

from __future__ import annotations

import pytest

from chassis_fmu.terminal import escaped


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        # ECMA-48: ESC and CSI start control sequences. Unicode Standard Annex 9: U+202E reverses the text direction.
        ("a\x1b[2Jb", "a\\u001b[2Jb"),
        ("\x9b31m", "\\u009b31m"),
        ("a\rb\x08\x7f\0", "a\\u000db\\u0008\\u007f\\u0000"),
        ("\u202efdp.\u202c", "\\u202efdp.\\u202c"),
        ("a\u2028b", "a\\u2028b"),
        ("a\n\tb", "a\n\tb"),
        ("body.roll (rad/s²), größer, 車, שלום", "body.roll (rad/s²), größer, 車, שלום"),
    ],
)
def test_control_characters_are_shown(text: str, shown: str) -> None:
    assert escaped(text) == shown
    assert escaped(shown) == shown

"""Texts from outside cannot control a terminal."""

import pytest

from hardware.printable import printable


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("Grün 1 °, ✓ 漢字 🦾", "Grün 1 °, ✓ 漢字 🦾"),
        ("two\nlines\tand a tab", "two\nlines\tand a tab"),
        ("\x1b]0;title\x07\x1b[2J", "\\x1b]0;title\\x07\\x1b[2J"),
        ("\r\x08\x00\x7f", "\\r\\x08\\x00\\x7f"),
        ("\x9b31m", "\\x9b31m"),
        ("a\u202eb\u2028c\u200d", "a\\u202eb\\u2028c\\u200d"),
        ("\udcff", "\\udcff"),
    ],
)
def test_other_characters_are_escaped(text: str, shown: str) -> None:
    assert printable(text) == shown
    shown.encode()


def test_every_character_is_harmless() -> None:
    shown = printable("".join(map(chr, range(0x3000))))
    assert {each for each in shown if not each.isprintable()} == {"\n", "\t"}

"""Texts from outside cannot control a terminal, and bytes are shown without a doubt."""

import pytest
from hypothesis import example, given, strategies as st

from hardware.printable import printable, wire_bytes, wire_text


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("Grün 1 °, ✓ 漢字 🦾", "Grün 1 °, ✓ 漢字 🦾"),
        ("two\nlines\tand a tab", "two\n    lines\tand a tab"),
        ("one\n\n  -> two\nError: three\n", "one\n\n  -> two\n    Error: three\n"),
        ("\x1b]0;title\x07\x1b[2J", "\\x1b]0;title\\x07\\x1b[2J"),
        ("\r\x08\x00\x7f", "\\r\\x08\\x00\\x7f"),
        ("\x9b31m", "\\x9b31m"),
        ("a\u202eb\u2028c\u200d", "a\\u202eb\\u2028c\\u200d"),
        ("\udcff", "\\udcff"),
    ],
)
def test_other_characters_are_escaped_and_further_lines_indented(text: str, shown: str) -> None:
    assert printable(text) == shown
    shown.encode()


def test_every_character_is_harmless() -> None:
    shown = printable("".join(map(chr, range(0x3000))))
    assert {each for each in shown if not each.isprintable()} == {"\n", "\t"}


@pytest.mark.parametrize(
    ("data", "shown"),
    [
        (b"b090,s090,", "b090,s090,"),
        (b"k0001,00,00,1021\n", "k0001,00,00,1021\n"),
        (b"\xff\xff\x01\x04", "0xff ff 01 04"),
        (b"AB\x00", "0x41 42 00"),
        (b"gr\xc3\xbcn", "0x67 72 c3 bc 6e"),
        (b"", ""),
    ],
)
def test_bytes_of_a_wire_are_a_text_or_in_hex(data: bytes, shown: str) -> None:
    assert wire_text(data) == shown


@given(st.binary() | st.text(alphabet="0x aAfF1,", max_size=8).map(str.encode))
@example(b"0xff")
def test_the_bytes_of_a_wire_can_be_read_from_their_text(data: bytes) -> None:
    assert wire_bytes(wire_text(data)) == data

"""Texts for people: counts, lines of files, and safe forms of texts from elsewhere."""

import re

_HEX = "0x"
_NEXT_LINE = re.compile(r"\n(?=\S)")
_SPACE = "\n\r\t"  # white space in a text from a wire
_BEFORE, _WIDTH = 40, 96  # characters of a cut line before the caret, and in total
_MOST = 800  # characters of a corrected line


def plural(count: int, what: str) -> str:
    """Return a number of things, such as `1 file` or `2 files`."""
    return f"{count} {what}{'' if count == 1 else 's'}"


def printable(text: str) -> str:
    r"""Return a text that cannot control a terminal, and whose further lines are indented.

    Control characters become escapes: `\x1b`. Tabs stay. Only the first line begins at the left,
    so that a text from outside cannot look like other lines of a command or of the log.
    """
    return _NEXT_LINE.sub("\n    ", escaped(text))


def escaped(text: str) -> str:
    r"""Return a text with escapes for control characters, such as `\x1b`.

    Line ends and tabs stay.
    """
    if text.isprintable():
        return text
    return "".join(
        each if each.isprintable() or each in "\n\t" else each.encode("unicode_escape").decode()
        for each in text
    )


def excerpt(line: str, column: int, instead: str = "") -> str:
    """Return a line of a file with a caret below it, then the corrected line, for a message.

    Args:
        line: The line. Of a long line, the result has only the part around the caret.
        column: Column of the caret, from 1.
        instead: The corrected line, or "" for none.
    """
    begin = max(0, column - 1 - _BEFORE) if len(line) > _WIDTH else 0
    text = f"\n    {in_one_line(line[begin : begin + _WIDTH])}\n    {' ' * (column - 1 - begin)}^"
    return f"{text}\n  write:\n    {in_one_line(instead)[:_MOST]}" if instead else text


def in_one_line(text: str) -> str:
    """Return a text with a sign of width 1 for each control character."""
    return "".join(each if each.isprintable() else " " if each == "\t" else "?" for each in text)


def wire_text(data: bytes) -> str:
    """Return bytes as text for people: a text unchanged, other bytes as `0xff ff 01 04`.

    Bytes are a text if all of them are printable ASCII characters, line ends or tabs, and if they
    do not begin with `0x`. Different bytes give different results.
    """
    text = data.decode("latin-1")
    plain = data.isascii() and all(each.isprintable() or each in _SPACE for each in text)
    return text if plain and not text.startswith(_HEX) else _HEX + data.hex(" ")


def wire_bytes(text: str) -> bytes:
    """Return the bytes for which `wire_text` returns this text.

    Raises:
        ValueError: `wire_text` never returns this text.
    """
    return bytes.fromhex(text[2:]) if text.startswith(_HEX) else text.encode("ascii")

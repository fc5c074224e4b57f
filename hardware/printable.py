"""Texts for people: counts, and safe forms of texts from files, servers and boards."""

import re

_HEX = "0x"
_NEXT_LINE = re.compile(r"\n(?=\S)")
_SPACE = "\n\r\t"  # white space of a text of a wire


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


def wire_text(data: bytes) -> str:
    """Return the bytes of a wire for people: a text as it is, other bytes as `0xff ff 01 04`.

    Bytes are a text if all of them are printable ASCII characters, line ends or tabs. Different
    bytes give different results.
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

"""Standard streams: handles closed streams and ended readers, and prints texts safely."""

import errno
import json
import os
import re
import sys
from contextlib import suppress
from typing import Any, TextIO

import click

from hardware.printable import escaped, printable

_HARD = "\xa0"  # no-break space
_UNIT = re.compile(r"(?<=\d) (?=(?:deg|mm|s|ms|kB)\b)")
_STYLE = re.compile("\x1b\\[[0-9;]*m")
_WORD = re.compile(r"([ \t]*)([^ \t]+)")
_GUIDE = re.compile("[ │├└─]*")
_BELOW = str.maketrans("├└─", "│  ")  # guides of a tree in the next line
_COLUMNS = 80  # width of a terminal that does not report it
_STREAMS = (("stdin", "r"), ("stdout", "w"), ("stderr", "w"))


def open_closed_streams() -> None:
    """Connect closed standard streams to the null device.

    Otherwise the next opened file, such as a serial port, would get the number of such a stream.
    """
    while (handle := os.open(os.devnull, os.O_RDWR)) < len(_STREAMS):
        os.set_inheritable(handle, True)
    os.close(handle)
    for number, (name, mode) in enumerate(_STREAMS):
        if getattr(sys, name) is None:
            setattr(sys, name, open(number, mode, closefd=False))  # noqa: SIM115, as long as the process


def discard(stream: TextIO) -> None:
    """Discard the buffered text of a stream, and all later text."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, stream.fileno())
    os.close(nowhere)


def settle(stream: TextIO) -> None:
    """Write the buffered text of a stream. Discard it if that fails: Python would exit with 120."""
    try:
        stream.flush()
    except OSError:
        discard(stream)


def is_screen(stream: TextIO) -> bool:
    """Return True for a terminal that can move its cursor and has the characters of a picture."""
    dumb = os.environ.get("TERM", "").lower() in ("", "dumb", "unknown")
    return stream.isatty() and not dumb and (stream.encoding or "").lower().startswith("utf")


def fold(text: str, width: int) -> str:
    """Return a text with its lines broken at spaces, but not between a number and its unit.

    Continuation lines are indented, and keep the lines of a drawn tree. A word that is too long,
    such as a path, stays whole. Escape sequences for colours take no columns.

    Args:
        text: The text.
        width: Columns of the terminal.
    """
    return "\n".join(part for line in text.split("\n") for part in _folded(line, max(width, 20)))


def _folded(line: str, width: int) -> list[str]:
    if _length(line) <= width:
        return [line]
    guide = _GUIDE.match(_STYLE.sub("", line))
    assert guide
    indent, parts = guide[0].translate(_BELOW) + " " * 4, [""]
    for gap, word in _WORD.findall(_UNIT.sub(_HARD, line)):
        if parts[-1].strip() and _length(parts[-1] + gap + word) > width:
            parts.append(indent + word)
        else:
            parts[-1] += gap + word
    return [part.replace(_HARD, " ") for part in parts]


def _length(text: str) -> int:
    return len(_STYLE.sub("", text))


def fit(text: str, stream: TextIO) -> str:
    """Return a text with its lines broken at spaces if the stream is a terminal, except JSON."""
    if not stream.isatty() or text.startswith("{"):
        return text
    try:
        columns = os.get_terminal_size(stream.fileno()).columns
    except OSError:  # the stream was just closed
        return text
    return fold(text, columns or _COLUMNS)


def echo(*texts: object, err: bool = False, nl: bool = True, whole: bool = False) -> None:
    """Print texts, each at the start of a line, with escapes for control characters.

    Args:
        texts: The texts. Their second and further lines are indented.
        err: True to print to standard error.
        nl: True to print a line break after the texts.
        whole: True for a text that the user copies, such as a command: its lines are not broken,
            and not indented.
    """
    words = "\n".join(map(escaped if whole else printable, map(str, texts)))
    words = words if whole else fit(words, sys.stderr if err else sys.stdout)
    click.echo(words, err=err, nl=nl)  # noqa: TID251


def echo_result(as_json: bool, row: Any, *lines: object) -> None:
    """Print a result, as JSON or as lines. `docs/output.schema.json` describes the rows."""
    echo(*([json.dumps(row)] if as_json else lines))


class LastingStream:
    """A stream that discards its text after its reader has ended or its terminal is closed.

    It also discards its text after the disk is full, and reports this on standard error.

    Args:
        stream: The stream.
    """

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def write(self, text: str) -> None:
        """Write a text."""
        try:
            self._stream.write(text)
        except OSError as error:
            self._discard(error)

    def flush(self) -> None:
        """Write the buffered text."""
        try:
            self._stream.flush()
        except OSError as error:
            self._discard(error)

    def _discard(self, error: OSError) -> None:
        discard(self._stream)
        if error.errno == errno.ENOSPC:
            with suppress(OSError):  # standard error may be on that disk, too
                echo("warning: the disk is full; the rest of the output is lost", err=True)
            settle(sys.stderr)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

"""The alternate screen of a terminal: what was there before is back when it is left."""

import os
import threading
from collections.abc import Iterable
from contextlib import suppress
from typing import IO, Self

from .keyboard import restore_keyboard
from .streams import LastingStream

_SHOW_CURSOR = "\x1b[?25h"
_ENTER = "\x1b[?1049h\x1b[?25l"  # another screen, without a cursor
_EXIT = f"\x1b[H\x1b[J{_SHOW_CURSOR}\x1b[?1049l"  # cleared, for terminals that have only one

_left = threading.Event()  # not set while the screen is shown
_left.set()


class FullScreen:
    """Draws lines on the alternate screen, as a context.

    Every line is drawn over the one before, so that nothing flickers, and nothing is left behind
    when the size of the terminal changes or keys are pressed.

    Args:
        stream: The terminal.
    """

    def __init__(self, stream: LastingStream | IO[str]) -> None:
        self._stream = stream

    def __enter__(self) -> Self:
        _left.clear()
        self._write(_ENTER)
        return self

    def __exit__(self, *raised: object) -> None:
        self._write(_EXIT)
        _left.set()

    def draw(self, lines: Iterable[str]) -> None:
        """Draw lines, none of which is wider than the terminal, and not more than its height."""
        self._write("\x1b[H" + "\x1b[K\r\n".join(lines) + "\x1b[K\x1b[J")

    def _write(self, text: str) -> None:
        self._stream.write(text)
        self._stream.flush()


def last_words(text: str) -> None:
    """Leave screen and keyboard, and print a text to standard error, before the process is ended.

    A terminal that does not take it within 0.2 s is left.
    """

    def write() -> None:
        restore_keyboard()
        with suppress(OSError):
            if os.isatty(1):
                os.write(1, (_SHOW_CURSOR if _left.is_set() else _EXIT).encode())
            os.write(2, f"\n{text}\n".encode())

    thread = threading.Thread(target=write, daemon=True)
    thread.start()
    thread.join(0.2)

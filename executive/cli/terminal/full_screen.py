"""The alternate screen of a terminal. When it ends, the terminal shows the earlier content."""

import os
import signal
import threading
from collections.abc import Iterable
from contextlib import suppress
from typing import IO, Self

from .keyboard import restore_keyboard, suspended_keyboard
from .streams import LastingStream

_SHOW_CURSOR = "\x1b[?25h"
_ENTER = "\x1b[?1049h\x1b[?25l"  # switch to the alternate screen, without a cursor
_EXIT = f"\x1b[H\x1b[J{_SHOW_CURSOR}\x1b[?1049l"  # also clears terminals with only one screen

_left = threading.Event()  # not set while the screen is shown
_left.set()
_lock = threading.RLock()  # blocks drawing while the process is being suspended


class FullScreen:
    """A context that draws lines on the alternate screen.

    Each line replaces the previous one, so the screen does not flicker. The rest of the screen is
    cleared, also after typed keys or a change of the terminal's size.

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
        """Draw lines. They must fit the width and height of the terminal."""
        with _lock:
            if not _left.is_set():
                self._write("\x1b[H" + "\x1b[K\r\n".join(lines) + "\x1b[K\x1b[J")

    def _write(self, text: str) -> None:
        self._stream.write(text)
        self._stream.flush()


def suspend(*_signal: object) -> None:
    """Suspend this process, for Ctrl-Z. The shell has screen and keyboard meanwhile.

    If the process continues in the background, the shell keeps the screen. Call this function from
    the main thread.
    """
    with _lock, suspended_keyboard():
        shown = not _left.is_set()
        if shown:
            _left.set()
            os.write(1, _EXIT.encode())
        handler = signal.signal(signal.SIGTSTP, signal.SIG_DFL)
        os.kill(os.getpid(), signal.SIGTSTP)  # no effect without a shell that can continue it
        signal.signal(signal.SIGTSTP, handler)
        if shown and os.tcgetpgrp(1) == os.getpgrp():
            os.write(1, _ENTER.encode())
            _left.clear()


def last_words(text: str) -> None:
    """Restore screen and keyboard, and print a text to standard error, before the process ends.

    Gives up after 1 s if the terminal does not accept the text.
    """

    def write() -> None:
        restore_keyboard()
        with suppress(OSError):
            if os.isatty(1):
                os.write(1, (_SHOW_CURSOR if _left.is_set() else _EXIT).encode())
            os.write(2, f"\n{text}\n".encode())

    thread = threading.Thread(target=write, daemon=True)
    thread.start()
    # Several waits: a stall of the whole host ends one wait without giving the thread time.
    for _ in range(50):
        thread.join(0.02)

"""A full-screen view that keys and other threads change."""

import os
import select
import shutil
import sys
import threading
from abc import ABC, abstractmethod
from collections.abc import Iterable
from contextlib import suppress

from hardware.printable import printable

from .full_screen import FullScreen
from .keyboard import keys_in
from .streams import LastingStream

_RED, _PLAIN = "\x1b[31m", "\x1b[0m"


class KeyScreen(ABC):
    """Draws lines and reads keys, until `end` is called or the terminal is closed.

    Args:
        every: Longest time between two drawings [s]; None to draw only after a key or `wake`.

    Attributes:
        left: True if `leave` was called.
    """

    def __init__(self, every: float | None = None) -> None:
        self._every = every
        self._reader, self._writer = os.pipe()
        os.set_blocking(self._writer, False)
        self._ended = threading.Event()
        self.left = False

    @abstractmethod
    def update(self) -> None:
        """Update the view with recent events. Called before every drawing."""

    @abstractmethod
    def lines(self, width: int, rows: int) -> Iterable[tuple[str, bool]]:
        """Return the lines of the screen, each with True if it belongs to an error.

        Args:
            width: Number of columns.
            rows: Number of lines.
        """

    @abstractmethod
    def press(self, key: str) -> None:
        """Execute the command of a key."""

    @abstractmethod
    def stop(self) -> None:
        """Stop the arm. Any thread may call."""

    def wake(self) -> None:
        """Draw the screen again. Any thread may call."""
        with suppress(BlockingIOError):  # a drawing is already due
            os.write(self._writer, b"\0")

    def end(self) -> None:
        """End the view. Any thread may call."""
        self._ended.set()
        self.wake()

    def leave(self) -> None:
        """Stop the arm and end the view, after a signal. Any thread may call."""
        self.left = True
        self.end()
        self.stop()

    def show(self, keys: int) -> None:
        """Draw the view and read keys until the view ends.

        Args:
            keys: File handle of the keyboard, which is read key by key.
        """
        colored = "NO_COLOR" not in os.environ
        with FullScreen(LastingStream(sys.stdout)) as screen:
            while not self._ended.is_set():
                self.update()
                screen.draw(
                    f"{_RED}{printable(line)}{_PLAIN}" if wrong and colored else printable(line)
                    for line, wrong in self.lines(*shutil.get_terminal_size())
                )
                for key in self._pressed(keys):
                    self.press(key)

    def _pressed(self, keys: int) -> list[str]:
        """Wait for keys, for `wake`, or for the time to draw. Return the pressed keys."""
        ready, _, _ = select.select([keys, self._reader], [], [], self._every)
        if self._reader in ready:
            os.read(self._reader, 4096)
        if keys not in ready:
            return []
        with suppress(OSError):  # the terminal is closed
            if data := os.read(keys, 4096):
                return keys_in(data)
        self.end()
        return []

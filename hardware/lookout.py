"""Looking out for a board that was unplugged; it may come back under another name."""

import logging
import os
import threading

from .clock import Clock
from .ports import lasting_name

logger = logging.getLogger(__name__)

# How often to look while a board is away; nothing looks while it is there [s].
_EVERY = 1.0


class Lookout:
    """Reports the return of the board on a port, known by the name that udev always gives it.

    Args:
        port: Its device while it is there.
        clock: Whose time.
    """

    def __init__(self, port: str, clock: Clock) -> None:
        self._port, self._clock = port, clock
        self._name = lasting_name(port)
        self._signal = clock.signal()
        self._over = False

    def begin(self) -> threading.Thread | None:
        """Look out in a thread of its own; not at all for a port without a lasting name."""
        if self._name is None:
            return None
        return self._clock.spawn(self._look, "lookout")

    def end(self) -> None:
        """Look out no longer, for good. Harmless when nobody does."""
        with self._signal:
            self._over = True
            self._signal.notify()

    def _look(self) -> None:
        assert self._name
        with self._signal:
            while not self._over and not self._name.exists():
                self._signal.wait(self._clock.now() + _EVERY)
            if not self._over:
                what = "The board of port %s is back as %s; configure and activate the arm to go on"
                logger.warning(what, self._port, os.path.realpath(self._name))

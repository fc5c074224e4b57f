"""Looking out for a board that was unplugged; it may come back under another name.

The report is for who keeps an arm for long, such as a server. `armtree run` ends with the fault.
"""

import logging
import os
import threading

from hardware.clock import Clock
from hardware.link.ports import lasting_name

from .events import BoardReturned, Observer

logger = logging.getLogger(__name__)

# How often to look while a board is away. A hub takes longer to notice that it was plugged in, so
# that no absence is overlooked; nothing looks while the board is there [s].
_EVERY = 0.1


class ReconnectWatcher:
    """Reports the return of the board on a port, known by the name that udev always gives it.

    Args:
        port: Its device while it is there.
        clock: Whose time.
        observe: Told of the return.
    """

    def __init__(self, port: str, clock: Clock, observe: Observer) -> None:
        self._port, self._clock, self._observe = port, clock, observe
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
        # The hang-up comes before udev takes the name away.
        if self._await(there=False) and self._await(there=True):
            assert self._name
            event = BoardReturned(self._clock.now(), self._port, os.path.realpath(self._name))
            logger.warning("%s", event)
            self._observe(event)

    def _await(self, there: bool) -> bool:
        """Wait until the name is there, or is not; false where nobody wants to know any more."""
        assert self._name
        with self._signal:
            while not self._over and self._name.exists() is not there:
                self._signal.wait(self._clock.now() + _EVERY)
            return not self._over

"""Detects that an unplugged board was plugged in again, even under another device name.

Only programs that keep running need this, such as the server. `armtree run` ends at the fault.
"""

import logging
import os
import threading

from hardware.clock import Clock
from hardware.link.serial_ports import persistent_name

from .events import BoardReturned, Observer

logger = logging.getLogger(__name__)

# Time between two checks while a board is unplugged [s]. A USB hub needs longer than this to report
# a new device, so every absence is noticed.
_PERIOD = 0.1


class ReconnectWatcher:
    """Reports the return of the board on a port, found by its name under `/dev/serial/by-id`.

    Args:
        port: Device of the board. The board must be plugged in now.
        clock: Time source.
        observe: Callback for the event.
    """

    def __init__(self, port: str, clock: Clock, observe: Observer) -> None:
        self._port, self._clock, self._observe = port, clock, observe
        self._name = persistent_name(port)
        self._signal = clock.signal()
        self._stopped = False

    def start(self) -> threading.Thread | None:
        """Watch in a thread. Does nothing if the port has no persistent name."""
        if self._name is None:
            return None
        return self._clock.spawn(self._watch, "reconnect")

    def stop(self) -> None:
        """Stop watching. Does nothing if it was not started."""
        with self._signal:
            self._stopped = True
            self._signal.notify()

    def _watch(self) -> None:
        # The port hangs up before udev removes its name.
        if self._wait_until(present=False) and self._wait_until(present=True):
            assert self._name
            event = BoardReturned(self._clock.now(), self._port, os.path.realpath(self._name))
            logger.warning("%s", event)
            self._observe(event)

    def _wait_until(self, present: bool) -> bool:
        """Wait until the name is present or absent. Return False if the watcher is stopped."""
        assert self._name
        with self._signal:
            while not self._stopped and self._name.exists() is not present:
                self._signal.wait(self._clock.now() + _PERIOD)
            return not self._stopped

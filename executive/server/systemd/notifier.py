"""Messages to systemd from a server that systemd started: it is ready, runs, or ends.

The messages are those of sd_notify(3), the environment variables those of sd_watchdog_enabled(3).
"""

import asyncio
import os
import re
import socket
from collections.abc import Mapping


class SystemdNotifier:
    """Sends messages to systemd from the event loop, so a loop that hangs sends none.

    It sends nothing if systemd did not start this process.

    Args:
        environment: The environment of the process.
    """

    def __init__(self, environment: Mapping[str, str] = os.environ) -> None:
        # A name that begins with @ is an abstract socket.
        self._address = re.sub("^@", "\0", environment.get("NOTIFY_SOCKET", ""))
        own = environment.get("WATCHDOG_PID", str(os.getpid())) == str(os.getpid())
        self._timeout = int(environment.get("WATCHDOG_USEC", "0")) / 1e6 if own else 0.0

    def ready(self, loop: asyncio.AbstractEventLoop) -> None:
        """Report that the server answers; then, at half of the watchdog's timeout, that it runs."""
        self._send("READY=1")
        if self._address and self._timeout:
            self._repeat(loop)

    def ending(self) -> None:
        """Report that the server ends."""
        self._send("STOPPING=1")

    def _repeat(self, loop: asyncio.AbstractEventLoop) -> None:
        self._send("WATCHDOG=1")
        loop.call_later(self._timeout / 2, self._repeat, loop)

    def _send(self, message: str) -> None:
        if not self._address:
            return
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as sender:
            sender.setblocking(False)
            try:
                sender.sendto(message.encode(), self._address)
            except OSError:  # systemd is busy or gone; the next message may arrive
                return

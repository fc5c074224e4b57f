"""A bus of servos that keeps its own log of the bytes that it reads."""

import time
from pathlib import Path

from hardware.drivers.feetech.virtual.bus import Bus


class LoggedBus(Bus):
    """A bus with a log: a line of time [s, monotonic] and hexadecimal digits for each piece.

    Args:
        bus: The bus, which is not used otherwise from now on.
        log: The file.
    """

    def __init__(self, bus: Bus, log: Path) -> None:
        self.__dict__.update(vars(bus))
        self._log = log

    def receive(self, data: bytes, now: float) -> None:
        """Put bytes on the line."""
        with self._log.open("a") as log:
            log.write(f"{time.monotonic():.6f} {data.hex()}\n")
        super().receive(data, now)


def logged(log: Path) -> list[tuple[float, bytes]]:
    """What a log has so far."""
    lines = log.read_text().split("\n")[:-1] if log.exists() else []
    pieces = (line.split() for line in lines)
    return [(float(when), bytes.fromhex(data)) for when, data in pieces]

"""The transmit buffer of the board: lines that leave at the speed of the serial line."""

from collections import deque

RING = 255  # size of the buffer, besides the byte being sent [bytes]


class Transmitter:
    """Sends lines. Drops a line if the buffer has no room for it.

    Args:
        byte_time: Time to send one byte [s].
    """

    def __init__(self, byte_time: float) -> None:
        self._byte_time = byte_time
        self._lines: deque[tuple[float, bytes]] = deque()  # end time of the last byte, and line
        self._free = 0.0

    def room_at(self, length: int) -> float:
        """Return the earliest time at which a line of this many bytes fits [s]."""
        return self._free - (RING + 1 - length) * self._byte_time

    def put(self, line: bytes, now: float) -> bool:
        """Send a line. Return False if there is no room for it."""
        if now < self.room_at(len(line)):
            return False
        self._free = max(self._free, now) + len(line) * self._byte_time
        self._lines.append((self._free, line))
        return True

    def next(self) -> float | None:
        """Return the end time of the next line [s], or None if there is none."""
        return self._lines[0][0] if self._lines else None

    def sent(self, now: float) -> bytes:
        """Return the lines that have been sent, and remove them."""
        data = b""
        while self._lines and self._lines[0][0] <= now:
            data += self._lines.popleft()[1]
        return data

    def cut(self, now: float) -> None:
        """Drop all unsent bytes, also of a line that is being sent."""
        lines, self._lines = self._lines, deque()
        for end, line in lines:
            left = max(0.0, end - now) / self._byte_time
            if part := line[: max(0, int(len(line) - left))]:
                self._lines.append((min(end, now), part))
        self._free = min(self._free, now)

"""The way out of the board: a ring of lines that empties at the speed of the line."""

from collections import deque

RING = 255  # bytes that wait; one more is on its way


class Transmitter:
    """Sends lines; one that finds no room is left out.

    Args:
        byte_time: How long a byte is on the line [s].
    """

    def __init__(self, byte_time: float) -> None:
        self._byte_time = byte_time
        self._lines: deque[tuple[float, bytes]] = deque()  # each with the end of its last byte
        self._free = 0.0

    def room_at(self, length: int) -> float:
        """From when on there is room for a line of this many bytes [s]."""
        return self._free - (RING + 1 - length) * self._byte_time

    def put(self, line: bytes, now: float) -> bool:
        """Send a line; false if there is no room for it."""
        if now < self.room_at(len(line)):
            return False
        self._free = max(self._free, now) + len(line) * self._byte_time
        self._lines.append((self._free, line))
        return True

    def next(self) -> float | None:
        """When the next line will have been sent [s]; None if there is none."""
        return self._lines[0][0] if self._lines else None

    def sent(self, now: float) -> bytes:
        """Take the lines that have been sent by now."""
        data = b""
        while self._lines and self._lines[0][0] <= now:
            data += self._lines.popleft()[1]
        return data

    def cut(self, now: float) -> None:
        """Forget what has not been sent; of the line on its way, the first bytes have."""
        lines, self._lines = self._lines, deque()
        for end, line in lines:
            left = max(0.0, end - now) / self._byte_time
            if part := line[: max(0, int(len(line) - left))]:
                self._lines.append((min(end, now), part))
        self._free = min(self._free, now)

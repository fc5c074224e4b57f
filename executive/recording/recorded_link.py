"""A line to the board on which no frame overtakes its recording."""

from executive.errors import RecordingBehind
from hardware import Clock, Link

from .recordings import Recordings

# A disk that takes longer is a fault: what is not recorded must not go on moving.
MOST_BEHIND = 0.05  # [s]

# For this long a stop lets the frame before it get to the disk; it does not wait for a slow one.
_HOLD_WAITS = 0.002  # [s]


class RecordedLink:
    """A link that sends a frame only when all before it are on their way to the disk.

    Args:
        link: The line to the board.
        recordings: Where what is sent on it is told.
        clock: Whose time.
    """

    def __init__(self, link: Link, recordings: Recordings, clock: Clock) -> None:
        self._link, self._recordings, self._clock = link, recordings, clock
        self._last = b""

    @property
    def port(self) -> str:
        """What a person calls it."""
        return self._link.port

    def open(self) -> None:
        """Open it."""
        self._link.open()

    def write(self, data: bytes) -> None:
        """Send bytes.

        Raises:
            RecordingBehind: What was sent before is not recorded.
            LinkError: As the link's own.
        """
        if data == self._last:  # as a stop does: it commands nothing new, so it goes in any case
            self._recordings.caught_up(_HOLD_WAITS)
        elif not self._recorded():
            raise RecordingBehind(self.port, MOST_BEHIND)
        self._link.write(data)
        self._last = data

    def read(self) -> bytes:
        """Wait for bytes."""
        return self._link.read()

    def close(self, discard: bool = False) -> None:
        """Close it; what has not left yet may be discarded."""
        self._link.close(discard)

    def _recorded(self) -> bool:
        """Whether all before is on its way to the disk, or is within the time it may take."""
        until = self._clock.now() + MOST_BEHIND
        while not self._recordings.caught_up(max(0.0, until - self._clock.now())):
            if self._clock.now() >= until:
                return False
        return True

"""A link to the board that sends no frame before the previous one is recorded."""

from executive.errors import RecordingBehind
from hardware import Clock, Link

from .recordings import Recordings

# If recording takes longer, it is a fault: the arm must not move without a recording.
MOST_BEHIND = 0.05  # [s]

# Longest time that a stop waits for the recording of the frame before it.
_HOLD_WAITS = 0.002  # [s]


class RecordedLink:
    """A link that sends a frame only after all frames before it were recorded.

    Args:
        link: Link to the board.
        recordings: Recordings of the frames.
        clock: Time source.
    """

    def __init__(self, link: Link, recordings: Recordings, clock: Clock) -> None:
        self._link, self._recordings, self._clock = link, recordings, clock
        self._last = b""

    @property
    def port(self) -> str:
        """Name of the port."""
        return self._link.port

    def open(self) -> None:
        """Open the link."""
        self._link.open()

    def write(self, data: bytes) -> None:
        """Send bytes.

        Raises:
            RecordingBehind: The frames before are not recorded.
            LinkError: The link failed.
        """
        if data == self._last:  # a stop repeats the last frame; it must be sent in any case
            self._recordings.caught_up(_HOLD_WAITS)
        elif not self._recorded():
            raise RecordingBehind(self.port, MOST_BEHIND)
        self._link.write(data)
        self._last = data

    def read(self) -> bytes:
        """Wait for bytes."""
        return self._link.read()

    def close(self, discard: bool = False) -> None:
        """Close the link.

        Args:
            discard: True to discard bytes that are not sent yet.
        """
        self._link.close(discard)

    def _recorded(self) -> bool:
        """Wait for the recording of all frames before; return False if it takes too long."""
        until = self._clock.now() + MOST_BEHIND
        while not self._recordings.caught_up(max(0.0, until - self._clock.now())):
            if self._clock.now() >= until:
                return False
        return True

"""A link to the board that sends no frame before the previous one is recorded."""

import logging

from executive.errors import RecordingBehind
from hardware import Clock, Link
from hardware.link.host_load import busy_words, or_busy

from .recordings import Recordings

logger = logging.getLogger(__name__)

# Longest wait for the recording without a report, and shortest time between two reports [s].
_REPORTED, _AT_MOST_EVERY = 0.05, 1.0

# Longest time that a stop waits for the recording of the previous frame.
_HOLD_WAITS = 0.002  # [s]


class RecordedLink:
    """A link to the board. Each frame waits for the recording of the earlier frames.

    Args:
        link: Link to the board.
        recordings: Recordings of the frames.
        clock: Time source.
        timeout: Longest time that a frame waits [s].
    """

    def __init__(self, link: Link, recordings: Recordings, clock: Clock, timeout: float) -> None:
        self._link, self._recordings, self._clock = link, recordings, clock
        self._timeout = timeout
        self._since: float | None = None  # start of the next frame's wait [s]
        self._quiet_until = 0.0  # time of the next report [s]

    @property
    def port(self) -> str:
        """Name of the port."""
        return self._link.port

    def open(self) -> None:
        """Open the link."""
        self._link.open()

    def ready(self, timeout: float) -> bool:
        """Return True if every sent frame was recorded, so that the next frame may be sent.

        Args:
            timeout: Longest time to wait in this call [s].

        Raises:
            RecordingBehind: The total wait of the frame is too long.
        """
        begin = self._clock.now()
        if self._since is None:
            self._recordings.write_time()  # forget the writes before this wait
        recorded = self._recordings.caught_up(timeout)
        if recorded and self._since is None:
            return True
        since = self._since = begin if self._since is None else self._since
        waited = self._clock.now() - since
        if recorded or waited >= self._timeout:
            self._since = None
            cause = self._likely_cause(waited)
            if not recorded:
                raise RecordingBehind(self.port, self._timeout, cause)
            self._report(waited, cause)
        return recorded

    def write(self, data: bytes) -> None:
        """Send bytes. A stop may come at any time. Other frames come when the link is `ready`.

        Raises:
            LinkError: The link failed.
        """
        # A stop does not wait until a slow disk has created the file, which has no frame yet.
        if self._recordings.begun:
            self._recordings.caught_up(_HOLD_WAITS)
        self._link.write(data)

    def read(self) -> bytes:
        """Wait for bytes and return them."""
        return self._link.read()

    @property
    def unread(self) -> bool:
        """True if bytes have arrived that `read` has not returned yet."""
        return self._link.unread

    def close(self, discard: bool = False) -> None:
        """Close the link.

        Args:
            discard: True to discard unsent bytes.
        """
        self._link.close(discard)

    def _report(self, waited: float, cause: str) -> None:
        now = self._clock.now()
        if waited >= _REPORTED and now >= self._quiet_until:
            self._quiet_until = now + _AT_MOST_EVERY
            logger.warning(
                "A frame waited %.2f s for the recording of the previous one. The likely cause: %s",
                waited,
                cause,
            )

    def _likely_cause(self, waited: float) -> str:
        writing = self._recordings.write_time()
        if writing <= waited / 2:
            return busy_words()
        # A write also takes long if its thread gets no processor.
        return f"writes to the disk took {writing:.2f} s; record to a faster disk{or_busy()}"

"""The link interface: a serial port, a virtual board, or a board in this process."""

from typing import Protocol

VIRTUAL = "virtual"  # name of the port that needs no hardware
BITS_PER_BYTE = 10  # 8N1: start bit, eight data bits, stop bit


class Link(Protocol):
    """A byte stream to a board. Opening the link resets most boards, which may move the arm."""

    @property
    def port(self) -> str:
        """Name of the port for messages."""

    def open(self) -> None:
        """Lock the port and open it.

        Raises:
            LinkError: The port cannot be opened. The message names the port and what to do.
        """

    def write(self, data: bytes) -> None:
        """Send bytes.

        The arm is deactivated with `PortStalled` if this call takes longer than 0.3 s.

        Raises:
            PortLost: The port disappeared.
            PortStalled: The other end accepts no more bytes. Some bytes may still arrive.
        """

    def read(self) -> bytes:
        """Wait for bytes and return them; empty if the link is closed.

        Raises:
            PortLost: The port disappeared.
        """

    @property
    def unread(self) -> bool:
        """True if bytes have arrived that `read` has not returned yet. Must not wait."""

    def close(self, discard: bool = False) -> None:
        """Close the port and release it. Does nothing if closed. Waiting calls return.

        The arm waits 0.9 s for this call. A link drops bytes that it cannot send in time.

        Args:
            discard: True to drop bytes that were written but not sent.

        Raises:
            LinkError: Closing failed. The port is released nevertheless.
        """

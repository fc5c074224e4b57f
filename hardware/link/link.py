"""The link interface: a serial port, a virtual board, or a board in this process."""

from typing import Protocol

VIRTUAL = "virtual"  # name of the port that needs no hardware
BITS_PER_BYTE = 10  # 8N1: start bit, eight data bits, stop bit


class Link(Protocol):
    """A byte stream to a board. Opening it resets most boards, which may move the arm."""

    @property
    def port(self) -> str:
        """Name of the port for messages."""

    def open(self) -> None:
        """Lock the port and open it.

        Raises:
            LinkError: The port cannot be opened. The message names it and what to do.
        """

    def write(self, data: bytes) -> None:
        """Send bytes.

        The arm is deactivated with `PortStalled` if this takes longer than 0.3 s.

        Raises:
            PortLost: The port disappeared.
            PortStalled: The other end accepts no more bytes. The bytes may or may not arrive.
        """

    def read(self) -> bytes:
        """Wait for bytes, and return them. No bytes mean that the link is closed.

        Raises:
            PortLost: The port disappeared.
        """

    def close(self, discard: bool = False) -> None:
        """Close the port and release it. `read` and `write` return. Does nothing if closed.

        The arm waits for this for 0.9 s. A link drops bytes that it cannot send in time.

        Args:
            discard: Whether to drop bytes that were written but have not been sent.

        Raises:
            LinkError: Closing failed. The port is released nevertheless.
        """

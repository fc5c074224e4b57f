"""The line to the board, as a seam: a serial port, the virtual Arduino, or the board in-process."""

from typing import Protocol

BITS_PER_BYTE = 10  # 8N1: start bit, eight data bits, stop bit


class Link(Protocol):
    """A byte stream to a board. Opening it resets most boards, and that may move the arm."""

    @property
    def port(self) -> str:
        """What a person calls it."""

    def open(self) -> None:
        """Take the port for ourselves and open it.

        Raises:
            LinkError: It cannot be had; says which port and the way out.
        """

    def write(self, data: bytes) -> None:
        """Send bytes; return within 0.3 s, or raise.

        Whoever waits for a write that takes longer than 0.5 s takes the port for stuck and closes
        it. But who stops the arm writes the hold frame itself, and waits for that.

        Raises:
            PortLost: It went away.
            PortStalled: The other end takes no more; the bytes may or may not arrive.
        """

    def read(self) -> bytes:
        """Wait for bytes; empty once the link is closed, and only then.

        Raises:
            PortLost: It went away.
        """

    def close(self, discard: bool = False) -> None:
        """Close the port and give it up; `read` and `write` return. Harmless when closed.

        Args:
            discard: Whether what was written and has not left yet shall never leave.

        Raises:
            PortLost: Closing failed; the port is given up all the same.
        """

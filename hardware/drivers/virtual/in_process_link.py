"""Links without a port: to a virtual board in this process, and one without a board."""

from typing import Generic, TypeVar

from hardware.clock import Clock
from hardware.errors import PortLost
from hardware.link.link import VIRTUAL
from hardware.printable import wire_text

from .model import BoardModel

Model = TypeVar("Model", bound=BoardModel)


class BoardLink(Generic[Model]):
    """A link to a virtual board in this process.

    Args:
        board: The board.
        clock: Time source of the board.
    """

    port = "board"
    unread = False  # simulated time waits for the thread that reads

    def __init__(self, board: Model, clock: Clock) -> None:
        self.board = board
        self._clock = clock
        self._changed = clock.signal()
        self._open = False
        self._lost = False

    def open(self) -> None:
        """Open the link, which resets most boards."""
        with self._changed:
            self._open, self._lost = True, False
            self.board.open(self._clock.now())

    def write(self, data: bytes) -> None:
        """Send bytes.

        Raises:
            PortLost: The board was unplugged, or the link is not open.
        """
        with self._changed:
            if self._lost or not self._open:
                what = wire_text(data)
                why = f"Something went wrong while sending the message {what} to the port"
                raise PortLost(self.port, f"{why} {self.port}")
            self.board.receive(data, self._clock.now())
            self._changed.notify()  # a waiting `read` computes the time of the next answer again

    def read(self) -> bytes:
        """Wait for bytes and return them; empty if the link is closed.

        Raises:
            PortLost: The board was unplugged.
        """
        with self._changed:
            while self._open:
                if self._lost:
                    raise PortLost(self.port, "Something went wrong while listening")
                if data := self.board.read_output(self._clock.now()):
                    return data
                self._changed.wait(self.board.next_output())
            return b""

    def close(self, discard: bool = False) -> None:
        """Close the link. A waiting `read` returns.

        Args:
            discard: True to drop the bytes that have not arrived.
        """
        with self._changed:
            self._open = False
            if discard:
                self.board.cut_off(self._clock.now())
            self._changed.notify()

    def unplug(self) -> None:
        """Disconnect the cable."""
        with self._changed:
            self._lost = True
            self._changed.notify()


class NullLink:
    """A link without a board. The link accepts all bytes and returns none.

    Args:
        clock: Time source.
    """

    port = VIRTUAL
    unread = False

    def __init__(self, clock: Clock) -> None:
        self._changed, self._open = clock.signal(), False

    def open(self) -> None:
        """Open the link."""
        self._open = True

    def write(self, data: bytes) -> None:
        """Drop the bytes."""

    def read(self) -> bytes:
        """Wait until the link is closed."""
        with self._changed:
            while self._open:
                self._changed.wait(None)
        return b""

    def close(self, discard: bool = False) -> None:
        """Close the link. A waiting `read` returns."""
        with self._changed:
            self._open = False
            self._changed.notify()

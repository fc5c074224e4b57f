"""The board in-process, on the injected clock: the same model, without a pseudo-terminal."""

from hardware.clock import Clock
from hardware.errors import PortLost

from .board import Board


class BoardLink:
    """A link to a board in this process.

    Args:
        board: The board at the other end.
        clock: Whose time the board lives in.
    """

    port = "board"

    def __init__(self, board: Board, clock: Clock) -> None:
        self.board = board
        self._clock = clock
        self._changed = clock.signal()
        self._open = False
        self._lost = False

    def open(self) -> None:
        """Open the link, which resets the board."""
        with self._changed:
            self._open, self._lost = True, False
            self.board.reset(self._clock.now())
            self.board.says(self._clock.now())  # what came before nobody heard

    def write(self, data: bytes) -> None:
        """Put bytes on the line.

        Raises:
            PortLost: The board was unplugged, or the link is not open.
        """
        with self._changed:
            if self._lost or not self._open:
                text = data.decode("ascii", "replace")
                why = f"Something went wrong while sending the message {text} to the port"
                raise PortLost(self.port, f"{why} {self.port}")
            self.board.receive(data, self._clock.now())
            self._changed.notify()  # who reads must know when to expect an answer

    def read(self) -> bytes:
        """Wait for bytes; empty once the link is closed.

        Raises:
            PortLost: The board was unplugged.
        """
        with self._changed:
            while self._open:
                if self._lost:
                    raise PortLost(self.port, "Something went wrong while listening")
                if data := self.board.says(self._clock.now()):
                    return data
                self._changed.wait(self.board.says_next())
            return b""

    def close(self, discard: bool = False) -> None:
        """Close the link; a waiting `read` returns.

        Args:
            discard: Whether to drop what has not arrived yet.
        """
        with self._changed:
            self._open = False
            if discard:
                self.board.cut_off(self._clock.now())
            self._changed.notify()

    def unplug(self) -> None:
        """Pull the cable."""
        with self._changed:
            self._lost = True
            self._changed.notify()

"""The interface of a model of a board."""

from typing import Protocol


class BoardModel(Protocol):
    """A board and its line, as a pure model without a clock and without I/O.

    The caller passes the time [s], which never decreases. For the port `virtual`, armtree puts the
    model behind a pseudo-terminal. Tests with simulated time run it in their own process. A model
    must be picklable.
    """

    def open(self, now: float) -> None:
        """Open the port, which resets most boards. Unread output is lost."""

    def receive(self, data: bytes, now: float) -> None:
        """Put bytes on the line to the board. They arrive one by one, at the speed of the line."""

    def cut_off(self, now: float) -> None:
        """Drop the bytes that have not arrived."""

    def read_output(self, now: float) -> bytes:
        """Return the bytes that the board has sent, and remove them."""

    def next_output(self) -> float | None:
        """Return the time of the next output if no byte is received [s]; None for no output."""

    def state(self, now: float) -> object:
        """Return the state of the board, for tests. The state must be picklable."""

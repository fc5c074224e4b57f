"""The interface of a model of a board."""

from typing import Protocol


class BoardModel(Protocol):
    """A board and its line, as a pure model without a clock and without I/O.

    The caller passes the time [s], which never decreases. armtree puts the model behind a
    pseudo-terminal for the port `virtual`, and in the process of a test that simulates time. A
    model can be pickled.
    """

    def open(self, now: float) -> None:
        """A program has opened the port. Most boards reset. Unread output is lost."""

    def receive(self, data: bytes, now: float) -> None:
        """Put bytes on the line to the board. They arrive one by one, at its speed."""

    def cut_off(self, now: float) -> None:
        """Drop the bytes that have not arrived."""

    def read_output(self, now: float) -> bytes:
        """Return the bytes that the board has sent by now, and remove them."""

    def next_output(self) -> float | None:
        """Return when to read the output again if no byte is received [s], or None for never."""

    def state(self, now: float) -> object:
        """Return the state of the board, for tests. It can be pickled."""

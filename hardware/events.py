"""What the arm tells whoever watches it. Times are on the injected clock [s]."""

from collections.abc import Callable
from dataclasses import dataclass

from .errors import HardwareError
from .lifecycle import State


@dataclass(frozen=True, slots=True)
class FrameSent:
    """A frame went out.

    Attributes:
        time: When it was written [s].
        data: Its bytes.
        positions: The joint values it stands for, one per actuated joint [rad].
        scheduled: When it was due [s]; None for the hold frame of a stop.
    """

    time: float
    data: bytes
    positions: tuple[float, ...]
    scheduled: float | None


@dataclass(frozen=True, slots=True)
class CommandSent:
    """Bytes that are no frame went out: a setting of the board.

    Attributes:
        time: When they were written [s].
        data: The bytes.
    """

    time: float
    data: bytes


@dataclass(frozen=True, slots=True)
class BytesReceived:
    """The board said something.

    Attributes:
        time: When it was read [s].
        data: What it said.
    """

    time: float
    data: bytes


@dataclass(frozen=True, slots=True)
class StateChanged:
    """The lifecycle took an edge.

    Attributes:
        time: When [s].
        label: Name of the edge.
        start: Where it began.
        goal: Where it led.
    """

    time: float
    label: str
    start: State
    goal: State


@dataclass(frozen=True, slots=True)
class Faulted:
    """Something failed while the arm was active.

    Attributes:
        time: When [s].
        error: What failed.
    """

    time: float
    error: HardwareError


ArmEvent = FrameSent | CommandSent | BytesReceived | StateChanged | Faulted
Observer = Callable[[ArmEvent], None]

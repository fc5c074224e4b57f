"""What the arm tells whoever watches it. Times are on the injected clock [s]."""

import threading
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

from hardware.errors import HardwareError

from .lifecycle import State

# Observers are quick; where one is not, perhaps as it waits for a lock of the one who closes the
# arm, whoever closes it waits no longer than this [s].
PATIENCE = 0.5


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


@dataclass(frozen=True, slots=True)
class BoardReturned:
    """A board that was lost is there again; to go on is a person's act.

    Attributes:
        time: When it was seen [s].
        port: What it was called when it was opened.
        device: What it is now, such as `/dev/ttyACM1`.
    """

    time: float
    port: str
    device: str

    def __str__(self) -> str:
        back = f"The board of port {self.port} is back as {self.device}"
        return f"{back}; configure and activate the arm to go on"


ArmEvent = FrameSent | CommandSent | BytesReceived | StateChanged | Faulted | BoardReturned
Observer = Callable[[ArmEvent], None]


class Outbox:
    """Events on their way to an observer: each once, in the order in which they were put.

    Whoever puts them under a lock delivers them after letting go of it, so that an observer may
    wait for a lock whose owner wants that one.

    Args:
        observe: Told of them.
    """

    def __init__(self, observe: Observer) -> None:
        self._observe = observe
        self._events = deque[ArmEvent]()
        self._delivering = threading.RLock()  # an observer may bring about the next event

    def put(self, event: ArmEvent) -> None:
        """Add an event."""
        self._events.append(event)

    def deliver(self, patience: float = 0.0) -> None:
        """Tell all that was put; where another thread is at it, that one does.

        Args:
            patience: How long to wait for that thread to end [s].
        """
        while self._delivering.acquire(timeout=patience):
            try:
                while self._events:
                    self._observe(self._events.popleft())
            finally:
                self._delivering.release()
            if not self._events:  # who put one meanwhile may have left it to this thread
                return

"""Events that the arm reports to its observer. Times are on the injected clock [s]."""

import threading
from collections import deque
from collections.abc import Callable

from hardware.drivers.board_protocol import Measurement
from hardware.errors import HardwareError
from hardware.loading.dataclass import dataclass

from .lifecycle import State

# Longest time that a close of the arm waits for a slow observer [s]. The observer may itself wait
# for a lock of the closing thread.
OBSERVER_TIMEOUT = 0.5


@dataclass(frozen=True, slots=True)
class FrameSent:
    """A frame was written.

    Attributes:
        time: Time of the write [s].
        data: Bytes of the frame.
        positions: Commanded positions, one per actuated joint [rad].
        scheduled: Planned time of the write [s]; None for the hold frame of a stop.
    """

    time: float
    data: bytes
    positions: tuple[float, ...]
    scheduled: float | None


@dataclass(frozen=True, slots=True)
class CommandSent:
    """Bytes other than a frame were written: a setting of the board, or a request to it.

    Attributes:
        time: Time of the write [s].
        data: The bytes.
        request: True if the bytes only request an answer.
    """

    time: float
    data: bytes
    request: bool = False


@dataclass(frozen=True, slots=True)
class BytesReceived:
    """The board sent bytes.

    Attributes:
        time: Time of the read [s].
        data: The bytes.
    """

    time: float
    data: bytes


@dataclass(frozen=True, slots=True)
class Measured:
    """The board measured its joints.

    Attributes:
        time: Time at which the last bytes of the measurement were read [s].
        measurement: The measured values.
    """

    time: float
    measurement: Measurement


@dataclass(frozen=True, slots=True)
class StateChanged:
    """The lifecycle changed its state.

    Attributes:
        time: Time of the change [s].
        label: Name of the transition.
        start: State before the transition.
        goal: State after the transition.
    """

    time: float
    label: str
    start: State
    goal: State


@dataclass(frozen=True, slots=True)
class Faulted:
    """An error occurred while the arm was active.

    Attributes:
        time: Time of the error [s].
        error: The error.
    """

    time: float
    error: HardwareError


@dataclass(frozen=True, slots=True)
class BoardReturned:
    """A lost board was plugged in again. Only a person may then activate the arm.

    Attributes:
        time: Time at which the board was found [s].
        port: Name under which the port of the board was opened.
        device: Present device of the board, such as `/dev/ttyACM1`.
    """

    time: float
    port: str
    device: str

    def __str__(self) -> str:
        back = f"The board of port {self.port} is back as {self.device}"
        return f"{back}; configure and activate the arm to continue"


ArmEvent = (
    FrameSent | CommandSent | BytesReceived | Measured | StateChanged | Faulted | BoardReturned
)
Observer = Callable[[ArmEvent], None]


class Outbox:
    """Delivers every event to an observer once, in the order of `put`.

    A caller that puts events under a lock must release the lock before it delivers them. The
    observer may then wait for that lock without a deadlock.

    Args:
        observe: Callback for every event.
    """

    def __init__(self, observe: Observer) -> None:
        self._observe = observe
        self._events = deque[ArmEvent]()
        self._delivering = threading.RLock()  # the observer may cause the next event

    def put(self, event: ArmEvent) -> None:
        """Add an event."""
        self._events.append(event)

    def deliver(self, timeout: float = 0.0) -> None:
        """Deliver all events, or leave them to another thread that is delivering.

        Args:
            timeout: Longest time to wait for that thread [s].
        """
        while self._delivering.acquire(timeout=timeout):
            try:
                while self._events:
                    self._observe(self._events.popleft())
            finally:
                self._delivering.release()
            if not self._events:  # another thread may have left an event to this one
                return

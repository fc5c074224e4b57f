"""Drops repeated measurements of a resting arm from the recording."""

import math
import threading
from collections.abc import Callable

from hardware import ArmEvent, BytesReceived, CommandSent, FrameSent, Measured, Measurement

# Largest change of a resting arm that counts as noise: [rad], share of the torque, [C], [V], count.
_CHANGES = {
    "position": math.radians(0.5),
    "effort": 0.1,
    "temperature": 1.0,
    "voltage": 0.5,
    "lost": 1.0,
}
_LONGEST = 10.0  # longest time between records of a resting arm [s]


class Exchanges:
    """Drops exchanges with a board if its measurement has not changed.

    A resting arm is polled several times a second, usually with equal measurements. An exchange is
    a request, the bytes of its answers, and the measurement. A whole exchange is recorded if a
    frame was sent since the last record, if the measurement has changed, if 10 s have passed, or if
    the answer is incomplete. All other events are recorded at once. Thread-safe.

    Args:
        record: Callback that records an event.
    """

    def __init__(self, record: Callable[[ArmEvent], None]) -> None:
        self._record = record
        self._held: list[ArmEvent] = []  # the exchange so far
        self._last: Measured | None = None  # last recorded measurement; None to record the next one
        self._lock = threading.RLock()

    def restart(self) -> None:
        """Record the next exchange, because a new recording begins."""
        with self._lock:
            self._last = None

    def take(self, event: ArmEvent) -> None:
        """Record an event, or keep it until its exchange is complete."""
        with self._lock:
            match event:
                case CommandSent(request=True):
                    self._release()  # the answer to the previous request was incomplete
                    self._held.append(event)
                case BytesReceived():
                    self._held.append(event)
                case Measured() if self._last and not _differs(self._last, event):
                    self._held.clear()
                case Measured():
                    self._release()
                    self._last = event
                    self._record(event)
                case _:
                    self._release()
                    if isinstance(event, FrameSent):
                        self._last = None
                    self._record(event)

    def _release(self) -> None:
        held, self._held = self._held, []
        for event in held:
            self._record(event)


def _differs(before: Measured, after: Measured) -> bool:
    late = after.time - before.time >= _LONGEST
    return late or any(
        abs(new - old) >= change
        for quantity, change in _CHANGES.items()
        for old, new in zip(
            _values(before.measurement, quantity), _values(after.measurement, quantity), strict=True
        )
    )


def _values(measurement: Measurement, quantity: str) -> tuple[float, ...]:
    values: tuple[float, ...] = getattr(measurement, quantity)
    return values

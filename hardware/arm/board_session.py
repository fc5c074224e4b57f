"""The protocol of a board during one connection, shared by the threads of the arm."""

import threading
from collections.abc import Sequence

from hardware.drivers.board_protocol import BoardProtocol, Measurement
from hardware.drivers.wire_format import Frame


class BoardSession:
    """The protocol of a board during one connection. It also counts sent frames. Thread-safe.

    Args:
        protocol: The protocol. Nothing else may use it.

    Attributes:
        sent: Number of frames sent.
    """

    def __init__(self, protocol: BoardProtocol) -> None:
        self._protocol = protocol
        self._lock = threading.RLock()  # a signal handler may stop the arm
        self.sent = 0

    @property
    def boot_frame(self) -> Frame | None:
        """Frame of the pose that the board reported, or None before the report."""
        return self._protocol.boot_frame

    @property
    def measured(self) -> Measurement | None:
        """Last measurement; None before the first one, or if the board does not measure."""
        return self._protocol.measured

    @property
    def acknowledged(self) -> int:
        """Number of acknowledged frames, or of sent frames if the board acknowledges none."""
        with self._lock:
            acknowledged = self._protocol.acknowledged
            return self.sent if acknowledged is None else acknowledged

    def all_acknowledged(self) -> bool:
        """Return True if the board has received every sent frame."""
        return self.acknowledged == self.sent

    @property
    def free_at(self) -> float:
        """Earliest time of the next frame [s]."""
        return self._protocol.free_at

    @property
    def next_poll(self) -> float:
        """Time of the next `poll` [s]; inf if no poll is due."""
        return self._protocol.next_poll

    def check_booted(self, port: str, waited: float) -> None:
        """Check that the board has sent every required report. See `BoardProtocol`."""
        with self._lock:
            self._protocol.check_booted(port, waited)

    def start_commands(self) -> bytes:
        """Return the bytes to send once, when the arm becomes active."""
        with self._lock:
            return self._protocol.start_commands()

    def hold_commands(self) -> bytes:
        """Return the bytes that hold the joints after a fault. See `BoardProtocol`."""
        with self._lock:
            return self._protocol.hold_commands()

    def torque_commands(self, on: bool) -> Sequence[bytes]:
        """Return the commands that switch the torque of all servos. See `BoardProtocol`."""
        with self._lock:
            return self._protocol.torque_commands(on)

    def note_sent(self, frame: Frame, now: float) -> None:
        """Count a frame that is about to be sent."""
        with self._lock:
            self.sent += 1
            self._protocol.note_sent(frame, now)

    def receive(self, data: bytes, now: float) -> bool:
        """Process received bytes. Raises the errors of the protocol.

        Returns:
            True if a value has changed. Threads may wait for such a change.
        """
        with self._lock:
            before = self._awaited
            self._protocol.receive(data, now)
            return self._awaited != before

    @property
    def _awaited(self) -> tuple[object, ...]:
        protocol = self._protocol
        free = protocol.free_at, protocol.next_poll
        return protocol.boot_frame, protocol.acknowledged, protocol.measured, *free

    def poll(self, now: float) -> bytes:
        """Return a request to send now, or no bytes. Raises the errors of the protocol."""
        with self._lock:
            return self._protocol.poll(now) if now >= self._protocol.next_poll else b""

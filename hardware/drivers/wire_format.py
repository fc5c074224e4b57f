"""The wire format of a driver: joint positions to frames and back."""

from collections.abc import Sequence
from typing import Protocol

from hardware.loading.dataclass import dataclass
from hardware.printable import wire_text


@dataclass(frozen=True, slots=True)
class Frame:
    """One command to all servos.

    Attributes:
        servos: Servo angles in the order of the joints, in the unit of the servos.
        data: Bytes to send. They may be binary.
    """

    servos: tuple[int, ...]
    data: bytes

    def __str__(self) -> str:
        return wire_text(self.data)


class WireFormat(Protocol):
    """Converts joint positions to frames and back."""

    def encode(self, positions: Sequence[float]) -> Frame:
        """Return the frame for joint positions, one per actuated joint [rad].

        Raises:
            BadPosition: A position is missing, not a number, not finite or outside its limits.
        """

    def frame(self, servos: Sequence[int]) -> Frame:
        """Return the frame for servo angles, in the unit of the servos."""

    def decode(self, frame: Frame) -> tuple[float, ...]:
        """Return the joint positions of a frame, within their limits [rad]."""

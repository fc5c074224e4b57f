"""The wire format: joint values to frames such as `b090,s090,e090,g000,` and back.

The order of the operations is that of the published driver and must stay: the value is truncated,
so an equal formula in another order gives other bytes.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass

from hardware.drivers.driver import Frame
from hardware.errors import BadPosition
from hardware.joints import Joint, check_position

ANGLE_MAX = 180  # of a servo [deg]


@dataclass(frozen=True, slots=True)
class WireField:
    """How one joint travels in a frame, in servo degrees.

    The value is `trunc((sign * q + offset) * 180 / span)`, and 180 minus that where `reversed`.

    Attributes:
        letter: Names the servo on the wire.
        sign: +1 or -1, applied to the joint value.
        offset: Added to the signed joint value [rad].
        span: Joint travel that the servo's 180 degrees cover [rad].
        reversed: Whether the servo is mounted the other way round.
    """

    letter: str
    sign: int
    offset: float
    span: float
    reversed: bool


class Codec:
    """Encodes the actuated joints of a robot into frames.

    Args:
        joints: The joints with a servo, in the order of their fields.

    Attributes:
        letters: The letters of the fields, in order.
    """

    def __init__(self, joints: Sequence[Joint]) -> None:
        self._fields = [(j, j.wire) for j in joints if isinstance(j.wire, WireField)]
        self.letters = "".join(wire.letter for _, wire in self._fields)
        self._pattern = re.compile(re.sub("(.)", r"\1([0-9]{3}),", self.letters).encode())

    def encode(self, positions: Sequence[float]) -> Frame:
        """The frame for joint positions [rad].

        Args:
            positions: One value per actuated joint.

        Raises:
            BadPosition: A value is missing, not a number, not finite or outside its limits.
        """
        if len(positions) != len(self._fields):
            names = ", ".join(joint.name for joint, _ in self._fields)
            raise BadPosition(f"{len(positions)} values for {len(self._fields)} joints: {names}")
        fields = zip(self._fields, positions, strict=True)
        return self.frame([servo_angle(w, check_position(joint, q)) for (joint, w), q in fields])

    def frame(self, servos: Sequence[int]) -> Frame:
        """The frame for servo angles [deg], each from 0 to 180."""
        fields = zip(self._fields, servos, strict=True)
        text = "".join(f"{wire.letter}{angle:03d}," for (_, wire), angle in fields)
        return Frame(tuple(servos), text.encode())

    def parse(self, data: bytes) -> Frame:
        """The frame that these bytes spell.

        Raises:
            ValueError: They are no frame of this robot.
        """
        match = self._pattern.fullmatch(data)
        servos = tuple(int(angle) for angle in match.groups()) if match else ()
        if match is None or max(servos) > ANGLE_MAX:
            raise ValueError(f"{data!r} is no frame such as {self.frame([0] * len(self._fields))}")
        return Frame(servos, data)

    def decode(self, frame: Frame) -> tuple[float, ...]:
        """The joint positions that a frame stands for [rad].

        Truncation maps a whole bin of positions to one angle; this is the middle of the bin, moved
        inside the limits.
        """
        return tuple(
            min(max(_joint(wire, angle), joint.lower), joint.upper)
            for (joint, wire), angle in zip(self._fields, frame.servos, strict=True)
        )


def servo_angle(wire: WireField, q: float) -> int:
    """The servo angle [deg] that a joint value [rad] travels as."""
    angle = int(((wire.sign * q + wire.offset) * 180) / wire.span)
    return 180 - angle if wire.reversed else angle


def _joint(wire: WireField, servo: int) -> float:
    angle = 180 - servo if wire.reversed else servo
    return wire.sign * ((angle + 0.5) * wire.span / 180 - wire.offset)

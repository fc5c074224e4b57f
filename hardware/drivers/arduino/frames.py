"""The wire format: joint positions to frames such as `b090,s090,e090,g000,` and back.

The order of the arithmetic is that of the published driver, and must not change. Angles are
truncated, so another order of the same formula can give other bytes.
"""

import re
from collections.abc import Sequence

from hardware.drivers.wire_format import Frame
from hardware.joints import Joint, check_positions
from hardware.loading.dataclass import dataclass

ANGLE_MAX = 180  # largest angle of a servo [deg]


@dataclass(frozen=True, slots=True)
class WireField:
    """The encoding of one joint in a frame, as a servo angle in degrees.

    The angle is `trunc((sign * q + offset) * 180 / span)`, or 180 minus this value if `reversed`.

    Attributes:
        letter: Letter of the servo in a frame.
        sign: +1 or -1, the factor of the joint position.
        offset: Added to the signed joint position [rad].
        span: Range of the joint over the 180 degrees of the servo [rad].
        reversed: True if the servo turns in the opposite direction.
    """

    letter: str
    sign: int
    offset: float
    span: float
    reversed: bool


class Codec:
    """Encodes the positions of the actuated joints into frames, and decodes them.

    Args:
        joints: The actuated joints, in the order of their fields.

    Attributes:
        letters: Letters of the fields, in order.
    """

    def __init__(self, joints: Sequence[Joint]) -> None:
        self._fields = [(j, j.wire) for j in joints if isinstance(j.wire, WireField)]
        self.letters = "".join(wire.letter for _, wire in self._fields)
        self._pattern = re.compile(re.sub("(.)", r"\1([0-9]{3}),", self.letters).encode())

    def encode(self, positions: Sequence[float]) -> Frame:
        """Return the frame for joint positions.

        Args:
            positions: One position per actuated joint [rad].

        Raises:
            BadPosition: A position is missing, not a number, not finite or outside its limits.
        """
        checked = check_positions([joint for joint, _ in self._fields], positions)
        fields = zip(self._fields, checked, strict=True)
        return self.frame([servo_angle(wire, q) for (_, wire), q in fields])

    def frame(self, servos: Sequence[int]) -> Frame:
        """Return the frame for servo angles, each from 0 to 180 [deg]."""
        fields = zip(self._fields, servos, strict=True)
        text = "".join(f"{wire.letter}{angle:03d}," for (_, wire), angle in fields)
        return Frame(tuple(servos), text.encode())

    def parse(self, data: bytes) -> Frame:
        """Return the frame with these bytes.

        Raises:
            ValueError: The bytes are not a frame of this robot.
        """
        match = self._pattern.fullmatch(data)
        servos = tuple(int(angle) for angle in match.groups()) if match else ()
        if match is None or max(servos) > ANGLE_MAX:
            wanted = self.frame([0] * len(self._fields))
            raise ValueError(f"{data!r} is not a frame such as {wanted}")
        return Frame(servos, data)

    def decode(self, frame: Frame) -> tuple[float, ...]:
        """Return the joint positions of a frame, clipped to the joint limits [rad].

        Truncation maps an interval of positions to one angle. The result is the middle of the
        interval.
        """
        return tuple(
            min(max(_position(wire, angle), joint.lower), joint.upper)
            for (joint, wire), angle in zip(self._fields, frame.servos, strict=True)
        )


def servo_angle(wire: WireField, q: float) -> int:
    """Return the servo angle [deg] for a joint position [rad]."""
    angle = int(((wire.sign * q + wire.offset) * 180) / wire.span)
    return 180 - angle if wire.reversed else angle


def _position(wire: WireField, servo: int) -> float:
    angle = 180 - servo if wire.reversed else servo
    return wire.sign * ((angle + 0.5) * wire.span / 180 - wire.offset)

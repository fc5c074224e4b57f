"""The driver of an arm whose robot file names none: it moves on the virtual port only.

Its frames are the positions in millionths of a radian or metre, so that every arm can be planned
for, moved and recorded before its board is known.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from hardware.clock import Clock, RealClock
from hardware.errors import BadPosition, NoDriver
from hardware.joints import Joint, check_position
from hardware.link.link import VIRTUAL
from hardware.toml_table import TomlTable

from .driver import Frame
from .firmware_profile import Firmware

NO_FIRMWARE = Firmware("none", 50.0, 0.0, 10**9, 10**6, 0.0, b"")  # no limit of steps and buffer
NO_BAUD = 4_000_000  # [bit/s]
_RESOLUTION = 1e-6  # [rad or m]
_FIELD = re.compile(rb"([+-][0-9]{9,}),")


class NullWireFormat:
    """Converts joint positions to frames such as `+000785398,-000100000,` and back.

    Args:
        joints: The actuated joints, in the order of their fields.
    """

    def __init__(self, joints: Sequence[Joint]) -> None:
        self._joints = tuple(joints)

    def encode(self, positions: Sequence[float]) -> Frame:
        """Return the frame for joint positions, one per actuated joint [rad].

        Raises:
            BadPosition: A position is missing, not a number, not finite or outside its limits.
        """
        if len(positions) != len(self._joints):
            names = ", ".join(joint.name for joint in self._joints)
            raise BadPosition(f"{len(positions)} values for {len(self._joints)} joints: {names}")
        pairs = zip(self._joints, positions, strict=True)
        return self.frame([round(check_position(joint, q) / _RESOLUTION) for joint, q in pairs])

    def frame(self, servos: Sequence[int]) -> Frame:
        """Return the frame for positions in millionths of a radian or metre."""
        return Frame(tuple(servos), "".join(f"{servo:+010d}," for servo in servos).encode())

    def parse(self, data: bytes) -> Frame:
        """Return the frame with these bytes.

        Raises:
            ValueError: They are not a frame of this robot.
        """
        frame = self.frame([int(field) for field in _FIELD.findall(data)])
        if frame.data != data or len(frame.servos) != len(self._joints):
            raise ValueError(f"{data!r} is no frame such as {self.frame([0] * len(self._joints))}")
        return frame

    def decode(self, frame: Frame) -> tuple[float, ...]:
        """Return the joint positions of a frame, within their limits [rad]."""
        return tuple(
            min(max(servo * _RESOLUTION, joint.lower), joint.upper)
            for joint, servo in zip(self._joints, frame.servos, strict=True)
        )


class NullLink:
    """A link without a board: it accepts all bytes and never answers.

    Args:
        clock: Time source.
    """

    port = VIRTUAL

    def __init__(self, clock: Clock) -> None:
        self._changed, self._open = clock.signal(), False

    def open(self) -> None:
        """Open the link."""
        self._open = True

    def write(self, data: bytes) -> None:
        """Drop the bytes."""

    def read(self) -> bytes:
        """Wait until the link is closed."""
        with self._changed:
            while self._open:
                self._changed.wait(None)
        return b""

    def close(self, discard: bool = False) -> None:
        """Close the link. A waiting `read` returns."""
        with self._changed:
            self._open = False
            self._changed.notify()


@dataclass(frozen=True)
class NullDriver:
    """A driver that moves nothing real.

    Attributes:
        path: Path of the robot file.
    """

    path: Path

    @property
    def firmwares(self) -> Mapping[str, Firmware]:
        """A profile without limits, because no firmware is named."""
        return {NO_FIRMWARE.name: NO_FIRMWARE}

    def wire(self, joint: TomlTable, lower: float, upper: float) -> None:
        """Refuse the key `wire`."""
        if "wire" in joint:
            joint.fail("wire", "needs a driver; write driver and [serial] too, or leave it out")

    def check(self, root: TomlTable, joints: Sequence[Joint], firmware: Firmware) -> None:
        """Accept any joints."""

    def wire_format(self, joints: Sequence[Joint]) -> NullWireFormat:
        """Return the conversion of positions to frames that no board reads."""
        return NullWireFormat(joints)

    def link(self, joints: Sequence[Joint], firmware: Firmware, baud: int, port: str) -> NullLink:
        """Return a link to nothing.

        Raises:
            NoDriver: The port is not `virtual`.
        """
        if port != VIRTUAL:
            raise NoDriver(self.path, port)
        return NullLink(RealClock())

"""The driver for a robot file without a driver. The arm moves on the virtual port only.

Its frames are the positions in millionths of a radian or metre. So armtree can plan, move and
record every arm before its board is known.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NoReturn

from hardware.errors import NoDriver
from hardware.joints import Joint, check_positions
from hardware.loading.dataclass import dataclass
from hardware.toml_table import TomlTable

from .board_protocol import BoardProtocol
from .firmware_profile import Firmware
from .wire_format import Frame

NO_FIRMWARE = Firmware("none", rate=50.0, max_step=10**9)  # 10**9: no limit of steps
NO_BAUD = 4_000_000  # [bit/s]
_RESOLUTION = 1e-6  # [rad or m]


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
        checked = check_positions(self._joints, positions)
        return self.frame([round(q / _RESOLUTION) for q in checked])

    def frame(self, servos: Sequence[int]) -> Frame:
        """Return the frame for positions in millionths of a radian or metre."""
        return Frame(tuple(servos), "".join(f"{servo:+010d}," for servo in servos).encode())

    def decode(self, frame: Frame) -> tuple[float, ...]:
        """Return the joint positions of a frame, clipped to the joint limits [rad]."""
        return tuple(
            min(max(servo * _RESOLUTION, joint.lower), joint.upper)
            for joint, servo in zip(self._joints, frame.servos, strict=True)
        )


@dataclass(frozen=True, slots=True)
class NullDriver:
    """A driver that moves nothing real.

    Attributes:
        path: Path of the robot file.
    """

    path: Path

    @property
    def firmwares(self) -> Mapping[str, Firmware]:
        """A profile without limits, because the robot file names no firmware."""
        return {NO_FIRMWARE.name: NO_FIRMWARE}

    def wire(self, joint: TomlTable, lower: float, upper: float) -> None:
        """Refuse the key `wire`."""
        if "wire" in joint:
            joint.fail("wire", "needs a driver; write driver and [serial] too, or leave wire out")

    def check(self, root: TomlTable, joints: Sequence[Joint], firmware: Firmware) -> None:
        """Accept any joints."""

    def wire_format(self, joints: Sequence[Joint], firmware: Firmware) -> NullWireFormat:
        """Return the wire format. No board reads frames of this format."""
        return NullWireFormat(joints)

    def protocol(
        self, joints: Sequence[Joint], firmware: Firmware, robot_file: Path
    ) -> BoardProtocol:
        """Return the protocol of a board that sends nothing."""
        return BoardProtocol()

    def link(self, joints: Sequence[Joint], firmware: Firmware, baud: int, port: str) -> NoReturn:
        """Raise NoDriver."""
        raise NoDriver(self.path, port)

    def model(self, joints: Sequence[Joint], firmware: Firmware, baud: int) -> None:
        """Return None: there is no board."""

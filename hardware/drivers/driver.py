"""The driver interface: what armtree needs to speak to one kind of board.

A robot file names its driver, which is found among the entry points `armtree.hardware`, so an
installed package may add one. Limits, lifecycle, pacing and stop are the same for every driver.

A firmware with a `banner` speaks the protocol of `arduino/firmware/README.md`, acknowledgements
included. A board with another protocol must leave `banner` empty: its bytes are recorded but not
interpreted.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

from hardware.joints import Joint
from hardware.link.link import Link
from hardware.printable import wire_text
from hardware.toml_table import TomlTable

from .firmware_profile import Firmware

GROUP = "armtree.hardware"


@dataclass(frozen=True, slots=True)
class Frame:
    """One command to all servos.

    Attributes:
        servos: Servo angles in the order of the fields, in the unit of the servos.
        data: Bytes that are sent.
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

    def parse(self, data: bytes) -> Frame:
        """Return the frame with these bytes.

        Raises:
            ValueError: They are not a frame of this robot.
        """

    def decode(self, frame: Frame) -> tuple[float, ...]:
        """Return the joint positions of a frame, within their limits [rad]."""


class Driver(Protocol):
    """The driver of one kind of board. Created without arguments; equal drivers behave equally."""

    @property
    def firmwares(self) -> Mapping[str, Firmware]:
        """The firmwares that the board may run, by their names in a robot file."""

    def wire(self, joint: TomlTable, lower: float, upper: float) -> object:
        """Read how a joint is encoded in a frame, from the key `wire` of its table.

        Args:
            joint: Table of the joint. It rejects wrong values.
            lower: Smallest position of the joint [rad].
            upper: Largest position of the joint [rad].

        Raises:
            DescriptionError: The table is wrong.
        """

    def check(self, root: TomlTable, joints: Sequence[Joint], firmware: Firmware) -> None:
        """Check that the board can drive the joints.

        Args:
            root: Root table of the robot file.
            joints: The actuated joints.
            firmware: Firmware of the board.

        Raises:
            DescriptionError: It cannot.
        """

    def wire_format(self, joints: Sequence[Joint]) -> WireFormat:
        """Return the wire format of the actuated joints."""

    def link(self, joints: Sequence[Joint], firmware: Firmware, baud: int, port: str) -> Link:
        """Return a link to a board that drives the actuated joints.

        Args:
            joints: The actuated joints.
            firmware: Firmware of the board.
            baud: Speed of the line [bit/s].
            port: Name of the port; `virtual` needs no hardware.
        """


def load_driver(root: TomlTable) -> Driver:
    """Load the driver that a robot file names.

    Args:
        root: Root table of the robot file.

    Raises:
        DescriptionError: There is no driver of that name, or it cannot be loaded.
    """
    from importlib.metadata import entry_points  # slow to import

    present = {point.name: point for point in entry_points(group=GROUP)}
    name = root.choice("driver", present)
    try:
        driver: Driver = present[name].load()()
    except Exception as error:  # code of another package may raise any exception
        root.fail("driver", f"{name} cannot be loaded from {present[name].value}: {error!r}")
    return driver

"""The driver interface: the parts that armtree needs for one kind of board.

A robot file names its driver. Drivers are entry points of the group `armtree.hardware`, so an
installed package may add one. Limits, lifecycle, pacing and stop are the same for every driver.

A driver has five parts: the firmware profile (what the host must know of the board), the wire
format (joint positions to frames and back), the protocol (all messages other than frames), the link
(a byte stream), and optionally a model of the board.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Protocol

from hardware.installed import entry_points
from hardware.joints import Joint
from hardware.link.link import Link
from hardware.toml_table import TomlTable

from .board_protocol import BoardProtocol
from .firmware_profile import Firmware
from .virtual.model import BoardModel
from .wire_format import WireFormat

GROUP = "armtree.hardware"


class Driver(Protocol):
    """The driver of one kind of board. armtree creates the driver without arguments."""

    @property
    def firmwares(self) -> Mapping[str, Firmware]:
        """The firmwares that the board may run, by their names in a robot file."""

    def wire(self, joint: TomlTable, lower: float, upper: float) -> object:
        """Read the encoding of a joint from the key `wire` of its table.

        Args:
            joint: Table of the joint in the robot file. Methods of the table reject wrong values.
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
            DescriptionError: The board cannot drive a joint.
        """

    def wire_format(self, joints: Sequence[Joint], firmware: Firmware) -> WireFormat:
        """Return the wire format of the actuated joints for a firmware."""

    def protocol(
        self, joints: Sequence[Joint], firmware: Firmware, robot_file: Path
    ) -> BoardProtocol:
        """Return the protocol of a connection that is about to be opened.

        Args:
            joints: The actuated joints.
            firmware: Firmware of the board.
            robot_file: The robot file, for messages.
        """

    def link(self, joints: Sequence[Joint], firmware: Firmware, baud: int, port: str) -> Link:
        """Return a link to a real board that drives the actuated joints.

        Args:
            joints: The actuated joints.
            firmware: Firmware of the board.
            baud: Speed of the line [bit/s].
            port: Name of the port, which is not `virtual`.
        """

    def model(self, joints: Sequence[Joint], firmware: Firmware, baud: int) -> BoardModel | None:
        """Return a model of the board in the start pose of the arm, for the port `virtual`.

        Returns None if there is no model. The port then accepts all bytes and never answers.

        Args:
            joints: The actuated joints.
            firmware: Firmware of the board.
            baud: Speed of the line [bit/s].
        """


def load_driver(root: TomlTable) -> Driver:
    """Load the driver that a robot file names.

    Args:
        root: Root table of the robot file.

    Raises:
        DescriptionError: No driver has that name, or the driver cannot be loaded.
    """
    present = entry_points(GROUP)
    name = root.choice("driver", present)
    try:
        driver: Driver = present[name].load()()
    except Exception as error:  # code of another package may raise any exception
        root.fail("driver", f"{name} cannot be loaded from {present[name].value}: {error!r}")
    return driver

"""The robot as data: joints, groups, limits, and the board it hangs on."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from hardware.drivers.driver import Driver, WireFormat
from hardware.drivers.firmware import Firmware
from hardware.drivers.null_driver import NullDriver
from hardware.joints import Joint
from hardware.link.link import Link


@dataclass(frozen=True, slots=True)
class Serial:
    """The serial line.

    Attributes:
        port: Device, `virtual`, or empty where the robot file names none.
        baud: [bit/s].
        boot_wait: How long after opening the board listens [s].
        resets: Whether opening it resets the board.
    """

    port: str
    baud: int
    boot_wait: float
    resets: bool = True


@dataclass(frozen=True, slots=True)
class CollisionRules:
    """What may not touch, and how near is too near.

    Attributes:
        margin: Distance that planning keeps [m].
        allowed: Pairs of links that are not checked.
        floor: Height of the floor in the URDF's root frame [m]; None for no floor.
        floor_ignores: Links that may stand on or in the floor.
    """

    margin: float
    allowed: frozenset[frozenset[str]]
    floor: float | None
    floor_ignores: frozenset[str]


@dataclass(frozen=True, slots=True)
class Tool:
    """What the arm works with: the point that goes where a task says.

    Attributes:
        link: That carries it.
        offset: Where it is in the frame of that link [m].
        axis: Where it points in that frame.
    """

    link: str
    offset: tuple[float, float, float]
    axis: tuple[float, float, float]


@dataclass(frozen=True)
class Robot:
    """A robot description, checked.

    Attributes:
        name: Name of the robot.
        path: The robot file.
        urdf: The URDF file.
        joints: All moving joints, mimics included, in the order of the robot file.
        groups: Group name to the names of its joints, mimics included.
        serial: The line to the board.
        driver: What speaks to the board.
        firmware: What runs on the board.
        collision: What may not touch.
        tool: What it works with; None where the file does not say.
        brake: How long a stop slows the motion down before it holds [s]; 0 to hold at once.
        links: Names of all links.
    """

    name: str
    path: Path
    urdf: Path
    joints: tuple[Joint, ...]
    groups: Mapping[str, tuple[str, ...]]
    serial: Serial
    driver: Driver
    firmware: Firmware
    collision: CollisionRules
    tool: Tool | None = None
    brake: float = 0.0
    links: tuple[str, ...] = ()

    @property
    def actuated(self) -> tuple[Joint, ...]:
        """Joints that move of their own, in the order of their fields in a frame."""
        return tuple(joint for joint in self.joints if joint.mimic is None)

    @property
    def has_driver(self) -> bool:
        """Whether its file names a driver, so that it can be moved."""
        return not isinstance(self.driver, NullDriver)

    @cached_property
    def wire_format(self) -> WireFormat:
        """Joint positions to frames and back.

        Raises:
            NoDriver: Its robot file names none.
        """
        return self.driver.wire_format(self.actuated)

    @property
    def boot_pose(self) -> tuple[float, ...]:
        """Where a reset puts the actuated joints [rad]."""
        return tuple(joint.boot for joint in self.actuated)

    @property
    def open_effect(self) -> str:
        """What the arm does when its port is opened."""
        return self.firmware.reset_effect if self.serial.resets else "stays where it is"

    def link(self, port: str) -> Link:
        """The line to its board on a port.

        Raises:
            NoDriver: Its robot file names none.
        """
        return self.driver.link(self.actuated, self.firmware, self.serial.baud, port)

    def joint(self, name: str) -> Joint:
        """The joint of that name.

        Raises:
            KeyError: There is none; the message lists the joints there are.
        """
        for joint in self.joints:
            if joint.name == name:
                return joint
        raise KeyError(f"no joint {name}; there are {', '.join(j.name for j in self.joints)}")

    def actuated_in(self, group: str) -> tuple[Joint, ...]:
        """The joints of a group that move of their own, mimics left out."""
        members = (self.joint(name) for name in self.groups[group])
        return tuple(joint for joint in members if joint.mimic is None)

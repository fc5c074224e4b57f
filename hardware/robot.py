"""The robot as data: joints, groups, limits, and the board it hangs on."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

from .profiles import Firmware

if TYPE_CHECKING:
    from .driver import Driver, WireFormat


@dataclass(frozen=True, slots=True)
class Mimic:
    """A joint that follows another: `multiplier * leader + offset`.

    Attributes:
        leader: Name of the joint it follows.
        multiplier: Unitless.
        offset: [rad].
    """

    leader: str
    multiplier: float
    offset: float

    def value(self, leader: float) -> float:
        """The follower's value [rad] for the leader's [rad]."""
        return self.multiplier * leader + self.offset


@dataclass(frozen=True, slots=True)
class Joint:
    """One moving joint.

    Attributes:
        name: As in the URDF.
        lower: Smallest position [rad].
        upper: Largest position [rad].
        velocity: Limit [rad/s].
        acceleration: Limit [rad/s2].
        boot: Where a reset of the board puts it [rad].
        mimic: Whom it follows; None for a joint of its own.
        wire: How it travels in a frame, as its driver read it; None for a joint that has no servo
            of its own.
    """

    name: str
    lower: float
    upper: float
    velocity: float
    acceleration: float
    boot: float
    mimic: Mimic | None
    wire: object | None


@dataclass(frozen=True, slots=True)
class Serial:
    """The serial line.

    Attributes:
        port: Device, `virtual`, or empty where the robot file names none.
        baud: [bit/s].
        boot_wait: How long after opening the board listens [s].
    """

    port: str
    baud: int
    boot_wait: float


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
        brake: How long a stop slows the motion down before it holds [s]; 0 to hold at once.
    """

    name: str
    path: Path
    urdf: Path
    joints: tuple[Joint, ...]
    groups: Mapping[str, tuple[str, ...]]
    serial: Serial
    driver: "Driver"
    firmware: Firmware
    collision: CollisionRules
    brake: float = 0.0

    @property
    def actuated(self) -> tuple[Joint, ...]:
        """Joints with a servo, in the order of their fields in a frame."""
        return tuple(joint for joint in self.joints if joint.wire)

    @cached_property
    def wire_format(self) -> "WireFormat":
        """Joint positions to frames and back."""
        return self.driver.wire_format(self.actuated)

    @property
    def boot_pose(self) -> tuple[float, ...]:
        """Where a reset puts the actuated joints [rad]."""
        return tuple(joint.boot for joint in self.actuated)

    def joint(self, name: str) -> Joint:
        """The joint of that name.

        Raises:
            KeyError: There is none; the message lists the joints there are.
        """
        for joint in self.joints:
            if joint.name == name:
                return joint
        raise KeyError(f"no joint {name}; there are {', '.join(j.name for j in self.joints)}")

    def leaders(self, group: str) -> tuple[Joint, ...]:
        """The joints of a group that move of their own, mimics left out."""
        members = (self.joint(name) for name in self.groups[group])
        return tuple(joint for joint in members if joint.mimic is None)

"""The robot as data: joints, groups, limits and board."""

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import field, replace
from functools import cached_property, partial
from pathlib import Path
from typing import cast

from hardware.clock import Clock, RealClock
from hardware.drivers.board_protocol import BoardProtocol
from hardware.drivers.driver import Driver
from hardware.drivers.firmware_profile import Ability, Firmware
from hardware.drivers.null_driver import NullDriver
from hardware.drivers.servo_bus import ServoBus, ServoDriver
from hardware.drivers.servo_errors import CalibrationMissing
from hardware.drivers.virtual.in_process_link import BoardLink, NullLink
from hardware.drivers.virtual.model import BoardModel
from hardware.drivers.wire_format import Frame, WireFormat
from hardware.errors import NotAble, PoseOutsideLimits
from hardware.joints import Joint, joint_words, rounded
from hardware.link.link import VIRTUAL, Link
from hardware.loading.dataclass import dataclass

from .calibration import CalibratedJoint, calibrate_command, calibration_file
from .forward_kinematics import ForwardKinematics, reach
from .gripper import Gripper, closing
from .guards import OPENING, Guards
from .meshes import find_mesh
from .urdf import Urdf

# Margin at the ends of a calibrated range, so that the joint does not push against its stop [deg].
RANGE_MARGIN = 1.0

TURNS = ("roll", "pitch", "yaw")  # names of the rotations of a tool
POINT_JOINTS = 3  # number of joints that hold a tool at a point
_FREE_JOINTS = 6  # number of joints that hold a tool at a point in any orientation


@dataclass(frozen=True, slots=True)
class Serial:
    """The serial line.

    Attributes:
        port: Device, or `virtual`; empty if the robot file names no port.
        baud: Speed of the line [bit/s].
        boot_wait: Time from opening the port until the board reads from it [s].
        resets: True if opening the port resets the board.
    """

    port: str
    baud: int
    boot_wait: float
    resets: bool = True


@dataclass(frozen=True, slots=True)
class CollisionRules:
    """Rules of collision checking.

    Attributes:
        margin: Smallest distance between bodies in a plan [m].
        allowed: Pairs of links that are not checked.
        floor: Height of the floor in the root frame of the URDF [m]; None for no floor.
        floor_ignores: Links that may touch or intersect the floor.
        start_contact: Deepest overlap of bodies in which a motion may start [m]; 0 if a motion may
            not start closer than the margin. The motion deepens an overlap by at most 1 mm.
    """

    margin: float
    allowed: frozenset[frozenset[str]]
    floor: float | None
    floor_ignores: frozenset[str]
    start_contact: float = 0.0


@dataclass(frozen=True, slots=True)
class Tool:
    """The tool center point (TCP), which moves to the targets of a task.

    Attributes:
        link: Name of the link that carries the tool.
        offset: Position of the TCP in the frame of that link [m].
        axis: Direction in which the tool points, in the same frame.
    """

    link: str
    offset: tuple[float, float, float]
    axis: tuple[float, float, float]


@dataclasses.dataclass(frozen=True)
class Robot:
    """A validated robot description.

    Attributes:
        name: Name of the robot.
        path: The robot file.
        urdf: The URDF file.
        joints: The independent joints in the order of the robot file, then the mimic joints.
        groups: Names of the joints of each group, mimic joints included.
        serial: The serial line.
        driver: Driver of the board.
        firmware: Firmware of the board.
        collision: Rules of collision checking.
        tool: The tool, or None if the robot file has none.
        gripper: The gripper, or None if the robot file does not define its width.
        brake: Time in which a stop slows the motion down before the hold [s]; 0 to hold at once.
        acceleration_sum: Largest sum of the absolute accelerations of all joints [rad/s2].
        needs_calibration: True if the robot must be calibrated before it moves on a real port.
        calibration: The calibration file, or None if there is none.
        guards: Limits of measured values; unused if the board measures nothing.
        links: Names of all links.
        home: Target of `armtree home`: poses and JOINT=VALUE; empty for the start pose.
        meshes: Files of meshes by their names in the URDF. Only for meshes that `find_mesh` would
            not find, as in a recording.
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
    gripper: Gripper | None = None
    brake: float = 0.0
    acceleration_sum: float = math.inf
    needs_calibration: bool = False
    calibration: Path | None = None
    guards: Guards = field(default_factory=Guards)
    links: tuple[str, ...] = ()
    home: tuple[str, ...] = ()
    meshes: Mapping[str, Path] = field(default_factory=dict)

    @property
    def actuated(self) -> tuple[Joint, ...]:
        """The joints that move independently, in the order of their fields in a frame."""
        return tuple(joint for joint in self.joints if joint.mimic is None)

    @property
    def files(self) -> tuple[Path, ...]:
        """The robot file, the URDF and, if there is one, the calibration."""
        return (self.path, self.urdf, *filter(None, [self.calibration]))

    @property
    def has_driver(self) -> bool:
        """True if the robot file names a driver. If not, only the port `virtual` can be used."""
        return not isinstance(self.driver, NullDriver)

    def __getstate__(self) -> dict[str, object]:
        """Return the attributes to pickle: all except the parsed URDF.

        The URDF is large, and few processes need it. The result is a copy, because another thread
        may cache a property during the pickling.
        """
        state = self.__dict__.copy()
        state.pop("description", None)
        return state

    @cached_property
    def description(self) -> Urdf:
        """The URDF. The file is read once, at the first use.

        Raises:
            OSError, ValueError, LookupError, UrdfError: `Urdf.read` failed.
        """
        return Urdf.read(self.urdf)

    @cached_property
    def wire_format(self) -> WireFormat:
        """The conversion of joint positions to frames and back."""
        return self.driver.wire_format(self.actuated, self.firmware)

    @property
    def boot_pose(self) -> tuple[float, ...]:
        """Positions in the start pose, one per actuated joint [rad]."""
        return tuple(joint.boot for joint in self.actuated)

    def by_joint(self, values: Sequence[float]) -> dict[str, float]:
        """Return values by the name of their joint.

        Args:
            values: One value per actuated joint.
        """
        names = (joint.name for joint in self.actuated)
        return dict(zip(names, values, strict=True))

    def of_all_joints(self, positions: Mapping[str, float]) -> dict[str, float]:
        """Return the positions of all joints by name, also of mimic joints [rad].

        Args:
            positions: Positions of the actuated joints by name [rad].
        """
        return {
            joint.name: joint.mimic.value(positions[joint.mimic.leader])
            if joint.mimic
            else positions[joint.name]
            for joint in self.joints
        }

    def pose_of(self, frame: Frame) -> tuple[float, ...]:
        """Return the pose in a frame that the board reports, one position per actuated joint [rad].

        Measured positions are moved within the limits, as `within_limits` does for a resting arm.

        Raises:
            PoseOutsideLimits: A servo is outside the limits of its joint.
        """
        pose = self.wire_format.decode(frame)  # decode moves it inside the limits
        nearest = self.wire_format.encode(pose).servos
        if frame.servos == nearest:
            return pose
        if self.can(Ability.MEASURE):
            return self.within_limits(self.unlimited.decode(frame), resting=True)
        words, pairs = self.firmware.words, zip(frame.servos, nearest, strict=True)
        outside, (angle, near) = next(
            (joint, pair)
            for joint, pair in zip(self.actuated, pairs, strict=True)
            if pair[0] != pair[1]
        )
        place, limit = f"{angle} {words.unit}", f"{near} {words.unit}"
        raise PoseOutsideLimits(outside.name, place, limit, words.advice_outside)

    @cached_property
    def unlimited(self) -> WireFormat:
        """The conversion of joint positions to frames and back, for joints without limits."""
        free = [replace(joint, lower=-math.inf, upper=math.inf) for joint in self.actuated]
        return self.driver.wire_format(free, self.firmware)

    def within_limits(self, measured: Sequence[float], resting: bool = False) -> tuple[float, ...]:
        """Return measured positions, moved within the limits of their joints [rad].

        At the end of a motion to its limit, a joint may be a little outside. A distance of
        `settle_deg` is accepted, as at the end of any motion.

        Args:
            measured: One position per actuated joint [rad].
            resting: True to accept `settle_deg` outside the calibrated range. A joint that rests on
                a stop is at the end of this range, which may exceed the limits of the URDF.

        Raises:
            PoseOutsideLimits: A joint is farther outside.
        """
        within, allowed = list[float](), math.radians(self.guards.settle_deg)
        for joint, q in zip(self.actuated, measured, strict=True):
            near = min(max(q, joint.lower), joint.upper)
            least, most = (resting and joint.swept) or (near, near)
            outside = max(min(least, near) - q, q - max(most, near))
            if outside > (allowed if joint.unit == "rad" else 0.0):
                place, limit = rounded(q, joint.unit), rounded(near, joint.unit)
                advice = self.firmware.words.advice_outside
                raise PoseOutsideLimits(joint.name, place, limit, advice)
            within.append(near)
        return tuple(within)

    @property
    def open_effect(self) -> str:
        """Effect on the arm of opening the port, as text for messages."""
        return self.firmware.words.reset_effect if self.serial.resets else "stays where it is"

    def can(self, ability: Ability) -> bool:
        """Return True if the board has an ability."""
        return ability in self.firmware.abilities

    def require(self, ability: Ability) -> None:
        """Check that the board has an ability.

        Raises:
            NotAble: The board does not have the ability.
        """
        if not self.can(ability):
            raise NotAble(self.name, self.firmware.name, ability.value)

    def protocol(self) -> BoardProtocol:
        """Return a new protocol of the board, for a connection that is about to be opened."""
        return self.driver.protocol(self.actuated, self.firmware, self.path)

    def model(self) -> BoardModel | None:
        """Return a model of the board in the start pose of the arm, or None if there is none."""
        return self.driver.model(self.actuated, self.firmware, self.serial.baud)

    def link(self, port: str) -> Link:
        """Return a link to the board on a port, or to a virtual board on the port `virtual`.

        Raises:
            NoDriver: The robot file names no driver, and the port is not `virtual`.
            CalibrationMissing: The arm must be calibrated before it moves on that port.
        """
        baud = self.serial.baud
        if port != VIRTUAL:
            if self.needs_calibration and not self.calibration:
                command = calibrate_command(self.path, port)
                raise CalibrationMissing(self.path, calibration_file(self.path), command)
            return self.driver.link(self.actuated, self.firmware, baud, port)
        from hardware.drivers.virtual.board_process import VirtualLink  # slow to import

        model = self.model()
        return VirtualLink(model, baud) if model else NullLink(RealClock())

    @property
    def servos(self) -> dict[str, int]:
        """Ids of the servos, by the names of their joints.

        Raises:
            NotAble: The board cannot identify servos.
        """
        return self._servo_driver.servos(self.actuated)

    @property
    def kept(self) -> dict[str, dict[str, int]]:
        """Values that calibrated servos must store, by the names of their joints.

        The names of the values are those in `ServoReport.kept`.

        Raises:
            NotAble: The board cannot identify servos.
        """
        return self._servo_driver.kept(self.actuated)

    def servo_bus(self, port: str, baud: int, clock: Clock) -> ServoBus:
        """Return a bus on a port, for requests to single servos. The bus is not open.

        Args:
            port: Name of the port, or `virtual`.
            baud: Speed of the line [bit/s].
            clock: Time source.

        Raises:
            NotAble: The board cannot identify servos.
        """
        if port == VIRTUAL:
            return self.servos_on(self.link(port), clock)
        link = self.driver.link(self.actuated, self.firmware, baud, port)
        return self.servos_on(link, clock)

    def servos_on(self, link: Link, clock: Clock) -> ServoBus:
        """Return a bus on a link that is not open. Raises the errors of `servo_bus`."""
        return self._servo_driver.servo_bus(self.firmware, link, clock)

    def calibrated(self, joint: Joint, kept: Mapping[str, int], turn: float) -> CalibratedJoint:
        """Return the calibration of a joint for the range that its servo stores.

        The middle of this range becomes the middle of the joint's limits in the URDF.

        Args:
            joint: The joint, with its limits in the URDF.
            kept: Values that its servo stores, by their names in `ServoReport.kept`: `least` and
                `most` are the range [ticks].
            turn: Angle of a tick [deg].
        """
        middle = (joint.lower + joint.upper) / 2
        wire = self._servo_driver.calibrated_wire(joint, self.firmware, kept, middle)
        half = max((kept["most"] - kept["least"]) * turn / 2 - RANGE_MARGIN, 0.0)
        centre = math.degrees(middle)
        return CalibratedJoint(centre - half, centre + half, wire, {})

    @property
    def _servo_driver(self) -> ServoDriver:
        self.require(Ability.IDENTIFY)
        return cast("ServoDriver", self.driver)

    def simulated_link(self, clock: Clock) -> Link:
        """Return a link to a virtual board in this process, on a clock that may be simulated."""
        model = self.model()
        return BoardLink(model, clock) if model else NullLink(clock)

    def mesh(self, name: str) -> Path:
        """Return the file of a mesh, by its name in the URDF.

        Raises:
            UrdfError: The file is not found, or it is unusable.
        """
        return self.meshes.get(name) or find_mesh(self.urdf, name)

    @cached_property
    def grips(self) -> dict[str, int]:
        """Direction in which each joint of the gripper grips, by its name: 1 or -1."""
        width = partial(self.gripper.width, self.kinematics) if self.gripper else abs
        way = -1 if self.guards.grips == OPENING else 1
        return {joint.name: way * closing(joint, width) for joint in self.actuated_in("gripper")}

    @cached_property
    def reach(self) -> float:
        """Upper bound of the distance of any link from the root [m]."""
        return reach(self.description)

    @cached_property
    def kinematics(self) -> ForwardKinematics:
        """Forward kinematics of the robot."""
        return ForwardKinematics(self.description)

    def tool_position(self, positions: Mapping[str, float]) -> tuple[float, float, float] | None:
        """Return the position of the tool in the root frame [m]; None if the robot has no tool.

        Args:
            positions: Position of every actuated joint [rad], by name.
        """
        if self.tool is None:
            return None
        return self.kinematics.locate(self.tool.link, self.tool.offset, positions)

    def width(self, positions: Mapping[str, float]) -> float | None:
        """Return the width of the gripper [m]; None if the robot file names no pads.

        Args:
            positions: Position of every actuated joint [rad], by name.
        """
        if self.gripper is None:
            return None
        return self.gripper.width(self.kinematics, positions[self.gripper.joint.name])

    def at_width(self, width: float) -> dict[str, float]:
        """Return the position of the gripper's joint at a width [m], by the name of the joint.

        Raises:
            BadPosition: The gripper cannot reach this width.
        """
        assert self.gripper
        return {self.gripper.joint.name: self.gripper.position(self.kinematics, width)}

    def joint(self, name: str) -> Joint:
        """Return the joint with this name.

        Raises:
            KeyError: There is no such joint. The message lists the joints.
        """
        for joint in self.joints:
            if joint.name == name:
                return joint
        raise KeyError(f"no joint {name}; there are {', '.join(j.name for j in self.joints)}")

    def words(self, positions: Mapping[str, float]) -> str:
        """Return positions by joint [rad] for people, as `joint_1 70.0 deg, joint_2 0.0 deg`."""
        return joint_words(positions, {joint.name: joint.unit for joint in self.joints})

    def turns(self, group: str = "arm") -> tuple[str, ...]:
        """Return the names of the rotations that a group can make in most poses; see `TURNS`.

        The tool center point does not move in a rotation. A group with less than six joints can
        make a yaw only in few poses. A group with at most three joints can make no rotation.
        """
        members = self.groups.get(group, ())
        count = sum(joint.name in members for joint in self.actuated)
        if count <= POINT_JOINTS:
            return ()
        return TURNS if count >= _FREE_JOINTS else TURNS[:2]

    def actuated_in(self, group: str) -> tuple[Joint, ...]:
        """Return the joints of a group without its mimic joints."""
        members = (self.joint(name) for name in self.groups[group])
        return tuple(joint for joint in members if joint.mimic is None)

"""The state of the joints in the form of ROS's `JointState`, for the bridges to ROS."""

from collections.abc import Mapping
from dataclasses import field

import logs
from hardware import Robot
from hardware.loading.dataclass import dataclass

from .events import Event, Where


@dataclass(frozen=True, slots=True)
class JointState:
    """The last known values of joints: measured, or commanded if the board does not measure.

    Attributes:
        measured: True if the values are measured.
        position: Position by joint [rad].
        velocity: Measured velocity by joint [rad/s]; empty if unknown.
        effort: Measured share of the largest torque of the servo by joint, -1 to 1; empty if
            unknown.
    """

    measured: bool
    position: Mapping[str, float]
    velocity: Mapping[str, float] = field(default_factory=dict)
    effort: Mapping[str, float] = field(default_factory=dict)

    @classmethod
    def of(cls, report: Event | Where, measures: bool) -> "JointState | None":
        """Return the values of the actuated joints in a report.

        Args:
            report: An event, or the position of the arm.
            measures: True if the board measures. Its commanded positions are then ignored.

        Returns:
            The values, or None if the report has none.
        """
        match report:
            case logs.Measured(joints=names) if names:
                rows = report.position, report.velocity, report.effort
                # A row that is not measured is empty.
                return cls(True, *(dict(zip(names, row, strict=False)) for row in rows))
            case logs.Sent(joints=names) if names and not measures:
                return cls(False, dict(zip(names, report.positions, strict=True)))
            case Where(measured=position) if position and measures:
                rates, efforts = report.measured_velocity, report.measured_effort
                return cls(True, position, rates or {}, efforts or {})
            case Where(commanded=position) if position and not measures:
                return cls(False, position)
            case _:
                return None

    def of_all_joints(self, robot: Robot) -> "JointState":
        """Return the values of all joints of a robot, computed from those of the actuated joints.

        The efforts are unknown if a joint mimics another one, because it has no servo of its own.

        Args:
            robot: The robot. It must have these actuated joints. The result has its order.
        """
        position = robot.of_all_joints(self.position)
        velocity = {
            joint.name: joint.mimic.multiplier * self.velocity[joint.mimic.leader]
            if joint.mimic
            else self.velocity[joint.name]
            for joint in robot.joints
            if self.velocity
        }
        known = self.effort and not any(joint.mimic for joint in robot.joints)
        effort = {joint.name: self.effort[joint.name] for joint in robot.joints if known}
        return JointState(self.measured, position, velocity, effort)

    @property
    def frame_id(self) -> str:
        """`measured` or `commanded`: the `frame_id` in ROS, which joint states do not need."""
        return "measured" if self.measured else "commanded"

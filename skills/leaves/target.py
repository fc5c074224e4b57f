"""Leaves that make a target of all joints from targets or distances of some joints."""

from collections.abc import Mapping
from typing import Any

from py_trees.common import Status
from py_trees.ports import PortInformation

from hardware import Robot
from skills.base import Skill
from skills.errors import OutOfBounds, refuse
from skills.joint_targets import (
    check_targets,
    completed,
    distance_errors,
    joined,
    joint_errors,
    mimic_errors,
    missing_joint_errors,
)
from skills.ports import Port, Positions

_OUTPUTS: dict[str, PortInformation] = {
    "goal": PortInformation(Positions, description="target of every actuated joint, checked [rad]")
}
_START = PortInformation(Positions, description="position of every actuated joint [rad]")


class Target(Skill):
    """Set targets of some joints; the others keep their start position. Fail if out of limits."""

    validates_partial = True

    INPUT_PORTS = {
        "start": _START,
        "joints": PortInformation(Positions, description="targets of some joints [rad]"),
    }
    OUTPUT_PORTS = _OUTPUTS

    @classmethod
    def validate(cls, robot: Robot, inputs: Mapping[str, Any]) -> None:
        """Check the inputs that are known before the run."""
        errors = missing_joint_errors(robot, "start", inputs["start"]) if "start" in inputs else []
        if "joints" in inputs:
            errors += joint_errors(robot, inputs["joints"])
        refuse(errors)

    @classmethod
    def poses(cls, robot: Robot, inputs: Mapping[str, Any]) -> list[tuple[float, ...]]:
        """Return the goal if it is known: from start and targets, or from targets of all joints."""
        joints = inputs.get("joints", {})
        start = inputs.get("start", joints)
        if not joints or not start.keys() >= {joint.name for joint in robot.actuated}:
            return []
        return [tuple(_goal(robot, start, joints, "joints").values())]

    def on_start(self) -> Status:
        """Complete the target and check it."""
        robot, start, joints = self.context.robot, self.get_input("start"), self.get_input("joints")
        refuse(missing_joint_errors(robot, "start", start))
        self._set_output("goal", _checked_goal(robot, start, joints, "joints"))
        return Status.SUCCESS


class Shift(Skill):
    """Move some joints by a distance from their start position. Fail if out of limits."""

    validates_partial = True

    INPUT_PORTS = {
        "start": _START,
        "by": Port(
            Positions,
            description="distances of some joints; at most half a turn for continuous joints [rad]",
            relative=True,
        ),
    }
    OUTPUT_PORTS = _OUTPUTS

    @classmethod
    def validate(cls, robot: Robot, inputs: Mapping[str, Any]) -> None:
        """Check the names of the joints, and that no distance exceeds a joint's range."""
        errors = missing_joint_errors(robot, "start", inputs["start"]) if "start" in inputs else []
        refuse([*errors, *distance_errors(robot, inputs.get("by", {}))])

    @classmethod
    def poses(cls, robot: Robot, inputs: Mapping[str, Any]) -> list[tuple[float, ...]]:
        """Return the goal if start and distances are known, else an empty list.

        Raises:
            OutOfBounds: The goal is outside the limits of a joint.
            BadTarget: A mimic joint is named without its leader, or contradicts it.
        """
        if "start" not in inputs or "by" not in inputs:
            return []
        return [tuple(_shifted(robot, inputs["start"], inputs["by"]).values())]

    def on_start(self) -> Status:
        """Add the distances and check the result."""
        robot, start, by = self.context.robot, self.get_input("start"), self.get_input("by")
        refuse(distance_errors(robot, by))
        refuse(missing_joint_errors(robot, "start", start))
        self._set_output("goal", _shifted(robot, start, by))
        return Status.SUCCESS


def _shifted(robot: Robot, start: Positions, by: Positions) -> Positions:
    joints = Positions((name, start[name] + distance) for name, distance in by.items())
    try:
        return _checked_goal(robot, start, joints, "by")
    except OutOfBounds as error:
        begin = robot.joint(error.joint).words(start[error.joint])
        error.args = (f"{error}; {error.joint} starts at {begin}",)
        raise


def _checked_goal(robot: Robot, start: Positions, joints: Positions, port: str) -> Positions:
    refuse(mimic_errors(robot, joints, port))
    check_targets(robot, completed(robot, start, joints, port), (port,))
    return _goal(robot, start, joints, port)


def _goal(robot: Robot, start: Positions, joints: Positions, port: str) -> Positions:
    return joined(robot, completed(robot, start, joints, port))

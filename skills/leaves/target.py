"""Leaves that complete targets of some joints to a target of every joint."""

import math
from collections.abc import Mapping
from typing import Any

from py_trees.common import Status
from py_trees.ports import PortInformation

from hardware import BadPosition, Joint, Robot
from hardware.spelling import suggestion
from skills.base import Skill
from skills.errors import BadTarget, OutOfBounds, SkillError, refuse
from skills.joint_targets import (
    check_complete,
    check_targets,
    joined,
    mimic_errors,
    missing_joint_errors,
    split_by_group,
    target_errors,
    unknown_joint_errors,
)
from skills.ports import Positions

_OUTPUTS: dict[str, PortInformation] = {
    "goal": PortInformation(Positions, description="target of every actuated joint, checked [rad]")
}
_START = PortInformation(Positions, description="position of every actuated joint [rad]")


class Target(Skill):
    """Take targets of some joints. The others keep their start position. Fail if out of limits."""

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
            errors += _target_errors(robot, inputs["joints"], "joints")
        refuse(errors)

    @classmethod
    def poses(cls, robot: Robot, inputs: Mapping[str, Any]) -> list[tuple[float, ...]]:
        """Return the goal if start and targets are known."""
        if "start" not in inputs or "joints" not in inputs:
            return []
        return [tuple(_goal(robot, inputs["start"], inputs["joints"], "joints").values())]

    def on_start(self) -> Status:
        """Complete the target and check it."""
        robot, start, joints = self.context.robot, self.get_input("start"), self.get_input("joints")
        check_complete(robot, "start", start)
        self._set_output("goal", _checked_goal(robot, start, joints, "joints"))
        return Status.SUCCESS


class Shift(Skill):
    """Move some joints by a distance from their start position. Fail if out of limits."""

    validates_partial = True

    INPUT_PORTS = {
        "start": _START,
        "by": PortInformation(
            Positions,
            description="distances of some joints, at most half a turn of a continuous one [rad]",
        ),
    }
    OUTPUT_PORTS = _OUTPUTS

    @classmethod
    def validate(cls, robot: Robot, inputs: Mapping[str, Any]) -> None:
        """Check the names of the joints, and that no distance exceeds a joint's range."""
        errors = missing_joint_errors(robot, "start", inputs["start"]) if "start" in inputs else []
        refuse([*errors, *_distance_errors(robot, inputs.get("by", {}))])

    @classmethod
    def poses(cls, robot: Robot, inputs: Mapping[str, Any]) -> list[tuple[float, ...]]:
        """Return the goal if start and distances are known."""
        if "start" not in inputs or "by" not in inputs:
            return []
        joints = _shifted(inputs["start"], inputs["by"])
        return [tuple(_goal(robot, inputs["start"], joints, "by").values())]

    def on_start(self) -> Status:
        """Add the distances and check the result."""
        robot, start, by = self.context.robot, self.get_input("start"), self.get_input("by")
        check_distances(robot, by)
        check_complete(robot, "start", start)
        self._set_output("goal", _checked_goal(robot, start, _shifted(start, by), "by"))
        return Status.SUCCESS


def _shifted(start: Positions, by: Positions) -> Positions:
    return Positions((name, start[name] + distance) for name, distance in by.items())


def check_joints(robot: Robot, joints: Positions) -> None:
    """Check targets of some joints, for any position of the others.

    Args:
        robot: Description of the robot.
        joints: Positions by joint name [rad].

    Raises:
        SkillError: A target is invalid.
        ExceptionGroup: Several targets are invalid.
    """
    refuse(_target_errors(robot, joints, "joints"))


def check_distances(robot: Robot, by: Mapping[str, float]) -> None:
    """Check distances of some joints.

    Args:
        robot: Description of the robot.
        by: Distances by joint name [rad].

    Raises:
        SkillError: A distance is invalid.
        ExceptionGroup: Several distances are invalid.
    """
    refuse(_distance_errors(robot, by))


def _target_errors(robot: Robot, joints: Positions, port: str) -> list[SkillError]:
    """Return the errors of targets of some joints that do not depend on the other joints."""
    errors = [*unknown_joint_errors(robot, joints, port), *mimic_errors(robot, joints, port)]
    written, wrong = {*joints, *joints.unknown}, {error.location[-1] for error in errors}
    # The position of a leader is unknown before the run if its name is missing or misspelt.
    wrong |= {j.name for j in robot.joints if j.mimic and j.mimic.leader not in written}
    part = Positions((name, q) for name, q in joints.items() if name not in wrong)
    boot = Positions((joint.name, joint.boot) for joint in robot.actuated)
    targets = {}
    for group, target in _completed(robot, boot, part, port).items():
        targets[group] = Positions(each for each in target.items() if each[0] not in joints.unknown)
        targets[group].unknown = tuple(name for name in joints.unknown if name in target)
    return [*errors, *target_errors(robot, targets, (port,))]


def _checked_goal(robot: Robot, start: Positions, joints: Positions, port: str) -> Positions:
    refuse(mimic_errors(robot, joints, port))
    check_targets(robot, _completed(robot, start, joints, port), (port,))
    return _goal(robot, start, joints, port)


def _goal(robot: Robot, start: Positions, joints: Positions, port: str) -> Positions:
    return joined(robot, _completed(robot, start, joints, port))


def _completed(
    robot: Robot, start: Positions, joints: Positions, port: str
) -> dict[str, dict[str, float]]:
    """Return a target for each group, with start positions of joints without a target."""
    targets = split_by_group(robot, joints, port)
    return {
        group: {joint.name: start[joint.name] for joint in robot.actuated_in(group)} | target
        for group, target in targets.items()
    }


def _distance_errors(robot: Robot, by: Mapping[str, float]) -> list[SkillError]:
    """Return the errors of distances that do not depend on the start."""
    joints = {joint.name: joint for joint in robot.actuated}
    written = [*by, *getattr(by, "unknown", ())]
    why = f"is not a joint that turns; there are {', '.join(joints)}"
    errors: list[SkillError] = [
        BadTarget(f"{name} {why}{suggestion(name, joints, written)}").at("by", name)
        for name in written
        if name not in joints
    ]
    for name, joint in joints.items():
        if name in by and (error := _too_far(joint, by[name])):
            errors.append(OutOfBounds([error]).at("by", name))
    return errors


def _too_far(joint: Joint, distance: float) -> BadPosition | None:
    """Return an error if a distance exceeds the range of a joint."""
    span = math.pi if joint.continuous else joint.upper - joint.lower
    if abs(distance) <= span:  # False for NaN
        return None
    most = "half a turn" if joint.continuous else "its range"
    why = f"{joint.name} by {joint.words(distance)} is more than {most}, {joint.words(span)}"
    limit = math.copysign(span, distance) if math.isfinite(distance) else None
    return BadPosition(why, joint.name, distance, limit)

"""Targets of some joints, completed to targets of all of them."""

import math
from collections.abc import Mapping
from typing import Any

from py_trees.common import Status
from py_trees.ports import PortInformation

from hardware import BadPosition, Joint, Robot
from hardware.suggestions import suggestion
from skills.base import Skill
from skills.errors import BadTarget, OutOfBounds, SkillError, refuse
from skills.ports import Positions

from .check_bounds import (
    by_group,
    check_targets,
    check_whole,
    lacking,
    lone_mimics,
    unknown_joints,
    wrong_targets,
)

_OUTPUTS: dict[str, PortInformation] = {
    "goal": PortInformation(Positions, description="target of every actuated joint, checked [rad]")
}
_START = PortInformation(Positions, description="where the arm stands [rad]")


class Target(Skill):
    """Take targets for some joints, and for all others where they stand; refuse what is outside."""

    validates_partial = True

    INPUT_PORTS = {
        "start": _START,
        "joints": PortInformation(Positions, description="targets of some joints [rad]"),
    }
    OUTPUT_PORTS = _OUTPUTS

    @classmethod
    def validate(cls, robot: Robot, inputs: Mapping[str, Any]) -> None:
        """Check what is spelled out."""
        wrong = lacking(robot, "start", inputs["start"]) if "start" in inputs else []
        if "joints" in inputs:
            wrong += _wrong_joints(robot, inputs["joints"], "joints")
        refuse(wrong)

    @classmethod
    def poses(cls, robot: Robot, inputs: Mapping[str, Any]) -> list[tuple[float, ...]]:
        """The goal, where start and targets are known."""
        if "start" not in inputs or "joints" not in inputs:
            return []
        return [tuple(_goal(robot, inputs["start"], inputs["joints"], "joints").values())]

    def on_start(self) -> Status:
        """Complete it, and check."""
        robot, start, joints = self.context.robot, self.get_input("start"), self.get_input("joints")
        check_whole(robot, "start", start)
        goal = _checked(robot, start, joints, "joints")
        self._set_output("goal", goal)
        return Status.SUCCESS


class Shift(Skill):
    """Take targets a distance away from where the joints stand; refuse what is outside."""

    validates_partial = True

    INPUT_PORTS = {
        "start": _START,
        "by": PortInformation(Positions, description="how far each of some joints moves [rad]"),
    }
    OUTPUT_PORTS = _OUTPUTS

    @classmethod
    def validate(cls, robot: Robot, inputs: Mapping[str, Any]) -> None:
        """Check the joints' names, and that none moves further than it can."""
        wrong = lacking(robot, "start", inputs["start"]) if "start" in inputs else []
        refuse([*wrong, *_wrong_distances(robot, inputs.get("by", {}))])

    @classmethod
    def poses(cls, robot: Robot, inputs: Mapping[str, Any]) -> list[tuple[float, ...]]:
        """The goal, where start and distances are known."""
        if "start" not in inputs or "by" not in inputs:
            return []
        joints = _shifted(inputs["start"], inputs["by"])
        return [tuple(_goal(robot, inputs["start"], joints, "by").values())]

    def on_start(self) -> Status:
        """Add, and check."""
        robot, start, by = self.context.robot, self.get_input("start"), self.get_input("by")
        check_distances(robot, by)
        check_whole(robot, "start", start)
        self._set_output("goal", _checked(robot, start, _shifted(start, by), "by"))
        return Status.SUCCESS


def _shifted(start: Positions, by: Positions) -> Positions:
    return Positions((name, start[name] + distance) for name, distance in by.items())


def check_joints(robot: Robot, joints: Positions, port: str) -> None:
    """Check targets of some joints, wherever the others are.

    Args:
        robot: Its joints and limits.
        joints: Positions by joint name [rad].
        port: Port that errors name.

    Raises:
        SkillError: A target is wrong.
        ExceptionGroup: Several are.
    """
    refuse(_wrong_joints(robot, joints, port))


def check_distances(robot: Robot, by: Mapping[str, float]) -> None:
    """Check distances that some joints move.

    Args:
        robot: Its joints and limits.
        by: Distances by joint name [rad].

    Raises:
        SkillError: A distance is wrong.
        ExceptionGroup: Several are.
    """
    refuse(_wrong_distances(robot, by))


def _wrong_joints(robot: Robot, joints: Positions, port: str) -> list[SkillError]:
    """What is wrong with targets of some joints, wherever the others stand."""
    wrong = [*unknown_joints(robot, joints, port), *lone_mimics(robot, joints, port)]
    written, told = {*joints, *joints.unknown}, {error.way[-1] for error in wrong}
    # Where a leader that is not named, or misspelt, stands by then, nobody knows.
    told |= {j.name for j in robot.joints if j.mimic and j.mimic.leader not in written}
    part = Positions((name, q) for name, q in joints.items() if name not in told)
    boot = Positions((joint.name, joint.boot) for joint in robot.actuated)
    targets = {}
    for group, target in _completed(robot, boot, part, port).items():
        targets[group] = Positions(each for each in target.items() if each[0] not in joints.unknown)
        targets[group].unknown = tuple(name for name in joints.unknown if name in target)
    return [*wrong, *wrong_targets(robot, targets, (port,))]


def _checked(robot: Robot, start: Positions, joints: Positions, port: str) -> Positions:
    refuse(lone_mimics(robot, joints, port))
    check_targets(robot, _completed(robot, start, joints, port), (port,))
    return _goal(robot, start, joints, port)


def _goal(robot: Robot, start: Positions, joints: Positions, port: str) -> Positions:
    targets = _completed(robot, start, joints, port)
    joined = {name: q for target in targets.values() for name, q in target.items()}
    return Positions((joint.name, joined[joint.name]) for joint in robot.actuated)


def _completed(
    robot: Robot, start: Positions, joints: Positions, port: str
) -> dict[str, dict[str, float]]:
    """Targets of every group, with the start where none is given."""
    targets = by_group(robot, joints, port)
    return {
        group: {joint.name: start[joint.name] for joint in robot.actuated_in(group)} | target
        for group, target in targets.items()
    }


def _wrong_distances(robot: Robot, by: Mapping[str, float]) -> list[SkillError]:
    """What is wrong with distances of some joints."""
    joints = {joint.name: joint for joint in robot.actuated}
    written = [*by, *getattr(by, "unknown", ())]
    there = ", ".join(joints)
    wrong: list[SkillError] = [
        BadTarget(
            f"{name} is no joint that turns; there are {there}{suggestion(name, joints, written)}"
        ).at("by", name)
        for name in written
        if name not in joints
    ]
    for name, joint in joints.items():
        if name in by and (far := _too_far(joint, by[name])):
            wrong.append(OutOfBounds([far]).at("by", name))
    return wrong


def _too_far(joint: Joint, distance: float) -> BadPosition | None:
    """Why a joint does not move by a distance; None where it may."""
    span = math.pi if joint.continuous else joint.upper - joint.lower
    if abs(distance) <= span:  # not where it is no number
        return None
    most = "half a turn" if joint.continuous else "its limits are apart"
    why = f"{joint.name} by {distance:g} {joint.unit} is further than {most}, {span:g} {joint.unit}"
    limit = math.copysign(span, distance) if math.isfinite(distance) else None
    return BadPosition(why, joint.name, distance, limit)

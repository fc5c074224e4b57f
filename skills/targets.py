"""Targets of some joints, completed to targets of all of them."""

import math
from collections.abc import Mapping
from typing import Any

from py_trees.common import Status
from py_trees.ports import PortInformation

from hardware import BadPosition, Robot

from .base import Skill
from .bounds import by_group, check_targets, check_whole
from .errors import BadTarget, OutOfBounds
from .positions import Positions

_OUTPUTS: dict[str, PortInformation] = {
    "goal": PortInformation(Positions, description="target of every actuated joint, checked [rad]")
}
_START = PortInformation(Positions, description="where the arm stands [rad]")


class Target(Skill):
    """Take targets for some joints, and for all others where they stand; refuse what is outside."""

    INPUT_PORTS = {
        "start": _START,
        "joints": PortInformation(Positions, description="targets of some joints [rad]"),
    }
    OUTPUT_PORTS = _OUTPUTS

    @classmethod
    def judge(cls, robot: Robot, inputs: Mapping[str, Any]) -> None:
        """Check what is spelled out."""
        if "start" in inputs:
            check_whole(robot, "start", inputs["start"])
        if "joints" in inputs:
            boot = Positions((joint.name, joint.boot) for joint in robot.actuated)
            check_targets(robot, _completed(robot, boot, inputs["joints"], "joints"), ("joints",))

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

    INPUT_PORTS = {
        "start": _START,
        "by": PortInformation(Positions, description="how far each of some joints moves [rad]"),
    }
    OUTPUT_PORTS = _OUTPUTS

    @classmethod
    def judge(cls, robot: Robot, inputs: Mapping[str, Any]) -> None:
        """Check the joints' names, and that none moves further than it can."""
        if "start" in inputs:
            check_whole(robot, "start", inputs["start"])
        _check_distances(robot, inputs.get("by", {}))

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
        _check_distances(robot, by)
        check_whole(robot, "start", start)
        self._set_output("goal", _checked(robot, start, _shifted(start, by), "by"))
        return Status.SUCCESS


def _shifted(start: Positions, by: Positions) -> Positions:
    return Positions((name, start[name] + distance) for name, distance in by.items())


def _checked(robot: Robot, start: Positions, joints: Positions, port: str) -> Positions:
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
        group: {joint.name: start[joint.name] for joint in robot.leaders(group)} | target
        for group, target in targets.items()
    }


def _check_distances(robot: Robot, by: Mapping[str, float]) -> None:
    joints = {joint.name: joint for joint in robot.actuated}
    if unknown := [name for name in by if name not in joints]:
        there = ", ".join(joints)
        raise BadTarget(f"{', '.join(unknown)} is no joint that turns; there are {there}").at(
            "by", unknown[0]
        )
    far = []
    for name, distance in by.items():
        span = math.pi if joints[name].endless else joints[name].upper - joints[name].lower
        if not abs(distance) <= span:  # not a number, too
            unit = joints[name].unit
            most = "half a turn" if joints[name].endless else "its limits are apart"
            why = f"{name} by {distance:g} {unit} is further than {most}, {span:g} {unit}"
            limit = math.copysign(span, distance) if math.isfinite(distance) else None
            far.append(BadPosition(why, name, distance, limit))
    if far:
        raise OutOfBounds(far).at("by", far[0].joint)

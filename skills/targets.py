"""Targets of some joints, completed to targets of all of them."""

from collections.abc import Mapping
from typing import Any

from py_trees.common import Status
from py_trees.ports import PortInformation

from hardware import Robot

from .base import Skill
from .bounds import check_targets
from .errors import BadTarget
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
        """Check the targets that are spelled out."""
        if "joints" in inputs:
            zero = Positions((joint.name, joint.boot) for joint in robot.actuated)
            check_targets(robot, _by_group(robot, zero, inputs["joints"]))

    def on_start(self) -> Status:
        """Complete it, and check."""
        goal = _checked(self.context.robot, self.get_input("start"), self.get_input("joints"))
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
        """Check the joints' names."""
        _check_names(robot, inputs.get("by", {}))

    def on_start(self) -> Status:
        """Add, and check."""
        robot, start, by = self.context.robot, self.get_input("start"), self.get_input("by")
        _check_names(robot, by)
        joints = Positions((name, start[name] + distance) for name, distance in by.items())
        self._set_output("goal", _checked(robot, start, joints))
        return Status.SUCCESS


def _checked(robot: Robot, start: Positions, joints: Positions) -> Positions:
    targets = _by_group(robot, start, joints)
    check_targets(robot, targets)
    joined = {name: q for target in targets.values() for name, q in target.items()}
    return Positions((joint.name, joined[joint.name]) for joint in robot.actuated)


def _by_group(robot: Robot, start: Positions, joints: Positions) -> dict[str, Positions]:
    """Targets of every group, with the start where none is given."""
    known = {name for group in robot.groups.values() for name in group}
    if unknown := [name for name in joints if name not in known]:
        there = ", ".join(joint.name for joint in robot.joints)
        raise BadTarget(f"{', '.join(unknown)} is no joint of the robot; it has {there}")
    return {
        group: Positions(
            (name, joints[name] if name in joints else start[name])
            for name in names
            if name in joints or robot.joint(name).mimic is None
        )
        for group, names in robot.groups.items()
    }


def _check_names(robot: Robot, by: Mapping[str, float]) -> None:
    own = [joint.name for joint in robot.actuated]
    if unknown := [name for name in by if name not in own]:
        raise BadTarget(f"{', '.join(unknown)} is no joint that turns; there are {', '.join(own)}")

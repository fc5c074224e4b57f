"""Whether a target may be commanded at all."""

import math
from collections.abc import Mapping
from typing import Any

from py_trees.common import Status
from py_trees.ports import PortInformation

from hardware import BadPosition, Joint, Robot, check_position

from .base import Skill
from .errors import BadTarget, OutOfBounds
from .positions import Positions


class CheckBounds(Skill):
    """Refuse a target that is incomplete or outside the limits of any joint of both groups."""

    INPUT_PORTS = {
        "arm": PortInformation(Positions, description="target of the arm's joints [rad]"),
        "gripper": PortInformation(Positions, description="target of the gripper's joints [rad]"),
    }
    OUTPUT_PORTS = {
        "goal": PortInformation(
            Positions, description="target of every actuated joint, checked [rad]"
        )
    }

    @classmethod
    def judge(cls, robot: Robot, inputs: Mapping[str, Any]) -> None:
        """Check the targets that are spelled out."""
        check_targets(robot, {name: inputs[name] for name in cls.INPUT_PORTS if name in inputs})

    @classmethod
    def poses(cls, robot: Robot, inputs: Mapping[str, Any]) -> list[tuple[float, ...]]:
        """The goal, where both targets are spelled out."""
        if any(group not in inputs for group in cls.INPUT_PORTS):
            return []
        targets = {group: inputs[group] for group in cls.INPUT_PORTS}
        return [tuple(_joined(robot, targets).values())]

    def on_start(self) -> Status:
        """Check, and join both targets."""
        targets = {group: self.get_input(group) for group in self.INPUT_PORTS}
        check_targets(self.context.robot, targets)
        self._set_output("goal", _joined(self.context.robot, targets))
        return Status.SUCCESS


def _joined(robot: Robot, targets: Mapping[str, Mapping[str, float]]) -> Positions:
    """The target of every actuated joint."""
    joined = {name: q for target in targets.values() for name, q in target.items()}
    return Positions((joint.name, joined[joint.name]) for joint in robot.actuated)


def check_targets(robot: Robot, targets: Mapping[str, Mapping[str, float]]) -> None:
    """Check a target per group.

    Args:
        robot: Whose limits count.
        targets: Group name to joint name to position [rad]; a mimic joint may be left out.

    Raises:
        BadTarget: An unknown or missing joint, or a mimic joint that contradicts its leader.
        OutOfBounds: Names every joint that is out, its value and its limits.
    """
    wrong, out = list[str](), list[BadPosition]()
    for group, target in targets.items():
        wrong += _wrong_names(robot, group, target)
        out += [error for name, q in target.items() if (error := _outside(robot, name, q))]
    if out:
        raise OutOfBounds(out)
    if wrong:
        raise BadTarget("; ".join(wrong))


def _wrong_names(robot: Robot, group: str, target: Mapping[str, float]) -> list[str]:
    if group not in robot.groups:
        return [f"the robot has no group {group}; it has {', '.join(robot.groups)}"]
    joints = {name: robot.joint(name) for name in robot.groups[group]}
    own = [name for name, joint in joints.items() if joint.mimic is None]
    there = f"the {group} has {', '.join(joints)}"
    unknown = [
        f"{name} is no joint of the {group}; {there}" for name in target if name not in joints
    ]
    missing = [f"{name} is missing; {there}" for name in own if name not in target]
    apart = [reason for joint in joints.values() if (reason := _contradicts(joint, target))]
    return unknown + missing + apart


def _contradicts(joint: Joint, target: Mapping[str, float]) -> str:
    mimic = joint.mimic
    if mimic is None or joint.name not in target or mimic.leader not in target:
        return ""
    follows, given = mimic.value(target[mimic.leader]), target[joint.name]
    if math.isclose(given, follows, abs_tol=1e-9):  # up to the rounding of decimal literals
        return ""
    return (
        f"{joint.name} = {given:g} contradicts {mimic.leader} = {target[mimic.leader]:g}, which it "
        f"follows to {follows:g}; leave {joint.name} out"
    )


def _outside(robot: Robot, name: str, q: float) -> BadPosition | None:
    joints = {joint.name: joint for joint in robot.joints}
    if name in joints:
        try:
            check_position(joints[name], q)
        except BadPosition as error:
            return error
    return None

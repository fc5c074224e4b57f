"""Whether a target may be commanded at all."""

import math
from collections.abc import Iterator, Mapping
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


def check_targets(
    robot: Robot,
    targets: Mapping[str, Mapping[str, float]],
    port: tuple[str | int, ...] | None = None,
) -> None:
    """Check a target per group.

    Args:
        robot: Whose limits count.
        targets: Group name to joint name to position [rad]; a mimic joint may be left out.
        port: The way to where all of them are written; None for each at the port of its group.

    Raises:
        BadTarget: An unknown or missing joint, or a mimic joint that contradicts its leader.
        OutOfBounds: Names every joint that is out, its value and its limits.
    """
    wrong, out = list[tuple[tuple[str | int, ...], str]](), list[BadPosition]()
    ways = {group: (group,) if port is None else port for group in targets}
    first: tuple[str | int, ...] = ()
    for group, target in targets.items():
        wrong += [((*ways[group], name), why) for name, why in _wrong_names(robot, group, target)]
        outside = [error for name, q in target.items() if (error := _outside(robot, name, q))]
        if outside and not out:
            first = (*ways[group], outside[0].joint)
        out += outside
    if out:
        raise OutOfBounds(out).at(*first)
    if wrong:
        raise BadTarget("; ".join(why for _, why in wrong)).at(*wrong[0][0])


def check_whole(robot: Robot, port: str, given: Mapping[str, float]) -> None:
    """Check that a configuration names every joint that is moved.

    Args:
        robot: Whose joints.
        port: Where it is written.
        given: Joint name to position [rad].

    Raises:
        BadTarget: A joint is missing.
    """
    names = [joint.name for joint in robot.actuated]
    if missing := [name for name in names if name not in given]:
        raise BadTarget(
            f"the {port} lacks {', '.join(missing)}; it must name {', '.join(names)}"
        ).at(port)


def check_link(robot: Robot, port: str, name: str) -> None:
    """Check that a link is one of the robot's.

    Raises:
        BadTarget: It is not.
    """
    if name not in robot.links:
        raise BadTarget(f"the robot has no link {name}; it has {', '.join(robot.links)}").at(port)


def by_group(robot: Robot, joints: Mapping[str, float], port: str) -> dict[str, dict[str, float]]:
    """Positions of joints, apart by the groups of the robot.

    Raises:
        BadTarget: A name is no joint's.
    """
    known = [name for group in robot.groups.values() for name in group]
    if unknown := [name for name in joints if name not in known]:
        there = ", ".join(joint.name for joint in robot.joints)
        raise BadTarget(f"{', '.join(unknown)} is no joint of the robot; it has {there}").at(
            port, unknown[0]
        )
    return {
        group: {name: joints[name] for name in names if name in joints}
        for group, names in robot.groups.items()
    }


def _wrong_names(
    robot: Robot, group: str, target: Mapping[str, float]
) -> Iterator[tuple[str, str]]:
    """Joints that are wrong, and why."""
    if group not in robot.groups:
        yield group, f"the robot has no group {group}; it has {', '.join(robot.groups)}"
        return
    joints = {name: robot.joint(name) for name in robot.groups[group]}
    there = f"the {group} has {', '.join(joints)}"
    for name in target:
        if name not in joints:
            yield name, f"{name} is no joint of the {group}; {there}"
    for name, joint in joints.items():
        if joint.mimic is None and name not in target:
            yield name, f"{name} is missing; {there}"
    for name, joint in joints.items():
        if reason := _contradicts(joint, target):
            yield name, reason


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

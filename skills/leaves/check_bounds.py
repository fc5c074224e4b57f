"""Whether a target may be commanded at all."""

import math
from collections.abc import Iterator, Mapping
from typing import Any

from py_trees.common import Status
from py_trees.ports import PortInformation

from hardware import BadPosition, Joint, Mimic, Robot, check_position
from hardware.suggestions import corrections, suggestion
from skills.base import Skill
from skills.errors import BadTarget, OutOfBounds, SkillError, combine_errors, refuse
from skills.ports import Positions


class CheckBounds(Skill):
    """Refuse a target that is incomplete or outside the limits of any joint of both groups."""

    validates_partial = True
    copies_targets = True

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
    def validate(cls, robot: Robot, inputs: Mapping[str, Any]) -> None:
        """Check the targets that are spelled out."""
        given = {name: inputs[name] for name in cls.INPUT_PORTS if name in inputs}
        refuse(wrong_targets(robot, given))

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
        OutOfBounds: Joints are out; its words are of all that is wrong.
        BadTarget: An unknown or missing joint, or a mimic joint that contradicts its leader.
    """
    if wrong := wrong_targets(robot, targets, port):
        raise combine_errors(wrong)


def wrong_targets(
    robot: Robot,
    targets: Mapping[str, Mapping[str, float]],
    port: tuple[str | int, ...] | None = None,
) -> list[SkillError]:
    """All that is wrong with a target per group, each with the way there; as `check_targets`."""
    wrong: list[SkillError] = []
    for group, target in targets.items():
        way = (group,) if port is None else port
        wrong += _wrong_values(robot, target, *way)
        wrong += [BadTarget(why).at(*way, name) for name, why in _wrong_names(robot, group, target)]
    return wrong


def wrong_whole(robot: Robot, port: str, given: Mapping[str, float]) -> list[SkillError]:
    """All that is wrong with a target of every joint that is moved, each with the way there."""
    names = [*lacking(robot, port, given), *unknown_joints(robot, given, port)]
    return [*_wrong_values(robot, given, port), *names]


def check_whole(robot: Robot, port: str, given: Mapping[str, float]) -> None:
    """Check that a configuration names every joint that is moved.

    Args:
        robot: Whose joints.
        port: Where it is written.
        given: Joint name to position [rad].

    Raises:
        BadTarget: A joint is missing.
    """
    refuse(lacking(robot, port, given))


def lacking(robot: Robot, port: str, given: Mapping[str, float]) -> list[SkillError]:
    """What `check_whole` refuses; a joint that is misspelt does not lack."""
    names = [joint.name for joint in robot.actuated]
    written = _written(given)
    meant = corrections(written, [joint.name for joint in robot.joints]).values()
    missing = [name for name in names if name not in written and name not in meant]
    why = f"the {port} lacks {', '.join(missing)}; it must name {', '.join(names)}"
    return [BadTarget(why).at(port)] if missing else []


def check_link(robot: Robot, port: str, name: str) -> None:
    """Check that a link is one of the robot's.

    Raises:
        BadTarget: It is not.
    """
    refuse(no_link(robot, port, name))


def no_link(robot: Robot, port: str, name: str) -> list[SkillError]:
    """What `check_link` refuses."""
    there = f"the robot has no link {name}; it has {', '.join(robot.links)}"
    return (
        [] if name in robot.links else [BadTarget(there + suggestion(name, robot.links)).at(port)]
    )


def by_group(robot: Robot, joints: Mapping[str, float], port: str) -> dict[str, dict[str, float]]:
    """Positions of joints, apart by the groups of the robot.

    Raises:
        BadTarget: A name is no joint's.
    """
    if unknown := unknown_joints(robot, joints, port):
        raise combine_errors(unknown)
    return {
        group: {name: joints[name] for name in names if name in joints}
        for group, names in robot.groups.items()
    }


def unknown_joints(robot: Robot, joints: Mapping[str, float], *way: str | int) -> list[SkillError]:
    """What `by_group` refuses."""
    there, written = [joint.name for joint in robot.joints], _written(joints)
    known = {name for group in robot.groups.values() for name in group}
    words = f"is no joint of the robot; it has {', '.join(there)}"
    return [
        BadTarget(f"{name} {words}{suggestion(name, there, written)}").at(*way, name)
        for name in written
        if name not in known
    ]


def lone_mimics(robot: Robot, joints: Mapping[str, float], *way: str | int) -> list[SkillError]:
    """Joints that follow another one that is not named, and so cannot be told where to go."""
    written = _written(joints)
    named = {*written, *corrections(written, [joint.name for joint in robot.joints]).values()}
    return [
        BadTarget(_follows(joint, joint.mimic, joints.get(joint.name))).at(*way, joint.name)
        for joint in robot.joints
        if joint.mimic and joint.name in written and joint.mimic.leader not in named
    ]


def _follows(joint: Joint, mimic: Mimic, given: float | None) -> str:
    why = f"{joint.name} follows {mimic.leader}; name {mimic.leader} instead"
    if given is None or not math.isfinite(given) or not mimic.multiplier:
        return why
    leader = (given - mimic.offset) / mimic.multiplier + 0.0  # no -0
    return f"{why} ({mimic.leader} = {leader:g} gives {joint.name} = {given:g})"


def _wrong_names(
    robot: Robot, group: str, target: Mapping[str, float]
) -> Iterator[tuple[str, str]]:
    """Joints that are wrong, and why."""
    if group not in robot.groups:
        yield group, f"the robot has no group {group}; it has {', '.join(robot.groups)}"
        return
    joints = {name: robot.joint(name) for name in robot.groups[group]}
    there, written = f"the {group} has {', '.join(joints)}", _written(target)
    meant = corrections(written, joints)
    for name in written:
        if name not in joints:
            yield (
                name,
                f"{name} is no joint of the {group}; {there}{suggestion(name, joints, written)}",
            )
    for name, joint in joints.items():
        if joint.mimic is None and name not in written and name not in meant.values():
            yield name, f"{name} is missing; {there}"


def _written(target: Mapping[str, float]) -> list[str]:
    """The joints that are named, with those of which the value is not known."""
    return [*target, *getattr(target, "unknown", ())]


def _wrong_values(robot: Robot, target: Mapping[str, float], *way: str | int) -> list[SkillError]:
    """Joints that are out of their limits, and mimic joints that contradict their leaders."""
    wrong: list[SkillError] = []
    for joint in (joint for joint in robot.joints if joint.name in target):
        try:
            check_position(joint, target[joint.name])
        except BadPosition as error:
            wrong.append(OutOfBounds([error]).at(*way, joint.name))
        else:
            why = _contradicts(joint, target)
            wrong += [BadTarget(why).at(*way, joint.name)] if why else []
    return wrong


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

"""Checks of joint targets, joint names and links in a task."""

import math
from collections.abc import Iterator, Mapping

from hardware import BadPosition, Joint, Mimic, Robot, check_position
from hardware.spelling import corrections, suggestion

from .errors import BadTarget, OutOfBounds, SkillError, combine_errors
from .ports import Positions

Location = tuple[str | int, ...]


def check_targets(
    robot: Robot, targets: Mapping[str, Mapping[str, float]], location: Location | None = None
) -> None:
    """Check the joint targets of one or more groups.

    Args:
        robot: Description of the robot.
        targets: Joint targets of each group: joint name to position [rad]. Mimic joints may be
            omitted.
        location: Location of the value with all targets: its port, then keys or indices. None if
            each group has an own port, with the name of the group.

    Raises:
        OutOfBounds: A joint is outside its limits. The message names all errors.
        BadTarget: A joint is unknown or missing, or a mimic joint contradicts its leader.
    """
    if errors := target_errors(robot, targets, location):
        raise combine_errors(errors)


def target_errors(
    robot: Robot, targets: Mapping[str, Mapping[str, float]], location: Location | None = None
) -> list[SkillError]:
    """Return all errors that `check_targets` finds. Each error has the location of its value."""
    errors: list[SkillError] = []
    for group, target in targets.items():
        at = (group,) if location is None else location
        errors += _value_errors(robot, target, at)
        errors += [BadTarget(why).at(*at, name) for name, why in _name_errors(robot, group, target)]
    return errors


def joined(robot: Robot, targets: Mapping[str, Mapping[str, float]]) -> Positions:
    """Return one target for all actuated joints, joined from complete targets of all groups."""
    positions = {name: q for target in targets.values() for name, q in target.items()}
    return Positions((joint.name, positions[joint.name]) for joint in robot.actuated)


def configuration_errors(
    robot: Robot, port: str, configuration: Mapping[str, float]
) -> list[SkillError]:
    """Return all errors of a configuration. Each error has the location of its value.

    Args:
        robot: Description of the robot.
        port: Name of the port with the configuration.
        configuration: Position of every actuated joint [rad], by name.
    """
    return [
        *_value_errors(robot, configuration, (port,)),
        *missing_joint_errors(robot, port, configuration),
        *unknown_joint_errors(robot, configuration, port),
    ]


def missing_joint_errors(
    robot: Robot, port: str, configuration: Mapping[str, float]
) -> list[SkillError]:
    """Return a list with one error if joints are missing, else an empty list.

    A joint whose name is misspelt does not count as missing.
    """
    names = [joint.name for joint in robot.actuated]
    written = _written(configuration)
    corrected = corrections(written, [joint.name for joint in robot.joints]).values()
    missing = [name for name in names if name not in written and name not in corrected]
    why = f"the {port} lacks {', '.join(missing)}; it must name {', '.join(names)}"
    return [BadTarget(why).at(port)] if missing else []


def link_errors(robot: Robot, port: str, link: str) -> list[SkillError]:
    """Return a list with one error if the robot does not have this link, else an empty list."""
    if link in robot.links:
        return []
    why = f"the robot has no link {link}; it has {', '.join(robot.links)}"
    return [BadTarget(why + suggestion(link, robot.links)).at(port)]


def split_by_group(
    robot: Robot, joints: Mapping[str, float], port: str
) -> dict[str, dict[str, float]]:
    """Return joint positions by group: for each group, joint name to position [rad].

    Raises:
        BadTarget: A joint is unknown.
    """
    if errors := unknown_joint_errors(robot, joints, port):
        raise combine_errors(errors)
    return {
        group: {name: joints[name] for name in names if name in joints}
        for group, names in robot.groups.items()
    }


def unknown_joint_errors(
    robot: Robot, joints: Mapping[str, float], *location: str | int
) -> list[SkillError]:
    """Return an error for each joint that the robot does not have."""
    known = {name for group in robot.groups.values() for name in group}
    leaders = [joint.name for joint in robot.actuated]
    written = _written(joints)
    why = f"is not a joint of the robot; it has {_joint_names(robot)}"
    return [
        BadTarget(f"{name} {why}{suggestion(name, leaders, written)}").at(*location, name)
        for name in written
        if name not in known
    ]


def _joint_names(robot: Robot) -> str:
    """Return the names of the actuated joints of each group, as words for a message."""
    groups = ((group, [joint.name for joint in robot.actuated_in(group)]) for group in robot.groups)
    return " and ".join(f"{', '.join(names)} ({group})" for group, names in groups if names)


def mimic_errors(
    robot: Robot, joints: Mapping[str, float], *location: str | int
) -> list[SkillError]:
    """Return an error for each mimic joint that is named without its leader."""
    written = _written(joints)
    named = {*written, *corrections(written, [joint.name for joint in robot.joints]).values()}
    return [
        BadTarget(_follows(joint, joint.mimic, joints.get(joint.name))).at(*location, joint.name)
        for joint in robot.joints
        if joint.mimic and joint.name in written and joint.mimic.leader not in named
    ]


def _follows(joint: Joint, mimic: Mimic, position: float | None) -> str:
    why = f"{joint.name} follows {mimic.leader}; name {mimic.leader} instead"
    if position is None or not math.isfinite(position) or not mimic.multiplier:
        return why
    leader = joint.words((position - mimic.offset) / mimic.multiplier)
    return f"{why} ({mimic.leader} = {leader} gives {joint.name} = {joint.words(position)})"


def _name_errors(
    robot: Robot, group: str, target: Mapping[str, float]
) -> Iterator[tuple[str, str]]:
    """Yield the name of each unknown or missing joint or group, and the message of the error."""
    if group not in robot.groups:
        yield group, f"the robot has no group {group}; it has {', '.join(robot.groups)}"
        return
    joints = {name: robot.joint(name) for name in robot.groups[group]}
    there, written = f"the {group} has {', '.join(joints)}", _written(target)
    corrected = corrections(written, joints).values()
    others = {name for other in robot.groups if other != group for name in robot.groups[other]}
    if written and others.issuperset(written):
        yield group, f"{there}, not {', '.join(written)}"
        return
    for name in written:
        if name not in joints:
            near = suggestion(name, joints, written)
            yield name, f"{name} is not a joint of the {group}; {there}{near}"
    actuated = (name for name, joint in joints.items() if joint.mimic is None)
    if missing := [name for name in actuated if name not in written and name not in corrected]:
        verb = "is" if len(missing) == 1 else "are"
        yield missing[0], f"{', '.join(missing)} {verb} missing; {there}"


def _written(target: Mapping[str, float]) -> list[str]:
    """Return the names of the joints in a target, also of joints whose value is unknown."""
    return [*target, *getattr(target, "unknown", ())]


def _value_errors(
    robot: Robot, target: Mapping[str, float], location: Location
) -> list[SkillError]:
    """Return an error for each joint outside its limits or contradicting its leader."""
    errors: list[SkillError] = []
    for joint in (joint for joint in robot.joints if joint.name in target):
        if why := _contradiction(joint, target):
            errors.append(BadTarget(why, superfluous=True).at(*location, joint.name))
            continue
        try:
            check_position(joint, target[joint.name])
        except BadPosition as error:
            errors.append(OutOfBounds([error]).at(*location, joint.name))
    return errors


def _contradiction(joint: Joint, target: Mapping[str, float]) -> str:
    mimic = joint.mimic
    if mimic is None or mimic.leader not in target:
        return ""
    follows, given = mimic.value(target[mimic.leader]), target[joint.name]
    # Tolerance for decimal literals.
    if not math.isfinite(given) or math.isclose(given, follows, abs_tol=1e-9):
        return ""
    times = f"{mimic.multiplier:g} times {mimic.leader}"
    offset = f" plus {joint.words(mimic.offset)}" if mimic.offset else ""
    leader = f"{mimic.leader} = {joint.words(target[mimic.leader])}"
    why = f"{joint.name} = {joint.words(given)} contradicts {leader}"
    return f"{why}: {joint.name} is always {times}{offset}; leave {joint.name} out"


def joint_errors(robot: Robot, joints: Positions) -> list[SkillError]:
    """Return the errors of targets of some joints, as far as they are known before the run.

    Args:
        robot: Description of the robot.
        joints: Value of the port `joints`: positions by joint name [rad].
    """
    port = "joints"
    errors = [*unknown_joint_errors(robot, joints, port), *mimic_errors(robot, joints, port)]
    written, wrong = _written(joints), {error.location[-1] for error in errors}
    # If the name of a leader is missing or misspelt, its position is unknown before the run.
    wrong |= {j.name for j in robot.joints if j.mimic and j.mimic.leader not in written}
    part = Positions((name, q) for name, q in joints.items() if name not in wrong)
    boot = robot.by_joint(robot.boot_pose)
    targets = {}
    for group, target in completed(robot, boot, part, port).items():
        targets[group] = Positions(each for each in target.items() if each[0] not in joints.unknown)
        targets[group].unknown = tuple(name for name in joints.unknown if name in target)
    return [*errors, *target_errors(robot, targets, (port,))]


def completed(
    robot: Robot, start: Mapping[str, float], joints: Positions, port: str
) -> dict[str, dict[str, float]]:
    """Return a complete target for each group: joint name to position [rad].

    Args:
        robot: Description of the robot.
        start: Start position of every actuated joint [rad], by name. A joint without a target keeps
            this position.
        joints: Targets of some joints [rad], by name.
        port: Name of the port with the targets, for errors.
    """
    targets = split_by_group(robot, joints, port)
    return {
        group: {joint.name: start[joint.name] for joint in robot.actuated_in(group)} | target
        for group, target in targets.items()
    }


def distance_errors(robot: Robot, by: Mapping[str, float]) -> list[SkillError]:
    """Return the errors of distances that are known before the start position is known.

    Args:
        robot: Description of the robot.
        by: Value of the port `by`: distances by joint name [rad].
    """
    joints = {joint.name: joint for joint in robot.actuated}
    written = _written(by)
    why = f"is not an actuated joint; choose from {', '.join(joints)}"
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
    """Return an error if a distance exceeds the range of a joint, else None."""
    span = math.pi if joint.continuous else joint.upper - joint.lower
    if abs(distance) <= span:  # False for NaN
        return None
    most = "half a turn" if joint.continuous else "its range"
    why = f"{joint.name} by {joint.words(distance)} is more than {most}, {joint.words(span)}"
    limit = math.copysign(span, distance) if math.isfinite(distance) else None
    return BadPosition(why, joint.name, distance, limit)

"""Ports for a target of the tool, the checks of their values, and the query to the planner."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

from py_trees.ports import PortInformation

from hardware import Robot
from hardware.description.robot import POINT_JOINTS
from hardware.printable import plural
from hardware.spelling import suggestion

from .errors import BadTarget, SkillError
from .joint_targets import link_errors, missing_joint_errors
from .motion.query import ToolQuery
from .ports import MOST_REACHES, ORIGIN, Positions, vector, xyz

TOOL_PORTS: dict[str, PortInformation] = {
    "start": PortInformation(Positions, description="position of every actuated joint [rad]"),
    "point": vector("x, y, z in the frame of the robot's root [m]", "m"),
    "relative": PortInformation(
        bool,
        default_value=False,
        description="true if the point is relative to the tool",
    ),
    "direction": vector(
        "x, y, z of the direction of the tool's axis; default: any direction", default=()
    ),
    "turn": vector(
        "roll, pitch and yaw of the tool from its orientation at the start [rad], instead of a "
        "direction; roll is about its axis, pitch is up, yaw is about the vertical",
        "rad",
        default=(),
    ),
    "tool": PortInformation(
        str,
        default_value="",
        description="link with the tool; empty for the robot's own tool",
    ),
    "offset": vector(
        "position of the tool in the frame of link `tool`; "
        "without `tool`, offset from the robot's own tool [m]",
        "m",
        ORIGIN,
    ),
    "axis": vector(
        "axis of the tool on its link; default: the axis of the robot file, or z", default=()
    ),
    "group": PortInformation(str, default_value="arm", description="group that moves"),
}


def tool_target_errors(robot: Robot, inputs: Mapping[str, Any]) -> list[SkillError]:
    """Return the errors of known values of the ports. Each error has the location of its value.

    Args:
        robot: Description of the robot.
        inputs: Known values, by port. Ports may be missing.
    """
    errors = missing_joint_errors(robot, "start", inputs["start"]) if "start" in inputs else []
    if "group" in inputs:
        errors += group_errors(robot, inputs["group"])
    if inputs.get("tool"):
        errors += link_errors(robot, "tool", inputs["tool"])
    far = max(map(abs, inputs.get("point", [0.0])))
    if far > MOST_REACHES * robot.reach > 0:
        why = f"point {far:g} m is far beyond the reach of this arm, {robot.reach:.2g} m"
        errors.append(BadTarget(why).at("point"))
    if turn := inputs.get("turn"):
        errors += _turn_errors(robot, turn, inputs)
    for port in ("direction", "axis"):
        if inputs.get(port) and not any(inputs[port]):
            why = f"{port} is 0, 0, 0; at least one of x, y, z must not be 0"
            errors.append(BadTarget(why).at(port))
    return errors


def query_tool_target(robot: Robot, inputs: Mapping[str, Any]) -> ToolQuery:
    """Return the query for joint positions that bring the tool to its target.

    The world of the query is empty.

    Args:
        robot: Description of the robot.
        inputs: Values by port. Ports with a default may be missing.

    Raises:
        BadTarget: A vector does not have three values.
    """
    given = {name: port.default_value for name, port in TOOL_PORTS.items()} | {**inputs}
    return ToolQuery(
        group=given["group"],
        start=tuple(given["start"][joint.name] for joint in robot.actuated),
        point=xyz("point", given["point"]),
        direction=xyz("direction", given["direction"]) if given["direction"] else None,
        link=given["tool"],
        offset=xyz("offset", given["offset"]),
        axis=xyz("axis", given["axis"]) if given["axis"] else None,
        relative=given["relative"],
        turn=xyz("turn", given["turn"]) if given["turn"] else None,
    )


def _turn_errors(
    robot: Robot, turn: Sequence[float], inputs: Mapping[str, Any]
) -> list[SkillError]:
    """Return a list with one error if the input `turn` is invalid in every pose, else an empty one.

    Args:
        robot: Description of the robot.
        turn: Roll, pitch and yaw [rad].
        inputs: Known values of all ports, by port.
    """
    group = inputs.get("group", "arm")
    if inputs.get("direction"):
        why = "turn and direction exclude each other; give one of them"
    elif max(map(abs, turn)) > math.pi:
        why = f"turn has {math.degrees(max(turn, key=abs)):g} deg; give -180 to 180 deg"
    elif group in robot.groups and not robot.turns(group):
        count = plural(len(robot.actuated_in(group)), "joint")
        why = f"the {group} cannot turn its tool in place: it has {count}, and needs more than "
        why += f"{POINT_JOINTS}; move joints instead"
    else:
        return []
    return [BadTarget(why).at("turn")]


def group_errors(robot: Robot, group: str) -> list[SkillError]:
    """Return a list with one error if the robot does not have this group, else an empty list."""
    if group in robot.groups:
        return []
    there = f"the robot has no group {group}; it has {', '.join(robot.groups)}"
    return [BadTarget(there + suggestion(group, robot.groups)).at("group")]

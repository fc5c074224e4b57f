"""A leaf that computes joint positions for a point of the tool (inverse kinematics)."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from py_trees.common import Status
from py_trees.ports import PortInformation

from hardware import Robot
from hardware.spelling import suggestion
from skills.errors import BadTarget, SkillError, refuse
from skills.joint_targets import check_complete, link_errors, missing_joint_errors
from skills.motion.errors import MotionError
from skills.motion.query import Reached, Result, ToolQuery
from skills.planning_skill import PlanningSkill
from skills.ports import MOST_REACHES, ORIGIN, Positions, vector, xyz

_GROUP = PortInformation(str, default_value="arm", description="group that moves")
_START = PortInformation(Positions, description="position of every actuated joint [rad]")
_TARGET = PortInformation(Positions, description="position of each of the group's joints [rad]")


class ReachPoint(PlanningSkill):
    """Compute joint positions that bring the tool to a point. Choose the ones reached soonest."""

    tool_output = "target"

    INPUT_PORTS = {
        "start": _START,
        "point": vector("x, y, z in the frame of the robot's root [m]", "m"),
        "relative": PortInformation(
            bool,
            default_value=False,
            description="true if the point is relative to the tool",
        ),
        "direction": vector(
            "x, y, z of the direction of the tool's axis; default: any direction", default=()
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
        "group": _GROUP,
    }
    OUTPUT_PORTS = {"target": _TARGET}

    @classmethod
    def validate(cls, robot: Robot, inputs: Mapping[str, Any]) -> None:
        """Check the inputs that are known before the run."""
        errors = missing_joint_errors(robot, "start", inputs["start"]) if "start" in inputs else []
        if "group" in inputs:
            errors += _group_errors(robot, inputs["group"])
        if inputs.get("tool"):
            errors += link_errors(robot, "tool", inputs["tool"])
        far = max(map(abs, inputs.get("point", [0.0])))
        if far > MOST_REACHES * robot.reach > 0:
            why = f"point {far:g} m is far beyond the reach of this arm, {robot.reach:.2g} m"
            errors.append(BadTarget(why).at("point"))
        for port in ("direction", "axis"):
            if inputs.get(port) and not any(inputs[port]):
                why = f"{port} points nowhere; one of x, y, z must not be 0"
                errors.append(BadTarget(why).at(port))
        refuse(errors)

    def on_start(self) -> Status:
        """Send the query to a worker."""
        given = {port: self.get_input(port) for port in self.INPUT_PORTS}
        start, robot = given["start"], self.context.robot
        check_complete(robot, "start", start)
        self._names = _joints(robot, given["group"])
        query, context = self.tool_query(robot, given), self.context
        assert query
        world, seed, timeout = context.scene.world, context.seed, context.timeout
        return self.request(replace(query, world=world, seed=seed, timeout=timeout))

    @classmethod
    def tool_query(cls, robot: Robot, inputs: Mapping[str, Any]) -> ToolQuery | None:
        """Return the query for the inputs, in an empty world; None if an input is not known."""
        if any(port not in inputs for port in cls.INPUT_PORTS):
            return None
        return ToolQuery(
            group=inputs["group"],
            start=tuple(inputs["start"][joint.name] for joint in robot.actuated),
            point=xyz("point", inputs["point"]),
            direction=xyz("direction", inputs["direction"]) if inputs["direction"] else None,
            link=inputs["tool"],
            offset=xyz("offset", inputs["offset"]),
            axis=xyz("axis", inputs["axis"]) if inputs["axis"] else None,
            relative=inputs["relative"],
        )

    def on_answer(self, answer: Result) -> Status:
        """Write the positions."""
        if isinstance(answer, MotionError):
            raise answer
        assert isinstance(answer, Reached)
        target = Positions(zip(self._names, answer.positions, strict=True))
        self._set_output("target", target)
        self.feedback_message = self.context.robot.words(target)
        return Status.SUCCESS


TOOL_PORTS = ReachPoint.INPUT_PORTS


def check_tool(robot: Robot, inputs: Mapping[str, Any]) -> None:
    """Check values of some of `TOOL_PORTS`.

    Raises:
        SkillError: A value is invalid.
        ExceptionGroup: Several values are invalid.
    """
    ReachPoint.validate(robot, inputs)


def tool_query(robot: Robot, inputs: Mapping[str, Any]) -> ToolQuery:
    """Return the query for a point of the tool, in an empty world.

    Args:
        robot: Description of the robot.
        inputs: Values of `TOOL_PORTS`. Ports with a default may be missing.
    """
    defaults = {name: port.default_value for name, port in TOOL_PORTS.items()}
    query = ReachPoint.tool_query(robot, {**defaults, **inputs})
    assert query
    return query


def _joints(robot: Robot, group: str) -> list[str]:
    """Return the names of the actuated joints of a group."""
    refuse(_group_errors(robot, group))
    return [joint.name for joint in robot.actuated_in(group)]


def _group_errors(robot: Robot, group: str) -> list[SkillError]:
    if group in robot.groups:
        return []
    there = f"the robot has no group {group}; it has {', '.join(robot.groups)}"
    return [BadTarget(there + suggestion(group, robot.groups)).at("group")]

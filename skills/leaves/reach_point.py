"""Where the joints must be for the tool to be at a point."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from py_trees.common import Status
from py_trees.ports import PortInformation

from hardware import Robot
from hardware.suggestions import suggestion
from skills.errors import BadTarget, SkillError, refuse
from skills.motion.errors import MotionError
from skills.motion.query import Reached, Result, ToolQuery
from skills.planning_skill import PlanningSkill
from skills.ports import Port, Positions, xyz

from .check_bounds import check_whole, lacking, no_link

_GROUP = PortInformation(str, default_value="arm", description="group whose joints are meant")
_START = PortInformation(Positions, description="where the arm stands [rad]")
_TARGET = PortInformation(Positions, description="position of each of the group's joints [rad]")


class ReachPoint(PlanningSkill):
    """The joint positions, soonest reached, that bring the tool to a point in the room."""

    tool_output = "target"

    INPUT_PORTS = {
        "start": _START,
        "point": Port(
            list[float],
            description="x, y, z in the frame of the robot's root [m]",
            unit="m",
            count=3,
        ),
        "relative": PortInformation(
            bool, default_value=False, description="whether it counts from where the tool is"
        ),
        "direction": Port(
            list[float],
            default_value=[],
            description="x, y, z that the tool's axis shall point along; without it any",
            count=3,
        ),
        "tool": PortInformation(
            str, default_value="", description="link with the tool; empty for the robot's own"
        ),
        "offset": Port(
            list[float],
            default_value=[0.0, 0.0, 0.0],
            description="the tool on that link, or beyond the robot's own [m]",
            unit="m",
            count=3,
        ),
        "axis": Port(
            list[float],
            default_value=[],
            description="the tool's axis on that link; without it the robot's own, or z",
            count=3,
        ),
        "group": _GROUP,
    }
    OUTPUT_PORTS = {"target": _TARGET}

    @classmethod
    def validate(cls, robot: Robot, inputs: Mapping[str, Any]) -> None:
        """Check what is spelled out."""
        wrong = lacking(robot, "start", inputs["start"]) if "start" in inputs else []
        if "group" in inputs:
            wrong += _no_group(robot, inputs["group"])
        if inputs.get("tool"):
            wrong += no_link(robot, "tool", inputs["tool"])
        for port in ("direction", "axis"):
            if inputs.get(port) and not any(inputs[port]):
                why = f"{port} points nowhere; one of x, y, z must not be 0"
                wrong.append(BadTarget(why).at(port))
        refuse(wrong)

    def on_start(self) -> Status:
        """Hand the question to a worker."""
        given = {port: self.get_input(port) for port in self.INPUT_PORTS}
        start, robot = given["start"], self.context.robot
        check_whole(robot, "start", start)
        self._names = _leaders(robot, given["group"])
        query, context = self.tool_query(robot, given), self.context
        assert query
        world, seed, timeout = context.scene.world, context.seed, context.timeout
        return self.ask(replace(query, world=world, seed=seed, timeout=timeout))

    @classmethod
    def tool_query(cls, robot: Robot, inputs: Mapping[str, Any]) -> ToolQuery | None:
        """The point, the direction and the tool of the inputs."""
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
        """Hand the positions on."""
        if isinstance(answer, MotionError):
            raise answer
        assert isinstance(answer, Reached)
        target = Positions(zip(self._names, answer.positions, strict=True))
        self._set_output("target", target)
        self.feedback_message = ", ".join(f"{name} {q:.3f}" for name, q in target.items())
        return Status.SUCCESS


TOOL_PORTS = ReachPoint.INPUT_PORTS


def check_tool(robot: Robot, inputs: Mapping[str, Any]) -> None:
    """Check values of some of `TOOL_PORTS`.

    Raises:
        SkillError: A value is wrong.
        ExceptionGroup: Several are.
    """
    ReachPoint.validate(robot, inputs)


def _leaders(robot: Robot, group: str) -> list[str]:
    """Names of the joints of a group that move of their own."""
    refuse(_no_group(robot, group))
    return [joint.name for joint in robot.actuated_in(group)]


def _no_group(robot: Robot, group: str) -> list[SkillError]:
    if group in robot.groups:
        return []
    there = f"the robot has no group {group}; it has {', '.join(robot.groups)}"
    return [BadTarget(there + suggestion(group, robot.groups)).at("group")]

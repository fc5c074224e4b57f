"""A leaf that computes joint positions for a point of the tool (inverse kinematics)."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from py_trees.common import Status
from py_trees.ports import PortInformation

from hardware import Robot
from skills.errors import refuse
from skills.joint_targets import missing_joint_errors
from skills.motion.errors import MotionError
from skills.motion.query import Reached, Result, ToolQuery
from skills.planning_skill import PlanningSkill
from skills.ports import Positions
from skills.tool_target import TOOL_PORTS, group_errors, query_tool_target, tool_target_errors

_TARGET = PortInformation(Positions, description="position of each of the group's joints [rad]")


class ReachPoint(PlanningSkill):
    """Compute joint positions that bring the tool to a point. Prefer the shortest motion."""

    tool_output = "target"

    INPUT_PORTS = TOOL_PORTS
    OUTPUT_PORTS = {"target": _TARGET}

    @classmethod
    def validate(cls, robot: Robot, inputs: Mapping[str, Any]) -> None:
        """Check the inputs that are known before the run."""
        refuse(tool_target_errors(robot, inputs))

    def on_start(self) -> Status:
        """Send the query to a worker."""
        given = {port: self.get_input(port) for port in self.INPUT_PORTS}
        robot, context = self.context.robot, self.context
        refuse(missing_joint_errors(robot, "start", given["start"]))
        refuse(group_errors(robot, given["group"]))
        self._names = [joint.name for joint in robot.actuated_in(given["group"])]
        query, world = query_tool_target(robot, given), context.scene.world
        return self.request(replace(query, world=world, seed=context.seed, timeout=context.timeout))

    @classmethod
    def tool_query(cls, robot: Robot, inputs: Mapping[str, Any]) -> ToolQuery | None:
        """Return the query for the inputs, in an empty world, or None if an input is not known."""
        known = all(port in inputs for port in cls.INPUT_PORTS)
        return query_tool_target(robot, inputs) if known else None

    def on_answer(self, answer: Result) -> Status:
        """Write the positions that the planner returned."""
        if isinstance(answer, MotionError):
            raise answer
        assert isinstance(answer, Reached)
        target = Positions(zip(self._names, answer.positions, strict=True))
        self._set_output("target", target)
        self.feedback_message = self.context.robot.words(target)
        return Status.SUCCESS

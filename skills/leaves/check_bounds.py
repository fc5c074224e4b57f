"""A leaf that checks a target against the limits of the joints."""

from collections.abc import Mapping
from typing import Any

from py_trees.common import Status
from py_trees.ports import PortInformation

from hardware import Robot
from skills.base import Skill
from skills.errors import refuse
from skills.joint_targets import check_targets, joined, target_errors
from skills.ports import Positions


class CheckBounds(Skill):
    """Check targets of both groups, and join them. Fail if a joint is missing or out of limits."""

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
        """Check the targets that are known before the run."""
        given = {group: inputs[group] for group in cls.INPUT_PORTS if group in inputs}
        refuse(target_errors(robot, given))

    @classmethod
    def poses(cls, robot: Robot, inputs: Mapping[str, Any]) -> list[tuple[float, ...]]:
        """Return the goal if both targets are known, else an empty list."""
        if any(group not in inputs for group in cls.INPUT_PORTS):
            return []
        targets = {group: inputs[group] for group in cls.INPUT_PORTS}
        return [tuple(joined(robot, targets).values())]

    def on_start(self) -> Status:
        """Check both targets, and write them as one goal."""
        targets = {group: self.get_input(group) for group in self.INPUT_PORTS}
        check_targets(self.context.robot, targets)
        self._set_output("goal", joined(self.context.robot, targets))
        return Status.SUCCESS

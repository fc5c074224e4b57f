"""A leaf that writes the position of the arm, as the start of a motion."""

from py_trees.common import Status
from py_trees.ports import PortInformation

from skills.base import Skill
from skills.ports import Positions


class SetStart(Skill):
    """Write the commanded position of the arm, as the start of a plan."""

    pose_output = "start"

    OUTPUT_PORTS = {
        "start": PortInformation(
            Positions, description="commanded position of every actuated joint [rad]"
        )
    }

    def on_start(self) -> Status:
        """Write the commanded position."""
        start = Positions(self.context.robot.by_joint(self.context.arm.commanded))
        self._set_output("start", start)
        self.feedback_message = self.context.robot.words(start)
        return Status.SUCCESS

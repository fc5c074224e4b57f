"""A condition: the arm is active."""

from py_trees.common import Status

from hardware import State
from skills.base import Skill
from skills.errors import ConditionFails


class CheckHardware(Skill):
    """Succeed if the arm is active, else fail."""

    condition = True

    def on_start(self) -> Status:
        """Check the lifecycle state of the arm."""
        state = self.context.arm.state
        if state is not State.ACTIVE:
            raise ConditionFails(f"the arm is {state.name.lower()}, not active")
        return Status.SUCCESS

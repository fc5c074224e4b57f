"""A leaf that waits."""

from collections.abc import Mapping
from typing import Any

from py_trees.common import Status

from skills.base import Skill
from skills.ports import Port


class Wait(Skill):
    """Wait for a duration."""

    may_fail = False
    phase = "waiting"
    synonyms = ("sleep", "delay", "pause")

    INPUT_PORTS = {
        "duration": Port(float, description="duration [s]", unit="s", least=0.0, most=86_400.0)
    }

    _deadline = 0.0

    @classmethod
    def min_duration(cls, inputs: Mapping[str, Any]) -> float:
        """Return the duration if it is known, else 0 [s]."""
        duration: float = inputs.get("duration", 0.0)
        return duration

    def on_start(self) -> Status:
        """Set the deadline."""
        self._deadline = self.context.now() + self.get_input("duration")
        return self.on_running()

    def on_running(self) -> Status:
        """Succeed when the deadline has passed."""
        if self.context.now() >= self._deadline:
            return Status.SUCCESS
        self.context.wake_at(self._deadline)
        return Status.RUNNING

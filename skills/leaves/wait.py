"""Letting time pass."""

from collections.abc import Mapping
from typing import Any

from py_trees.common import Status
from py_trees.ports import PortInformation

from skills.base import Skill
from skills.ports import Port


class Wait(Skill):
    """Wait for a while."""

    may_fail = False
    doing = "waiting"

    INPUT_PORTS = {
        "duration": Port(float, description="how long [s]", unit="s", least=0.0, most=86_400.0)
    }
    OUTPUT_PORTS: dict[str, PortInformation] = {}

    _until = 0.0

    @classmethod
    def shortest(cls, inputs: Mapping[str, Any]) -> float:
        """As long as the file says [s]."""
        duration: float = inputs.get("duration", 0.0)
        return duration

    def on_start(self) -> Status:
        """Note when it ends."""
        self._until = self.context.now() + self.get_input("duration")
        return self.on_running()

    def on_running(self) -> Status:
        """Look at the clock."""
        if self.context.now() >= self._until:
            return Status.SUCCESS
        self.context.wake_at(self._until)
        return Status.RUNNING

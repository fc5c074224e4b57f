"""What was told of goals last: rosbridge's status topic."""

from collections import deque

from executive.errors import UnknownGoal
from executive.executive import Executive
from executive.goals.goal import GoalStatus

from . import protocol as ros


class Statuses:
    """The last status of every goal that is known, in the order in which they were accepted.

    Events are handled after the fact, so what the executive says now may be ahead of them.

    Args:
        executive: Whose goals; those it knows by now are known here.
    """

    def __init__(self, executive: Executive) -> None:
        self._executive = executive
        self._told: dict[str, str] = {}
        self._ended: deque[str] = deque()
        self._message = ""  # as long as no goal changes
        for goal in executive.goals():
            self.note(goal)

    def note(self, goal: GoalStatus) -> None:
        """Take what is told of a goal."""
        state = goal.state.value
        self._told[goal.identity] = ros.goal_status(goal.identity, goal.stamp_ns, state)
        self._message = ""
        if goal.outcome:
            self._ended.append(goal.identity)
        self._forget()

    def message(self) -> str:
        """All of them, as published."""
        self._forget()
        self._message = self._message or ros.status_array(self._told.values())
        return self._message

    def _forget(self) -> None:
        """Forget the goals that the executive has forgotten."""
        while self._ended and not self._known(self._ended[0]):
            self._told.pop(self._ended.popleft(), None)
            self._message = ""

    def _known(self, identity: str) -> bool:
        try:
            self._executive.goal(identity)
        except UnknownGoal:
            return False
        return True

"""The goals of a server, from its events."""

import asyncio
from collections.abc import Callable
from dataclasses import replace

from executive.api.outcome import GoalState, GoalStatus, Outcome, cause_of
from executive.errors import ServerLost

MOST_ENDED = 100  # number of ended goals in the list


class Goals:
    """The goals under way, and the last ones that ended, in the order of acceptance.

    Args:
        changed: Callback after every change.

    Attributes:
        known: Goals by id.
    """

    def __init__(self, changed: Callable[[GoalStatus], None]) -> None:
        self.known: dict[str, GoalStatus] = {}
        self._changed = changed
        self._ends: dict[str, asyncio.Future[GoalStatus]] = {}
        self._seen: dict[str, asyncio.Future[GoalStatus]] = {}

    def take(self, goal: GoalStatus) -> None:
        """Store the state of a goal, unless a later state or its end is known."""
        before = self.known.get(goal.identity)
        if before and (before.outcome or before.state.value >= goal.state.value):
            return
        self.known[goal.identity] = goal
        for futures in (self._seen, self._ends if goal.outcome else {}):
            if future := futures.pop(goal.identity, None):
                future.set_result(goal)
        ended = [each for each, status in self.known.items() if status.outcome]
        for identity in ended[:-MOST_ENDED]:
            del self.known[identity]
        self._changed(goal)

    async def seen(self, identity: str) -> GoalStatus:
        """Wait until a goal is known. Return its state."""
        return self.known.get(identity) or await self._wait(self._seen, identity)

    async def end(self, identity: str) -> GoalStatus:
        """Wait for the end of a known goal. Return its state."""
        goal = self.known[identity]
        return goal if goal.outcome else await self._wait(self._ends, identity)

    def lose(self, remaining: frozenset[str] = frozenset()) -> None:
        """End the goals under way, because the server is gone or has forgotten them.

        Args:
            remaining: Goals that are still under way.
        """
        cause = cause_of(ServerLost())
        for goal in tuple(self.known.values()):
            if not goal.outcome and goal.identity not in remaining:
                outcome = Outcome.of(goal.task, GoalState.ABORTED, cause)
                self.take(replace(goal, state=GoalState.ABORTED, outcome=outcome))

    async def _wait(
        self, futures: dict[str, asyncio.Future[GoalStatus]], identity: str
    ) -> GoalStatus:
        future = futures.setdefault(identity, asyncio.get_running_loop().create_future())
        return await asyncio.shield(future)

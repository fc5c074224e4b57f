"""Arms without hardware, for workers of a fleet: what `AsyncClient` does, without HTTP."""

import asyncio
from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager
from typing import Any

from executive.api import Policy
from executive.api.events import Status
from executive.api.outcome import (
    CancelCode,
    CancelResult,
    GoalState,
    GoalStatus,
    Outcome,
    cause_of,
)
from executive.client.asynchronous import AsyncClient
from executive.client.values import Task
from executive.errors import GoalBusy, GoalCanceled, Refused
from hardware import State


class SimulatedArm(AsyncClient):
    """The server of an arm whose goals last until they are ended, or for a time.

    Attributes:
        duration: Time that a goal takes [s]; None to wait for `finish`.
        received: Identities of the goals that it accepted, in order.
        started: Set when a goal is accepted.
        stops: Number of stops.
    """

    def __init__(self, url: str = "http://arm", duration: float | None = None) -> None:
        self.url, self.duration = url, duration
        self.received: list[str] = []
        self.tasks_of: list[int | str] = []
        self.started = asyncio.Event()
        self.stops = 0
        self._ended: dict[str, asyncio.Future[Outcome]] = {}

    async def status(self) -> Status:
        """The state: active, and busy while a goal runs."""
        goal = GoalStatus(self._running, 1, GoalState.EXECUTING, 1, None) if self._running else None
        nothing: Mapping[str, float] = {}
        return Status(
            State.ACTIVE, None, "", nothing, None, goal, None, "", "", 1, (), Policy.REJECT, False,
            (), self.stops, 1.0, 1.0,
        )  # fmt: skip

    @property
    def _running(self) -> str:
        return next((identity for identity, end in self._ended.items() if not end.done()), "")

    async def tasks(self) -> tuple[Task, ...]:
        """No task says anything of itself."""
        return ()

    @asynccontextmanager
    async def hold(self, goal_id: str) -> AsyncIterator[None]:
        """Cancel the goal when the context ends."""
        try:
            yield
        finally:
            self._end(goal_id, GoalState.CANCELED)

    async def send(
        self, task: int | str, arguments: Any = None, goal_id: str = "", deadman: bool = False
    ) -> str:
        """Accept a goal, or refuse a second one."""
        if self._running:
            raise Refused(cause_of(GoalBusy()))
        assert goal_id not in self.received, "executed twice"
        self.received.append(goal_id)
        self.tasks_of.append(task)
        loop = asyncio.get_running_loop()
        self._ended[goal_id] = loop.create_future()
        if self.duration is not None:
            loop.call_later(self.duration, self.finish, goal_id)
        self.started.set()
        return goal_id

    def finish(self, goal_id: str) -> None:
        """Let a goal succeed."""
        self._end(goal_id, GoalState.SUCCEEDED)

    async def result(self, goal_id: str, timeout: float | None = None) -> Outcome:
        """Wait for the end of a goal."""
        return await asyncio.shield(self._ended[goal_id])

    async def goals(self) -> tuple[GoalStatus, ...]:
        """The goals that it accepted."""
        return tuple(GoalStatus(each, 1, GoalState.EXECUTING, 1, None) for each in self.received)

    async def cancel(self, goal_id: str = "", stamp_ns: int = 0) -> CancelResult:
        """Cancel a goal."""
        self._end(goal_id, GoalState.CANCELED)
        return CancelResult(CancelCode.NONE, (goal_id,))

    async def stop(self) -> CancelResult:
        """Cancel the running goal."""
        self.stops += 1
        return await self.cancel(self._running)

    def _end(self, goal_id: str, state: GoalState) -> None:
        end = self._ended.get(goal_id)
        if end and not end.done():
            cause = None if state is GoalState.SUCCEEDED else cause_of(GoalCanceled())
            end.set_result(Outcome.of(1, state, cause, 3, 0.5, "recordings/one.mcap"))

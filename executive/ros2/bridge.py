"""The connection to the server: follows its events, sends goals, and holds them."""

import asyncio
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from typing import Any, Self

import logs
from executive.api.events import Event
from executive.api.outcome import GoalStatus, cause_of
from executive.client.asynchronous import AsyncClient
from executive.client.held_goals import HeldGoals
from executive.client.values import Task
from executive.errors import ClientError, DuplicateGoal, Refused, ServerUnreachable
from hardware import Robot

from .goals import Goals

_CLIENT = "armtree-ros2"
_KINDS = "status", "feedback", "sent", "measured", "lifecycle"
_PAUSE_SECONDS = 0.5  # time between two attempts to reach the server
# Time without a server until its goals count as aborted and new goals are refused.
LOST_SECONDS = 2.0
_SEEN_SECONDS = 2.0  # longest time from the answer to a request to the events of its effect
_END_SECONDS = 1.5  # at the end of this process, longest time for the end of its goals
_TASKS_SECONDS = 3.0  # time between two reads of the list of tasks, because files may change


class Bridge:
    """The node's connection to a server. All parts of the node share it.

    Use it as an asynchronous context.

    Args:
        url: URL of the server.
        robot: Robot of the arm.
        log: Logger of the node.

    Attributes:
        goals: Goals of the server.
        robot: Robot of the arm.
        tasks: Tasks of the server.
        arm: State of the hardware; empty if the server does not answer.
        on_goal: Callback for each new state of a goal.
        on_event: Callback for every other event.
        on_tasks: Callback after a change of the tasks.
    """

    def __init__(self, url: str, robot: Robot, log: Any) -> None:
        self.robot, self.log = robot, log
        self.goals = Goals(self._goal_changed)
        self.tasks: tuple[Task, ...] = ()
        self.arm = ""
        self.on_goal: list[Callable[[GoalStatus], None]] = []
        self.on_event: list[Callable[[Event], None]] = []
        self.on_tasks: list[Callable[[], None]] = []
        self._connect = partial(AsyncClient, url, name=_CLIENT)
        self.client = self._connect()
        self._held, self._connected = HeldGoals(), asyncio.Event()
        self._arm_changed = asyncio.Event()

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(self, *raised: object) -> None:
        self._release()
        await self.client.close()

    async def run(self) -> None:
        """Follow the server while it answers. Reconnect after a loss."""
        told, losing = "", list[asyncio.TimerHandle]()
        while True:
            try:
                async with self.client.events(*_KINDS) as events:
                    await self._synchronize()
                    self.log.info(f"connected to {self.client.url}; the arm is {self.arm}")
                    told = ""
                    while losing:
                        losing.pop().cancel()
                    async for event in events:
                        self._take(event)
            except ClientError as error:
                if not told:
                    self.log.error(f"{error}")
                told = str(error)
            if self.arm:
                self.arm = ""
                self._connected.clear()
                losing.append(asyncio.get_running_loop().call_later(LOST_SECONDS, self._lose))
            await asyncio.sleep(_PAUSE_SECONDS)

    async def follow_tasks(self) -> None:
        """Read the list of tasks every few seconds while the server answers."""
        while True:
            await asyncio.sleep(_TASKS_SECONDS)
            if self.arm:
                with suppress(ClientError):
                    await self._read_tasks()

    async def connected(self) -> None:
        """Wait until the goals of the server are known.

        Raises:
            ServerUnreachable: The server does not answer in time.
        """
        try:
            async with asyncio.timeout(LOST_SECONDS):
                await self._connected.wait()
        except TimeoutError as error:
            words = "the node is not connected to it"
            raise ServerUnreachable(self.client.url, words) from error

    async def send(self, task: int | str, goal_id: str = "") -> GoalStatus:
        """Send a goal. It is canceled if this process ends or loses the server.

        Args:
            task: Number or name of the task. It gets its default arguments.
            goal_id: 32 hexadecimal digits; empty for random ones.

        Raises:
            ClientError: The server refuses the goal, or does not answer.
        """

        def post(client: AsyncClient, identity: str) -> Any:
            return client.send(task, None, identity, deadman=True)

        await self.connected()
        if goal_id in self.goals.known or goal_id in self._held.tasks:
            raise Refused(cause_of(DuplicateGoal(goal_id)))
        identity = await self._held.send(self._connect, post, goal_id)
        try:
            async with asyncio.timeout(_SEEN_SECONDS):
                return await self.goals.seen(identity)
        except TimeoutError:
            self.goals.take(await self.client.goal(identity))
            return self.goals.known[identity]

    async def change_arm(self, transition: str) -> None:
        """Request a transition of the arm, and wait until `arm` is the new state.

        Raises:
            ClientError: The transition failed, or the server does not answer.
        """
        state = await self.client.arm(transition)
        with suppress(TimeoutError):  # the arm has changed again
            async with asyncio.timeout(_SEEN_SECONDS):
                while self.arm != state:
                    self._arm_changed.clear()
                    await self._arm_changed.wait()

    async def end(self) -> None:
        """End the goals of this process."""
        ours = self._held.tasks.keys() & self.goals.known.keys()
        ends = [asyncio.ensure_future(self.goals.end(each)) for each in ours]
        self._release()
        if ends and self.arm:
            await asyncio.wait(ends, timeout=_END_SECONDS)

    def _lose(self) -> None:
        """Report all goals as ended. Stop holding those of this process, so that they end."""
        self._release()
        self.goals.lose()

    def _release(self) -> None:
        """Stop holding the goals of this process, so that the server cancels them."""
        for identity in tuple(self._held.tasks):
            self._held.release(identity)

    async def _synchronize(self) -> None:
        await self._read_tasks()
        status, goals = await self.client.status(), await self.client.goals()
        self.arm = status.arm.value
        for goal in goals:
            self.goals.take(goal)
        self.goals.lose(frozenset(goal.identity for goal in goals))
        self._connected.set()

    async def _read_tasks(self) -> None:
        if (found := await self.client.tasks()) != self.tasks:
            self.tasks = found
            for act in self.on_tasks:
                act()

    def _take(self, event: Event) -> None:
        if isinstance(event, GoalStatus):
            self.goals.take(event)
            return
        if isinstance(event, logs.Transition):
            self.arm = event.goal
            self._arm_changed.set()
        for act in self.on_event:
            act(event)

    def _goal_changed(self, goal: GoalStatus) -> None:
        for act in self.on_goal:
            act(goal)

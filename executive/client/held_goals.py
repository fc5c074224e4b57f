"""Held goals: they end with this process, and with its connection to the server."""

import asyncio
import uuid
from collections.abc import Awaitable, Callable

from executive.api.outcome import cause_of
from executive.errors import ClientError, Refused, TooMuch

from .asynchronous import AsyncClient

MOST_HELD = 4  # largest number of held goals; each needs three of the server's streams

Connect = Callable[[], AsyncClient]
Send = Callable[[AsyncClient, str], Awaitable[str]]


class HeldGoals:
    """The goals of this process. They are canceled if the process ends or loses the server.

    Attributes:
        tasks: asyncio task that holds each goal, by id.
    """

    def __init__(self) -> None:
        self.tasks: dict[str, asyncio.Task[None]] = {}

    async def send(self, connect: Connect, send: Send, goal_id: str = "") -> str:
        """Send a goal, and hold it until it ends. Return its id.

        Args:
            connect: Callback that returns a client of the server.
            send: Callback that sends the goal with an id and with `deadman`.
            goal_id: 32 hexadecimal digits; empty for random ones.

        Raises:
            ClientError: The server refuses the goal, or too many goals are held.
        """
        if len(self.tasks) >= MOST_HELD:
            words = f"{MOST_HELD} goals of this process are under way, which is the limit"
            raise Refused(cause_of(TooMuch(words)))
        goal_id = goal_id or uuid.uuid4().hex
        accepted: asyncio.Future[str] = asyncio.get_running_loop().create_future()

        async def hold() -> None:
            try:
                async with connect() as client, client.hold(goal_id):
                    accepted.set_result(await send(client, goal_id))
                    await client.result(goal_id)
            except ClientError as error:
                if not accepted.done():
                    accepted.set_exception(error)
            finally:
                del self.tasks[goal_id]

        self.tasks[goal_id] = asyncio.create_task(hold())
        try:
            return await accepted
        except asyncio.CancelledError:  # also at the moment of the acceptance
            self.release(goal_id)
            raise

    def release(self, goal_id: str) -> None:
        """Stop holding a goal, so that the server cancels it."""
        if holding := self.tasks.get(goal_id):
            holding.cancel()

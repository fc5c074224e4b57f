"""Requests the jobs of a pool from the NATS server, one at a time, the highest priority first."""

import asyncio
import json
from collections.abc import Sequence
from contextlib import suppress
from typing import Any

from nats.aio.msg import Msg
from nats.aio.subscription import Subscription

from .connection import GONE, JOBS, Fleet, consumer_of
from .values import PRIORITIES

_PULL_SECONDS = 20.0  # longest time that a request waits at the NATS server
_ANSWER_SECONDS = 1.0  # longest time for the answer that no job is queued


class JobRequests:
    """The requests of one arm.

    Args:
        fleet: The fleet.
        pool: Name of the pool.
    """

    def __init__(self, fleet: Fleet, pool: str) -> None:
        self._fleet, self._pool = fleet, pool
        self._inbox, self._subscription = "", None  # type: str, Subscription | None
        self._wanted: asyncio.Future[Msg | None] | None = None
        self._withdrawing: asyncio.Task[None] | None = None

    async def next(self) -> Msg | None:
        """Return the queued job of the highest priority; None if none comes for a while."""
        for priority in PRIORITIES[:-1]:
            if found := await self._ask([priority], _ANSWER_SECONDS, no_wait=True):
                return found
        begin = (loop := asyncio.get_running_loop()).time()
        try:
            found = await self._ask(PRIORITIES, _PULL_SECONDS, expires=round(_PULL_SECONDS * 1e9))
        finally:
            self._withdraw()
        if not found and loop.time() - begin < _ANSWER_SECONDS:  # the NATS server refuses
            await asyncio.sleep(_ANSWER_SECONDS)
        return found

    def repeat(self) -> None:
        """Make `next` return: the NATS server has forgotten the requests."""
        if self._wanted and not self._wanted.done():
            self._wanted.set_result(None)

    async def _ask(self, priorities: Sequence[str], seconds: float, **how: Any) -> Msg | None:
        """Return the first job that is sent for a request per priority; None for none.

        Args:
            priorities: The priorities.
            seconds: Longest time to wait [s].
            how: Options of the requests.
        """
        connection = self._fleet.nats
        if self._subscription is None:
            self._inbox = connection.new_inbox()
            self._subscription = await connection.subscribe(self._inbox, cb=self._note)
        self._wanted = wanted = asyncio.get_running_loop().create_future()
        for priority in priorities:
            subject = f"$JS.API.CONSUMER.MSG.NEXT.{JOBS}.{consumer_of(self._pool, priority)}"
            request = json.dumps({"batch": 1, **how}).encode()
            await connection.publish(subject, request, self._inbox)
        await asyncio.wait((wanted,), timeout=seconds)
        self._wanted = None
        return wanted.result() if wanted.done() else None

    async def _note(self, message: Msg) -> None:
        is_job = not (message.headers and message.headers.get("Status"))
        if self._wanted and not self._wanted.done():
            self._wanted.set_result(message if is_job else None)
        elif is_job:  # two requests were answered at once, or one too late
            await message.nak()

    def _withdraw(self) -> None:
        """Withdraw the requests that are open. Jobs that were sent before are given back."""
        if self._subscription:
            self._withdrawing = asyncio.create_task(_drain(self._subscription))
            self._subscription = None


async def _drain(subscription: Subscription) -> None:
    with suppress(*GONE):
        await subscription.drain()  # type: ignore[no-untyped-call]

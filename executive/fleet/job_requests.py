"""Requests the jobs of a pool from the NATS server, one at a time, highest priority first."""

import asyncio
import json
from collections.abc import Sequence
from typing import Any

from nats.aio.msg import Msg
from nats.aio.subscription import Subscription

from .connection import JOBS, Fleet, consumer_of
from .values import PRIORITIES

_PULL_SECONDS = 20.0  # longest time of a waiting request at the NATS server
_ANSWER_SECONDS = 1.0  # longest time for the answer that no job is queued


class JobRequests:
    """The requests of one arm.

    Waiting requests share an inbox that accepts one message: a job, or "no job". The NATS server
    then closes the inbox, and delivers no further job to it.

    Args:
        fleet: The fleet.
        pool: Name of the pool.
    """

    def __init__(self, fleet: Fleet, pool: str) -> None:
        self._fleet, self._pool = fleet, pool
        self._inbox: Subscription | None = None
        self._answer: asyncio.Future[Msg]  # future message of the inbox
        self._forgotten = asyncio.Event()
        self._withdrawn = False

    async def next(self) -> Msg | None:
        """Return the queued job of the highest priority; None if no job comes in time."""
        self._withdrawn = False
        for priority in PRIORITIES[:-1]:
            if found := await self._ask([priority], _ANSWER_SECONDS, no_wait=True):
                return found
        begin = (loop := asyncio.get_running_loop()).time()
        longest = _PULL_SECONDS + _ANSWER_SECONDS
        found = await self._ask(PRIORITIES, longest, expires=round(_PULL_SECONDS * 1e9))
        if self._inbox and not self._forgotten.is_set():  # all requests of the inbox have expired
            await self._inbox.unsubscribe()
            self._inbox = None
        # An early empty answer: the NATS server refuses the request.
        early = loop.time() - begin < _ANSWER_SECONDS
        if early and not (found or self._forgotten.is_set()):
            await asyncio.sleep(_ANSWER_SECONDS)
        return found

    def repeat(self) -> None:
        """Make `next` return, because the NATS server has forgotten the requests."""
        self._forgotten.set()

    def withdraw(self) -> None:
        """Withdraw the waiting requests. `next` then returns, with a job if one is on its way."""
        self._withdrawn = True
        self._forgotten.set()

    async def _ask(self, priorities: Sequence[str], seconds: float, **how: Any) -> Msg | None:
        """Request a job of each priority. Return the first job, or None.

        An inbox without a message is kept. A late message in it answers the next requests.

        Args:
            priorities: The priorities.
            seconds: Longest time to wait [s].
            how: Options of the requests.
        """
        if self._withdrawn:
            return None
        connection = self._fleet.nats
        if self._inbox is None:
            self._answer = asyncio.get_running_loop().create_future()
            inbox = await connection.subscribe(connection.new_inbox(), future=self._answer)
            await inbox.unsubscribe(limit=1)
            self._inbox = inbox
        if not self._withdrawn:
            self._forgotten.clear()
        for priority in priorities:
            subject = f"$JS.API.CONSUMER.MSG.NEXT.{JOBS}.{consumer_of(self._pool, priority)}"
            request = json.dumps({"batch": 1, **how}).encode()
            await connection.publish(subject, request, self._inbox.subject)
        forgotten = asyncio.ensure_future(self._forgotten.wait())
        try:
            waited = (self._answer, forgotten)
            await asyncio.wait(waited, timeout=seconds, return_when=asyncio.FIRST_COMPLETED)
        finally:
            forgotten.cancel()
        if self._withdrawn and not self._answer.done():
            inbox, self._inbox = self._inbox, None
            await inbox.drain()  # returns when no further message can come
        if not self._answer.done():
            return None
        message, self._inbox = self._answer.result(), None
        return message if message.reply else None  # only a job has a subject for its reply

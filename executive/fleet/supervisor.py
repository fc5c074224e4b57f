"""Ends the jobs of lost arms. Only this module decides that an arm is lost."""

import asyncio
import logging
from collections import Counter
from collections.abc import AsyncIterator
from dataclasses import replace

from nats.js.errors import KeyWrongLastSequenceError

from hardware import Clock, utc_ns

from .connection import ALIVE_SECONDS, GONE, Fleet
from .errors import ArmLost
from .fleet_client import FleetClient, publish
from .values import JobRecord, Presence, failed, to_bytes

logger = logging.getLogger(__name__)

LOST_SECONDS = 1.5 * ALIVE_SECONDS  # silence after which an arm is lost
MOST_ATTEMPTS = 3
_SWEEP_SECONDS = 5.0


class Supervisor:
    """Ends the claimed jobs of lost arms, or sends them again if their task is `retry: safe`.

    Several supervisors may run at once. Each change is made once.

    Args:
        fleet: The fleet, with a connection that always reconnects.
        clock: Time source.

    Attributes:
        ended: Number of jobs that ended, by pool, state and code.
    """

    def __init__(self, fleet: Fleet, clock: Clock) -> None:
        self._fleet, self._clock = fleet, clock
        self._silent: dict[str, float] = {}  # start of the arm's silence, by job [s]
        self._claimed: dict[str, JobRecord] = {}
        self._waiting = dict[str, str]()  # last logged text about waiting jobs, by pool
        self._revision = 0  # revision of the last record that was read
        self.ended = Counter[tuple[str, str, str]]()

    async def run(self) -> None:
        """Supervise until canceled."""
        while True:
            try:
                async for record in self.sweep():
                    logger.warning(
                        "The job %s of %s is %s: its arm is lost",
                        record.job.identity,
                        record.arm,
                        "aborted" if record.result else "sent again",
                    )
                await self._log_waiting()
            except GONE:
                self.reconnected()
            await asyncio.sleep(_SWEEP_SECONDS)

    async def _log_waiting(self) -> None:
        """Log the pools whose jobs wait for an arm, at each change of the states of their arms."""
        waiting = await FleetClient(self._fleet, self._clock).waiting()
        arms = {pool: words.partition(";")[0] for pool, words in waiting.items()}
        for pool, words in arms.items():
            if words != self._waiting.get(pool):
                logger.warning("%s", waiting[pool])
        self._waiting = arms

    def reconnected(self) -> None:
        """Give all arms time to reconnect, and read all records again."""
        self._silent.clear()
        self._claimed.clear()
        self.ended.clear()
        self._revision = 0

    @property
    def claimed(self) -> int:
        """Number of claimed jobs that have not ended."""
        return len(self._claimed)

    async def sweep(self) -> AsyncIterator[JobRecord]:
        """Check all claimed jobs once. Yield the jobs that end here or are sent again."""
        changed, self._revision = await self._fleet.changes(JobRecord, self._revision)
        for identity, record in changed.items():
            self._claimed.pop(identity, None)
            if record and record.result is None:
                self._claimed[identity] = record
            elif record and record.result and not record.late:  # a late result was counted before
                self.ended[record.job.pool, record.state, record.result.code] += 1
        alive = await self._fleet.values(Presence)
        now = self._clock.now()
        silent = {
            identity: self._silent.get(identity, now)
            for identity, record in self._claimed.items()
            if not ((there := alive.get(record.arm)) and there.job == identity)
        }
        self._silent = silent
        for identity, since in silent.items():
            if now - since >= LOST_SECONDS and (
                given_up := await self._give_up(self._claimed[identity], now - since)
            ):
                yield given_up

    async def _give_up(self, record: JobRecord, silence: float) -> JobRecord | None:
        job = record.job
        if record.retry_safe and job.attempt < MOST_ATTEMPTS:
            # The next worker replaces this record. The server refuses a repetition of this message.
            again = replace(job, attempt=job.attempt + 1)
            return None if await publish(self._fleet, again) else replace(record, job=again)
        found = await self._fleet.get(JobRecord, job.identity)
        if found is None or found[0] != record:
            return None
        lost = ArmLost(record.arm, record.url, silence)
        now = utc_ns(self._clock)
        ended = replace(record, result=failed(lost), ended_ns=now)
        try:
            await self._fleet.jobs.update(job.identity, to_bytes(ended), last=found[1])
        except KeyWrongLastSequenceError:
            return None
        return ended

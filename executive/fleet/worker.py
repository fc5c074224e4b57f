"""The worker of an arm: runs the jobs of a pool as a client of the arm's server."""

import asyncio
import json
import logging
import math
import random
import socket
import uuid
from collections.abc import Awaitable, Callable
from contextlib import suppress
from dataclasses import replace
from typing import Any, TypeVar

from nats.aio.msg import Msg
from nats.js.errors import APIError, KeyWrongLastSequenceError

from executive.api import strict_json
from executive.api.events import Status
from executive.api.outcome import Ending, GoalState, cause_of
from executive.client.asynchronous import AsyncClient
from executive.errors import ClientError, GoalBusy, QueueFull, ServerUnreachable
from hardware import Clock, State, utc_ns

from .connection import ALIVE_SECONDS, GONE, Fleet, control_subject, end_all
from .errors import ArmLost, BadJob, DeadlinePassed, FleetError, NameTaken, TooLong
from .job_requests import JobRequests
from .values import (
    BUSY,
    HELD,
    IDENTITY,
    READY,
    UNREACHABLE,
    Job,
    JobRecord,
    Member,
    Presence,
    failed,
    from_bytes,
    to_bytes,
)

T = TypeVar("T")

logger = logging.getLogger(__name__)

BEAT_SECONDS = 3.0  # time between two presences
_SPREAD = 0.3, 1.0  # delay of a presence after a change [s]
_LAST_SECONDS = 3.0  # longest time for the last result after `end`
_PAUSE_SECONDS = 1.0  # delay before a failed step is repeated
_STORE_SECONDS = 0.1  # longest time that the confirmation of a stop waits until its hold is stored
_ATTEMPTS = 10  # largest number of attempts to reach the server of the arm for a result
# Codes of refusals before any motion, so that another arm may run the job.
_NOT_NOW = (GoalBusy.code, QueueFull.code)

_BY_FLEET, _AT_ARM = "stopped by the fleet", "stopped at the arm"  # reasons to take no jobs


class Worker:
    """Joins an arm to a fleet.

    Args:
        fleet: The fleet, with a connection that always reconnects.
        server: Client of the server of the arm.
        pool: Name of its pool.
        name: Name of the arm in the pool.
        clock: Time source.
        page: URL of the server for other machines; empty for the URL of `server`.
    """

    def __init__(
        self,
        fleet: Fleet,
        server: AsyncClient,
        pool: str,
        name: str,
        clock: Clock,
        page: str = "",
    ) -> None:
        self._fleet, self._server, self._pool, self._clock = fleet, server, pool, clock
        self._page = page or server.url
        self.arm = f"{pool}.{name}"
        self._me = uuid.uuid4().hex
        self._presence = Presence(self._me, UNREACHABLE)
        self._held = ""  # why the arm takes no job; empty if it takes jobs
        self._stops: int | None = None  # number of stops of the server; None if unknown
        self._canceled: set[str] = set()  # jobs that the fleet has canceled
        self._revision = 0  # revision of the stored presence; 0 if it is not stored
        self._joined_ns = utc_ns(clock)
        self._member: Member | None = None  # member that the NATS server stores; None if unknown
        self._in_order = True
        self._changed, self._free = asyncio.Event(), asyncio.Event()
        self._idle, self._ending = asyncio.Event(), asyncio.Event()
        self._sending = asyncio.Lock()  # held from the claim of a job until its arm has accepted it
        self._looking, self._storing = asyncio.Lock(), asyncio.Lock()
        self._requests = JobRequests(fleet, pool)
        self._idle.set()

    async def run(self) -> None:
        """Run jobs of the pool until `end` is called.

        Raises:
            NameTaken: Another worker has that name.
        """
        await self._join()
        recovering = asyncio.create_task(self._recover())
        parts = (self._beat(), self._work(), self._ending.wait())
        tasks = [asyncio.create_task(part) for part in parts]
        try:
            await self._listen("stop", self._stop)
            await self._listen("resume", self._resume)
            await self._listen("cancel", self._cancel)
            done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
            self._ending.set()
            with suppress(TimeoutError):
                async with asyncio.timeout(_LAST_SECONDS):
                    await self._idle.wait()
            for task in done:
                task.result()  # raises NameTaken, and errors of bugs
        finally:
            await end_all(recovering, *tasks)
            await self._leave()

    def end(self, in_order: bool = True) -> None:
        """Take no more jobs. `run` returns when the result of the last job is stored.

        Args:
            in_order: False if the server of the arm has died. The arm then remains a member, so
                that a stop reports it as missing.
        """
        self._in_order = in_order
        self._ending.set()

    @property
    def _refusal(self) -> str:
        """Why the arm takes no job; empty if it takes jobs."""
        return "ending" if self._ending.is_set() else self._held

    async def reconnected(self) -> None:
        """Request a job again, because a reconnect or a stop has ended the last request."""
        self._changed.set()
        self._requests.repeat()

    async def _join(self) -> None:
        """Store presence and member. Wait if a dead worker had the name: it becomes free.

        An arm that a stop holds is also held by a new worker.
        """
        end = self._clock.now() + ALIVE_SECONDS + 2 * _PAUSE_SECONDS
        while True:
            try:
                if earlier := await self._stored(Member):
                    self._held = earlier[0].held
                await self._say()
                return
            except NameTaken:
                if self._clock.now() > end:
                    raise
            except GONE as error:
                logger.debug("Fleet: %r", error)
            await asyncio.sleep(_PAUSE_SECONDS)

    async def _say(self) -> None:
        """Store the presence, and the member if the NATS server may not know it.

        Raises:
            NameTaken: Another worker has stored its presence with this name.
        """
        fleet, data = self._fleet, to_bytes(self._presence)
        try:
            if self._revision:
                self._revision = await fleet.alive.update(self.arm, data, last=self._revision)
            else:
                self._revision = await fleet.alive.create(self.arm, data)
        except KeyWrongLastSequenceError:
            found, member = await self._stored(Presence), await self._stored(Member)
            self._revision = 0
            if found and found[0].worker != self._me:
                raise NameTaken(self.arm, member[0].url if member else "unknown") from None
            if found:  # an answer was lost
                self._revision = found[1]
            else:  # it expired, or the NATS server restarted, perhaps without its disk
                self._member = None
            await self._say()
        await self._store_member()

    async def _store_member(self) -> None:
        """Store the member and the consumers of its pool, unless the NATS server has them."""
        async with self._storing:  # so that no older hold is stored after a newer hold
            if self._member is None and await self._fleet.add_consumers(self._pool):
                self._held = self._held or _BY_FLEET
            host = socket.gethostname()
            mine = Member(self.arm, self._page, host, self._me, self._joined_ns, self._held)
            if mine != self._member:
                self._member = None  # unknown until the answer, which may be lost
                await self._fleet.members.put(self.arm, to_bytes(mine))
                self._member = mine

    async def _store_hold(self) -> None:
        """Store the hold of a stop, in case this worker dies. If NATS is slow, `_beat` does it."""
        with suppress(*GONE):
            async with asyncio.timeout(_STORE_SECONDS):
                if self._revision:  # else another worker may have the name
                    await self._store_member()

    async def _stored(self, kind: type[T]) -> tuple[T, int] | None:
        """Return a stored value of this arm, and its revision. Remove a malformed value."""
        try:
            return await self._fleet.get(kind, self.arm)
        except BadJob as error:
            logger.warning("Fleet: removed a malformed value of %s: %s", self.arm, error)
            bucket = self._fleet.alive if kind is Presence else self._fleet.members
            await bucket.purge(self.arm)
            return None

    async def _leave(self) -> None:
        if not self._revision:  # another worker has the name
            return
        with suppress(*GONE):
            if self._in_order and self._idle.is_set() and self._held != _BY_FLEET:
                await self._fleet.members.purge(self.arm)
            else:
                await self._store_member()
            await self._fleet.alive.purge(self.arm)

    async def _beat(self) -> None:
        """Report the state of the arm every few seconds and at every change."""
        while True:
            await self._look()
            self._changed.clear()
            with suppress(*GONE):
                await self._say()
            with suppress(TimeoutError):
                async with asyncio.timeout(BEAT_SECONDS):
                    await self._changed.wait()
                # The delay limits the traffic: short jobs change the state often, and a stop
                # changes all arms at once.
                await asyncio.sleep(random.uniform(*_SPREAD))

    async def _look(self) -> bool:
        """Read the state of the arm from its server. Return True if it can take a job."""
        try:
            status = await self._status()
            state = BUSY if status.goal or self._presence.job else status.arm.value
        except ClientError:
            state = UNREACHABLE
        if state == State.ACTIVE.value:
            state = HELD if self._refusal else READY
        self._presence = replace(self._presence, state=state)
        if state == READY:
            self._free.set()
        else:
            self._wait()
        return state == READY

    async def _status(self) -> Status:
        """Return the status of the server. Hold the arm if it was stopped, also while idle."""
        async with self._looking:  # so that no older count comes after a newer count
            status = await self._server.status()
            if self._stops is not None and status.stops > self._stops:
                self._hold_after_stop()
            self._stops = status.stops
        return status

    def _hold_after_stop(self) -> None:
        if self._held:
            return
        self._held = _AT_ARM
        self._changed.set()
        logger.warning("Fleet: %s was stopped, and takes no jobs until a resume", self.arm)

    def _wait(self) -> None:
        """Take no job for now. Also withdraw the request that waits at the NATS server."""
        self._free.clear()
        self._requests.withdraw()

    async def _work(self) -> None:
        """Take one job after the other."""
        while True:
            if not await self._look():
                await self._free.wait()
            try:
                if message := await self._requests.next():
                    await self._take(message)
            except GONE as error:  # an unclaimed job is delivered again
                logger.debug("Fleet: %r", error)
                await asyncio.sleep(_PAUSE_SECONDS)

    async def _take(self, message: Msg) -> None:
        """Run a job, unless another arm has claimed it."""
        try:
            job = from_bytes(Job, message.data)
        except BadJob as error:
            logger.warning("Fleet: a job was dropped: %s", error)
            await message.term()
            return
        ready, safe = await asyncio.gather(self._look(), self._is_retry_safe(job))
        if not ready:
            await message.nak()
            return
        # If this process dies or pauses for a second, the hold ends. The server then cancels the
        # goal, or refuses the goal if it arrives later.
        async with self._server.hold(job.identity):
            async with self._sending:
                record, revision, left = await self._claim(message, job, safe)
                if record.result or not revision:
                    await message.ack()
                    return
                self._set_job(job.identity)
                result = await self._send(job)
            if result is None:
                with suppress(*GONE):
                    await message.ack()
                result = await self._result(job, left)
            elif result.code in _NOT_NOW:
                await self._release(job.identity, revision)
                self._set_job("")
                await message.nak(_PAUSE_SECONDS)
                return
        await self._store(record, revision, result)
        self._presence = replace(self._presence, last=result.code, done=self._presence.done + 1)
        self._set_job("")
        if not message.is_acked:
            await message.ack()

    async def _send(self, job: Job) -> Ending | None:
        """Send a claimed job to the arm. Return None if the arm accepts it, else the failure."""
        if why := self._refusal:
            return failed(GoalBusy(f"{self.arm} is held: {why}"))
        try:
            await self._server.send(job.task, job.arguments, job.identity, deadman=True)
        except ServerUnreachable:
            return None  # the arm may have accepted it; `_result` finds out
        except ClientError as error:
            return failed(error)
        return None

    async def _release(self, identity: str, revision: int) -> None:
        """Remove the claim of a refused job. Wait as long as the NATS server is gone."""
        while True:
            try:
                await self._fleet.jobs.delete(identity, last=revision)
                break
            except APIError:
                break  # the first answer was lost
            except GONE:
                await asyncio.sleep(_PAUSE_SECONDS)

    async def _result(self, job: Job, left: float | None) -> Ending:
        """Wait for the end of a job. Cancel the job after `left` [s]; None for no limit."""
        waiting = asyncio.create_task(self._end_of(job.identity))
        try:
            in_time, _ = await asyncio.wait((waiting,), timeout=left)
            if not in_time:
                self._canceled.add(job.identity)
            while not waiting.done():  # a cancel may be lost
                with suppress(ClientError):
                    await self._server.cancel(job.identity)
                await asyncio.wait((waiting,), timeout=_PAUSE_SECONDS)
            ending = await waiting
        finally:
            waiting.cancel()
        if ending.state is GoalState.CANCELED and job.identity not in self._canceled:
            self._hold_after_stop()
        self._canceled.discard(job.identity)
        if ending.state is GoalState.CANCELED and not in_time:
            cause = cause_of(TooLong(job.end_within_s or 0.0))
            ending = replace(ending, code=cause.code, message=cause.message, cause=cause)
        return ending

    async def _end_of(self, identity: str) -> Ending:
        """Wait for the end of a goal, also if its server is unreachable for a moment."""
        attempt = 1
        while True:
            try:
                return await self._server.result(identity)
            except ClientError as error:
                if not isinstance(error, ServerUnreachable) or attempt == _ATTEMPTS:
                    return failed(error)
            attempt += 1
            await asyncio.sleep(_PAUSE_SECONDS)

    async def _is_retry_safe(self, job: Job) -> bool:
        try:
            tasks = await self._server.tasks()
        except ClientError:
            return False
        wanted = (each for each in tasks if job.task in (each.number, each.name))
        return any(each.retry_safe for each in wanted)

    async def _claim(
        self, message: Msg, job: Job, safe: bool
    ) -> tuple[JobRecord, int, float | None]:
        """Create the record of a job. Wait as long as the NATS server is gone.

        The record may be stored even if the answer is lost. Giving up then would leave a claim
        without a run.

        Args:
            message: Message of the job.
            job: The job.
            safe: True if its task may run again after its arm was lost.

        Returns:
            The record, its revision, and the time until the latest end of the job [s], None for no
            limit. The record has a result if the job comes too late. The revision is 0 if another
            arm was first.
        """
        limits = [each for each in (job.start_within_s, job.end_within_s) if each is not None]
        while True:
            try:
                age = await self._fleet.age(message, job) if limits else 0.0
                late = age - min(limits, default=math.inf)
                result = failed(DeadlinePassed(late)) if late > 0 else None
                now = utc_ns(self._clock)
                end = now if result else 0
                record = JobRecord(job, self.arm, self._page, self._me, now, safe, result, end)
                left = None if job.end_within_s is None else job.end_within_s - age
                return record, await self._create(record), left
            except GONE as error:
                if self._refusal:
                    raise
                logger.debug("Fleet: %r", error)
                await asyncio.sleep(_PAUSE_SECONDS)

    async def _create(self, record: JobRecord) -> int:
        """Create the record of a job. Return its revision, or 0 if another arm was first.

        A second attempt replaces the record of a lost arm.
        """
        identity = record.job.identity
        try:
            return await self._fleet.jobs.create(identity, to_bytes(record))
        except KeyWrongLastSequenceError:
            try:
                found = await self._fleet.get(JobRecord, identity)
            except BadJob as error:
                logger.warning("Fleet: the job %s was dropped: %s", identity, error)
                return 0
        if found is None or found[0].result:
            return 0
        earlier, revision = found
        mine = earlier.worker == self._me and earlier.job == record.job  # the answer was lost
        if not (mine or record.job.attempt > earlier.job.attempt):
            return 0
        try:
            return await self._fleet.jobs.update(identity, to_bytes(record), last=revision)
        except KeyWrongLastSequenceError:
            return 0

    async def _store(self, record: JobRecord, revision: int, result: Ending) -> None:
        """Store the result of a job. Wait as long as the NATS server is gone."""
        identity, told = record.job.identity, False
        mine = replace(record, result=result, ended_ns=utc_ns(self._clock))
        while True:
            try:
                await self._fleet.jobs.update(identity, to_bytes(mine), last=revision)
                return
            except KeyWrongLastSequenceError:
                with suppress(*GONE):
                    try:
                        found = await self._fleet.get(JobRecord, identity)
                    except BadJob as error:
                        words = "Fleet: the record of %s was invalid and is replaced: %s"
                        logger.warning(words, identity, error)
                        await self._fleet.jobs.put(identity, to_bytes(mine))
                        return
                    if found is None:  # the NATS server has lost its disk
                        await self._fleet.jobs.create(identity, to_bytes(mine))
                        return
                    if found[0].worker != self._me or to_bytes(found[0]) == to_bytes(mine):
                        return  # another arm has the job now, or the first answer was lost
                    mine, revision = replace(mine, late=True), found[1]
            except GONE as error:
                if not told:
                    words = "Fleet: the NATS server is gone (%s); the result is stored later"
                    logger.warning(words, error)
                told = True
                await asyncio.sleep(_PAUSE_SECONDS)

    async def _recover(self) -> None:
        """Store the results of jobs of an earlier worker of this arm."""
        try:
            for goal in await self._server.goals():
                with suppress(BadJob):  # a malformed record is not of this arm
                    await self._recover_goal(goal.identity)
        except (ClientError, FleetError) as error:
            logger.warning("Fleet: the results of earlier jobs cannot be read: %s", error)

    async def _recover_goal(self, identity: str) -> None:
        while True:
            try:
                found = await self._fleet.get(JobRecord, identity)
                break
            except GONE:
                await asyncio.sleep(_PAUSE_SECONDS)
        if found is None or found[0].arm != self.arm or found[0].worker == self._me:
            return
        record, revision = found
        if record.result and record.result.code != ArmLost.code:
            return
        record = replace(record, worker=self._me, late=bool(record.result))
        result = await self._server.result(identity)
        logger.info("Fleet: the job %s of an earlier worker is %s", identity, result.state.name)
        await self._store(record, revision, result)

    async def _listen(
        self, request: str, answer: Callable[[Msg], Awaitable[dict[str, Any]]]
    ) -> None:
        """Answer requests to this arm, to its pool, and to all arms."""

        async def respond(message: Msg) -> None:
            try:
                found = {"error": "", **await answer(message)}
            except (ClientError, ValueError) as error:
                found = {"error": str(error)}
            with suppress(*GONE):
                if message.reply:  # the NATS server lets only this arm use this subject
                    subject = f"{message.reply}.{self.arm}"
                    await self._fleet.nats.publish(subject, json.dumps(found).encode())

        for whom in ("", self._pool, self.arm):
            await self._fleet.nats.subscribe(control_subject(request, whom), cb=respond)

    async def _stop(self, request: Msg) -> dict[str, Any]:
        self._held = _BY_FLEET  # `_beat` then withdraws the requests for jobs
        # A stop of whole pools holds their queues, so a new worker of this arm is held, too.
        alone = request.subject == control_subject("stop", self.arm)
        storing = asyncio.create_task(self._store_hold()) if alone else None
        try:
            goals = (await self._server.stop()).goals
            if self._sending.locked():  # a job may reach the arm after the stop
                async with self._sending:
                    goals += (await self._server.stop()).goals
        finally:
            self._changed.set()
            if storing:
                await storing
        return {"goals": list(goals)}

    async def _resume(self, _: Msg) -> dict[str, Any]:
        self._held, self._stops = "", None  # before the wait, in which a new stop may come
        with suppress(ClientError):
            await self._status()  # earlier stops hold it no longer
        await self.reconnected()
        return {}

    async def _cancel(self, request: Msg) -> dict[str, Any]:
        identity = strict_json.parse_object(request.data).get("job")
        if not isinstance(identity, str) or not IDENTITY.fullmatch(identity):
            raise ValueError("a cancel needs the id of a job; a stop cancels all")
        self._canceled.add(identity)
        async with self._sending:
            pass  # afterwards the arm knows the job
        return (await self._server.cancel(identity)).to_json()

    def _set_job(self, identity: str) -> None:
        self._presence = replace(self._presence, job=identity, state=BUSY)
        (self._idle.clear if identity else self._idle.set)()
        self._free.clear()
        self._changed.set()

"""The client of a fleet for a person: send, cancel, stop, resume, list."""

import asyncio
import json
import uuid
from collections import Counter
from collections.abc import AsyncIterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Any

from nats.js.api import ConsumerInfo, RawStreamMsg
from nats.js.errors import APIError, KeyWrongLastSequenceError, NotFoundError

from executive.api import strict_json
from executive.api.outcome import GoalState
from executive.errors import GoalCanceled
from hardware import Clock, utc_ns
from hardware.loading.dataclass import dataclass

from .connection import (
    ALIVE,
    GONE,
    JOBS,
    Fleet,
    confirm_subject,
    consumer_of,
    control_subject,
    job_subject,
)
from .errors import (
    BadJob,
    Confirmation,
    DuplicateJob,
    FleetError,
    NotConfirmed,
    PoolNotServed,
    UnknownJob,
    check_name,
)
from .values import (
    BUSY,
    PRIORITIES,
    READY,
    Job,
    JobRecord,
    Member,
    Presence,
    failed,
    from_bytes,
    to_bytes,
)

STOP_SECONDS = 2.0  # longest time for the confirmation of an arm
_RESULT_SECONDS = 10.0  # longest time for the result of a canceled job
_FOREVER = "2200-01-01T00:00:00Z"


@dataclass(frozen=True, slots=True)
class ArmRow:
    """An arm in a list.

    Attributes:
        member: Entry of the arm in the list of members.
        presence: Last report of the arm; None if the arm is gone.
    """

    member: Member
    presence: Presence | None

    @property
    def state(self) -> str:
        """State of the arm, or `gone`."""
        return self.presence.state if self.presence else "gone"

    def to_json(self) -> dict[str, Any]:
        """Return the arm as a JSON object."""
        known = self.presence or Presence("", self.state)
        return {
            "arm": self.member.arm,
            "state": self.state,
            "job": known.job,
            "last": known.last,
            "done": known.done,
            "url": self.member.url,
            "host": self.member.host,
            "worker": self.member.worker,
            "joined_ns": self.member.joined_ns,
        }


class FleetClient:
    """A client of a fleet, for a person.

    Args:
        fleet: The fleet.
        clock: Time source.
    """

    def __init__(self, fleet: Fleet, clock: Clock) -> None:
        self._fleet, self._clock = fleet, clock

    async def send(
        self,
        task: int | str,
        pool: str,
        arguments: Mapping[str, Any],
        identity: str = "",
        priority: str = "normal",
        start_within: float | None = None,
        end_within: float | None = None,
    ) -> Job:
        """Send a job. Returns when the job is on disk.

        Args:
            task: Number or name of the task.
            pool: Name of the pool whose arms may run it.
            arguments: Values of the task's parameters, by name.
            identity: 32 hexadecimal digits; empty for random ones.
            priority: One of `PRIORITIES`.
            start_within: Longest time until its start [s]; None for no limit.
            end_within: Longest time until its end [s]; None for no limit.

        Raises:
            PoolNotServed: No arm serves the pool.
            DuplicateJob: A job with that id exists.
            BadName, BadJob: An argument is malformed.
        """
        check_name("a pool", pool)
        chosen = identity or uuid.uuid4().hex
        now, limits = utc_ns(self._clock), (start_within, end_within)
        job = Job(chosen, pool, task, dict(arguments), now, priority, *limits)
        from_bytes(Job, to_bytes(job))
        if not await self._is_served(pool):
            served = {arm.partition(".")[0] for arm in await self._fleet.values(Presence)}
            raise PoolNotServed(pool, sorted(served))
        if identity:  # NATS knows the id of a message for an hour only
            with suppress(UnknownJob):
                await self.job(identity)
                raise DuplicateJob(identity)
        if await publish(self._fleet, job):
            raise DuplicateJob(chosen)
        return job

    async def _is_served(self, pool: str) -> bool:
        try:
            await self._fleet.stream.get_msg(
                f"KV_{ALIVE}",
                seq=1,
                subject=f"$KV.{ALIVE}.{pool}.*",
                next=True,
                direct=True,
            )
        except NotFoundError:
            return False
        return True

    async def pools(self) -> dict[str, int]:
        """Return the number of unclaimed jobs of each pool that an arm has ever joined."""
        found = list[ConsumerInfo]()
        while infos := await self._fleet.stream.consumers_info(JOBS, offset=len(found)):
            found += infos  # an answer has a limited number of consumers
        jobs = Counter[str]()
        for each in found:
            number = (each.num_pending or 0) + (each.num_ack_pending or 0)
            jobs[(each.name or "").rpartition("-")[0]] += number
        return jobs

    async def waiting(self) -> dict[str, str]:
        """Return the reason why jobs wait, by pool, except for pools with a ready or busy arm."""
        queued = await self.pools()
        return waiting_words(await self.arms(), queued) if any(queued.values()) else {}

    async def arms(self) -> list[ArmRow]:
        """Return the arms of the fleet by name, also arms that are gone."""
        members = await self._fleet.values(Member)
        alive = await self._fleet.values(Presence)
        return [ArmRow(members[arm], alive.get(arm)) for arm in sorted(members)]

    async def records(self) -> list[JobRecord]:
        """Return the records of claimed and ended jobs, in the order of sending."""
        found = await self._fleet.values(JobRecord)
        return sorted(found.values(), key=lambda record: record.job.sent_ns)

    async def queued(self, most: int = 100) -> tuple[int, list[Job]]:
        """Return the number of queued jobs, and the oldest of them.

        Args:
            most: Largest number of jobs to return.
        """
        info = await self._fleet.stream.stream_info(JOBS)
        found: list[Job] = []
        sequence = info.state.first_seq
        while len(found) < min(most, info.state.messages):
            try:
                message = await self._fleet.stream.get_msg(
                    JOBS, seq=sequence, subject="fleet.job.>", next=True, direct=True
                )
            except NotFoundError:
                break
            sequence = (message.seq or sequence) + 1
            try:
                job = from_bytes(Job, message.data)
                known = await self._fleet.get(JobRecord, job.identity)
            except BadJob:
                continue  # a worker will drop it
            if known is None or known[0].job.attempt < job.attempt:
                found.append(job)
        return max(info.state.messages, len(found)), found

    async def job(self, identity: str) -> JobRecord | Job:
        """Return the record of a job, or the job while it is queued.

        Raises:
            UnknownJob: No job has that id.
            BadJob: The job is malformed.
        """
        if found := await self._fleet.get(JobRecord, identity):
            return found[0]
        with suppress(NotFoundError):
            return from_bytes(Job, (await self._message(identity)).data)
        if found := await self._fleet.get(JobRecord, identity):  # an arm has claimed it meanwhile
            return found[0]
        raise UnknownJob(identity)

    async def _message(self, identity: str) -> RawStreamMsg:
        """Return the message of a queued job.

        Raises:
            NotFoundError: No such job is queued.
        """
        subject = job_subject("*", "*", identity)
        return await self._fleet.stream.get_msg(JOBS, 1, subject, direct=True, next=True)

    async def wait(self, identity: str) -> AsyncIterator[JobRecord]:
        """Yield the record of a job when it is claimed, and when it has ended."""
        watcher = await self._fleet.jobs.watch(identity, ignore_deletes=True)
        try:
            async for entry in watcher:
                if entry is not None:
                    record = from_bytes(JobRecord, entry.value)
                    yield record
                    if record.result:
                        return
        finally:
            await watcher.stop()  # type: ignore[no-untyped-call]

    async def cancel(self, identity: str) -> tuple[JobRecord, bool]:
        """Cancel a job. A queued job ends at once, a running job when its arm has stopped.

        Returns:
            The record of the job, which has ended, and True if it had ended before the cancel.

        Raises:
            UnknownJob: No job has that id.
            NotConfirmed: Its arm does not confirm, or stores no result.
        """
        known = await self.job(identity)
        if isinstance(known, Job):
            now = utc_ns(self._clock)
            result = failed(GoalCanceled(), GoalState.CANCELED)
            record = JobRecord(known, "", "", "", now, result=result, ended_ns=now)
            try:
                await self._fleet.jobs.create(identity, to_bytes(record))
                with suppress(APIError):  # else the next arm that receives it drops it
                    message = await self._message(identity)
                    await self._fleet.stream.delete_msg(JOBS, message.seq or 0)
                return record, False
            except KeyWrongLastSequenceError:
                known = await self.job(identity)  # an arm has claimed it meanwhile
        assert isinstance(known, JobRecord)
        if known.result:
            return known, True
        try:
            await self.request("cancel", [known.arm], {"job": identity})
        except FleetError:
            if known.retry_safe:
                await self._end_attempts(identity)
            raise
        with suppress(TimeoutError):
            async with asyncio.timeout(_RESULT_SECONDS):
                async for record in self.wait(identity):
                    if record.result:
                        return record, False
        raise NotConfirmed("cancel", [], 1, [f"{known.arm} (it stores no result of the job)"])

    async def _end_attempts(self, identity: str) -> None:
        """End a job whose arm does not answer, so that no further attempt of it runs."""
        found = await self._fleet.get(JobRecord, identity)
        if found and found[0].result is None:
            result = failed(GoalCanceled(), GoalState.CANCELED)
            ended = replace(found[0], result=result, ended_ns=utc_ns(self._clock))
            with suppress(KeyWrongLastSequenceError):  # an arm has changed the record first
                await self._fleet.jobs.update(identity, to_bytes(ended), last=found[1])

    async def stop(self, whom: Sequence[str] = ()) -> list[Confirmation]:
        """Stop arms, and hold the queues of their pools until `resume`.

        Args:
            whom: Pools, and arms as POOL.NAME; empty for all arms.

        Raises:
            NotConfirmed: Some arms did not confirm, or the queues are not held.
        """
        asked = asyncio.create_task(self.request("stop", whom))
        await asyncio.sleep(0)  # the stop is sent first
        holding = self._hold_queues(whom, hold=True)
        confirmed, failure = await asyncio.gather(asked, holding, return_exceptions=True)
        unheld = (str(failure) or type(failure).__name__) if isinstance(failure, GONE) else ""
        if unheld and isinstance(confirmed, NotConfirmed):
            found = confirmed
            raise NotConfirmed("stop", found.confirmed, found.wanted, found.missing, unheld)
        if isinstance(confirmed, BaseException):
            raise confirmed
        if unheld:
            raise NotConfirmed("stop", confirmed, len(confirmed), [], unheld)
        if failure:
            raise failure
        return confirmed

    async def resume(self, whom: Sequence[str] = ()) -> list[Confirmation]:
        """Allow jobs again for arms that a stop holds.

        Args:
            whom: Pools, and arms as POOL.NAME; empty for all arms.

        Raises:
            NotConfirmed: Some arms did not confirm. The error names them.
            FleetError: The queue of a pool is held, so its arms would get no jobs.
        """
        await self._hold_queues(whom, hold=False)
        confirmed = await self.request("resume", whom)
        for pool in {arm.partition(".")[0] for arm in whom}:
            info = await self._fleet.stream.consumer_info(JOBS, consumer_of(pool, PRIORITIES[-1]))
            if info.paused:
                words = f"the arms are resumed, but an earlier stop still holds the queue of {pool}"
                raise FleetError(f"{words}; `armtree fleet resume {pool}` resumes both")
        return confirmed

    async def forget(self, arm: str) -> None:
        """Remove an arm that is gone from the list.

        Raises:
            FleetError: The arm is still connected, or it is not a member.
        """
        row = next((row for row in await self.arms() if row.member.arm == arm), None)
        if row is None or row.presence:
            why = "is still connected; end its server" if row else "is not an arm of this fleet"
            raise FleetError(f"{arm} {why}; `armtree fleet ls` lists the arms")
        await self._fleet.members.purge(arm)

    async def request(
        self, request: str, whom: Sequence[str], body: Mapping[str, Any] | None = None
    ) -> list[Confirmation]:
        """Send a request to arms, and wait until all of them have answered.

        Args:
            request: `stop`, `resume` or `cancel`.
            whom: Pools, and arms as POOL.NAME; empty for all arms.
            body: Content of the request.

        Raises:
            NotConfirmed: Some arms did not answer in time, or failed. The error names them.
        """
        connection, whom = self._fleet.nats, tuple(whom)
        begin, reply = self._clock.now(), confirm_subject(uuid.uuid4().hex)
        found: dict[str, Confirmation] = {}
        left, complete = set[str](), asyncio.Event()  # arms that have not answered

        async def note(message: Any) -> None:
            took = self._clock.now() - begin
            # An answer of another form confirms nothing.
            with suppress(strict_json.NotJson, KeyError, TypeError):
                answer = strict_json.parse_object(message.data)
                arm = message.subject.removeprefix(f"{reply}.")
                goals = tuple(map(str, answer.get("goals", ())))
                found[arm] = Confirmation(arm, str(answer["error"]), goals, took)
                left.discard(arm)
                if not left:
                    complete.set()

        subscription = await connection.subscribe(f"{reply}.>", cb=note)
        for each in whom or ("",):
            data = json.dumps(dict(body or {})).encode()
            await connection.publish(control_subject(request, each), data, reply)
        await connection.flush()
        members = await self._fleet.values(Member)
        wanted = {arm for arm in members if not whom or {arm, arm.partition(".")[0]} & {*whom}}
        known = {*members, *found}  # an arm may answer and leave
        if unknown := {each for each in whom if not any(_names(each, arm) for arm in known)}:
            names = ", ".join(sorted(unknown))
            raise FleetError(f"no arm or pool is called {names}; `armtree fleet ls` lists them")
        left |= wanted - found.keys()
        if left:
            complete.clear()
            with suppress(TimeoutError):
                async with asyncio.timeout(begin + STOP_SECONDS - self._clock.now()):
                    await complete.wait()
        await subscription.unsubscribe()
        errors = {arm for arm, answer in found.items() if answer.error}
        confirmed = sorted(found.values(), key=lambda answer: answer.arm)
        if missing := sorted((wanted - found.keys()) | errors):
            words = {arm: f" ({found[arm].error})" if arm in found else "" for arm in missing}
            named = [f"{arm}{words[arm]}" for arm in missing]
            good = [each for each in confirmed if not each.error]
            raise NotConfirmed(request, good, len(wanted), named)
        return confirmed

    async def _hold_queues(self, whom: Sequence[str], hold: bool) -> None:
        """Hold or release the queues of whole pools, also for arms that are not connected now."""
        pools = await self.pools()
        for pool in pools.keys() & {*whom} if {*whom} else pools:
            for priority in PRIORITIES:
                name = consumer_of(pool, priority)
                if hold:
                    await self._fleet.stream.pause_consumer(JOBS, name, _FOREVER)
                else:
                    await self._fleet.stream.resume_consumer(JOBS, name)


def waiting_words(rows: Sequence[ArmRow], queued: Mapping[str, int]) -> dict[str, str]:
    """Return the reason why jobs wait, by pool, except for pools with a ready or busy arm.

    Args:
        rows: The arms.
        queued: Number of queued jobs by pool.
    """
    lines = dict[str, str]()
    for pool, number in sorted(queued.items()):
        states = Counter(row.state for row in rows if _names(pool, row.member.arm))
        if number and not (states[READY] or states[BUSY]):
            found = ", ".join(f"{count} {state}" for state, count in sorted(states.items()))
            jobs = "the job waits" if number == 1 else f"{number} jobs wait"
            lines[pool] = f"no arm of {pool} is ready: {found or 'none has joined'}; {jobs}"
    return lines


def _names(whom: str, arm: str) -> bool:
    return whom in (arm, arm.partition(".")[0])


async def publish(fleet: Fleet, job: Job) -> bool:
    """Publish a job. Return True if this attempt was published before.

    Returns when the job is on disk.
    """
    repeated = await fleet.stream.publish(
        job_subject(job.pool, job.priority, job.identity),
        to_bytes(job),
        headers={"Nats-Msg-Id": f"{job.identity}.{job.attempt}"},
    )
    return bool(repeated.duplicate)

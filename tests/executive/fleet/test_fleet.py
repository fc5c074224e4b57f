"""Jobs of a fleet: a real nats-server, real workers, simulated arms."""

import asyncio
import json
import re
import shutil
from dataclasses import replace
from typing import Any

import nats.errors
import pytest
from nats.js.kv import KeyValue

from executive.api.outcome import CancelResult, Outcome
from executive.errors import ServerUnreachable
from executive.fleet import connection, worker as worker_module
from executive.fleet.connection import job_subject, open_fleet
from executive.fleet.errors import (
    BadJob,
    BadName,
    DuplicateJob,
    FleetError,
    FleetUnreachable,
    NameTaken,
    PoolNotServed,
    UnknownJob,
)
from executive.fleet.fleet_client import FleetClient, publish
from executive.fleet.nats_server import NatsOptions, nats_server
from executive.fleet.supervisor import LOST_SECONDS, Supervisor
from executive.fleet.values import Job, JobRecord, Member, Presence, to_bytes
from executive.fleet.worker import Worker
from hardware import RealClock
from tests.support.servers.cuttable_proxy import CuttableProxy
from tests.support.servers.fleet_arms import CLOCK, ended, joined, sent
from tests.support.servers.simulated_arms import SimulatedArm

pytestmark = pytest.mark.slow

pytest_plugins = ["tests.support.servers.fleet_fixtures"]
LOST_ID = "d" * 32


class SetClock(RealClock):
    """A clock that a test sets."""

    time = 1000.0

    def now(self) -> float:
        return self.time


def lost(attempt: int = 1, retry_safe: bool = False) -> JobRecord:
    """The record of a job whose arm never reports."""
    job = Job(LOST_ID, "bench", 1, {}, 1, attempt=attempt)
    return JobRecord(job, "bench.gone", "http://gone", "e" * 32, 1, retry_safe)


def test_a_job_runs_once_and_a_repeat_is_refused(url: str) -> None:
    async def main() -> None:
        arms = [SimulatedArm(duration=0.0), SimulatedArm(duration=0.0)]
        async with joined(url, *arms) as client:
            job = await client.send("wave", "bench", {"swing": "20 deg"})
            record = await ended(client, job)
            assert record.result
            assert (record.state, record.result.frames) == ("SUCCEEDED", 3)
            with pytest.raises(DuplicateJob):
                await client.send("wave", "bench", {}, job.identity)
            # As a sender of another version could: another message with the id of a known job.
            fleet = client._fleet
            assert not await publish(fleet, replace(job, attempt=0))
            assert await publish(fleet, replace(job, attempt=0))
            after = await client.send("wave", "bench", {})
            await ended(client, after)
            received = [identity for arm in arms for identity in arm.received]
            assert sorted(received) == sorted({job.identity, after.identity})
            assert [each.job for each in await client.records()] == [job, after]

    asyncio.run(main())


def test_the_queue_has_priorities_deadlines_and_cancel(url: str) -> None:
    async def main() -> None:
        arm = SimulatedArm()
        async with joined(url, arm) as client:
            first = await client.send(1, "bench", {})
            await arm.started.wait()
            order = ("low", "normal", "high")
            jobs = [await client.send(each, "bench", {}, priority=each) for each in order]
            late = await client.send("late", "bench", {}, start_within=1e-9)
            deep = await client.job(late.identity)
            assert deep == late
            gone = await client.send("gone", "bench", {})
            assert (await client.queued())[0] == 5
            canceled, _ = await client.cancel(gone.identity)
            assert (canceled.state, canceled.arm) == ("CANCELED", "")
            assert (await client.queued())[0] == 4
            assert await client.pools() == {"bench": 4}
            arm.duration = 0.0
            canceled, had_ended = await client.cancel(first.identity)
            assert (canceled.state, had_ended) == ("CANCELED", False)
            assert await client.cancel(first.identity) == (canceled, True)
            for job in jobs:
                assert (await ended(client, job)).state == "SUCCEEDED"
            result = (await ended(client, late)).result
            assert result
            assert result.code == "fleet.deadline"
            assert arm.tasks_of == [1, "high", "normal", "low"]

    asyncio.run(main())


def test_a_job_that_takes_too_long_is_canceled_and_its_arm_takes_the_next(url: str) -> None:
    async def main() -> None:
        arm = SimulatedArm()
        async with joined(url, arm) as client:
            job = await client.send(1, "bench", {}, end_within=2.0)
            result = (await ended(client, job)).result
            assert result
            assert (result.state.name, result.code) == ("CANCELED", "fleet.too_long")
            assert "2 s after it was sent" in result.message
            assert result.frames == 3  # it moved until then
            arm.duration = 0.0
            after = await client.send(2, "bench", {}, end_within=60)
            assert (await ended(client, after)).state == "SUCCEEDED"

    asyncio.run(main())


def test_a_failed_cancel_of_a_job_that_takes_too_long_is_repeated(
    url: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("executive.fleet.worker._PAUSE_SECONDS", 0.0)

    class Unsteady(SimulatedArm):
        """An arm that does not get the first cancels."""

        lost = 2

        async def cancel(self, goal_id: str = "", stamp_ns: int = 0) -> CancelResult:
            if self.lost:
                self.lost -= 1
                raise ServerUnreachable(self.url, "lost")
            return await super().cancel(goal_id)

    async def main() -> None:
        async with joined(url, Unsteady()) as client, asyncio.timeout(10):
            job = await client.send(1, "bench", {}, end_within=2.0)
            result = (await ended(client, job)).result
            assert result
            assert (result.state.name, result.code) == ("CANCELED", "fleet.too_long")

    asyncio.run(main())


def test_programs_that_subscribe_get_the_changes_of_arms(url: str) -> None:
    async def main() -> None:
        arm = SimulatedArm()
        async with joined(url, arm) as client:
            events = await client._fleet.nats.subscribe("fleet.events.bench.*")
            job = await client.send(1, "bench", {})
            event = await events.next_msg(10.0)
            while (found := json.loads(event.data))["job"] != job.identity:
                event = await events.next_msg(10.0)
            assert (event.subject, found["state"]) == ("fleet.events.bench.0", "busy")
            arm.finish(job.identity)
            while (found := json.loads(event.data))["last"] != "ok":
                event = await events.next_msg(10.0)

    asyncio.run(main())


def test_what_is_malformed_stops_nothing(url: str) -> None:
    async def main() -> None:
        arm = SimulatedArm(duration=0.0)
        async with joined(url, arm) as client:
            fleet, clock = client._fleet, SetClock()
            # What a later version, or a broken program, may have stored.
            await fleet.members.put("bench.strange", b"[]")
            await fleet.alive.put("bench.strange", b'{"worker": 5}')
            await fleet.jobs.put("a" * 32, b'"text"')
            headers = {"Status": "404"}  # as at the end of an answer of NATS
            await fleet.stream.publish("$KV.fleet_members.bench.other", b"7", headers=headers)
            assert [row.member.arm for row in await client.arms()] == ["bench.0"]
            assert [each.arm for each in await client.resume()] == ["bench.0"]
            await fleet.jobs.create(LOST_ID, to_bytes(lost()))
            supervisor = Supervisor(fleet, clock)
            assert [each async for each in supervisor.sweep()] == []
            clock.time += LOST_SECONDS + 1
            assert [each.job.identity async for each in supervisor.sweep()] == [LOST_ID]
            await publish(fleet, replace(lost().job, identity="a" * 32))
            job = await client.send(1, "bench", {})
            assert (await ended(client, job)).state == "SUCCEEDED"
            assert arm.received == [job.identity]

    asyncio.run(main())


def test_jobs_that_arrive_at_once_wait_for_nothing(url: str) -> None:
    async def main() -> None:
        arm = SimulatedArm(duration=0.0)
        async with joined(url, arm) as client:
            fleet = client._fleet
            jobs = [Job(n * 32, "bench", n, {}, 1, p) for n, p in (("a", "high"), ("b", "low"))]
            for job in jobs:  # in one packet, so that both answer the requests of the idle arm
                subject = job_subject(job.pool, job.priority, job.identity)
                await fleet.nats.publish(subject, to_bytes(job))
            async with asyncio.timeout(10):
                for job in jobs:
                    assert (await ended(client, job)).state == "SUCCEEDED"

    asyncio.run(main())


def test_a_claim_and_a_result_whose_answers_are_lost_are_stored_once(
    url: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("executive.fleet.worker._PAUSE_SECONDS", 0.0)

    async def main() -> None:
        arm = SimulatedArm(duration=0.0)
        async with joined(url, arm) as client:
            create, lost_answers = KeyValue.create, iter([True, True])
            update, lost_results = KeyValue.update, iter([True])

            async def forgetful_update(bucket: KeyValue, key: str, value: bytes, last: int) -> int:
                revision = await update(bucket, key, value, last)
                if b"SUCCEEDED" in value and next(lost_results, False):
                    raise nats.errors.TimeoutError
                return revision

            async def forgetful(bucket: KeyValue, key: str, value: bytes) -> int:
                revision = await create(bucket, key, value)
                if next(lost_answers, False):
                    raise nats.errors.TimeoutError
                return revision

            monkeypatch.setattr(KeyValue, "create", forgetful)
            monkeypatch.setattr(KeyValue, "update", forgetful_update)
            job = await client.send(1, "bench", {})
            async with asyncio.timeout(10):
                assert (await ended(client, job)).state == "SUCCEEDED"
                after = await client.send(1, "bench", {})
                await ended(client, after)
            assert arm.received == [job.identity, after.identity]
            stored = await client.job(job.identity)
            assert isinstance(stored, JobRecord)
            assert not stored.late

    asyncio.run(main())


def test_a_worker_that_loses_its_server_for_a_moment_reports_the_true_result(
    url: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As after a pause of the worker, in which its connections have ended."""
    monkeypatch.setattr("executive.fleet.worker._PAUSE_SECONDS", 0.0)

    class Unsteady(SimulatedArm):
        """An arm whose first answers get lost."""

        lost = 2

        async def send(self, *words: Any, **named: Any) -> str:
            await super().send(*words, **named)
            raise ServerUnreachable(self.url, "lost")

        async def result(self, goal_id: str, timeout: float | None = None) -> Outcome:
            if self.lost:
                self.lost -= 1
                raise ServerUnreachable(self.url, "lost")
            return await super().result(goal_id)

    async def main() -> None:
        arm = Unsteady(duration=0.0)
        async with joined(url, arm) as client:
            job = await client.send(1, "bench", {})
            assert (await ended(client, job)).state == "SUCCEEDED"
            arm.lost = 10**6
            result = (await ended(client, await client.send(1, "bench", {}))).result
            assert result
            assert result.code == "server.unreachable"

    asyncio.run(main())


def test_a_worker_whose_name_was_taken_meanwhile_ends(url: str) -> None:
    async def main() -> None:
        async with open_fleet(url, "test") as fleet:
            worker = Worker(fleet, SimulatedArm(), "bench", "0", CLOCK)
            running = asyncio.create_task(worker.run())
            while not await fleet.values(Member):
                await asyncio.sleep(0)
            other = to_bytes(Presence("f" * 32, "ready"))
            await fleet.alive.put("bench.0", other)  # as if the first one had paused
            await worker.reconnected()
            with pytest.raises(NameTaken):
                await asyncio.wait_for(running, 10)
            assert (await fleet.alive.get("bench.0")).value == other
            assert [*await fleet.values(Member)] == ["bench.0"]

    asyncio.run(main())


def test_malformed_values_of_its_own_do_not_end_a_worker(url: str) -> None:
    async def main() -> None:
        async with open_fleet(url, "test") as fleet:
            arm = SimulatedArm()
            worker = Worker(fleet, arm, "bench", "0", CLOCK, "http://bench.example:8765")
            running = asyncio.create_task(worker.run())
            job = await sent(fleet)
            await arm.started.wait()
            assert (await fleet.values(Member))["bench.0"].url == "http://bench.example:8765"
            for bucket in (fleet.members, fleet.alive):
                await bucket.put("bench.0", b"not JSON")
            await fleet.jobs.put(job.identity, b"7")
            arm.finish(job.identity)
            async with asyncio.timeout(10):
                while not await fleet.values(Presence):
                    await asyncio.sleep(0)
                while not await fleet.values(Member):
                    await asyncio.sleep(0)
                while (record := (await fleet.values(JobRecord)).get(job.identity)) is None:
                    await asyncio.sleep(0)
            assert (record.state, record.url) == ("SUCCEEDED", "http://bench.example:8765")
            worker.end()
            await running

    asyncio.run(main())


def test_a_worker_may_start_before_the_nats_server(
    options: NatsOptions, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("ARMTREE_FLEET_TOKEN", raising=False)

    async def main() -> None:
        failed, arm = asyncio.Event(), SimulatedArm(duration=0.0)
        monkeypatch.setattr(connection.logger, "warning", lambda *_: failed.set())

        async def work() -> None:
            async with open_fleet(options.url, "arm", lasting=True) as fleet:
                await Worker(fleet, arm, "bench", "0", CLOCK).run()

        working = asyncio.create_task(work())
        await failed.wait()
        with nats_server(options, CLOCK):  # its token is in a file only now
            async with asyncio.timeout(20), open_fleet(options.url, "person") as fleet:
                job = await sent(fleet)
                record = await ended(FleetClient(fleet, CLOCK), job)
                assert record.state == "SUCCEEDED"
            working.cancel()
            await asyncio.wait([working])

    asyncio.run(main())


def test_a_command_ends_if_the_nats_server_dies(options: NatsOptions) -> None:
    async def main() -> None:
        with nats_server(options, CLOCK) as process:
            async with open_fleet(options.url, "test") as fleet:
                waiting = asyncio.ensure_future(anext(FleetClient(fleet, CLOCK).wait(LOST_ID)))
                while not (await fleet.stream.stream_info("KV_fleet_jobs")).state.consumer_count:
                    await asyncio.sleep(0)
                process.kill()
                await waiting

    with pytest.raises(FleetUnreachable, match=re.escape(options.url)):
        asyncio.run(main())


def test_the_end_of_a_connection_is_told_in_plain_words(url: str) -> None:
    """A command may see it before the library calls the connection closed."""

    async def main() -> None:
        async with open_fleet(url, "test"):
            raise nats.errors.UnexpectedEOF

    with pytest.raises(FleetUnreachable, match=r"the connection was lost\."):
        asyncio.run(main())


def test_wrong_jobs_are_refused_at_once(url: str) -> None:
    async def main() -> None:
        arm = SimulatedArm(duration=0.0)
        async with joined(url, arm) as client:
            with pytest.raises(PoolNotServed, match="pool other"):
                await client.send(1, "other", {})
            with pytest.raises(BadName):
                await client.send(1, "a.*", {})
            with pytest.raises(BadJob):
                await client.send(1, "bench", {}, "not an id")
            with pytest.raises(UnknownJob):
                await client.cancel("f" * 32)
            fleet = client._fleet
            await fleet.stream.publish("fleet.job.bench.high.x", b'{"identity": 1}')
            job = await client.send(1, "bench", {})
            assert (await ended(client, job)).state == "SUCCEEDED"
            assert (await client.queued())[1] == []

    asyncio.run(main())


def test_the_job_of_a_lost_arm_is_given_up_or_sent_again_if_that_is_safe(url: str) -> None:
    async def main() -> None:
        arm = SimulatedArm(duration=0.0)
        async with joined(url, arm) as client:
            fleet, clock = client._fleet, SetClock()
            supervisor = Supervisor(fleet, clock)
            safe = replace(lost(retry_safe=True), job=replace(lost().job, identity="c" * 32))
            for record in (lost(), safe):
                await fleet.jobs.create(record.job.identity, to_bytes(record))
            assert [each async for each in supervisor.sweep()] == []
            clock.time += LOST_SECONDS + 1
            swept = {each.job.identity: each async for each in supervisor.sweep()}
            assert swept.keys() == {LOST_ID, "c" * 32}
            record = await ended(client, lost().job)
            assert record.result
            assert (record.state, record.result.code) == ("ABORTED", "fleet.arm_lost")
            assert "16 s" in record.result.message
            again = await ended(client, safe.job)
            assert (again.arm, again.job.attempt, again.state) == ("bench.0", 2, "SUCCEEDED")
            assert arm.received == ["c" * 32]
            canceled = replace(safe, job=replace(lost().job, identity="b" * 32))
            await fleet.jobs.create("b" * 32, to_bytes(canceled))
            with pytest.raises(FleetError, match=r"called bench\.gone"):
                await client.cancel("b" * 32)
            await publish(fleet, replace(canceled.job, attempt=2))
            await ended(client, await client.send(1, "bench", {}))
            assert (await ended(client, canceled.job)).state == "CANCELED"
            assert "b" * 32 not in arm.received

    asyncio.run(main())


def test_an_arm_that_comes_back_reports_what_it_did(url: str) -> None:
    async def main() -> None:
        arm = SimulatedArm(duration=0.0)
        await arm.send(1, goal_id=LOST_ID)
        async with open_fleet(url, "earlier") as fleet:
            mine = replace(lost(), arm="bench.0")
            await fleet.jobs.create(LOST_ID, to_bytes(mine))
        async with joined(url, arm) as client:
            record = await ended(client, mine.job)
            assert (record.state, record.late) == ("SUCCEEDED", False)
            assert arm.received == [LOST_ID]

    asyncio.run(main())


def test_a_name_is_taken_only_while_its_worker_lives(
    url: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def main() -> None:
        async with joined(url, SimulatedArm("http://one")) as client:
            monkeypatch.setattr("executive.fleet.worker.ALIVE_SECONDS", -9.0)
            with pytest.raises(NameTaken, match=r"bench\.0, with the server http://one"):
                await Worker(client._fleet, SimulatedArm(), "bench", "0", CLOCK).run()
        async with open_fleet(url, "after") as fleet:
            assert await fleet.values(Member) == {}
            assert await fleet.values(Presence) == {}

    asyncio.run(main())


@pytest.mark.parametrize("keeps_its_disk", [True, False])
def test_a_result_waits_until_the_nats_server_is_back(
    options: NatsOptions, keeps_its_disk: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("executive.fleet.connection._ANSWER_SECONDS", 2.0)
    monkeypatch.setattr("executive.fleet.worker._PAUSE_SECONDS", 0.1)

    async def main() -> None:
        arm, up = SimulatedArm(), asyncio.Event()

        async def changed(is_up: bool) -> None:
            (up.set if is_up else up.clear)()

        with nats_server(options, CLOCK) as process:
            async with open_fleet(options.url, "worker", lasting=True, changed=changed) as fleet:
                worker = Worker(fleet, arm, "bench", "0", CLOCK)
                async with asyncio.TaskGroup() as group:
                    group.create_task(worker.run())
                    job = await sent(fleet)
                    await arm.started.wait()
                    process.kill()
                    process.wait()
                    arm.finish(job.identity)
                    arm.duration = 0.0
                    if not keeps_its_disk:
                        shutil.rmtree(options.data / "jetstream")
                    with nats_server(options, CLOCK):
                        await asyncio.wait_for(up.wait(), 20)
                        client = FleetClient(fleet, CLOCK)
                        assert (await ended(client, job)).state == "SUCCEEDED"
                        after = await sent(fleet)
                        assert (await ended(client, after)).state == "SUCCEEDED"
                        assert arm.received == [job.identity, after.identity]
                        assert [each.arm for each in await client.stop()] == ["bench.0"]
                        worker.end()

    asyncio.run(main())


@pytest.mark.parametrize("silent", [True, False])
def test_an_arm_whose_network_is_cut_finishes_its_job(
    options: NatsOptions, silent: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("executive.fleet.worker._PAUSE_SECONDS", 0.1)

    async def main() -> None:
        arm, stuck = SimulatedArm(), asyncio.Event()
        with nats_server(options, CLOCK), CuttableProxy(options.port) as proxy:
            url = f"nats://127.0.0.1:{proxy.port}"
            token = {"token": (options.data / "token").read_text()}
            async with open_fleet(options.url, "person") as near:
                # Only the arm gives up early: a busy machine may answer the person later.
                monkeypatch.setattr("executive.fleet.connection._ANSWER_SECONDS", 0.2)
                async with (
                    open_fleet(url, "arm", lasting=True, credentials=token) as fleet,
                    asyncio.TaskGroup() as group,
                ):
                    worker = Worker(fleet, arm, "bench", "0", CLOCK)
                    client = FleetClient(near, CLOCK)
                    group.create_task(worker.run())
                    job = await sent(near)
                    await arm.started.wait()
                    proxy.cut(silent)
                    monkeypatch.setattr(worker_module.logger, "warning", lambda *_: stuck.set())
                    arm.finish(job.identity)
                    await stuck.wait()  # the worker could not store the result
                    assert isinstance(found := await client.job(job.identity), JobRecord)
                    assert found.state == "CLAIMED"
                    proxy.mend()
                    assert (await ended(client, job)).state == "SUCCEEDED"
                    assert arm.received == [job.identity]
                    worker.end()

    asyncio.run(asyncio.wait_for(main(), 30))

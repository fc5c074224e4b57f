"""Stops of a fleet, and arms that take no jobs after one."""

import asyncio
import json
import logging

import nats.errors
import pytest
from nats.aio.msg import Msg
from nats.js.kv import KeyValue

from executive.fleet.connection import (
    JOBS,
    confirm_subject,
    consumer_of,
    control_subject,
    open_fleet,
)
from executive.fleet.errors import FleetError, NotConfirmed
from executive.fleet.fleet_client import FleetClient
from executive.fleet.supervisor import Supervisor
from executive.fleet.values import Job, Member, to_bytes
from executive.fleet.worker import Worker
from tests.support.servers.fleet_arms import CLOCK, ended, joined, sent
from tests.support.servers.simulated_arms import SimulatedArm

pytestmark = pytest.mark.slow

pytest_plugins = ["tests.support.servers.fleet_fixtures"]


def test_a_stop_holds_the_fleet_and_names_who_does_not_confirm(
    url: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def main() -> None:
        arms = [SimulatedArm(), SimulatedArm()]
        async with joined(url, *arms) as client:
            running = await client.send(1, "bench", {})
            await anext(client.wait(running.identity))
            confirmed = await client.stop()
            assert [each.arm for each in confirmed] == ["bench.0", "bench.1"]
            assert sum((each.goals for each in confirmed), ()).count(running.identity) == 1
            assert (await ended(client, running)).state == "CANCELED"
            queued = await client.send(2, "bench", {})
            assert (await client.queued())[0] == 1
            with pytest.raises(FleetError, match="still holds the queue of bench"):
                await client.resume(["bench.0"])
            for arm in arms:
                arm.duration = 0.0
            await client.resume(["bench"])
            assert (await ended(client, queued)).state == "SUCCEEDED"
            silent = Member("bench.silent", "http://silent", "host", "e" * 32, 1)
            await client._fleet.members.put(silent.arm, to_bytes(silent))
            with pytest.raises(
                NotConfirmed, match=r"2 of 3 arms confirmed stop; not .* bench\.silent;"
            ):
                await client.stop()
            assert [arm.stops for arm in arms] == [2, 2]
            await client.forget(silent.arm)
            assert len(await client.arms()) == 2

    asyncio.run(main())


def test_a_malformed_request_is_answered_and_a_malformed_answer_ignored(url: str) -> None:
    async def main() -> None:
        arm = SimulatedArm()
        async with joined(url, arm) as client:
            nats, reply = client._fleet.nats, confirm_subject("test")
            answers = await nats.subscribe(f"{reply}.bench.0")
            for body in (
                b"[]",
                b"7",
                b"not JSON",
                b'{"job": "a", "job": "b"}',
                b"{}",
                b'{"job": ""}',
                b'{"job": "../../arm/activate"}',
            ):
                await nats.publish(control_subject("cancel", "bench.0"), body, reply)
                assert json.loads((await answers.next_msg(5.0)).data)["error"]
            await nats.publish(control_subject("stop", "bench.0"), b"[]", reply)
            answer = await answers.next_msg(5.0)
            assert json.loads(answer.data)["error"] == ""  # a stop needs no body

            async def disturb(message: Msg) -> None:
                for garbage in (b"[]", b"not JSON", b'{"goals": []}'):
                    await nats.publish(f"{message.reply}.bench.0", garbage)

            await nats.subscribe(control_subject("stop"), cb=disturb)
            assert [each.arm for each in await client.stop()] == ["bench.0"]
            assert arm.stops == 2

    asyncio.run(main())


def test_an_arm_that_is_stopped_by_hand_takes_no_jobs(url: str) -> None:
    async def main() -> None:
        arm = SimulatedArm()
        async with joined(url, arm) as client:
            job = await client.send(1, "bench", {})
            await arm.started.wait()
            await arm.stop()
            assert (await ended(client, job)).state == "CANCELED"
            after = await client.send(2, "bench", {})
            arm.duration = 0.0
            assert isinstance(await client.job(after.identity), Job)
            await client.resume()
            assert (await ended(client, after)).state == "SUCCEEDED"

    asyncio.run(main())


def test_an_idle_arm_that_is_stopped_by_hand_takes_no_jobs(url: str) -> None:
    async def main() -> None:
        arms = [SimulatedArm(duration=0.0), SimulatedArm(duration=0.0)]
        async with joined(url, *arms) as client:
            await arms[0].stop()
            job = await client.send(1, "bench", {})
            assert (await ended(client, job)).arm == "bench.1"
            await arms[1].stop()
            after = await client.send(1, "bench", {})
            async with asyncio.timeout(20):
                while not (words := (await client.waiting()).get("bench")) or "2 held" not in words:
                    continue
            assert words == "no arm of bench is ready: 2 held; the job waits"
            fleet = client._fleet
            async with asyncio.timeout(20):  # no request of a held arm waits for a job
                while (
                    await fleet.stream.consumer_info(JOBS, consumer_of("bench", "low"))
                ).num_waiting:
                    continue
            assert isinstance(await client.job(after.identity), Job)
            await client.resume(["bench"])
            assert (await ended(client, after)).state == "SUCCEEDED"
            assert await client.waiting() == {}

    asyncio.run(main())


def test_a_job_of_a_short_stop_starts_with_the_resume(
    url: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The NATS server does not answer a request that waited while its queue was held."""
    monkeypatch.setattr("executive.fleet.worker._SPREAD", (0.5, 0.5))  # longer than the stop

    async def main() -> None:
        async with joined(url, SimulatedArm(duration=0.0)) as client:
            while not (
                await client._fleet.stream.consumer_info(JOBS, consumer_of("bench", "normal"))
            ).num_waiting:
                continue
            await client.stop()
            job = await client.send(1, "bench", {})
            await client.resume()
            async with asyncio.timeout(5):
                assert (await ended(client, job)).state == "SUCCEEDED"

    asyncio.run(main())


def test_the_supervisor_logs_once_that_jobs_wait_for_held_arms(
    url: str, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("executive.fleet.supervisor._SWEEP_SECONDS", 0.05)

    async def main() -> None:
        async with joined(url, SimulatedArm(duration=0.0)) as client:
            await client.stop(["bench.0"])
            while [row.state for row in await client.arms()] != ["held"]:
                continue
            await client.send(1, "bench", {})
            supervising = asyncio.create_task(Supervisor(client._fleet, CLOCK).run())
            async with asyncio.timeout(20):
                while not caplog.messages:
                    await asyncio.sleep(0)
            await client.send(1, "bench", {})
            for _ in range(3):
                await client.waiting()
            supervising.cancel()
            await client.resume(["bench"])

    with caplog.at_level(logging.WARNING, "executive.fleet.supervisor"):
        asyncio.run(main())
    assert caplog.messages == ["no arm of bench is ready: 1 held; the job waits"]


@pytest.mark.parametrize("whom", ["bench.0", "bench"])
def test_a_stop_by_the_fleet_outlives_a_restart_of_the_worker(url: str, whom: str) -> None:
    async def main() -> None:
        async with joined(url, SimulatedArm()) as client:
            await client.stop([whom])
        async with open_fleet(url, "test") as fleet, asyncio.TaskGroup() as group:
            client = FleetClient(fleet, CLOCK)
            if whom == "bench":  # the worker was killed before it stored its hold
                forgetful = Member("bench.0", "http://arm", "host", "e" * 32, 1)
                await fleet.members.put("bench.0", to_bytes(forgetful))
            assert [row.state for row in await client.arms()] == ["gone"]
            worker = Worker(fleet, SimulatedArm(duration=0.0), "bench", "0", CLOCK)
            group.create_task(worker.run())
            async with asyncio.timeout(20):
                while [row.state for row in await client.arms()] != ["held"]:
                    continue
            job = await client.send(1, "bench", {})
            assert isinstance(await client.job(job.identity), Job)
            await client.resume(["bench"])
            assert (await ended(client, job)).state == "SUCCEEDED"
            worker.end()

    asyncio.run(main())


def test_a_confirmed_stop_is_stored_so_that_it_outlives_a_killed_worker(
    url: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("executive.fleet.worker._STORE_SECONDS", 10.0)

    async def main() -> None:
        async with joined(url, SimulatedArm()) as client:
            await client.stop(["bench.0"])
            found = await client._fleet.get(Member, "bench.0")
            assert found
            assert found[0].held == "stopped by the fleet"

    asyncio.run(main())


def test_a_stop_is_confirmed_though_its_hold_cannot_be_stored_now(
    url: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def main() -> None:
        arm, put, free = SimulatedArm(), KeyValue.put, asyncio.Event()

        async def stuck(bucket: KeyValue, key: str, value: bytes) -> int:
            await free.wait()
            return await put(bucket, key, value)

        async with joined(url, arm) as client:
            monkeypatch.setattr(KeyValue, "put", stuck)
            try:
                confirmed = await client.stop(["bench.0"])
            finally:
                free.set()
            assert [each.arm for each in confirmed] == ["bench.0"]
            assert arm.stops == 1
            async with asyncio.timeout(10):  # the worker stores it later
                while not (await client._fleet.values(Member))["bench.0"].held:
                    continue

    asyncio.run(main())


def test_an_arm_whose_server_died_remains_a_member_so_that_a_stop_names_it(
    url: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("executive.fleet.worker._LAST_SECONDS", 0.0)
    monkeypatch.setattr("executive.fleet.fleet_client.STOP_SECONDS", 0.3)

    async def main() -> None:
        async with open_fleet(url, "test") as fleet:
            client = FleetClient(fleet, CLOCK)
            for in_order, busy in ((False, False), (True, True)):
                arm = SimulatedArm()
                async with open_fleet(url, "arm") as own:
                    worker = Worker(own, arm, "bench", "0", CLOCK)
                    running = asyncio.create_task(worker.run())
                    if busy:
                        await sent(fleet)
                        await arm.started.wait()
                    while not await client.arms():
                        continue
                    worker.end(in_order)
                    await running
                assert [row.state for row in await client.arms()] == ["gone"]
                with pytest.raises(
                    NotConfirmed, match=r"0 of 1 arms confirmed stop; not .* bench\.0;"
                ):
                    await client.stop()
                await client.forget("bench.0")
                assert await client.resume() == []

    asyncio.run(main())


async def fail_to_hold(*_: object, hold: bool) -> None:
    raise nats.errors.TimeoutError


def test_a_stop_whose_queues_cannot_be_held_shows_its_confirmations(
    url: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def main() -> None:
        arm = SimulatedArm()
        async with joined(url, arm) as client:
            monkeypatch.setattr(client, "_hold_queues", fail_to_hold)
            with pytest.raises(NotConfirmed) as failure:
                await client.stop()
            assert str(failure.value) == (
                "1 of 1 arms confirmed stop; the queues are not held and still deliver jobs "
                "(nats: timeout); type the stop again"
            )
            assert failure.value.hint == "type the stop again"
            assert [each.arm for each in failure.value.confirmed] == ["bench.0"]
            assert arm.stops == 1

    asyncio.run(main())


def test_a_stop_names_silent_arms_and_queues_that_are_not_held(
    url: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def main() -> None:
        async with joined(url, SimulatedArm()) as client:
            silent = Member("bench.silent", "http://silent", "host", "e" * 32, 1)
            await client._fleet.members.put(silent.arm, to_bytes(silent))
            monkeypatch.setattr(client, "_hold_queues", fail_to_hold)
            with pytest.raises(NotConfirmed) as failure:
                await client.stop()
            assert str(failure.value) == (
                "1 of 2 arms confirmed stop; not confirmed by bench.silent; the queues are not "
                "held and still deliver jobs (nats: timeout); check these arms, and use their own "
                "pages or power switches; then type the stop again"
            )
            assert [each.arm for each in failure.value.confirmed] == ["bench.0"]

    asyncio.run(main())

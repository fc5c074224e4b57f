"""The requests of one arm for jobs, at a real nats-server."""

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from nats.aio.client import Client as Nats
from nats.js import JetStreamContext
from nats.js.api import ConsumerInfo

from executive.fleet.connection import GONE, JOBS, Fleet, consumer_of, job_subject, open_fleet
from executive.fleet.errors import DuplicateJob
from executive.fleet.fleet_client import FleetClient, publish
from executive.fleet.job_requests import JobRequests
from executive.fleet.nats_server import NatsOptions, nats_server
from executive.fleet.values import Job, Presence, to_bytes
from hardware import RealClock
from tests.support.servers.free_port import free_port

CLOCK = RealClock()
HIGH, LOW = (Job(n * 32, "bench", 1, {}, 1, p) for n, p in (("a", "high"), ("b", "low")))


@asynccontextmanager
async def requesting(folder: Path) -> AsyncIterator[tuple[Fleet, JobRequests]]:
    """A fleet, and an arm of the pool bench."""
    options = NatsOptions(folder / "fleet", port=free_port())
    with nats_server(options, CLOCK):
        async with asyncio.timeout(20), open_fleet(options.url, "test") as fleet:
            await fleet.add_consumers("bench")
            yield fleet, JobRequests(fleet, "bench")


async def waits(fleet: Fleet) -> None:
    """Wait until an arm waits for a job of any priority."""
    while not (await fleet.stream.consumer_info(JOBS, consumer_of("bench", "low"))).num_waiting:
        continue


def test_a_job_that_is_sent_to_requests_that_were_answered_is_back_at_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It must not need the withdrawal of the requests, which the NATS server may read later."""
    withdraw, withdrawals = Nats._send_unsubscribe, list[Callable[[], Awaitable[None]]]()

    async def later(connection: Nats, sid: int, limit: int = 0) -> None:
        if limit:
            await withdraw(connection, sid, limit)
        else:
            withdrawals.append(partial(withdraw, connection, sid))

    async def main() -> None:
        async with requesting(tmp_path) as (fleet, requests):
            with monkeypatch.context() as patch:
                patch.setattr(Nats, "_send_unsubscribe", later)
                first = asyncio.create_task(requests.next())
                await waits(fleet)
                await publish(fleet, HIGH)
                message = await first
                assert message
                assert message.subject == job_subject("bench", "high", HIGH.identity)
                for _ in range(2):
                    await fleet.nats.flush()
                await publish(fleet, LOW)
            for each in withdrawals:
                await each()
            async with asyncio.timeout(5):  # a job that was lost is delivered again after 30 s
                message = await requests.next()
            assert message
            assert message.subject == job_subject("bench", "low", LOW.identity)

    asyncio.run(main())


def test_a_request_that_is_repeated_brings_one_job_at_a_time(tmp_path: Path) -> None:
    async def main() -> None:
        async with requesting(tmp_path) as (fleet, requests):
            asked = asyncio.create_task(requests.next())
            await waits(fleet)
            requests.repeat()  # as after a reconnection, though the NATS server has forgotten none
            assert await asked is None
            await publish(fleet, HIGH)
            await publish(fleet, LOW)
            found = list[str]()
            while len(found) < 2:
                if message := await requests.next():
                    found.append(message.subject.split(".")[-1])
                    await message.ack()
            assert sorted(found) == [HIGH.identity, LOW.identity]

    asyncio.run(main())


def test_the_id_of_a_queued_job_is_refused_though_nats_has_forgotten_it(tmp_path: Path) -> None:
    async def main() -> None:
        async with requesting(tmp_path) as (fleet, _):
            await fleet.alive.put("bench.arm", to_bytes(Presence("e" * 32, "busy")))
            subject = job_subject("bench", "high", HIGH.identity)
            await fleet.stream.publish(subject, to_bytes(HIGH))  # without a message id
            with pytest.raises(DuplicateJob):
                await FleetClient(fleet, CLOCK).send(1, "bench", {}, HIGH.identity)

    asyncio.run(main())


def test_all_pools_are_known_however_many_there_are(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ask = JetStreamContext.consumers_info

    async def two(*words: Any, **named: Any) -> list[ConsumerInfo]:
        return (await ask(*words, **named))[:2]  # NATS answers with at most 256

    monkeypatch.setattr(JetStreamContext, "consumers_info", two)

    async def main() -> None:
        async with requesting(tmp_path) as (fleet, _):
            await fleet.add_consumers("pool-2")
            assert await FleetClient(fleet, CLOCK).pools() == {"bench": 0, "pool-2": 0}

    asyncio.run(main())


def test_a_job_with_a_header_of_an_answer_is_a_job(tmp_path: Path) -> None:
    async def main() -> None:
        async with requesting(tmp_path) as (fleet, requests):
            subject = job_subject("bench", "high", HIGH.identity)
            await fleet.stream.publish(subject, b"", headers={"Status": "404"})
            message = await requests.next()
            assert message
            assert message.subject == subject
            await fleet.stream.delete_consumer(JOBS, consumer_of("bench", "high"))
            with pytest.raises(GONE, match="no time in an answer"):
                await fleet.age(message, HIGH)

    asyncio.run(main())

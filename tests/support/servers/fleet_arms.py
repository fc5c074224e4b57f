"""A fleet for tests: a real nats-server, real workers, simulated arms."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

from executive.fleet.connection import Fleet, open_fleet
from executive.fleet.fleet_client import FleetClient
from executive.fleet.values import Job, JobRecord
from executive.fleet.worker import Worker
from hardware import RealClock
from tests.support.servers.simulated_arms import SimulatedArm

CLOCK = RealClock()


@asynccontextmanager
async def joined(url: str, *arms: SimulatedArm, pool: str = "bench") -> AsyncIterator[FleetClient]:
    """A client, once these arms have joined as bench.0, bench.1 ..."""
    async with open_fleet(url, "test") as fleet, asyncio.TaskGroup() as group:
        client, workers = FleetClient(fleet, CLOCK), []
        for number, arm in enumerate(arms):
            workers.append(Worker(fleet, arm, pool, str(number), CLOCK))
            group.create_task(workers[-1].run())
        watcher = await fleet.alive.watchall()
        ready = set[str]()
        while len(ready) < len(arms):
            entry = await watcher.updates(10.0)  # type: ignore[no-untyped-call]
            if entry and b'"ready"' in (entry.value or b""):
                ready.add(entry.key)
        await watcher.stop()  # type: ignore[no-untyped-call]
        try:
            yield client
        finally:
            for worker in workers:
                worker.end()


async def ended(client: FleetClient, job: Job) -> JobRecord:
    """The record of a job that has ended."""
    return [record async for record in client.wait(job.identity)][-1]


async def sent(fleet: Fleet) -> Job:
    """A job that is sent as soon as an arm serves its pool."""
    watcher = await fleet.alive.watchall()
    async for entry in watcher:
        if entry is not None:
            break
    await watcher.stop()  # type: ignore[no-untyped-call]
    return await FleetClient(fleet, CLOCK).send(1, "bench", {})

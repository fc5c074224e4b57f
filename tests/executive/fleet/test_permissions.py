"""What the key of an arm allows at a real nats-server."""

import asyncio
import re
from pathlib import Path

import pytest

from executive.fleet.connection import (
    JOBS,
    MEMBERS,
    RECORDS,
    Fleet,
    control_subject,
    job_subject,
    open_fleet,
)
from executive.fleet.errors import NotConfirmed, NotStarted
from executive.fleet.fleet_client import FleetClient
from executive.fleet.nats_server import NatsOptions, make_key, nats_server, own_credentials
from executive.fleet.values import Job, Member, to_bytes
from executive.fleet.worker import Worker
from hardware import RealClock
from tests.support.servers.free_port import free_port
from tests.support.servers.simulated_arms import SimulatedArm

pytestmark = pytest.mark.slow

CLOCK = RealClock()


@pytest.fixture
def options(tmp_path: Path) -> NatsOptions:
    """A fleet with the key of bench.0, in the file arm.nkey."""
    keys = tmp_path / "keys"
    keys.write_text(f"arm {make_key(tmp_path / 'arm.nkey')} bench.0  # the first\n")
    return NatsOptions(tmp_path / "fleet", port=free_port(), nkeys=keys)


def test_an_arm_with_its_key_runs_jobs_and_touches_no_other_arm(options: NatsOptions) -> None:
    key = {"nkeys_seed": str(options.data.parent / "arm.nkey")}
    other = Member("bench.1", "http://other", "host", "e" * 32, 1)
    job = Job("a" * 32, "bench", 1, {}, 1)

    async def forbidden(fleet: Fleet) -> None:
        """What a stolen key tries."""
        nats = fleet.nats
        await nats.publish(f"$KV.{MEMBERS}.{other.arm}", b"", headers={"KV-Operation": "PURGE"})
        await nats.publish(job_subject("bench", "high", job.identity), to_bytes(job))
        await nats.publish(control_subject("stop"), b"{}")
        for act in ("PURGE", "DELETE"):
            for stream in (JOBS, f"KV_{MEMBERS}", f"KV_{RECORDS}"):
                await nats.publish(f"$JS.API.STREAM.{act}.{stream}", b"{}")
        await nats.flush()

    async def main() -> None:
        credentials = own_credentials(options)
        arm = SimulatedArm(duration=0.0)
        async with (
            open_fleet(options.url, "person", credentials=credentials) as fleet,
            open_fleet(options.url, "bench.0", lasting=True, credentials=key) as own,
            open_fleet(options.url, "bench.0", lasting=True, credentials=key) as stolen,
        ):
            client, worker = FleetClient(fleet, CLOCK), Worker(own, arm, "bench", "0", CLOCK)
            running = asyncio.create_task(worker.run())
            while not [row for row in await client.arms() if row.state == "ready"]:
                continue
            sent = await client.send(1, "bench", {})
            last = [each async for each in client.wait(sent.identity)][-1]
            assert (last.arm, last.state) == ("bench.0", "SUCCEEDED")
            await fleet.members.put(other.arm, to_bytes(other))
            await forbidden(stolen)
            assert [row.member.arm for row in await client.arms()] == ["bench.0", "bench.1"]
            assert await client.queued() == (0, [])
            assert [each.job for each in await client.records()] == [sent]
            assert arm.stops == 0

            async def confirm(message: object) -> None:
                reply = getattr(message, "reply", "")
                await stolen.nats.publish(f"{reply}.{other.arm}", b'{"error": ""}')

            await stolen.nats.subscribe(control_subject("stop"), cb=confirm)
            with pytest.raises(NotConfirmed, match=r"1 of 2 arms confirmed stop; not bench\.1;"):
                await client.stop()
            assert arm.stops == 1
            worker.end()
            await running

    with nats_server(options, CLOCK):
        asyncio.run(asyncio.wait_for(main(), 40))


@pytest.mark.parametrize("line", ["arm UABC", "arm UABC bench", "arm UABC bench.0 x", "person U"])
def test_a_line_of_the_keys_that_is_not_one_is_named(options: NatsOptions, line: str) -> None:
    assert options.nkeys
    options.nkeys.write_text(f"# keys\n{line}\n")
    words = re.escape("keys:2: expected `operator KEY` or `arm KEY POOL.NAME`")
    with pytest.raises(NotStarted, match=words), nats_server(options, CLOCK):
        pass

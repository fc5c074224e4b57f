"""A fleet of simulated arms in a few processes, and a real nats-server, all on this machine.

The arms have no server, so nothing here travels by HTTP: a stop of a real arm adds its own server.

`dispatch_p50_ms`: from the start of `send` until an idle arm has claimed the job, one at a time.
The arm accepts the goal afterwards.
`jobs_per_s`: jobs that are sent, claimed, run (for no time), and whose results are stored, with
everything on disk.
`fleet_stop_ms`: from the request until an arm has confirmed; `_p99` over all arms and runs, and
`_last` the last arm of each run.
`worker_idle_cpu_percent`: processor time of the worker of one idle arm.
`server_idle_cpu_percent`: that of nats-server, per arm.
`--arms 10` measures a small fleet; each arm should cost the same in a large one.
"""

import asyncio
import contextlib
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

# Files beside this one are named like rooms, and this folder comes first when run by itself.
sys.path = [folder for folder in sys.path if Path(folder) != Path(__file__).parent]

from executive.fleet.connection import GONE, Fleet, open_fleet
from executive.fleet.fleet_client import FleetClient
from executive.fleet.nats_server import NatsOptions, nats_server
from executive.fleet.values import JobRecord, Presence, from_bytes
from executive.fleet.worker import BEAT_SECONDS, Worker
from hardware import RealClock
from tests.bench.table import Row, arguments, show
from tests.support.servers.simulated_arms import SimulatedArm

POOL = "bench"
PORT = 14222
SENDERS = 64  # jobs that are being sent at the same time
CLOCK = RealClock()


async def arms(url: str, first: int, number: int) -> None:
    """Serve the pool with some arms, until standard input ends."""

    async def arm(name: str) -> None:
        async with open_fleet(url, name, lasting=True) as fleet:
            server = SimulatedArm(f"http://{name}", duration=0.0)
            await Worker(fleet, server, POOL, name, CLOCK).run()

    ended = asyncio.Event()
    asyncio.get_running_loop().add_reader(sys.stdin.fileno(), ended.set)
    joined = [asyncio.create_task(arm(f"arm-{first + n}")) for n in range(number)]
    await ended.wait()
    for each in joined:
        each.cancel()
    os._exit(0)


async def until_ready(fleet: Fleet, number: int) -> None:
    """Wait until all arms say that they are ready."""
    while True:
        with contextlib.suppress(*GONE):  # a thousand arms join at once
            alive = await fleet.values(Presence)
            if sum(each.state == "ready" for each in alive.values()) == number:
                return
        await asyncio.sleep(0.5)


async def dispatch(fleet: Fleet, number: int) -> list[float]:
    """Times from the start of `send` to the claim, one job after the other [ms]."""
    client, found = FleetClient(fleet, CLOCK), []
    for _ in range(number):
        watcher = await fleet.jobs.watchall()
        while await watcher.updates(10.0) is not None:  # type: ignore[no-untyped-call]
            pass
        begun = time.monotonic()
        await client.send(1, POOL, {})
        await watcher.updates(10.0)  # type: ignore[no-untyped-call]
        found.append(1000 * (time.monotonic() - begun))
        await watcher.stop()  # type: ignore[no-untyped-call]
    return found


async def throughput(fleet: Fleet, number: int) -> float:
    """Jobs per second, from the first `send` to the last stored result."""
    client, left = FleetClient(fleet, CLOCK), number
    watcher = await fleet.jobs.watchall()
    while await watcher.updates(10.0) is not None:  # type: ignore[no-untyped-call]
        pass
    gate = asyncio.Semaphore(SENDERS)

    async def one() -> None:
        async with gate:
            await client.send(1, POOL, {})

    begun = time.monotonic()
    sending = asyncio.gather(*(one() for _ in range(number)))
    while left:
        entry = await watcher.updates(60.0)  # type: ignore[no-untyped-call]
        left -= bool(entry and from_bytes(JobRecord, entry.value).result)
    await sending
    await watcher.stop()  # type: ignore[no-untyped-call]
    return number / (time.monotonic() - begun)


async def stop(fleet: Fleet) -> list[float]:
    """Times from the request to each confirmation [ms]."""
    client = FleetClient(fleet, CLOCK)
    found = [1000 * each.seconds for each in await client.stop()]
    await asyncio.sleep(1.0)  # the arms say what they do
    await client.resume()
    return found


def processor_time(pid: int) -> float:
    """Time that a process has had [s]."""
    words = Path(f"/proc/{pid}/stat").read_text().rpartition(") ")[2].split()
    return (int(words[11]) + int(words[12])) / os.sysconf("SC_CLK_TCK")


async def idle(pids: Sequence[int], seconds: float) -> list[float]:
    """Share of one processor that each process takes while nothing happens [%]."""
    before = [processor_time(pid) for pid in pids]
    await asyncio.sleep(seconds)
    after = [processor_time(pid) for pid in pids]
    return [100 * (b - a) / seconds for a, b in zip(before, after, strict=True)]


async def measure(url: str, nats: int, crowds: list[int], number: int, runs: int) -> list[Row]:
    """All figures."""
    async with open_fleet(url, "bench", lasting=True) as fleet:
        await until_ready(fleet, number)
        server, *workers = await idle([nats, *crowds], 5 * BEAT_SECONDS)
        sent = await dispatch(fleet, 20 * runs)
        rates = [await throughput(fleet, 1000) for _ in range(runs)]
        stops = []
        for _ in range(runs):
            await until_ready(fleet, number)
            stops.append(await stop(fleet))
    confirmed = sorted(each for run in stops for each in run)
    p99 = statistics.quantiles(confirmed, n=100)[98]
    return [
        Row("arms", "", [number]),
        Row("dispatch_p50_ms", "ms", sent, at_most=5.0),
        Row("jobs_per_s", "1/s", rates, at_least=500.0),
        Row("fleet_stop_p99_ms", "ms", [p99], at_most=250.0),
        Row("fleet_stop_last_ms", "ms", [max(run) for run in stops]),
        Row("worker_idle_cpu_percent", "%", [sum(workers) / number], at_most=0.5),
        Row("server_idle_cpu_percent", "%", [server / number]),
    ]


def main(number: int, crowds: int, runs: int, file: Path | None) -> None:
    """Measure and show."""
    with tempfile.TemporaryDirectory() as folder:
        options = NatsOptions(Path(folder), port=PORT)
        with nats_server(options, CLOCK) as nats:
            share = -(-number // crowds)
            started = [
                subprocess.Popen(
                    [
                        sys.executable,
                        __file__,
                        "--crowd",
                        str(first),
                        str(min(share, number - first)),
                    ],
                    stdin=subprocess.PIPE,
                )
                for first in range(0, number, share)
            ]
            pids = [each.pid for each in started]
            try:
                rows = asyncio.run(measure(options.url, nats.pid, pids, number, runs))
            finally:
                for each in started:
                    each.kill()
                    each.wait()
    show(rows, file)


if __name__ == "__main__":
    parser = arguments(__doc__ or "")
    parser.add_argument("--arms", type=int, default=1000, help="number of simulated arms")
    parser.add_argument("--crowds", type=int, default=2, help="processes that hold them")
    parser.add_argument("--crowd", type=int, nargs=2, help="FIRST NUMBER: be one of them")
    given = parser.parse_args()
    if given.crowd:
        asyncio.run(arms(NatsOptions(Path(), port=PORT).url, *given.crowd))
    else:
        main(given.arms, given.crowds, given.runs, given.json)

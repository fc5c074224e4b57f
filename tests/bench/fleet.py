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
`--arms 10` measures a small fleet; each arm should cost the same in a large one. 1,000 arms take
about a minute and a half on 2 quiet cores; each step says when it begins.
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
from executive.fleet.errors import NotConfirmed
from executive.fleet.fleet_client import STOP_SECONDS, FleetClient
from executive.fleet.nats_server import NatsOptions, nats_server
from executive.fleet.values import JobRecord, Presence, from_bytes
from executive.fleet.worker import BEAT_SECONDS, Worker
from hardware import RealClock
from tests.bench.table import Row, arguments, show
from tests.support.servers.simulated_arms import SimulatedArm

POOL = "bench"
PORT = 14222
JOBS_OF_RUN = 1000
SENDERS = 64  # jobs that are being sent at the same time
READY_SECONDS = 120.0  # longest time until all arms are ready
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


def say(step: str) -> None:
    """Print what begins."""
    sys.stderr.write(f"{time.strftime('%H:%M:%S')} {step}\n")


async def until_ready(fleet: Fleet, number: int) -> None:
    """Wait until all arms say that they are ready."""
    ready, end = 0, time.monotonic() + READY_SECONDS
    while ready != number:
        if time.monotonic() > end:
            sys.exit(f"{ready} of {number} arms are ready after {READY_SECONDS:g} s")
        await asyncio.sleep(0.5)
        with contextlib.suppress(*GONE):  # a thousand arms join at once
            alive = await fleet.values(Presence)
            ready = sum(each.state == "ready" for each in alive.values())


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
    """Times from the request to each confirmation [ms]. An arm that is late has the whole time."""
    client = FleetClient(fleet, CLOCK)
    try:
        confirmed, late = await client.stop(), 0
    except NotConfirmed as error:
        confirmed, late = [*error.confirmed], error.wanted - len(error.confirmed)
    await asyncio.sleep(1.0)  # the arms say what they do
    with contextlib.suppress(NotConfirmed):  # an arm that is late resumes, too
        await client.resume()
    return [1000 * each.seconds for each in confirmed] + late * [1000 * STOP_SECONDS]


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
        say(f"{number} arms join")
        await until_ready(fleet, number)
        say(f"all are idle for {5 * BEAT_SECONDS:g} s")
        server, *workers = await idle([nats, *crowds], 5 * BEAT_SECONDS)
        say(f"{20 * runs} jobs, one after the other")
        sent = await dispatch(fleet, 20 * runs)
        say(f"{runs} times {JOBS_OF_RUN} jobs at once")
        rates = [await throughput(fleet, JOBS_OF_RUN) for _ in range(runs)]
        say(f"{runs} stops")
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

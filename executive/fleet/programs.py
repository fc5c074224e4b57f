"""The programs of a fleet: its server, the worker of an arm, and the commands of a person."""

import asyncio
import logging
import os
import re
import signal
import socket
import sys
from collections.abc import Callable, Coroutine, Mapping
from contextlib import nullcontext, suppress
from pathlib import Path
from typing import Any

from httpcore import AsyncConnectionPool

from executive.api.schemas import RECORDING_NAME
from executive.client.asynchronous import AsyncClient
from executive.client.transport import ANSWER_TIMEOUT, Address, transport_errors
from hardware import RealClock

from .errors import FleetError, FleetMissing, without_login
from .worker_process import FleetPlace

try:
    from . import web
    from .connection import end_all, open_fleet
    from .fleet_client import FleetClient
    from .nats_server import (
        NatsOptions as NatsOptions,
        make_key as make_key,
        nats_server,
        own_credentials,
    )
    from .supervisor import Supervisor
    from .values import JobRecord
    from .worker import Worker
except ModuleNotFoundError as error:
    if error.name != "nats":
        raise
    raise FleetMissing("nats-py") from error

Act = Callable[[FleetClient], Coroutine[Any, Any, None]]

logger = logging.getLogger(__name__)

_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
_RETRY_SECONDS = 1.0
_FETCH_SECONDS = 300.0  # longest time to fetch a recording [s]
_MOST_FETCHED = 2**30  # largest recording that is fetched [bytes]


def run(url: str, act: Act, interrupted: Act | None = None) -> None:
    """Connect to a fleet, and call a function with a client of the fleet.

    Args:
        url: URL of the fleet.
        act: The function. Ctrl-C ends it.
        interrupted: Function that is called after Ctrl-C, or None.

    Raises:
        FleetError: The fleet cannot be reached, or it refuses the request.
    """

    async def main() -> None:
        async with open_fleet(url, "armtree") as fleet:
            acting = asyncio.create_task(act(client := FleetClient(fleet, RealClock())))
            try:
                await asyncio.wait((acting,))
            except asyncio.CancelledError:
                await end_all(acting)
                await asyncio.gather(acting, return_exceptions=True)
                if interrupted:
                    await interrupted(client)
                raise
            acting.result()

    asyncio.run(main())


def up(url: str, http_port: int, own: NatsOptions | None = None) -> None:
    """Run the supervisor and the page of a fleet until a signal arrives.

    Args:
        url: URL of the NATS server.
        http_port: TCP port of the page; 0 for any free one.
        own: Options of a NATS server to run until the signal; None if one already runs at `url`.

    Raises:
        FleetError: nats-server cannot start or has ended, its data folder is gone, or another
            program has the port.
    """

    async def main() -> None:
        ended = _signals()
        with (
            nats_server(own, RealClock()) if own else nullcontext() as process,
            web.listen(http_port) as listener,
        ):
            if own:
                logger.info("The fleet is at %s, its data in %s", url, own.data)
            credentials = own_credentials(own) if own else None
            watching = asyncio.create_task(_supervise(url, listener, credentials))
            try:
                while not ended.is_set():
                    with suppress(TimeoutError):
                        async with asyncio.timeout(_RETRY_SECONDS):
                            await ended.wait()
                    if watching.done():
                        watching.result()  # raises the errors of bugs
                    if own and process and (status := process.poll()) is not None:
                        raise FleetError(
                            f"nats-server has ended with status {status}; its log is "
                            f"{own.data / 'nats-server.log'}. Start it again: armtree fleet up"
                        )
                    if own and not own.data.is_dir():
                        raise FleetError(
                            f"the data folder {own.data} is gone, and new jobs would be lost, "
                            "so the fleet ends. Start it again: armtree fleet up"
                        )
            finally:
                await end_all(watching)

    asyncio.run(main())


async def _supervise(
    url: str, listener: socket.socket, credentials: Mapping[str, Any] | None
) -> None:
    logger.info("The page of the fleet: http://127.0.0.1:%d", listener.getsockname()[1])
    clock = RealClock()
    while True:
        known: list[Supervisor] = []

        async def changed(up: bool, known: list[Supervisor] = known) -> None:
            if up and known:
                known[0].reconnected()

        try:
            async with open_fleet(url, "supervisor", True, changed, credentials) as fleet:
                known.append(supervisor := Supervisor(fleet, clock))
                page = web.serve(FleetClient(fleet, clock), supervisor, listener)
                await asyncio.gather(supervisor.run(), page)
        except FleetError as error:
            logger.warning("%s", error)
            await asyncio.sleep(_RETRY_SECONDS)


async def join(server: str, place: FleetPlace, page: str, child: bool) -> None:
    """Run the worker of an arm until a signal arrives.

    Args:
        server: URL of the server of the arm.
        place: Place of the arm in the fleet.
        page: URL of the arm's page for other machines; empty for `server`.
        child: True to also end when standard input ends.

    Raises:
        NameTaken: Another worker has that name.
        FleetRefused: The fleet refuses the credentials.
    """
    url, known = place.url, list[Worker]()
    shown = without_login(url)

    async def changed(up: bool) -> None:
        if up:
            logger.info("Fleet: connected again to %s", shown)
        else:
            logger.warning(
                "Fleet: %s is gone; the arm finishes its job, and this program reconnects", shown
            )
        if up and known:
            await known[0].reconnected()

    async def serve() -> None:
        async with (
            AsyncClient(server) as client,
            open_fleet(url, f"{place.pool}.{place.name}", lasting=True, changed=changed) as fleet,
        ):
            worker = Worker(fleet, client, place.pool, place.name, RealClock(), page)
            known[:] = [worker]
            logger.info("Fleet: this arm is %s in %s", worker.arm, shown)
            await worker.run()

    in_order = True

    def parent_ended() -> None:
        nonlocal in_order
        in_order = bool(os.read(sys.stdin.fileno(), 1))  # see `worker_of`
        asyncio.get_running_loop().remove_reader(sys.stdin.fileno())
        ended.set()

    ended = _signals()
    if child:
        asyncio.get_running_loop().add_reader(sys.stdin.fileno(), parent_ended)
    serving = asyncio.create_task(serve())
    ending = asyncio.create_task(ended.wait())
    await asyncio.wait((serving, ending), return_when=asyncio.FIRST_COMPLETED)
    ending.cancel()
    if known:
        known[0].end(in_order)
    else:
        await end_all(serving)
    with suppress(asyncio.CancelledError):
        await serving


def _signals() -> asyncio.Event:
    """Return an event that a signal sets."""
    ended, loop = asyncio.Event(), asyncio.get_running_loop()
    for number in _SIGNALS:
        loop.add_signal_handler(number, ended.set)
    return ended


async def fetch_recording(
    client: FleetClient, identity: str, folder: Path, server: str | None = None
) -> Path:
    """Fetch the recording of a job from the server of its arm.

    Args:
        client: The fleet.
        identity: Id of the job.
        folder: Folder for the file.
        server: URL of the server, which gets ARMTREE_TOKEN. None for the URL that the arm has
            named, without the token: an arm must not get the token of another arm.

    Returns:
        The path of the file.

    Raises:
        UnknownJob: No job has that id.
        FleetError: The job has no recording, the server refuses the request or needs more than
            300 s, the file exists, or it is larger than 1 GiB.
        ClientError: The server of the arm does not answer.
    """
    found = await client.job(identity)
    result = found.result if isinstance(found, JobRecord) else None
    if not isinstance(found, JobRecord) or not result or not result.recording:
        raise FleetError(f"the job {identity} has no recording; `armtree fleet jobs` shows why")
    name, url = Path(result.recording).name, server or found.url
    path = folder / name
    if not re.fullmatch(RECORDING_NAME["pattern"], name):
        raise FleetError(f"{found.arm} names no valid recording: {name!r}; nothing was written")
    address = Address.find(url, None, trusted=bool(server))
    request = address.request("GET", f"/api/recordings/{name}/file")
    try:
        async with asyncio.timeout(_FETCH_SECONDS):
            await _fetch(url, request, path)
    except TimeoutError as error:
        raise FleetError(
            f"{url} does not give the file within {_FETCH_SECONDS:g} s; copy {result.recording} "
            f"from the machine of {found.arm}"
        ) from error
    return path


async def _fetch(url: str, request: dict[str, Any], path: Path) -> None:
    """Write the answer to a request to a new file."""
    refused = f"{url} does not give the file"
    with transport_errors(url, ANSWER_TIMEOUT):
        async with AsyncConnectionPool() as pool, pool.stream(**request) as response:
            if response.status != 200:
                why = f"it answers {response.status} for the recording {path.name}"
                raise FleetError(f"{refused}: {why}. {_WITH_TOKEN}")
            try:
                stream = path.open("xb")
            except FileExistsError as error:
                raise FleetError(f"{path} exists; give another folder: -o FOLDER") from error
            try:
                with stream:
                    async for piece in response.aiter_stream():
                        if stream.tell() + len(piece) > _MOST_FETCHED:
                            raise FleetError(f"{refused}: it has more than {_MOST_FETCHED} bytes")
                        stream.write(piece)
            except BaseException:
                path.unlink()
                raise


_WITH_TOKEN = (
    "If the server needs its token, type: ARMTREE_TOKEN=TOKEN armtree fleet logs JOB --from URL"
)

"""The server: a socket, a thread for the network, and an order in which to end."""

import asyncio
import logging
import os
import re
import socket
import threading
from dataclasses import dataclass
from typing import Any, Self

import uvicorn

from executive.errors import AddressInUse, ServerError
from executive.executive import Executive
from executive.goals.questions import Questions, nobody
from executive.live_library import LiveLibrary
from hardware import Clock, Robot

from . import token_file
from .event_hub import EventHub
from .http.answers import Api
from .http.app import App
from .http.strict_json import MAX_BYTES
from .limits.cancel_thread import CancelThread
from .limits.connections import HttpConnection, SharedState, WebSocketConnection
from .limits.fair_queue import FairQueue
from .rosbridge.bridge import Bridge
from .security import AccessRules, is_loopback, names

logger = logging.getLogger(__name__)

_BACKLOG = 128
_ORIGIN = re.compile(r"https?://[a-z0-9._:\[\]-]+")  # as browsers write one
_SEND_BUFFER = 128 * 1024  # [bytes] that may be on their way to a client that reads nothing
_LAST_ANSWERS = 0.05  # [s] for what is being answered when the server ends


@dataclass(frozen=True, slots=True)
class ListenOptions:
    """Where a server listens, and to whom.

    Attributes:
        address: Of the interface.
        port: Of TCP; 0 for any that is free.
        hosts: Names it has beside its address.
        origins: Of pages that may use it, beside its own.
        expose: Whether others than this machine may connect.
        rosbridge: Whether rosbridge clients may.
    """

    address: str = "127.0.0.1"
    port: int = token_file.PORT
    hosts: tuple[str, ...] = ()
    origins: tuple[str, ...] = ()
    expose: bool = False
    rosbridge: bool = False


class _Uvicorn(uvicorn.Server):
    """uvicorn without its ten looks a second at whether it is to end."""

    def __init__(self, config: uvicorn.Config, queue: FairQueue) -> None:
        super().__init__(config)
        self.server_state = SharedState(queue)
        self.ready, self._end = threading.Event(), asyncio.Event()

    async def main_loop(self) -> None:
        self.ready.set()
        await self._end.wait()

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        for listener in (*self.servers, *(sockets or ())):
            listener.close()
        for connection in tuple(self.server_state.connections):
            connection.shutdown()
        if tasks := tuple(self.server_state.tasks):
            _, late = await asyncio.wait(tasks, timeout=_LAST_ANSWERS)
            for task in late:
                task.cancel()
        for connection in tuple(self.server_state.connections):
            connection.transport.abort()
        await asyncio.sleep(0)  # lets what was closed be told so

    def end(self) -> None:
        """Shut down; on the loop."""
        self._end.set()


class Server:
    """Listens from the moment it is made; answers from `start` to `stop`, or its context's end.

    Args:
        executive: What it serves.
        library: The tasks there are.
        robot: Whose arm.
        clock: Whose time.
        place: Where it listens, and to whom.
        questions: The operator of the executive.

    Attributes:
        url: Where it is.
        token: For whatever changes state.

    Raises:
        ServerError: It would be open to more than was said.
        AddressInUse: Another program listens there.
    """

    def __init__(
        self,
        executive: Executive,
        library: LiveLibrary,
        robot: Robot,
        clock: Clock,
        place: ListenOptions,
        questions: Questions,
    ) -> None:
        _check(place)
        self._socket = _listen(place.address, place.port)
        self.port: int = self._socket.getsockname()[1]
        self._executive, self._library = executive, library
        self._robot, self._clock, self._place = robot, clock, place
        self._questions = questions
        own = next(iter(names((place.address,), self.port)))
        self.url, self.token = f"http://{own}", token_file.new_token()
        self._access = token_file.ServerInfo(self.url, self.token, os.getpid())
        try:
            token_file.publish(self.port, self._access)
        except OSError as error:
            self._socket.close()
            raise ServerError(f"the token cannot be left for our own clients: {error}") from error
        self._loop = asyncio.new_event_loop()
        self._hub = EventHub(self._loop)
        self._thread: threading.Thread | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *raised: object) -> None:
        self.stop()

    @property
    def connections(self) -> int:
        """How many there are."""
        return len(self._server.server_state.connections)

    def start(self) -> None:
        """Begin to answer."""
        self._end_events = self._executive.subscribe(self._hub.publish)
        self._questions.watch = self._hub.publish
        self._stops = stops = CancelThread(self._executive, self._clock)
        api = Api(self._executive, stops, self._library, self._hub, self._questions)
        bridge = Bridge(self._executive, stops, self._hub, self._robot, self._clock)
        app = App(api, self._rules(), self._clock, bridge.serve if self._place.rosbridge else None)
        self._server = _Uvicorn(_config(app), FairQueue(self._loop))
        self._thread = self._clock.spawn(self._run, "network")
        self._server.ready.wait()

    def stop(self) -> None:
        """Answer no more, also where it never did; whoever waits or watches is let go."""
        if self._thread:
            self._end_events()
            self._questions.watch = nobody
            self._loop.call_soon_threadsafe(self._hub.end)
            self._loop.call_soon_threadsafe(self._server.end)
            self._thread.join()
            self._stops.close()
        self._socket.close()
        self._loop.close()
        token_file.withdraw(self.port, self._access)

    def _run(self) -> None:
        with asyncio.Runner(loop_factory=lambda: self._loop) as runner:
            runner.run(self._server.serve([self._socket]))

    def _rules(self) -> AccessRules:
        place = self._place
        known = [*place.hosts, place.address]
        if is_loopback(place.address) or place.address in ("0.0.0.0", "::"):
            known += ["127.0.0.1", "localhost"]
        hosts = names(known, self.port)
        origins = {f"http://{host}" for host in hosts} | set(place.origins)
        # A proxy in front passes on what it was asked by. Pages of that name may be another's.
        hosts |= names(place.hosts, token_file.HTTP_PORT)
        return AccessRules(hosts, frozenset(origins), self.token, place.expose)


def _check(place: ListenOptions) -> None:
    try:
        loopback = is_loopback(place.address)
    except ValueError as error:
        raise ServerError(f"--bind {place.address} is no address, such as 127.0.0.1") from error
    if not loopback and not place.expose:
        raise ServerError(
            f"--bind {place.address} would let other machines move the arm; add --expose if they "
            "shall, and give the token to nobody else"
        )
    for page in place.origins:
        if not _ORIGIN.fullmatch(page):
            raise ServerError(f"--origin {page} is no origin, such as http://name:port")
    if place.expose and place.rosbridge:
        raise ServerError("rosbridge knows no token, so --rosbridge does not go with --expose")


def _listen(address: str, port: int) -> socket.socket:
    family = socket.AF_INET6 if ":" in address else socket.AF_INET
    # asyncio spares answers the wait for more only where a socket says that it is TCP's.
    made = socket.socket(family, socket.SOCK_STREAM, socket.IPPROTO_TCP)
    made.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    made.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _SEND_BUFFER)
    for option in token_file.KEEPALIVE:  # connections have them from here
        made.setsockopt(*option)
    try:
        made.bind((address, port))
    except OSError as error:
        made.close()
        raise AddressInUse(
            f"cannot listen on {address} port {port}: {error.strerror}; is another server there? "
            "--tcp-port takes another one"
        ) from error
    made.listen(_BACKLOG)
    return made


def _config(app: Any) -> uvicorn.Config:
    logging.getLogger("uvicorn.error").setLevel(logging.ERROR)  # strangers must not fill the log
    return uvicorn.Config(
        app,
        loop="asyncio",
        http=HttpConnection,
        ws=WebSocketConnection,
        ws_max_size=MAX_BYTES,
        ws_per_message_deflate=False,
        lifespan="off",
        log_config=None,
        access_log=False,
        proxy_headers=False,
        server_header=False,
        date_header=False,
        backlog=_BACKLOG,
    )

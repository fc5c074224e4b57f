"""The server: its socket, its thread, and the order of its shutdown."""

import asyncio
import logging
import os
import re
import socket
import threading
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any, Self
from urllib.parse import urlsplit

import uvicorn
from starlette.websockets import WebSocket

from executive.api import ADDRESS, PORT, token_file
from executive.api.outcome import CancelCode, CancelResult
from executive.api.strict_json import MAX_BYTES
from executive.errors import AddressInUse, ServerError
from executive.executive import Executive
from executive.goals.questions import Questions, ignore
from executive.host_limits import spare_files
from hardware import Clock, HostLimit
from hardware.loading.dataclass import dataclass

from .event_hub import EventHub
from .http.app import App
from .http.endpoints import Endpoints
from .http.recording_endpoints import RecordingEndpoints
from .limits.acceptor import Acceptor
from .limits.cancel_thread import CancelThread
from .limits.connections import MAX_HEAD, HttpConnection, SharedState, WebSocketConnection
from .limits.fair_queue import FairQueue
from .rosbridge.bridge import RosbridgeServer
from .security import AccessRules, host_names, is_loopback
from .sign_in import SignIn
from .systemd.notifier import SystemdNotifier

logger = logging.getLogger(__name__)

MAX_CONNECTIONS = 128  # enough for all streams, subscribers and rosbridge clients together
_BACKLOG = 4096  # connections that the kernel queues until they are accepted
# Loopback address, by the address of all interfaces.
_LOOPBACK = {"0.0.0.0": "127.0.0.1", "::": "::1"}
_ORIGIN = re.compile(r"https?://[a-z0-9._:\[\]-]+")  # pattern of an origin, as browsers send it
_SEND_BUFFER = 128 * 1024  # largest number of bytes in flight to a client that does not read
_SHUTDOWN_TIMEOUT = 0.05  # longest time for open answers at shutdown [s]


@dataclass(frozen=True, slots=True)
class ListenOptions:
    """Options of a server: its address and its clients.

    Attributes:
        address: IP address of the interface.
        port: TCP port; 0 for any free one.
        hosts: Names of the server besides its address.
        origins: Origins of other sites' pages that may use the server.
        expose: True if other machines may connect.
        rosbridge: True to serve rosbridge clients.
    """

    address: str = ADDRESS
    port: int = PORT
    hosts: tuple[str, ...] = ()
    origins: tuple[str, ...] = ()
    expose: bool = False
    rosbridge: bool = False

    def check(self) -> None:
        """Check the options against each other.

        Raises:
            ServerError: The options are unsafe or invalid.
        """
        try:
            loopback = is_loopback(self.address)
        except ValueError as error:
            why = f"--bind {self.address} is not an address, such as 127.0.0.1"
            raise ServerError(why) from error
        if not loopback and not self.expose:
            raise ServerError(
                f"--bind {self.address} would let other machines move the arm; add --expose to "
                "allow it, and keep the token secret"
            )
        for page in self.origins:
            if not _ORIGIN.fullmatch(page):
                raise ServerError(f"--origin {page} is not an origin, such as http://name:port")
        if self.expose and self.rosbridge:
            raise ServerError(
                "rosbridge has no token, so give --rosbridge or --expose, but not both"
            )

    def page(self, port: int) -> str:
        """Return the URL of the page for other machines: with the first of `hosts`, if any.

        Args:
            port: TCP port on which the server listens.
        """
        address = _LOOPBACK.get(self.address, self.address)
        name = next(iter(self.hosts), address)
        proxy = (each for each in self.origins if urlsplit(each).hostname == name.lower())
        return next(proxy, f"http://{next(iter(host_names((name,), port)))}")

    def rules(self, port: int, token: str) -> AccessRules:
        """Return the rules of access to a server with these options.

        Args:
            port: TCP port of the server.
            token: Token of the server.
        """
        known = [*self.hosts, self.address]
        if is_loopback(self.address) or self.address in _LOOPBACK:
            known += ["localhost", "127.0.0.1", _LOOPBACK.get(self.address, self.address)]
        hosts = host_names(known, port)
        origins = {f"http://{host}" for host in hosts} | set(self.origins)
        # A proxy may pass on Host without the port of this server. Pages of that name may be of
        # another server, so the name is not an origin.
        hosts |= host_names(self.hosts, token_file.HTTP_PORT)
        return AccessRules(hosts, frozenset(origins), token, self.expose)


class _Uvicorn(uvicorn.Server):
    """uvicorn with armtree's acceptor. It waits for the event `ending` instead of polling."""

    def __init__(self, config: uvicorn.Config, state: SharedState, listener: socket.socket) -> None:
        super().__init__(config)
        self.server_state, self._state, self._listener = state, state, listener
        self.ready, self.ending = threading.Event(), asyncio.Event()
        self._systemd = SystemdNotifier()

    async def main_loop(self) -> None:
        self._acceptor = Acceptor(
            asyncio.get_running_loop(), self._listener, self._state, self._connection
        )
        self.ready.set()
        self._systemd.ready(asyncio.get_running_loop())
        await self.ending.wait()
        self._systemd.ending()

    def _connection(self, accepted: float) -> HttpConnection:
        return HttpConnection(
            accepted, config=self.config, server_state=self._state, app_state=self.lifespan.state
        )

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        await self._acceptor.close()
        self._listener.close()
        for connection in tuple(self.server_state.connections):
            connection.shutdown()
        if tasks := tuple(self.server_state.tasks):
            _, late = await asyncio.wait(tasks, timeout=_SHUTDOWN_TIMEOUT)
            for task in late:
                task.cancel()
        for connection in tuple(self.server_state.connections):
            connection.transport.abort()
        await asyncio.sleep(0)  # let the callbacks of closed connections run


class HttpServer:
    """A server for endpoints, with its socket, its token and its thread.

    It listens from its creation, and answers from `serve` to `stop` or the end of its context.

    Args:
        listen: Address and clients of the server.
        clock: Time source.
        workers: Number of processes that this process starts.

    Attributes:
        url: URL of the server, for clients on this machine.
        port: TCP port.
        token: Token for every request that changes something.
        sign_in: Makes links that sign browsers in.

    Raises:
        ServerError: The options are unsafe or invalid, or the token file cannot be written.
        AddressInUse: Another program listens on the port.
        HostLimit: The limit of open files is too low.
    """

    def __init__(self, listen: ListenOptions, clock: Clock, workers: int = 0) -> None:
        listen.check()
        self._socket = _listen(listen.address, listen.port)
        self.port: int = self._socket.getsockname()[1]
        self._clock, self._options = clock, listen
        address = _LOOPBACK.get(listen.address, listen.address)
        host = next(iter(host_names((address,), self.port)))
        self.url, self.token = f"http://{host}", token_file.new_token()
        self.sign_in = SignIn(self.url, self.token)
        self._info = token_file.ServerInfo(self.url, self.token, os.getpid())
        try:
            token_file.write(self.port, self._info)
        except OSError as error:
            self._socket.close()
            raise ServerError(f"cannot write the token file: {error}") from error
        self._loop = asyncio.new_event_loop()
        self._thread: threading.Thread | None = None
        try:
            # Checked before the first connection is open.
            self._spare_files = spare_files(workers, least=2, most=4 * MAX_CONNECTIONS)
        except HostLimit:
            self.stop()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *raised: object) -> None:
        self.stop()

    @property
    def connections(self) -> int:
        """Number of open connections."""
        return len(self._server.server_state.connections)

    def serve(
        self,
        endpoints: RecordingEndpoints,
        stop: Callable[[], asyncio.Future[CancelResult]],
        rosbridge: Callable[[WebSocket], Awaitable[None]] | None = None,
    ) -> None:
        """Start to answer requests.

        Args:
            endpoints: Answer the requests.
            stop: Callback that stops the arm, in the event loop.
            rosbridge: Serves a WebSocket, or None.
        """
        rules = self._options.rules(self.port, self.token)
        app = App(endpoints, rules, self._clock, rosbridge)
        queue = FairQueue(self._loop)
        most = min(MAX_CONNECTIONS, self._spare_files // 2)
        state = SharedState(queue, rules, most, max(1, self._spare_files - 2 * most), stop)
        self._server = _Uvicorn(_config(app), state, self._socket)
        self._thread = self._clock.spawn(self._run, "network")
        self._server.ready.wait()

    def stop(self) -> None:
        """End all answers, and remove the token file. May be called without a start."""
        if self._thread:
            self._loop.call_soon_threadsafe(self._server.ending.set)
            self._thread.join()
        self._socket.close()
        self._loop.close()
        token_file.remove(self.port, self._info)

    def _run(self) -> None:
        with asyncio.Runner(loop_factory=lambda: self._loop) as runner:
            runner.run(self._server.serve([]))


class Server(HttpServer):
    """The HTTP and rosbridge server of an executive.

    Args:
        executive: Runs the goals. It reloads its tasks.
        listen: Address and clients of the server.
        questions: Open questions of tasks.

    Raises:
        ServerError, AddressInUse, HostLimit: The server cannot start; see `HttpServer`.
    """

    def __init__(
        self,
        executive: Executive,
        listen: ListenOptions,
        questions: Questions,
    ) -> None:
        super().__init__(listen, executive.clock, executive.setup.workers)
        self._executive, self._questions = executive, questions
        self._hub = EventHub(self._loop)

    def start(self) -> None:
        """Start to answer."""
        self._unsubscribe = self._executive.subscribe(self._hub.publish)
        self._questions.changed = self._hub.publish
        self._canceler = canceler = CancelThread(self._executive)
        endpoints = Endpoints(self._executive, canceler, self._hub, self._questions, self.sign_in)
        bridge = RosbridgeServer(self._executive, canceler, self._hub)
        rosbridge = bridge.serve if self._options.rosbridge else None
        self.serve(endpoints, canceler.stop, rosbridge)

    def stop(self) -> None:
        """End all answers and streams, and remove the token file. May be called without a start."""
        started = self._thread is not None
        if started:
            self._unsubscribe()
            self._questions.changed = ignore
            self._loop.call_soon_threadsafe(self._hub.end)
        super().stop()
        if started:
            self._canceler.close()


class Viewer(HttpServer):
    """Serves the page with the recordings of a folder, on a free port, only on this machine.

    Args:
        folder: The folder.
        clock: Time source.

    Raises:
        ServerError, AddressInUse, HostLimit: The server cannot start; see `HttpServer`.
    """

    def __init__(self, folder: Path, clock: Clock) -> None:
        super().__init__(ListenOptions(port=0), clock)
        self._folder = folder

    def start(self) -> None:
        """Start to answer."""
        self.serve(RecordingEndpoints(self._folder, self.sign_in, self._clock), self._refuse)

    def _refuse(self) -> asyncio.Future[CancelResult]:
        """Refuse a stop, because there is no arm."""
        refused: asyncio.Future[CancelResult] = self._loop.create_future()
        refused.set_result(CancelResult(CancelCode.REJECTED, ()))
        return refused


def _listen(address: str, port: int) -> socket.socket:
    family = socket.AF_INET6 if ":" in address else socket.AF_INET
    # asyncio sets TCP_NODELAY only on sockets that name this protocol.
    listener = socket.socket(family, socket.SOCK_STREAM, socket.IPPROTO_TCP)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _SEND_BUFFER)
    for option in token_file.KEEPALIVE:  # connections inherit these options
        listener.setsockopt(*option)
    try:
        listener.bind((address, port))
    except OSError as error:
        listener.close()
        raise AddressInUse(
            f"cannot listen on {address} port {port}: {error.strerror}; if another server runs "
            "there, end it, or choose another port with --tcp-port"
        ) from error
    listener.setblocking(False)
    listener.listen(_BACKLOG)
    return listener


def _config(app: Any) -> uvicorn.Config:
    # Clients without the token must not fill the log.
    logging.getLogger("uvicorn.error").setLevel(logging.ERROR)
    return uvicorn.Config(
        app,
        loop="asyncio",
        http=HttpConnection,
        ws=WebSocketConnection,
        h11_max_incomplete_event_size=MAX_HEAD,
        ws_max_size=MAX_BYTES,
        ws_per_message_deflate=False,
        lifespan="off",
        log_config=None,
        access_log=False,
        proxy_headers=False,
        server_header=False,
        date_header=False,
    )

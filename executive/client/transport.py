"""Code that both clients share: address, timeouts, errors and the hold of a goal."""

import json
import math
import os
import re
import threading
from collections.abc import AsyncIterator, Awaitable, Callable, Iterator, Mapping
from contextlib import asynccontextmanager, contextmanager
from typing import TYPE_CHECKING, Any, Self
from urllib.parse import quote, urlencode, urlsplit

from executive.api import PORT, token_file
from executive.api.token_file import KEEPALIVE
from executive.errors import ServerSilent, ServerUnreachable
from hardware.loading.dataclass import dataclass

if TYPE_CHECKING:
    import httpcore

ANSWER_TIMEOUT = 10.0  # longest time for an answer that does not wait for anything [s]
SILENCE_TIMEOUT = 45.0  # longest silence of an event stream [s]; the server sends every 15 s
POLL_PERIOD = 15.0  # longest time to wait for a result in one request [s]
BEAT_PERIOD = 0.2  # time between two bytes that hold a goal [s]
# Limits of connections of a client. The server closes connections that are idle for longer.
POOL: dict[str, Any] = {
    "max_connections": 100,
    "keepalive_expiry": 5.0,
    "socket_options": KEEPALIVE,
}
_STEPS = ("connect", "read", "write", "pool")


@dataclass(frozen=True, slots=True)
class Address:
    """The URL of a server, and the headers of every request to it.

    Attributes:
        url: URL without a slash at its end.
        headers: Headers of every request.
    """

    url: str
    headers: Mapping[str, str]

    @classmethod
    def find(
        cls, url: str | None, token: str | None, client: str = "", trusted: bool = True
    ) -> Self:
        """Return the address of a server.

        Args:
            url: URL; default ARMTREE_SERVER, then the server on this machine.
            token: Token; default ARMTREE_TOKEN, then the token file of the server.
            client: Name of this client; empty for no name.
            trusted: False for a URL from another program. Then ARMTREE_TOKEN is not sent.

        Raises:
            ServerUnreachable: The URL is invalid.
        """
        port = os.environ.get("ARMTREE_TCP_PORT", PORT)
        url = (url or os.environ.get("ARMTREE_SERVER") or f"http://localhost:{port}").rstrip("/")
        token = token or (os.environ.get("ARMTREE_TOKEN") if trusted else None)
        own = _own_server(url)
        url, token = (own.url, token or own.token) if own else (token_file.loopback(url), token)
        headers = {"authorization": f"Bearer {token}"} if token else {}
        if client:
            headers["user-agent"] = client
        headers["accept-encoding"] = "identity"  # a small answer must not unpack to a huge answer
        headers["host"] = urlsplit(url).netloc.rpartition("@")[2]
        return cls(url, headers)

    def request(
        self,
        method: str,
        path: str,
        query: Mapping[str, Any] | None = None,
        body: Mapping[str, Any] | None = None,
        timeout: float = ANSWER_TIMEOUT,
    ) -> dict[str, Any]:
        """Return the arguments of `stream` of a connection pool.

        Args:
            method: HTTP method.
            path: Path of the URL.
            query: Parameters of the URL.
            body: JSON object to send.
            timeout: Longest time for each step of the request, and for the answer [s].
        """
        headers, content = dict(self.headers), None
        if body is not None:
            content = json.dumps(body, ensure_ascii=False, allow_nan=False).encode()
            headers["content-type"] = "application/json"
        return {
            "method": method,
            "url": self.url + quote(path) + (f"?{urlencode(query)}" if query else ""),
            "headers": headers,
            "content": content,
            "extensions": {"timeout": dict.fromkeys(_STEPS, timeout)},
        }


def _own_server(url: str) -> token_file.ServerInfo | None:
    """Return the running server of this user at a URL, or None.

    The URL must have the server's own address, or `localhost`. Another user's program may listen at
    other addresses of this machine, such as ::1.
    """
    try:
        parts = urlsplit(url)
        port = parts.port or token_file.HTTP_PORT
        url.encode("ascii")
    except ValueError as error:
        raise ServerUnreachable(url, str(error)) from error
    if parts.scheme != "http":
        return None
    own = token_file.read(port)
    return own if own and parts.hostname in ("localhost", urlsplit(own.url).hostname) else None


@contextmanager
def transport_errors(url: str, silence: float, reads: bool = True) -> Iterator[None]:
    """Convert httpcore's errors inside this context to ServerUnreachable.

    Args:
        url: URL of the server.
        silence: Longest silence of the server [s].
        reads: True if the request only reads.

    Raises:
        ServerSilent: The server was silent for longer, or its answer did not end in time.
        ServerUnreachable: The server could not be reached.
    """
    import httpcore  # slow to import

    from .deadlines import AnswerTooSlow

    try:
        yield
    except httpcore.ReadTimeout as error:
        raise ServerSilent(url, silence, reads, isinstance(error, AnswerTooSlow)) from error
    except httpcore.RemoteProtocolError as error:
        words = "the connection ended before the answer did, or another program answers"
        raise ServerUnreachable(url, words) from error
    except (
        httpcore.TimeoutException,
        httpcore.NetworkError,
        httpcore.ProtocolError,
        httpcore.UnsupportedProtocol,
    ) as error:
        words = re.sub(r"^\[Errno -?\d+\] ", "", str(error)) or type(error).__name__
        raise ServerUnreachable(url, words) from error


def lift_deadline(response: "httpcore.Response") -> None:
    """Replace the deadline of an answer without end by `SILENCE_TIMEOUT` for each piece."""
    response.extensions["network_stream"].deadline.lift(SILENCE_TIMEOUT)


def poll_times(timeout: float | None) -> Iterator[float]:
    """Divide a wait into requests of `POLL_PERIOD`, to notice a server that hangs.

    Args:
        timeout: Longest time to wait [s]; None for no limit.

    Yields:
        The longest time of each request [s].
    """
    left = math.inf if timeout is None else timeout
    while left > POLL_PERIOD:
        yield POLL_PERIOD
        left -= POLL_PERIOD
    yield left


@contextmanager
def posted(post: Callable[[Iterator[bytes]], object]) -> Iterator[None]:
    """Send a body during this context, on a thread.

    Args:
        post: Callback that sends a request with the given body.
    """
    released = threading.Event()

    def beats() -> Iterator[bytes]:
        while not released.wait(BEAT_PERIOD):
            yield b"."

    posting = threading.Thread(target=post, args=(beats(),), name="hold", daemon=True)
    posting.start()
    try:
        yield
    finally:
        released.set()
        posting.join()


@asynccontextmanager
async def async_posted(
    post: Callable[[AsyncIterator[bytes]], Awaitable[object]],
) -> AsyncIterator[None]:
    """Send a body during this context, in a task.

    Args:
        post: Callback that sends a request with the given body.
    """
    import asyncio  # slow to import

    released = asyncio.Event()

    async def beats() -> AsyncIterator[bytes]:
        while not released.is_set():
            yield b"."
            try:
                await asyncio.wait_for(released.wait(), BEAT_PERIOD)
            except TimeoutError:
                continue

    posting = asyncio.ensure_future(post(beats()))
    try:
        yield
    finally:
        released.set()
        await posting

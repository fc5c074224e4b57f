"""Raw connections to a server."""

import contextlib
import socket
from collections.abc import Iterator

from tests.support.servers.serving import Served

GOAL = "0123456789abcdef" * 2

UPGRADE = (
    *("connection: upgrade", "upgrade: websocket", "sec-websocket-version: 13"),
    "sec-websocket-key: AAAAAAAAAAAAAAAAAAAAAA==",
)


@contextlib.contextmanager
def raw(served: Served, *lines: str) -> Iterator[socket.socket]:
    """A connection on which these lines of a head were sent."""
    with socket.create_connection(("127.0.0.1", served.server.port), 10) as connection:
        connection.sendall("".join(f"{line}\r\n" for line in lines).encode())
        yield connection


def answer(connection: socket.socket) -> bytes:
    """All data until the server closes the connection."""
    found = b""
    with contextlib.suppress(ConnectionResetError):
        while data := connection.recv(65_536):
            found += data
    return found


def stops(served: Served) -> bool:
    return served.ask("POST", "/api/stop", token=False)[0] == 200


HEAD = ("POST /api/goals HTTP/1.1", "host: 127.0.0.1:{port}", "authorization: Bearer {token}")


def head(served: Served, *more: str) -> list[str]:
    known = {"port": served.server.port, "token": served.server.token}
    return [line.format(**known) for line in (*HEAD, "content-type: application/json", *more)]

"""What passes between a worker and its parent: pickles, each with its length in front.

One is sent only when the one before it was answered, so nothing follows a message.
"""

import pickle
import socket
import time
from typing import Any

_PREFIX = 4  # of the length, highest byte first [bytes]
_MOST = 2**30  # that a pickle may have [bytes]
_CHUNK = 65_536  # that is read at a time [bytes]


class Garbled(Exception):
    """What came is no message."""


def packed(message: object) -> bytes:
    """A message as it is sent.

    Raises:
        ValueError: It is longer than a message may be.
    """
    body = pickle.dumps(message, pickle.HIGHEST_PROTOCOL)
    if len(body) > _MOST:
        raise ValueError(f"{len(body)} bytes")
    return len(body).to_bytes(_PREFIX) + body


def send(connection: socket.socket, data: bytes, until: float | None = None) -> None:
    """Send what was packed, or what is left of it.

    Args:
        connection: Where it goes. Its own time-out is changed where one is given.
        data: What to send.
        until: On the monotonic clock, for all of it [s]; None to wait as long as the socket does.

    Raises:
        TimeoutError: Not all of it was taken in time.
        OSError: The other end closed.
    """
    _wait(connection, until)
    connection.sendall(data)


def receive(connection: socket.socket, until: float | None = None) -> Any:
    """The next message, waited for.

    Args:
        connection: Where it comes from. Its own time-out is changed where one is given.
        until: On the monotonic clock, for all of it [s]; None to wait as long as the socket does.

    Raises:
        TimeoutError: Not all of it came in time.
        EOFError: The other end closed.
        Garbled: What came is no message.
    """
    data = bytearray()
    while _missing(data):
        _wait(connection, until)
        some = connection.recv(_CHUNK)
        if not some:
            raise EOFError
        data += some
    try:
        return pickle.loads(bytes(data[_PREFIX:]))
    except Exception as error:  # whatever there is in what another process sent
        raise Garbled(repr(error)) from error


def _wait(connection: socket.socket, until: float | None) -> None:
    """Have the next call wait until then, and no longer."""
    if until is None:
        return
    left = until - time.monotonic()
    if left <= 0.0:  # of which a socket would make not to wait at all
        raise TimeoutError
    connection.settimeout(left)


def _missing(data: bytearray) -> int:
    """How many bytes of a message are still to come.

    Raises:
        Garbled: It would be too long, or something follows it.
    """
    if len(data) < _PREFIX:
        return _PREFIX - len(data)
    length = int.from_bytes(data[:_PREFIX])
    if length > _MOST or len(data) > _PREFIX + length:
        raise Garbled(f"{len(data)} bytes of a message of {length}")
    return _PREFIX + length - len(data)

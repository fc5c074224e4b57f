"""Messages between a worker and its parent: pickles, each with its length in front.

The next message is sent only after the answer to the last one, so nothing follows a message.
"""

import pickle
import socket
import time
from typing import Any

_PREFIX = 4  # size of the length, big-endian [bytes]
_MAX_LENGTH = 2**30  # largest size of a pickle [bytes]
_CHUNK = 65_536  # bytes read at a time


class InvalidMessage(Exception):
    """What was received is not a message, or does not answer the request."""


def encode(message: object) -> bytes:
    """Return a message as it is sent.

    Raises:
        ValueError: It is too long.
    """
    body = pickle.dumps(message, pickle.HIGHEST_PROTOCOL)
    if len(body) > _MAX_LENGTH:
        raise ValueError(f"{len(body)} bytes")
    return len(body).to_bytes(_PREFIX) + body


def send(connection: socket.socket, data: bytes, until: float | None = None) -> None:
    """Send an encoded message, or the rest of one.

    Args:
        connection: Socket. Its timeout changes if `until` is given.
        data: Bytes to send.
        until: Deadline on the monotonic clock [s]. Default: the socket's own timeout.

    Raises:
        TimeoutError: The deadline passed.
        OSError: The other end is closed.
    """
    _set_timeout(connection, until)
    connection.sendall(data)


def receive(connection: socket.socket, until: float | None = None) -> Any:
    """Wait for the next message and return it.

    Args:
        connection: Socket. Its timeout changes if `until` is given.
        until: Deadline on the monotonic clock [s]. Default: the socket's own timeout.

    Raises:
        TimeoutError: The deadline passed.
        EOFError: The other end is closed.
        InvalidMessage: The bytes are not a message.
    """
    data = bytearray()
    while _missing(data):
        _set_timeout(connection, until)
        chunk = connection.recv(_CHUNK)
        if not chunk:
            raise EOFError
        data += chunk
    try:
        return pickle.loads(bytes(data[_PREFIX:]))
    except Exception as error:  # any exception, because the other process sent the bytes
        raise InvalidMessage(repr(error)) from error


def _set_timeout(connection: socket.socket, until: float | None) -> None:
    if until is None:
        return
    left = until - time.monotonic()
    if left <= 0.0:  # a socket takes 0 for non-blocking
        raise TimeoutError
    connection.settimeout(left)


def _missing(data: bytearray) -> int:
    """Return how many bytes of the next part of a message are missing.

    Raises:
        InvalidMessage: The message is too long, or something follows it.
    """
    if len(data) < _PREFIX:
        return _PREFIX - len(data)
    length = int.from_bytes(data[:_PREFIX])
    if length > _MAX_LENGTH or len(data) > _PREFIX + length:
        raise InvalidMessage(f"{len(data)} bytes of a message of {length}")
    return _PREFIX + length - len(data)

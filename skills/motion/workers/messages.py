"""Messages between a worker process and its parent process. A message is a length and a pickle."""

import pickle
import socket
import time
from typing import Any

# A worker's message after it has read the meshes of a request's world, and before it answers.
MESHES_READ = "meshes read"

_PREFIX = 4  # size of the length field, which is big-endian [bytes]
_MAX_LENGTH = 2**30  # largest size of a pickle [bytes]
_CHUNK = 65_536  # largest number of bytes in one read


class InvalidMessage(Exception):
    """The received bytes are not a message, or the message is not a valid answer to the request."""


def encode(message: object) -> bytes:
    """Return the bytes of a message.

    Raises:
        ValueError: The message is too long.
    """
    body = pickle.dumps(message, pickle.HIGHEST_PROTOCOL)
    if len(body) > _MAX_LENGTH:
        raise ValueError(f"{len(body)} bytes")
    return len(body).to_bytes(_PREFIX) + body


def send(connection: socket.socket, data: bytes, until: float | None = None) -> None:
    """Send an encoded message, or the rest of an encoded message.

    Args:
        connection: Socket. If `until` is given, its timeout changes.
        data: Bytes to send.
        until: Deadline on the monotonic clock [s]. Default: the timeout of the socket applies.

    Raises:
        TimeoutError: The deadline passed.
        OSError: The other process has closed its socket.
    """
    _set_timeout(connection, until)
    connection.sendall(data)


def receive(connection: socket.socket, until: float | None = None) -> Any:
    """Wait for the next message and return it.

    Args:
        connection: Socket. If `until` is given, its timeout changes.
        until: Deadline on the monotonic clock [s]. Default: the timeout of the socket applies.

    Raises:
        TimeoutError: The deadline passed.
        EOFError: The other process has closed its socket.
        InvalidMessage: The bytes are not a message.
    """
    data = bytearray()
    while missing := _missing(data):
        _set_timeout(connection, until)
        chunk = connection.recv(min(missing, _CHUNK))
        if not chunk:
            raise EOFError
        data += chunk
    try:
        return pickle.loads(bytes(data[_PREFIX:]))
    except Exception as error:  # bytes of another process may cause any exception
        raise InvalidMessage(repr(error)) from error


def _set_timeout(connection: socket.socket, until: float | None) -> None:
    if until is None:
        return
    left = until - time.monotonic()
    if left <= 0.0:  # for a socket, a timeout of 0 means non-blocking
        raise TimeoutError
    connection.settimeout(left)


def _missing(data: bytearray) -> int:
    """Return how many bytes of the length field, or else of the pickle, were not received yet.

    Raises:
        InvalidMessage: The message is too long.
    """
    if len(data) < _PREFIX:
        return _PREFIX - len(data)
    length = int.from_bytes(data[:_PREFIX])
    if length > _MAX_LENGTH:
        raise InvalidMessage(f"a message of {length} bytes")
    return _PREFIX + length - len(data)

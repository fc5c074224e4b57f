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


def packed(message: object) -> bytes:
    """A message as it is sent.

    Raises:
        ValueError: It is longer than a message may be.
    """
    body = pickle.dumps(message, pickle.HIGHEST_PROTOCOL)
    if len(body) > _MOST:
        raise ValueError(f"{len(body)} bytes")
    return len(body).to_bytes(_PREFIX) + body


def receive(connection: socket.socket, timeout: float | None = None) -> Any:
    """The next message, waited for.

    Args:
        connection: Where it comes from. Its own time-out is changed.
        timeout: For all of it [s]; None to wait for ever.

    Raises:
        TimeoutError: Not all of it came in time.
        EOFError: The other end closed.
        pickle.UnpicklingError: What came is no message; and all else that unpickling it raises.
    """
    until = None if timeout is None else time.monotonic() + timeout
    data = bytearray()
    while (missing := _missing(data)) > 0:
        data += _some(connection, until)
    if missing:
        raise pickle.UnpicklingError(f"{-missing} bytes too many")
    return pickle.loads(memoryview(data)[_PREFIX:])


def _some(connection: socket.socket, until: float | None) -> bytes:
    """What has come, at least one byte."""
    left = None if until is None else until - time.monotonic()
    if left is not None and left <= 0.0:  # 0 would mean not to wait at all
        raise TimeoutError
    connection.settimeout(left)
    if data := connection.recv(_CHUNK):
        return data
    raise EOFError


def _missing(data: bytearray) -> int:
    """How many bytes of a message have not come; less than none where there are too many."""
    if len(data) < _PREFIX:
        return _PREFIX - len(data)
    length = int.from_bytes(data[:_PREFIX])
    if length > _MOST:
        raise pickle.UnpicklingError(f"a message of {length} bytes")
    return _PREFIX + length - len(data)

"""Connections that have one deadline for a whole answer. httpcore limits only each read."""

from collections.abc import Callable
from typing import Any

import httpcore

_SHORTEST = 0.001  # a socket with a timeout of 0 would not wait at all [s]


class AnswerTooSlow(httpcore.ReadTimeout):
    """An answer began, and did not end before its deadline."""


class _Deadline:
    """The deadline of the answer to the last request. Its time begins when the request is sent."""

    def __init__(self, now: Callable[[], float]) -> None:
        self._now = now
        self.restart()

    def restart(self) -> None:
        """Forget the last answer, because another request is sent."""
        self._end: float | None = None
        self._silence: float | None = None
        self._began = False

    def lift(self, silence: float) -> None:
        """Limit only the time between two pieces [s], because the answer has no end."""
        self._silence = silence

    def left(self, timeout: float | None) -> float | None:
        """Return the longest time of a read [s].

        Args:
            timeout: Longest time for the answer [s].

        Raises:
            AnswerTooSlow: The deadline is over.
        """
        if timeout is None or self._silence is not None:
            return self._silence
        if self._end is None:
            self._end = self._now() + timeout
        left = self._end - self._now()
        if self._began and left <= 0:
            raise AnswerTooSlow
        return max(_SHORTEST, left)

    def received(self, data: bytes) -> bytes:
        """Return received data, and note that the answer has begun."""
        self._began = True
        return data

    def late(self, error: httpcore.ReadTimeout) -> httpcore.ReadTimeout:
        """Return the error of a read that timed out."""
        return AnswerTooSlow() if self._began and self._silence is None else error


class Stream(httpcore.NetworkStream):
    """A connection of `Client`."""

    def __init__(self, stream: httpcore.NetworkStream, now: Callable[[], float]) -> None:
        self._stream, self._now = stream, now
        self.deadline = _Deadline(now)

    def read(self, max_bytes: int, timeout: float | None = None) -> bytes:
        """Read data before the deadline of the answer."""
        left = self.deadline.left(timeout)
        try:
            return self.deadline.received(self._stream.read(max_bytes, left))
        except httpcore.ReadTimeout as error:
            raise self.deadline.late(error) from error

    def write(self, buffer: bytes, timeout: float | None = None) -> None:
        """Send data. The deadline of its answer begins afterwards."""
        self.deadline.restart()
        self._stream.write(buffer, timeout)

    def close(self) -> None:
        """Close the connection."""
        self._stream.close()

    def start_tls(self, *given: Any, **more: Any) -> httpcore.NetworkStream:
        """Return the encrypted connection."""
        return Stream(self._stream.start_tls(*given, **more), self._now)

    def get_extra_info(self, info: str) -> Any:
        """Return a property of the connection."""
        return self._stream.get_extra_info(info)


class Backend(httpcore.SyncBackend):
    """Opens the connections of `Client`."""

    def __init__(self, now: Callable[[], float]) -> None:
        self._now = now

    def connect_tcp(self, *given: Any, **more: Any) -> httpcore.NetworkStream:
        """Return a connection."""
        return Stream(super().connect_tcp(*given, **more), self._now)


class AsyncStream(httpcore.AsyncNetworkStream):
    """A connection of `AsyncClient`."""

    def __init__(self, stream: httpcore.AsyncNetworkStream, now: Callable[[], float]) -> None:
        self._stream, self._now = stream, now
        self.deadline = _Deadline(now)

    async def read(self, max_bytes: int, timeout: float | None = None) -> bytes:
        """Read data before the deadline of the answer."""
        left = self.deadline.left(timeout)
        try:
            return self.deadline.received(await self._stream.read(max_bytes, left))
        except httpcore.ReadTimeout as error:
            raise self.deadline.late(error) from error

    async def write(self, buffer: bytes, timeout: float | None = None) -> None:
        """Send data. The deadline of its answer begins afterwards."""
        self.deadline.restart()
        await self._stream.write(buffer, timeout)

    async def aclose(self) -> None:
        """Close the connection."""
        await self._stream.aclose()

    async def start_tls(self, *given: Any, **more: Any) -> httpcore.AsyncNetworkStream:
        """Return the encrypted connection."""
        return AsyncStream(await self._stream.start_tls(*given, **more), self._now)

    def get_extra_info(self, info: str) -> Any:
        """Return a property of the connection."""
        return self._stream.get_extra_info(info)


class AsyncBackend(httpcore.AnyIOBackend):
    """Opens the connections of `AsyncClient`."""

    def __init__(self, now: Callable[[], float]) -> None:
        self._now = now

    async def connect_tcp(self, *given: Any, **more: Any) -> httpcore.AsyncNetworkStream:
        """Return a connection."""
        return AsyncStream(await super().connect_tcp(*given, **more), self._now)

"""Connections that cannot hold the server up: uvicorn's protocols, with patience that ends.

uvicorn waits for ever for the head of a request, and for a client that reads nothing.
"""

import asyncio
import json

import h11
from uvicorn.protocols.http.h11_impl import STATUS_PHRASES, H11Protocol
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol

from .errors import BadRequest, as_json

MOST_CONNECTIONS = 128  # more than may stay: those who wait, who watch, and rosbridge clients
HEAD_SECONDS = 5.0  # a request's head must be whole by then, from its connection's last answer
STALL_SECONDS = 5.0  # a client that reads nothing for so long is cut off


class _Writing(asyncio.Protocol):
    """Cuts off a client that does not take what is written to it."""

    transport: asyncio.Transport
    _stalled: asyncio.TimerHandle | None = None

    def pause_writing(self) -> None:
        """The transport's buffer is full."""
        super().pause_writing()
        loop = asyncio.get_running_loop()
        self._stalled = loop.call_later(STALL_SECONDS, self.transport.abort)

    def resume_writing(self) -> None:
        """The transport's buffer has room."""
        super().resume_writing()
        self._end_patience()

    def connection_lost(self, exc: Exception | None) -> None:
        """It is over."""
        super().connection_lost(exc)
        self._end_patience()

    def _end_patience(self) -> None:
        if self._stalled:
            self._stalled.cancel()
            self._stalled = None


class WebSocketConnection(_Writing, WebSocketsSansIOProtocol):
    """A WebSocket."""


class HttpConnection(_Writing, H11Protocol):
    """An HTTP connection. Where there are too many, one that asks for nothing makes room."""

    _waiting: asyncio.TimerHandle | None = None
    since = 0.0  # when it was accepted, or last answered [s]

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Somebody has connected."""
        super().connection_made(transport)
        self.since = self.loop.time()
        self._watch()
        if len(self.connections) > MOST_CONNECTIONS:
            self._make_room()

    def connection_lost(self, exc: Exception | None) -> None:
        """It is over."""
        super().connection_lost(exc)
        self._asked()

    def data_received(self, data: bytes) -> None:
        """Something has come."""
        super().data_received(data)
        if self.transport.get_protocol() is self:  # else a WebSocket has taken over
            self._watch()

    def on_response_complete(self) -> None:
        """A request is answered."""
        super().on_response_complete()
        self.since = self.loop.time()
        self._watch()

    def handle_websocket_upgrade(self, event: h11.Request) -> None:
        """Another protocol takes over."""
        self._asked()
        super().handle_websocket_upgrade(event)

    def send_400_response(self, msg: str) -> None:
        """Answer what is no HTTP, as the application would."""
        body = json.dumps(as_json(BadRequest(msg))).encode()
        headers = [
            (b"content-type", b"application/json"),
            (b"content-length", str(len(body)).encode()),
            (b"connection", b"close"),
        ]
        if self.conn.our_state in (h11.IDLE, h11.SEND_RESPONSE):
            head = h11.Response(status_code=400, headers=headers, reason=STATUS_PHRASES[400])
            for event in (head, h11.Data(data=body), h11.EndOfMessage()):
                self.transport.write(self.conn.send(event) or b"")
        self.transport.close()

    @property
    def asks(self) -> bool:
        """Whether a request is under way whose body has come in whole."""
        cycle = self.cycle
        return cycle is not None and not cycle.response_complete and not cycle.more_body

    @property
    def leaving(self) -> bool:
        """Whether it is closed already."""
        return self.transport.is_closing()

    def _watch(self) -> None:
        """Be patient only while a request is under way; its body is the application's matter."""
        under_way = self.cycle is not None and not self.cycle.response_complete
        if under_way:
            self._asked()
        elif self._waiting is None:
            self._waiting = self.loop.call_later(HEAD_SECONDS, self.transport.abort)

    def _asked(self) -> None:
        if self._waiting:
            self._waiting.cancel()
            self._waiting = None

    def _make_room(self) -> None:
        idle = [
            each
            for each in self.connections
            if isinstance(each, HttpConnection) and not each.asks and not each.leaving
        ]
        min(idle, key=lambda each: each.since, default=self).transport.abort()

"""Connections that cannot hold the server up: uvicorn's protocols, with patience that ends.

uvicorn waits for ever for the head of a request, and for a client that reads nothing; and it takes
in whatever comes, at once.
"""

import asyncio
import json
import re
from typing import Any

import h11
from uvicorn.protocols.http.h11_impl import STATUS_PHRASES, H11Protocol
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol
from uvicorn.server import ServerState
from websockets.frames import CloseCode
from websockets.utils import apply_mask

from executive.errors import BadRequest
from executive.server.http.errors import as_json
from executive.server.security import HAS_TOKEN

from .fair_queue import CHUNK, FairQueue

MAX_CONNECTIONS = 128  # more than may stay: those who wait, who watch, and rosbridge clients
HEAD_SECONDS = 5.0  # a request's head must be whole by then, from its connection's last answer
STALL_SECONDS = 5.0  # a client that reads nothing for so long is cut off

_STOP = re.compile(rb"POST (?:http://[^/ ]*)?/api/stop[/? ]")
_CANCEL = re.compile(rb"POST (?:http://[^/ ]*)?/api/(cancel|goals/[0-9a-f]{32}/cancel)[? ]")
_BRIDGED_CANCEL = re.compile(rb"cancel_action_goal|_action/cancel_goal")
_TEXT = 0x81  # what the frame of a whole message of text begins with


class SharedState(ServerState):
    """What uvicorn's connections share, and ours.

    Args:
        queue: Queue of received data.
    """

    def __init__(self, queue: FairQueue) -> None:
        super().__init__()
        self.fair_queue = queue


class _QueuedProtocol(asyncio.Protocol):
    """Waits its turn with what comes, and cuts off a client that takes nothing."""

    transport: asyncio.Transport
    _stalled: asyncio.TimerHandle | None = None

    def __init__(self, *, server_state: SharedState, **more: Any) -> None:
        super().__init__(server_state=server_state, **more)  # type: ignore[call-arg]
        self.fair_queue = server_state.fair_queue

    def data_received(self, data: bytes) -> None:
        """Something has come; a stop is taken in at once, unless it is behind something else."""
        stop = 0 if self.fair_queue.has(self) else self.stop_in(data)
        if stop:
            self.process(data[:stop])
        if more := data[stop:]:
            self.transport.pause_reading()
            self.fair_queue.put(self, more, self.is_first(more))

    def process(self, data: bytes) -> None:
        """Its turn has come."""
        super().data_received(data)
        if not self.full:
            self.transport.resume_reading()

    def is_first(self, data: bytes) -> bool:
        """Whether it need not stand in line with everybody."""
        return False

    def stop_in(self, data: bytes) -> int:
        """How long the stop is that this begins with [bytes]; 0 where it begins with none."""
        raise NotImplementedError

    @property
    def full(self) -> bool:
        """Whether uvicorn wants to read no more for now."""
        raise NotImplementedError

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
        self.fair_queue.remove(self)
        super().connection_lost(exc)
        self._end_patience()

    def _end_patience(self) -> None:
        if self._stalled:
            self._stalled.cancel()
            self._stalled = None


class WebSocketConnection(_QueuedProtocol, WebSocketsSansIOProtocol):
    """A WebSocket."""

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Somebody has connected."""
        super().connection_made(transport)
        # As much as asyncio reads at a time, so that not too many messages come in one turn.
        self.transport.max_size = CHUNK  # type: ignore[attr-defined]

    def stop_in(self, data: bytes) -> int:
        """The first message, where it cancels goals.

        What only looks like one, in the midst of a longer message, gets no further than that piece.
        """
        length, message = _first_message(data)
        return length if _BRIDGED_CANCEL.search(message) else 0

    def send_receive_event_to_app(self) -> None:
        """A message is whole. Text that is not UTF-8 ends the connection; uvicorn logs each."""
        if self.curr_msg_data_type == "text" and not _is_utf8(b"".join(self.frames)):
            self.frames = []
            self.conn.fail(CloseCode.INVALID_DATA)
            self.handle_parser_exception()
        else:
            super().send_receive_event_to_app()

    @property
    def full(self) -> bool:
        """Whether a message waits to be read."""
        return self.read_paused


class HttpConnection(_QueuedProtocol, H11Protocol):
    """An HTTP connection.

    Where there are too many, one that asks for nothing makes room: of those who do not show the
    token, if there is any.
    """

    _waiting: asyncio.TimerHandle | None = None
    since = 0.0  # when it was accepted, or last answered [s]

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Somebody has connected."""
        super().connection_made(transport)
        self.since = self.loop.time()
        self._watch()
        if len(self.connections) > MAX_CONNECTIONS:
            self._make_room()

    def connection_lost(self, exc: Exception | None) -> None:
        """It is over."""
        super().connection_lost(exc)
        self._asked()

    def process(self, data: bytes) -> None:
        """Its turn has come."""
        super().process(data)
        if self.transport.get_protocol() is self:  # else a WebSocket has taken over
            self._watch()

    def stop_in(self, data: bytes) -> int:
        """All of it, where it asks for a stop."""
        return len(data) if _STOP.match(data) and not self._under_way else 0

    def is_first(self, data: bytes) -> bool:
        """Whether it is a cancel, or of somebody who has shown the token."""
        return self.has_token or bool(_CANCEL.match(data))

    @property
    def full(self) -> bool:
        """Whether enough of a body waits to be read."""
        return self.flow.read_paused and self.transport.get_protocol() is self

    def on_response_complete(self) -> None:
        """A request is answered; what was sent before that is no request."""
        if self.conn.trailing_data[0]:  # they would all be answered in one turn
            self.transport.close()
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
        return self._under_way and not self.cycle.more_body

    @property
    def has_token(self) -> bool:
        """Whether its last request did."""
        return self.cycle is not None and HAS_TOKEN in self.cycle.scope["state"]

    @property
    def leaving(self) -> bool:
        """Whether it is closed already."""
        return self.transport.is_closing()

    @property
    def _under_way(self) -> bool:
        return self.cycle is not None and not self.cycle.response_complete

    def _watch(self) -> None:
        """Be patient only while a request is under way; its body is the application's matter."""
        if self._under_way:
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
            if isinstance(each, HttpConnection) and not (each is self or each.asks or each.leaving)
        ]
        min(idle, key=lambda each: (each.has_token, each.since), default=self).transport.abort()


def _is_utf8(text: bytes) -> bool:
    try:
        text.decode()
    except UnicodeDecodeError:
        return False
    return True


def _first_message(data: bytes) -> tuple[int, bytes]:
    """The frame of a short message that this begins with: its length [bytes], and the message."""
    if len(data) < 2 or data[0] != _TEXT:
        return 0, b""
    length, head = data[1] & 0x7F, 2
    if length == 126:
        length, head = int.from_bytes(data[2:4]), 4
    end = head + 4 + length
    if length == 127 or len(data) < end:
        return 0, b""
    return end, apply_mask(data[head + 4 : end], data[head : head + 4])

"""uvicorn's connections with limits, so that no client can block the server.

Without this module, uvicorn waits without limit for the head of a request and for a client that
does not read, and processes all data at its arrival.
"""

import asyncio
import json
import os
import re
import socket
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from typing import Any

import h11
from uvicorn.protocols.http.h11_impl import STATUS_PHRASES, H11Protocol
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol
from uvicorn.server import ServerState
from websockets.frames import CloseCode
from websockets.utils import apply_mask

from executive.api.operations import OPERATIONS, Operation
from executive.api.outcome import CancelResult, cause_of
from executive.errors import BadRequest
from executive.server.security import AccessRules, is_authenticated

from .fair_queue import CHUNK, FairQueue
from .quick_stop import QuickStop

MAX_HEAD = 8 * 1024  # largest head of a request [bytes]
MAX_HEAD_LINES = 100  # largest number of lines in a head; parsing a line takes 5 us
READ_AT_ONCE = 4 * 1024  # largest queued data of a connection [bytes]; asyncio would read 256 KiB
DISCARDED = 256 * 1024  # largest number of bytes that are dropped before a connection is closed
HEAD_SECONDS = 5.0  # longest time for a head, from the acceptance or the last answer on [s]
STALL_SECONDS = 5.0  # time without reading after which a client is disconnected [s]


def _request_line(operation: Operation) -> str:
    path = operation.path
    for name, schema in operation.parameters.items():
        path = path.replace(f"{{{name}}}", schema["pattern"].strip("^$"))
    return f"{operation.method} {path}[/? ]"


_STOP = re.compile("|".join(_request_line(o) for o in OPERATIONS.values() if o.stops).encode())
_HEAD_END = re.compile(rb"\n\r?\n")
_PEEK = int(socket.MSG_PEEK | socket.MSG_DONTWAIT)
_TCP_ESTABLISHED = 1  # first byte of TCP_INFO while the client has not closed its side
_ROSBRIDGE_CANCEL = re.compile(rb"cancel_action_goal|_action/cancel_goal")
_TEXT_FRAME = 0x81  # first byte of a WebSocket frame with a whole text message


class SharedState(ServerState):
    """The shared state of all connections.

    Args:
        queue: Queue of received data.
        rules: Rules of access.
        max_connections: Largest number of connections. If there are more, one is closed. As many
            more may wait for service.
        max_new: Largest number of new connections, which do not wait for service yet.
        stop: Callback that stops the arm.
    """

    def __init__(
        self,
        queue: FairQueue,
        rules: AccessRules,
        max_connections: int,
        max_new: int,
        stop: Callable[[], asyncio.Future[CancelResult]],
    ) -> None:
        super().__init__()
        self.fair_queue, self.rules, self.stop = queue, rules, stop
        self.max_connections, self.max_new = max_connections, max_new


class _QueuedProtocol(asyncio.Protocol):
    """Queues received data, and disconnects a client that does not read."""

    transport: asyncio.Transport
    idle_since: float  # time of its acceptance, last answer or last message [s]
    stopping = False  # True if a stop has arrived but is not answered
    _stall_timer: asyncio.TimerHandle | None = None

    def __init__(self, *, server_state: SharedState, **more: Any) -> None:
        super().__init__(server_state=server_state, **more)  # type: ignore[call-arg]
        self.fair_queue = server_state.fair_queue

    def data_received(self, data: bytes) -> None:
        """Process a stop at once, unless other data is queued before it. Queue all other data."""
        taken = 0 if self.fair_queue.has(self) else self.take_stop(data)
        if more := data[taken:]:
            self.transport.pause_reading()
            self.fair_queue.put(self, more, self.has_priority(more))

    def process(self, data: bytes) -> None:
        """Process queued data."""
        super().data_received(data)
        if not (self.is_full or self.fair_queue.has(self)):
            self.transport.resume_reading()

    def has_priority(self, data: bytes) -> bool:
        """Return True if data is queued in the line with fewer connections."""
        return False

    def take_stop(self, data: bytes) -> int:
        """Execute a stop at the start of data. Return the number of processed bytes."""
        raise NotImplementedError

    @property
    def is_full(self) -> bool:
        """True while uvicorn does not accept more data."""
        raise NotImplementedError

    @property
    def awaits_answer(self) -> bool:
        """True if a complete request has arrived but is not answered."""
        return True

    @property
    def is_abandoned(self) -> bool:
        """True if the client has closed its side, and awaits no answer."""
        connection = self.transport.get_extra_info("socket")
        return not (self.awaits_answer or _is_open(connection))

    @property
    def has_token(self) -> bool:
        """True if the last request of the client contained the token."""
        return False

    def pause_writing(self) -> None:
        """Start the timer when the transport's buffer is full."""
        super().pause_writing()
        loop = asyncio.get_running_loop()
        self._stall_timer = loop.call_later(STALL_SECONDS, self.transport.abort)

    def resume_writing(self) -> None:
        """End the timer when the transport's buffer has room."""
        super().resume_writing()
        self._end_stall_timer()

    def connection_lost(self, exc: Exception | None) -> None:
        """Drop queued data when the connection ends."""
        self.fair_queue.remove(self)
        super().connection_lost(exc)
        self._end_stall_timer()

    def _end_stall_timer(self) -> None:
        if self._stall_timer:
            self._stall_timer.cancel()
            self._stall_timer = None


class WebSocketConnection(_QueuedProtocol, WebSocketsSansIOProtocol):
    """A WebSocket."""

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Limit the size of one read when a client connects."""
        super().connection_made(transport)
        # Largest read of asyncio, so that few messages are processed together.
        self.transport.max_size = CHUNK  # type: ignore[attr-defined]
        self.idle_since = self.loop.time()

    def process(self, data: bytes) -> None:
        """Process queued data."""
        self.idle_since = self.loop.time()
        super().process(data)

    def take_stop(self, data: bytes) -> int:
        """Process the first message if it cancels goals.

        Data inside a longer message may look like a cancel. Then only this data is processed early.
        """
        length, message = _first_message(data)
        if not _ROSBRIDGE_CANCEL.search(message):
            return 0
        self.process(data[:length])
        return length

    def send_receive_event_to_app(self) -> None:
        """Pass on a whole message. Close the connection if its text is not UTF-8.

        uvicorn would log an error for each such text.
        """
        if self.curr_msg_data_type == "text" and not _is_utf8(b"".join(self.frames)):
            self.frames = []
            self.conn.fail(CloseCode.INVALID_DATA)
            self.handle_parser_exception()
        else:
            super().send_receive_event_to_app()

    def shutdown(self) -> None:
        """Close the connection when the server ends.

        If the handshake is unanswered, uvicorn would answer it, and fail at the application's
        answer.
        """
        if self.handshake_complete:
            super().shutdown()
        else:
            self.transport.close()

    @property
    def is_full(self) -> bool:
        """True if a message waits for the application."""
        return self.read_paused


class HttpConnection(_QueuedProtocol, H11Protocol):
    """An HTTP connection.

    If there are too many connections, those ended by their clients are closed. If there are none,
    one connection is closed: one without the token if possible, then an idle one, then the one that
    is idle longest. If a stop waits on each of the others, the new connection is closed.

    Args:
        accepted: Time of its acceptance [s].
        more: Arguments of uvicorn's protocol.
    """

    server_state: SharedState
    _head_timer: asyncio.TimerHandle | None = None

    def __init__(self, accepted: float, **more: Any) -> None:
        super().__init__(**more)
        self.idle_since = accepted

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Start waiting for a request. Close another connection if there are too many."""
        super().connection_made(transport)
        self.transport.max_size = READ_AT_ONCE  # type: ignore[attr-defined]
        self._update_head_timer()
        if len(self.connections) > self.server_state.max_connections:
            self._close_another()

    def connection_lost(self, exc: Exception | None) -> None:
        """End the timer when the connection ends."""
        super().connection_lost(exc)
        self._end_head_timer()

    def process(self, data: bytes) -> None:
        """Process queued data. Refuse a head that is too large before parsing it."""
        if self.conn.their_state is h11.IDLE and _too_large(self.conn.trailing_data[0] + data):
            limits = f"{MAX_HEAD_LINES} lines and {MAX_HEAD >> 10} KiB"
            self.send_400_response(f"the head of a request may have at most {limits}")
            return
        super().process(data)
        if self.transport.get_protocol() is self:  # it has not become a WebSocket
            self._update_head_timer()

    def take_stop(self, data: bytes) -> int:
        """Execute a stop that has arrived as a whole, if its client may stop the arm. Answer it.

        Later data is dropped, because it was sent before the answer.
        """
        if self.conn.their_state is not h11.IDLE or self.conn.trailing_data[0]:
            return 0
        stop = QuickStop.find(data, self.server_state.rules)
        self.stopping = stop is not None
        if not stop:
            return 0
        self._end_head_timer()
        self._unset_keepalive_if_required()
        self.transport.pause_reading()
        self.server_state.stop().add_done_callback(partial(self._answer_stop, stop))
        return len(data)

    def _answer_stop(self, stop: QuickStop, stopped: asyncio.Future[CancelResult]) -> None:
        self.stopping = False
        stop.log()
        if self.transport.is_closing():
            return
        self.transport.write(stop.answer(stopped))
        if not stop.keeps:
            self.transport.close()
            return
        self.idle_since = self.loop.time()
        self._update_head_timer()
        self.transport.resume_reading()

    def has_priority(self, data: bytes) -> bool:
        """True for a stop or a cancel, and for a client that has sent the token."""
        return self.has_token or bool(_STOP.match(data))

    @property
    def is_full(self) -> bool:
        """True if enough of a body waits for the application."""
        return self.flow.read_paused and self.transport.get_protocol() is self

    def on_response_complete(self) -> None:
        """Close the connection if the client sent more before the answer was complete."""
        if self.conn.trailing_data[0]:  # uvicorn would answer all of it at once
            self.transport.close()
        super().on_response_complete()
        if self.transport.is_closing():
            self._discard()
        self.idle_since = self.loop.time()
        self._update_head_timer()

    def handle_websocket_upgrade(self, event: h11.Request) -> None:
        """End the timer when a WebSocket takes over.

        Data before the answer is refused, because RFC 6455 section 4.1 forbids it.
        """
        if self.conn.trailing_data[0] or self.fair_queue.has(self):
            words = "a WebSocket client must send nothing before the answer to its handshake"
            self.send_400_response(words)
            return
        self._end_head_timer()
        super().handle_websocket_upgrade(event)

    def send_400_response(self, msg: str) -> None:
        """Answer invalid HTTP with the same JSON as other errors."""
        body = json.dumps(cause_of(BadRequest(msg)).to_json()).encode()
        headers = [
            (b"content-type", b"application/json"),
            (b"content-length", str(len(body)).encode()),
            (b"connection", b"close"),
        ]
        if self.conn.our_state in (h11.IDLE, h11.SEND_RESPONSE):
            head = h11.Response(status_code=400, headers=headers, reason=STATUS_PHRASES[400])
            for event in (head, h11.Data(data=body), h11.EndOfMessage()):
                self.transport.write(self.conn.send(event) or b"")
        self.fair_queue.remove(self)
        self._discard()
        self.transport.close()

    def _discard(self) -> None:
        """Drop unread data, because closing with unread data resets the connection.

        The client would then lose the answer.
        """
        handle = self.transport.get_extra_info("socket").fileno()
        with suppress(OSError):  # no more data has arrived
            for _ in range(DISCARDED // MAX_HEAD):
                if not os.read(handle, MAX_HEAD):
                    return

    @property
    def awaits_answer(self) -> bool:
        """True if a complete request has arrived but is not answered."""
        return self.stopping or (self._is_answering and not self.cycle.more_body)

    @property
    def has_token(self) -> bool:
        """True if its last request contained the token."""
        return self.cycle is not None and is_authenticated(self.cycle.scope)

    @property
    def _is_answering(self) -> bool:
        return self.cycle is not None and not self.cycle.response_complete

    def _update_head_timer(self) -> None:
        """Run the timer while no request is being answered. The application times the body."""
        if self._is_answering:
            self._end_head_timer()
        elif self._head_timer is None:
            end = self.idle_since + HEAD_SECONDS
            self._head_timer = self.loop.call_at(end, self._head_timed_out)

    def _head_timed_out(self) -> None:
        """Close the connection, unless the server has not processed all received data."""
        if self.fair_queue.has(self):
            self._head_timer = self.loop.call_later(HEAD_SECONDS, self._head_timed_out)
        else:
            self._head_timer = None
            self.transport.abort()

    def _end_head_timer(self) -> None:
        if self._head_timer:
            self._head_timer.cancel()
            self._head_timer = None

    def _close_another(self) -> None:
        others = [
            each
            for each in self.connections
            if isinstance(each, HttpConnection | WebSocketConnection)
            and each is not self
            and not each.transport.is_closing()
        ]
        if others:
            oldest = min(
                others, key=lambda e: (e.stopping, e.has_token, e.awaits_answer, e.idle_since)
            )
            last = self if oldest.stopping else oldest
            for each in [each for each in others if each.is_abandoned] or [last]:
                each.transport.abort()


def peek(connection: socket.socket) -> bytes | None:
    """Return the next data of a connection without removing it.

    Returns:
        None if the client has closed its side and the head of a request is not complete.
    """
    try:
        data = connection.recv(MAX_HEAD, _PEEK)
    except BlockingIOError:
        return b""
    except OSError:
        return None
    if _HEAD_END.search(data):
        return data
    return data if data and _is_open(connection) else None


def _is_open(connection: socket.socket) -> bool:
    """Return True unless the client has closed its side."""
    state = connection.getsockopt(socket.IPPROTO_TCP, socket.TCP_INFO, 1)[0]
    return state == _TCP_ESTABLISHED


def _too_large(data: bytes) -> bool:
    """Return True if the head at the start of data has too many lines or bytes."""
    found = _HEAD_END.search(data)
    end, size = (found.start(), found.end()) if found else (len(data), len(data))
    return size > MAX_HEAD or data.count(b"\n", 0, end) > MAX_HEAD_LINES


def _is_utf8(text: bytes) -> bool:
    try:
        text.decode()
    except UnicodeDecodeError:
        return False
    return True


def _first_message(data: bytes) -> tuple[int, bytes]:
    """Return the length [bytes] and the message of the short text frame at the start of data."""
    if len(data) < 2 or data[0] != _TEXT_FRAME:
        return 0, b""
    length, head = data[1] & 0x7F, 2
    if length == 126:
        length, head = int.from_bytes(data[2:4]), 4
    end = head + 4 + length
    if length == 127 or len(data) < end:
        return 0, b""
    return end, apply_mask(data[head + 4 : end], data[head : head + 4])

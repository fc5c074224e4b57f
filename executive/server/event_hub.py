"""The event hub: passes events from the executive's threads to the event loop and subscribers."""

import asyncio
import json
import logging
from collections import deque
from collections.abc import Callable

import logs
from executive.api.events import Event, QuestionStatus, event_to_json, kind_of
from executive.api.outcome import GoalStatus

HEARTBEAT = 15.0  # time without an event after which a subscriber receives a comment [s]
MAX_BACKLOG = 4 * 1024 * 1024  # largest number of unread bytes of a subscriber


class Subscriber:
    """The unread events of one client.

    Args:
        kinds: Kinds of its events; empty for all.
        authenticated: True if the client has the token.
    """

    def __init__(self, kinds: frozenset[str], authenticated: bool) -> None:
        self.kinds, self.authenticated = kinds, authenticated
        self._unread: deque[bytes] = deque()
        self._bytes = 0
        self._changed = asyncio.Event()
        self._ended = self.dropped = False

    def put(self, text: bytes) -> None:
        """Add an event, or drop the subscriber if it is too far behind."""
        self._bytes += len(text)
        self.dropped = self.dropped or self._bytes > MAX_BACKLOG
        if not self.dropped:
            self._unread.append(text)
        self._changed.set()

    def end(self) -> None:
        """End the stream after the unread events."""
        self._ended = True
        self._changed.set()

    async def take(self) -> bytes:
        """Wait for events and return all unread events.

        Returns:
            The events; a comment if no event came for `HEARTBEAT`; or no bytes at the end of the
            stream and for a dropped subscriber.
        """
        if not self._ended:
            try:
                async with asyncio.timeout(HEARTBEAT):
                    await self._changed.wait()
            except TimeoutError:
                return b": still here\n\n"
            self._changed.clear()
        taken, self._bytes = b"".join(self._unread), 0
        self._unread.clear()
        return b"" if self.dropped else taken


class EventHub:
    """Accepts events from any thread, and passes them on in the event loop, in order.

    A new subscriber first receives the current state: the running goal, its nodes, its progress,
    its newest plans and schedule, its questions, and the last warning.

    Args:
        loop: Event loop in which listeners are called.

    Attributes:
        subscribers: Receive events as texts.
        listeners: Callbacks for every event.
    """

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self._loop = loop
        self._arrived: deque[Event] = deque()
        self._scheduled = False
        self._current: dict[str, Event] = {}
        self.subscribers: set[Subscriber] = set()
        self.listeners: list[Callable[[Event], None]] = []

    def publish(self, event: Event) -> None:
        """Accept an event. Any thread may call."""
        self._arrived.append(event)
        if not self._scheduled:
            self._scheduled = True
            self._loop.call_soon_threadsafe(self._deliver)

    def subscribe(self, kinds: frozenset[str], authenticated: bool) -> Subscriber:
        """Add a subscriber. It first receives the current state."""
        subscriber = Subscriber(kinds, authenticated)
        for event in self._current.values():
            if not kinds or kind_of(event) in kinds:
                subscriber.put(event_text(event))
        self.subscribers.add(subscriber)
        return subscriber

    def end(self) -> None:
        """Deliver the remaining events and end all streams. Call this in the event loop."""
        self._deliver()
        for subscriber in self.subscribers:
            subscriber.end()

    def _deliver(self) -> None:
        self._scheduled = False
        while self._arrived:
            event = self._arrived.popleft()
            self._update_current(event)
            for listener in self.listeners:
                listener(event)
            self._send(event)

    def _send(self, event: Event) -> None:
        kind = kind_of(event)
        interested = [each for each in self.subscribers if not each.kinds or kind in each.kinds]
        if kind and interested:
            text = event_text(event)
            for subscriber in interested:
                subscriber.put(text)

    def _update_current(self, event: Event) -> None:
        match event:
            case logs.Goal():
                self._keep("lifecycle")
                self._current["goal"] = event
            case GoalStatus() if event.outcome and self._is_current(event.identity):
                self._keep("lifecycle", "question")
            case logs.Transition() | logs.Schedule() | logs.Feedback():
                self._current[kind_of(event)] = event
            case logs.NodeStatus():
                self._current[f"node {event.path}"] = event
            case logs.Plan():
                self._current[f"plan {event.group}"] = event
            case logs.LogLine() if event.level >= logging.WARNING:
                self._current["warning"] = event
            case QuestionStatus(open=True):
                self._current[f"question {event.question_id}"] = event
            case QuestionStatus():
                self._current.pop(f"question {event.question_id}", None)

    def _is_current(self, identity: str) -> bool:
        goal = self._current.get("goal")
        return isinstance(goal, logs.Goal) and goal.goal_id == identity

    def _keep(self, *kinds: str) -> None:
        """Drop all current events of other kinds."""
        self._current = {
            key: event for key, event in self._current.items() if key.partition(" ")[0] in kinds
        }


def event_text(event: Event) -> bytes:
    """Return an event with a name as a server-sent event."""
    fields = event_to_json(event)
    text = json.dumps(fields, allow_nan=False, separators=(",", ":"))
    return f"event: {fields['event']}\ndata: {text}\n\n".encode()

"""What happens, handed from the executive's threads to the network's one."""

import asyncio
import json
import logging
from collections import deque
from collections.abc import Callable

import logs
from executive.executive import Event
from executive.goals.events import as_event, kind_of
from executive.goals.goal import GoalStatus, QuestionStatus

HEARTBEAT = 15.0  # [s] of silence after which a subscriber hears that the server is there
MAX_BACKLOG = 4 * 1024 * 1024  # bytes of events that a subscriber may be behind


class Subscriber:
    """Somebody who watches, and keeps up or is dropped.

    Args:
        kinds: Of events that are wanted; empty for all.
        known: Whether they show the token.
    """

    def __init__(self, kinds: frozenset[str], known: bool) -> None:
        self.kinds, self.known = kinds, known
        self._waiting: deque[bytes] = deque()
        self._bytes = 0
        self._some = asyncio.Event()
        self._ended = self.dropped = False

    def put(self, text: bytes) -> None:
        """One more event; drops the subscriber where too much is waiting."""
        self._bytes += len(text)
        self.dropped = self.dropped or self._bytes > MAX_BACKLOG
        if not self.dropped:
            self._waiting.append(text)
        self._some.set()

    def end(self) -> None:
        """There is nothing more."""
        self._ended = True
        self._some.set()

    async def take(self) -> bytes:
        """All that is waiting, as soon as there is something; empty at the end, or once dropped.

        After a long silence it is a comment.
        """
        if not self._ended:
            try:
                async with asyncio.timeout(HEARTBEAT):
                    await self._some.wait()
            except TimeoutError:
                return b": still here\n\n"
            self._some.clear()
        taken, self._bytes = b"".join(self._waiting), 0
        self._waiting.clear()
        return b"" if self.dropped else taken


class EventHub:
    """Takes events from any thread and tells of them on the loop, in order.

    Whoever joins late is first told what still holds: the goal under way, its nodes, its progress,
    the last warning.

    Args:
        loop: On which everybody is told.
    """

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self._loop = loop
        self._arrived: deque[Event] = deque()
        self._called = False
        self._holds: dict[str, Event] = {}
        self.subscribers: set[Subscriber] = set()
        self.listeners: list[Callable[[Event], None]] = []

    def publish(self, event: Event) -> None:
        """Take an event, from any thread."""
        self._arrived.append(event)
        if not self._called:
            self._called = True
            self._loop.call_soon_threadsafe(self._deliver)

    def subscribe(self, kinds: frozenset[str], known: bool) -> Subscriber:
        """Begin to watch."""
        subscriber = Subscriber(kinds, known)
        for event in self._holds.values():
            if not kinds or kind_of(event) in kinds:
                subscriber.put(_as_text(event))
        self.subscribers.add(subscriber)
        return subscriber

    def end(self) -> None:
        """Tell what has arrived, and let the subscribers go; on the loop."""
        self._deliver()
        for subscriber in self.subscribers:
            subscriber.end()

    def _deliver(self) -> None:
        self._called = False
        while self._arrived:
            event = self._arrived.popleft()
            self._remember(event)
            for listener in self.listeners:
                listener(event)
            self._show(event)

    def _show(self, event: Event) -> None:
        kind = kind_of(event)
        wanting = [each for each in self.subscribers if not each.kinds or kind in each.kinds]
        if kind and wanting:
            text = _as_text(event)
            for subscriber in wanting:
                subscriber.put(text)

    def _remember(self, event: Event) -> None:
        match event:
            case logs.Goal():
                self._keep("lifecycle")
                self._holds["goal"] = event
            case GoalStatus() if event.outcome and self._shows(event.identity):
                self._keep("lifecycle", "question")
            case logs.Transition():
                self._holds["lifecycle"] = event
            case logs.NodeStatus():
                self._holds[f"node {event.path}"] = event
            case logs.Feedback():
                self._holds["feedback"] = event
            case logs.LogLine() if event.level >= logging.WARNING:
                self._holds["warning"] = event
            case QuestionStatus(open=True):
                self._holds[f"question {event.question_id}"] = event
            case QuestionStatus():
                self._holds.pop(f"question {event.question_id}", None)

    def _shows(self, identity: str) -> bool:
        goal = self._holds.get("goal")
        return isinstance(goal, logs.Goal) and goal.goal_id == identity

    def _keep(self, *kinds: str) -> None:
        """Hold only these kinds of events any longer."""
        self._holds = {
            key: event for key, event in self._holds.items() if key.partition(" ")[0] in kinds
        }


def _as_text(event: Event) -> bytes:
    fields = as_event(event)
    text = json.dumps(fields, allow_nan=False, separators=(",", ":"))
    return f"event: {fields['event']}\ndata: {text}\n\n".encode()

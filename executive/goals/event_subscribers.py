"""Passes events of the executive to its subscribers."""

import logging
import threading
from collections.abc import Callable
from functools import partial

from executive.api.events import Event

logger = logging.getLogger(__name__)

Subscriber = Callable[[Event], None]


class EventSubscribers:
    """Passes every event to all subscribers. Any thread may call."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._subscribers: tuple[Subscriber, ...] = ()

    def add(self, subscriber: Subscriber) -> Callable[[], None]:
        """Add a subscriber.

        Returns:
            Function that removes the subscriber.
        """
        with self._lock:
            self._subscribers = (*self._subscribers, subscriber)
        return partial(self._remove, subscriber)

    def publish(self, event: Event) -> None:
        """Pass an event to all subscribers. A subscriber that raises an exception is removed."""
        for subscriber in self._subscribers:
            try:
                subscriber(event)
            except Exception:  # users' code must not stop the arm's threads
                self._remove(subscriber)  # remove first, because the log line is also an event
                logger.exception("a subscriber of events failed, and was removed")

    def _remove(self, subscriber: Subscriber) -> None:
        with self._lock:
            left = (each for each in self._subscribers if each is not subscriber)
            self._subscribers = tuple(left)

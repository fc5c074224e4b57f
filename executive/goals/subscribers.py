"""Whoever is told of everything as it happens."""

import logging
import threading
from collections.abc import Callable
from functools import partial

import logs

from .goal import GoalStatus, QuestionStatus

logger = logging.getLogger(__name__)

Event = logs.Record | GoalStatus | QuestionStatus
Watcher = Callable[[Event], None]


class EventSubscribers:
    """Hands every event to all who watch; any thread may tell, begin and leave."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._watchers: tuple[Watcher, ...] = ()

    def add(self, watcher: Watcher) -> Callable[[], None]:
        """Begin to watch; returns what ends it."""
        with self._lock:
            self._watchers = (*self._watchers, watcher)
        return partial(self._remove, watcher)

    def tell(self, event: Event) -> None:
        """Hand out an event. Who fails is told nothing more, not even of that."""
        for watcher in self._watchers:
            try:
                watcher(event)
            except Exception:  # somebody else's; it must keep the arm from nothing
                self._remove(watcher)
                logger.exception("a watcher failed, and is told nothing more")

    def _remove(self, watcher: Watcher) -> None:
        with self._lock:
            self._watchers = tuple(each for each in self._watchers if each is not watcher)

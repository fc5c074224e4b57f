"""A view of a run. It shows items on its own thread."""

import threading
from abc import ABC, abstractmethod
from queue import Empty, SimpleQueue
from typing import Self

import logs
from executive.api.events import QuestionStatus, Where
from executive.api.outcome import Outcome
from hardware import RealClock
from hardware.loading.dataclass import dataclass


@dataclass(frozen=True, slots=True)
class Prompt:
    """A question to the operator at this terminal.

    Attributes:
        text: The question; empty if no answer is expected any more.
    """

    text: str


# A line of text, an event, the arm of the shown goals, an outcome, or a question to the operator at
# this terminal.
Item = logs.Record | QuestionStatus | Outcome | Where | Prompt | str


class View(ABC):
    """Shows a run. Any thread may call `put`, which does not block.

    A thread of the view shows items in the order of their arrival, so that a slow terminal or a
    closed pipe cannot block the arm. After an exception while showing, no more items are shown. The
    exception is raised at the end of the context.

    Args:
        period: Time between two calls of `refresh` [s]; None to call it never.
    """

    def __init__(self, period: float | None = None) -> None:
        self._period, self._clock = period, RealClock()
        self._queue: SimpleQueue[Item | None] = SimpleQueue()
        self._thread = threading.Thread(target=self._run, name="view", daemon=True)
        self._error: Exception | None = None

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *raised: object) -> None:
        self._queue.put(None)
        self._thread.join()
        if self._error:
            raise self._error

    def put(self, item: Item) -> None:
        """Queue an item, which the thread of the view then shows."""
        self._queue.put(item)

    @abstractmethod
    def show(self, item: Item) -> None:
        """Show an item. Only the view's thread calls it."""

    def refresh(self) -> None:  # noqa: B027, a view of lines does not change with time
        """Draw again, because time has passed. Only the view's thread calls it."""

    def close(self) -> None:  # noqa: B027, as above
        """End the view. Only the view's thread calls it."""

    def _run(self) -> None:
        try:
            self._show_all()
        except Exception as error:
            self._error = error
        self.close()

    def _show_all(self) -> None:
        due = None if self._period is None else self._clock.now()
        while True:
            left = None if due is None else due - self._clock.now()
            if left is not None and left <= 0.0:
                self.refresh()
                due = self._clock.now() + (self._period or 0.0)
                continue
            try:
                item = self._queue.get(timeout=left)
            except Empty:
                continue
            if item is None:
                return
            self.show(item)

"""Questions of tasks to the operator. Any client may answer them."""

import threading
import uuid
from collections.abc import Callable

from executive.api.events import QuestionStatus
from executive.errors import BadAnswer, UnknownQuestion
from hardware import Clock
from skills import Question


def ignore(_: QuestionStatus) -> None:
    """Ignore a question."""


class Questions:
    """The open questions of tasks, as an operator. Any thread may list and answer them.

    Args:
        clock: Time source.

    Attributes:
        changed: Callback for every question that opens or closes, from any thread. It must be
            quick. Default: `ignore`.
    """

    def __init__(self, clock: Clock) -> None:
        self.changed: Callable[[QuestionStatus], None] = ignore
        self._clock, self._lock = clock, threading.Lock()
        self._open: dict[str, Question] = {}

    def ask(self, question: Question) -> None:
        """Open a question."""
        identity = uuid.uuid4().hex[:8]
        with self._lock:
            self._open[identity] = question
        self.changed(self._status(identity, question))

    def withdraw(self, question: Question) -> None:
        """Close a question, because its task no longer waits for the answer."""
        with self._lock:
            closed = [name for name, each in self._open.items() if each is question]
            for identity in closed:
                del self._open[identity]
        for identity in closed:
            self.changed(self._status(identity, question, is_open=False))

    def open(self) -> tuple[QuestionStatus, ...]:
        """Return the open questions, oldest first."""
        with self._lock:
            waiting = [item for item in self._open.items() if item[1].answered is None]
        return tuple(self._status(*item) for item in waiting)

    def answer(self, identity: str, words: str) -> str:
        """Answer a question. The first answer counts.

        Args:
            identity: Identity of the question, 8 hexadecimal digits.
            words: One of its choices, or an unambiguous abbreviation.

        Returns:
            The answer that counts, written as the choice.

        Raises:
            UnknownQuestion: No open question has that identity.
            BadAnswer: The answer is not one of the choices.
        """
        with self._lock:
            question = self._open.get(identity)
        if question is None or question.answered is not None:
            raise UnknownQuestion(identity)
        if not question.answer(words):
            raise BadAnswer(words, str(question))
        assert question.answered is not None
        return question.answered

    def _status(self, identity: str, question: Question, is_open: bool = True) -> QuestionStatus:
        now = self._clock.now()
        return QuestionStatus(now, identity, question.text, question.choices, is_open)

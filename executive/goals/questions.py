"""What tasks ask, kept until somebody answers it, by whatever way."""

import threading
import uuid
from collections.abc import Callable

from executive.errors import BadAnswer, UnknownQuestion
from hardware import Clock
from skills import Question

from .events import QuestionStatus


def nobody(_: QuestionStatus) -> None:
    """Watches nothing."""


class Questions:
    """An operator for programs: what is asked can be looked at and answered from any thread.

    Args:
        clock: Whose time.

    Attributes:
        watch: Told of every question when it is put, and when nobody waits for its answer any more;
            must be quick, from any thread.
    """

    def __init__(self, clock: Clock) -> None:
        self.watch: Callable[[QuestionStatus], None] = nobody
        self._clock, self._lock = clock, threading.Lock()
        self._open: dict[str, Question] = {}

    def ask(self, question: Question) -> None:
        """Put a question."""
        identity = uuid.uuid4().hex[:8]
        with self._lock:
            self._open[identity] = question
        self.watch(self._asked(identity, question))

    def withdraw(self, question: Question) -> None:
        """Nobody waits for its answer any more."""
        with self._lock:
            ended = [name for name, each in self._open.items() if each is question]
            for identity in ended:
                del self._open[identity]
        for identity in ended:
            self.watch(self._asked(identity, question, False))

    def open(self) -> tuple[QuestionStatus, ...]:
        """The questions that wait for an answer, the oldest first."""
        with self._lock:
            waiting = [item for item in self._open.items() if item[1].answered is None]
        return tuple(self._asked(*item) for item in waiting)

    def answer(self, identity: str, words: str) -> str:
        """Answer a question; the first answer counts.

        Args:
            identity: Which.
            words: One of its choices, which may be abbreviated where it stays clear.

        Returns:
            The answer that counts.

        Raises:
            UnknownQuestion: There is none, or it is answered.
            BadAnswer: It has other choices.
        """
        with self._lock:
            question = self._open.get(identity)
        if question is None or question.answered is not None:
            raise UnknownQuestion(identity)
        if not question.answer(words):
            raise BadAnswer(words, str(question))
        assert question.answered is not None
        return question.answered

    def _asked(self, identity: str, question: Question, waits: bool = True) -> QuestionStatus:
        return QuestionStatus(self._clock.now(), identity, question.text, question.choices, waits)

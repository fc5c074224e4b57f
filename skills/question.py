"""The interface to the operator, the person who watches the arm: questions and answers."""

import threading
from collections.abc import Callable
from typing import Protocol


class Question:
    """A question. Any thread may answer it, once.

    Args:
        text: The question.
        choices: Allowed answers; empty for any text.
        wake: Callback that is called when the question was answered or rejected.

    Attributes:
        text: The question.
        choices: Allowed answers; empty for any text.
        answered: The answer; None if the question was not answered yet.
        rejected: Reason why no answer is possible; empty if an answer is possible.
    """

    def __init__(self, text: str, choices: tuple[str, ...], wake: Callable[[], None]) -> None:
        self.text, self.choices = text, choices
        self.answered: str | None = None
        self.rejected = ""
        self._wake, self._lock = wake, threading.Lock()

    def __str__(self) -> str:
        return f"{self.text} [{'/'.join(self.choices)}]" if self.choices else self.text

    def answer(self, words: str) -> bool:
        """Answer the question. Only the first valid answer counts.

        Args:
            words: The answer. Upper and lower case are equal. If only one choice begins with the
                answer, this choice is the answer.

        Returns:
            True if the answer is valid, also if the question was already answered.
        """
        choice = self._choice(words.strip())
        with self._lock:
            if choice and self.answered is None:
                self.answered = choice
        if choice:
            self._wake()
        return bool(choice)

    def reject(self, reason: str) -> None:
        """Report that no answer to the question is possible.

        Args:
            reason: Reason for people, such as `there is no operator here`.
        """
        self.rejected = reason
        self._wake()

    def _choice(self, words: str) -> str:
        """Return the choice that an answer names or abbreviates; "" if there is no such choice.

        Without choices, returns the answer itself.
        """
        if not self.choices or not words:
            return words
        lower = words.lower()
        exact = [choice for choice in self.choices if choice.lower() == lower]
        prefixed = [choice for choice in self.choices if choice.lower().startswith(lower)]
        (found,) = exact or (prefixed if len(prefixed) == 1 else [""])
        return found


class Operator(Protocol):
    """Interface that shows questions to a person, in a terminal or on a server's page.

    No method blocks.
    """

    def ask(self, question: Question) -> None:
        """Show a question to the operator."""

    def withdraw(self, question: Question) -> None:
        """Remove a question from the operator's view, answered or not."""


class NoOperator:
    """Replaces the operator if nobody can answer. It rejects every question."""

    def ask(self, question: Question) -> None:
        """Reject the question."""
        question.reject("there is no operator here")

    def withdraw(self, question: Question) -> None:
        """Do nothing."""

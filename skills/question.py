"""The interface to the operator, the person beside the arm: questions and answers."""

import threading
from collections.abc import Callable
from typing import Protocol


class Question:
    """A question. Any thread may answer it, once.

    Args:
        text: The question.
        choices: Allowed answers; empty for any text.
        wake: Callback after the question was answered or rejected.

    Attributes:
        text: The question.
        choices: Allowed answers; empty for any text.
        answered: The answer, or None.
        rejected: Reason that no answer is possible; empty if an answer is possible.
    """

    def __init__(self, text: str, choices: tuple[str, ...], wake: Callable[[], None]) -> None:
        self.text, self.choices = text, choices
        self.answered: str | None = None
        self.rejected = ""
        self._wake, self._lock = wake, threading.Lock()

    def __str__(self) -> str:
        return f"{self.text} [{'/'.join(self.choices)}]" if self.choices else self.text

    def answer(self, words: str) -> bool:
        """Answer the question. The first valid answer counts.

        Args:
            words: The answer. Case does not count. An unambiguous prefix of a choice is accepted.

        Returns:
            True if the answer is valid.
        """
        choice = self._choice(words.strip())
        with self._lock:
            if choice and self.answered is None:
                self.answered = choice
        if choice:
            self._wake()
        return bool(choice)

    def reject(self, reason: str) -> None:
        """Report that no answer is possible."""
        self.rejected = reason
        self._wake()

    def _choice(self, words: str) -> str:
        """Return the choice that the words abbreviate, or "" if there is no such choice."""
        if not self.choices or not words:
            return words
        lower = words.lower()
        exact = [choice for choice in self.choices if choice.lower() == lower]
        prefixed = [choice for choice in self.choices if choice.lower().startswith(lower)]
        (found,) = exact or (prefixed if len(prefixed) == 1 else [""])
        return found


class Operator(Protocol):
    """Passes questions to a person, through a terminal or a server. No method blocks."""

    def ask(self, question: Question) -> None:
        """Show a question."""

    def withdraw(self, question: Question) -> None:
        """Remove a question, also if it was answered."""


class NoOperator:
    """Rejects every question."""

    def ask(self, question: Question) -> None:
        """Reject the question."""
        question.reject("there is no operator here")

    def withdraw(self, question: Question) -> None:
        """Do nothing."""

"""The person beside the arm, as a seam: questions go out, answers come back from any thread."""

import threading
from collections.abc import Callable
from typing import Protocol


class Question:
    """One question, which is answered once.

    Args:
        text: What is asked.
        choices: The answers there are; empty where any words do.
        wake: Called when it is answered, or nobody can.

    Attributes:
        text: The same.
        choices: The same.
        answered: The answer; None while there is none.
        unheard: Why nobody can answer; empty while somebody may.
    """

    def __init__(self, text: str, choices: tuple[str, ...], wake: Callable[[], None]) -> None:
        self.text, self.choices = text, choices
        self.answered: str | None = None
        self.rejected = ""
        self._wake, self._lock = wake, threading.Lock()

    def __str__(self) -> str:
        return f"{self.text} [{'/'.join(self.choices)}]" if self.choices else self.text

    def answer(self, words: str) -> bool:
        """Answer it; case counts not, and a choice may be abbreviated where it stays clear.

        Returns:
            Whether that is an answer; the first one counts.
        """
        chosen = self._meant(words.strip())
        with self._lock:
            if chosen and self.answered is None:
                self.answered = chosen
        if chosen:
            self._wake()
        return bool(chosen)

    def reject(self, why: str) -> None:
        """Tell that nobody can answer."""
        self.rejected = why
        self._wake()

    def _meant(self, words: str) -> str:
        if not self.choices or not words:
            return words
        lower = words.lower()
        exact = [choice for choice in self.choices if choice.lower() == lower]
        begun = [choice for choice in self.choices if choice.lower().startswith(lower)]
        (found,) = exact or (begun if len(begun) == 1 else [""])
        return found


class Operator(Protocol):
    """Whoever passes questions on to a person: a terminal, a server. It never blocks."""

    def ask(self, question: Question) -> None:
        """Put a question."""

    def withdraw(self, question: Question) -> None:
        """Nobody waits for its answer any more; answered ones are withdrawn, too."""


class NoOperator:
    """Nobody is there."""

    def ask(self, question: Question) -> None:
        """Say so."""
        question.reject("there is no operator here")

    def withdraw(self, question: Question) -> None:
        """Nothing was put to anybody."""

"""The operator at a terminal: questions on the screen, answers from the keyboard or a pipe."""

import os
import signal
import sys
import termios
import threading
from collections import deque
from collections.abc import Callable

from skills import Question

_TERMINAL = "/dev/tty"


class Terminal:
    """Asks one question after the other. Answers are lines of standard input.

    If standard input has ended or is missing, answers are lines of the controlling terminal. The
    constructor must run on the main thread.

    Args:
        prompt: Callback that shows a question. An empty text removes it.
    """

    def __init__(self, prompt: Callable[[str], None]) -> None:
        self._prompt = prompt
        self._lock = threading.Lock()
        self._open: deque[Question] = deque()
        self._lines: deque[str] = deque()
        self._reader: threading.Thread | None = None
        self._ended = False
        # A process that reads while it is in the background of a shell would be suspended, and the
        # arm would stop.
        signal.signal(signal.SIGTTIN, signal.SIG_IGN)

    def ask(self, question: Question) -> None:
        """Show a question when the earlier questions are answered."""
        with self._lock:
            self._open.append(question)
            first = len(self._open) == 1
        if first:
            self._show(question)

    def withdraw(self, question: Question) -> None:
        """Remove a question and show the next one."""
        with self._lock:
            shown = bool(self._open) and self._open[0] is question
            if question in self._open:
                self._open.remove(question)
            next_one = self._open[0] if shown and self._open else None
        if next_one:
            self._show(next_one)
        elif shown:
            self._prompt("")

    def _show(self, question: Question) -> None:
        if self._reader is None:
            _discard_input()
        self._prompt(f"? {question}")
        if self._reader is None:
            self._reader = threading.Thread(target=self._read, name="operator", daemon=True)
            self._reader.start()
        self._answer()

    def _answer(self) -> None:
        """Answer the shown question with the lines that were read."""
        while True:
            with self._lock:
                question = self._open[0] if self._open else None
                if question is None or question.answered is not None:
                    return
                line = self._lines.popleft() if self._lines else None
                ended = self._ended
            if line is None:
                if ended:
                    question.reject("no answer is possible: standard input has ended")
                return
            if not question.answer(line):
                self._prompt(f"? {line or 'nothing'} is not an answer to: {question}")

    def _read(self) -> None:
        for path in ("", _TERMINAL):
            try:
                self._read_lines(os.open(path, os.O_RDONLY) if path else sys.stdin.fileno())
            except (OSError, ValueError, AttributeError):
                # Standard input is missing, closed or not readable.
                continue
        with self._lock:
            self._ended = True
        self._answer()

    def _read_lines(self, handle: int) -> None:
        typed = os.isatty(handle)
        rest = b""
        while data := os.read(handle, 4096):
            *lines, rest = (rest + data).split(b"\n")
            self._add(lines, typed)
        self._add([rest] if rest else [], typed)

    def _add(self, lines: list[bytes], typed: bool) -> None:
        with self._lock:
            if self._open or not typed:  # text that is typed between questions is not an answer
                self._lines += [line.decode(errors="replace").strip() for line in lines]
        self._answer()


def _discard_input() -> None:
    """Discard the text that was typed before the first question."""
    if sys.stdin and sys.stdin.isatty() and _in_foreground(sys.stdin.fileno()):
        termios.tcflush(sys.stdin, termios.TCIFLUSH)


def _in_foreground(handle: int) -> bool:
    """Return True if this process is in the foreground of its terminal."""
    try:
        return os.tcgetpgrp(handle) == os.getpgrp()
    except OSError:
        return True  # not the controlling terminal, so no shell uses it

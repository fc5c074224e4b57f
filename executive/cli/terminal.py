"""The operator at the terminal: questions on the screen, answers from the keyboard or a pipe."""

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
    """Asks one question after the other; answers are lines of standard input.

    Where that has ended, or never was, they are lines of the terminal. Made on the main thread.

    Args:
        say: Shows a line.
    """

    def __init__(self, say: Callable[[str], None]) -> None:
        self._say = say
        self._lock = threading.Lock()
        self._open: deque[Question] = deque()
        self._lines: deque[str] = deque()
        self._reader: threading.Thread | None = None
        self._ended = False
        # In the background of a shell, to read would stop the process, and the arm with it.
        signal.signal(signal.SIGTTIN, signal.SIG_IGN)

    def ask(self, question: Question) -> None:
        """Put a question, now or when those before it are answered."""
        with self._lock:
            self._open.append(question)
            first = len(self._open) == 1
        if first:
            self._put(question)

    def withdraw(self, question: Question) -> None:
        """Go on to the next."""
        with self._lock:
            shown = bool(self._open) and self._open[0] is question
            if question in self._open:
                self._open.remove(question)
            following = self._open[0] if shown and self._open else None
        if following:
            self._put(following)

    def _put(self, question: Question) -> None:
        if self._reader is None:
            _forget_typed()
        self._say(f"? {question}")
        if self._reader is None:
            self._reader = threading.Thread(target=self._read, name="operator", daemon=True)
            self._reader.start()
        self._settle()

    def _settle(self) -> None:
        """Take lines as answers to the question that is shown, as far as both are there."""
        while True:
            with self._lock:
                question = self._open[0] if self._open else None
                if question is None or question.answered is not None:
                    return
                line = self._lines.popleft() if self._lines else None
                over = self._ended
            if line is None:
                if over:
                    question.reject("no answer is possible: standard input has ended")
                return
            if not question.answer(line):
                self._say(f"? {line or 'nothing'} is no answer to: {question}")

    def _read(self) -> None:
        for path in ("", _TERMINAL):
            try:
                self._read_lines(os.open(path, os.O_RDONLY) if path else sys.stdin.fileno())
            except (
                OSError,
                ValueError,
                AttributeError,
            ):  # there is none, it is closed, or not ours to read
                continue
        with self._lock:
            self._ended = True
        self._settle()

    def _read_lines(self, handle: int) -> None:
        by_hand = os.isatty(handle)
        rest = b""
        while data := os.read(handle, 4096):
            *lines, rest = (rest + data).split(b"\n")
            self._take(lines, by_hand)
        self._take([rest] if rest else [], by_hand)

    def _take(self, lines: list[bytes], by_hand: bool) -> None:
        with self._lock:
            if self._open or not by_hand:  # typed between questions: no answer
                self._lines += [line.decode(errors="replace").strip() for line in lines]
        self._settle()


def _forget_typed() -> None:
    """Drop what was typed before anything was asked; it answers nothing."""
    if sys.stdin and sys.stdin.isatty() and _in_front(sys.stdin.fileno()):
        termios.tcflush(sys.stdin, termios.TCIFLUSH)


def _in_front(handle: int) -> bool:
    """Whether what is typed at a terminal is typed for this process, not for a shell."""
    try:
        return os.tcgetpgrp(handle) == os.getpgrp()
    except OSError:
        return True  # no shell shares a terminal that controls no session of ours

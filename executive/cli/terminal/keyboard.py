"""Reads the keyboard: a line that answers a question, or key by key."""

import contextlib
import os
import re
import select
import signal
import sys
import termios
import tty
from collections.abc import Iterator
from typing import Any

import click

from .streams import echo

LEFT, RIGHT, UP, DOWN = "\x1b[D", "\x1b[C", "\x1b[A", "\x1b[B"
ENTER, ESCAPE, DELETE = "\n", "\x1b", "\x7f"

# Patterns of keys: an arrow in either mode of a terminal, another sequence, or one character.
_KEY = re.compile("\x1b[O\\[][0-9;]*[A-Za-z~]|.", re.DOTALL)
_before: dict[int, list[Any]] = {}  # original attributes of terminals that are read key by key
_NAMES = {ENTER: "Enter", ESCAPE: "Escape", DELETE: "Backspace", "\t": "Tab"}
_SAME = {"\r": ENTER, "\x08": DELETE}


def ask(question: str) -> str:
    """Print a question and return the typed line.

    It does not use `input`, because `input` may lose a Ctrl-C just before it reads.

    Raises:
        KeyboardInterrupt: The user pressed Ctrl-C.
        click.Abort: Standard input has ended.
    """
    echo(f"{question} ", nl=False)
    reader, writer = os.pipe()
    os.set_blocking(writer, False)
    before = signal.set_wakeup_fd(writer)
    try:
        select.select([sys.stdin, reader], [], [])
    finally:
        signal.set_wakeup_fd(before)
        os.close(reader)
        os.close(writer)
    if line := sys.stdin.readline():
        return line.strip()
    echo("")
    raise click.Abort


def keys_in(data: bytes) -> list[str]:
    """Return the keys that a terminal sent."""
    keys = _KEY.findall(data.decode("ascii", "replace"))
    return [key.replace("O", "[", 1) if len(key) > 1 else _SAME.get(key, key) for key in keys]


def pressed_keys(keyboard: int | None, seconds: float | None) -> list[str]:
    """Wait for keys, and return them. If no key is pressed in time, return an empty list.

    Args:
        keyboard: File handle from `key_by_key`; None only to wait.
        seconds: Longest time to wait [s]; None for no limit.
    """
    handles = [] if keyboard is None else [keyboard]
    ready, _, _ = select.select(handles, [], [], seconds)
    return keys_in(os.read(ready[0], 4096)) if ready else []


def key_name(key: str) -> str:
    """Return the name of a key, for people."""
    return _NAMES.get(key, key if key.isprintable() else "This key")


@contextlib.contextmanager
def key_by_key() -> Iterator[int | None]:
    """Read the keyboard key by key. Yield its file handle, or None if there is no terminal.

    The end of the context drops unread keys, so that a shell does not execute them.
    """
    if not (sys.stdin.isatty() and sys.stdout.isatty()):
        yield None
        return
    handle = sys.stdin.fileno()
    _before[handle] = termios.tcgetattr(handle)
    tty.setcbreak(handle)
    try:
        yield handle
    finally:
        restore_keyboard(termios.TCSAFLUSH)


@contextlib.contextmanager
def suspended_keyboard() -> Iterator[None]:
    """Leave the keyboard to the shell during this context, if `key_by_key` reads it."""
    ours = {handle: termios.tcgetattr(handle) for handle in _before}
    for handle, before in _before.items():
        termios.tcsetattr(handle, termios.TCSADRAIN, before)
    yield
    for handle, attributes in ours.items():
        termios.tcsetattr(handle, termios.TCSADRAIN, attributes)


def restore_keyboard(when: int = termios.TCSANOW) -> None:
    """End `key_by_key` before this process ends abruptly.

    Args:
        when: Time of the change, as in `termios`. Default: at once, even if the terminal blocks
            output.
    """
    for handle, before in _before.items():
        with contextlib.suppress(termios.error):  # the terminal is closed
            termios.tcsetattr(handle, when, before)
            termios.tcflush(handle, termios.TCIFLUSH)
    _before.clear()

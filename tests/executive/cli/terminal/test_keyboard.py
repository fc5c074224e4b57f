"""The keyboard is given back with its echo, and without the keys that nobody read."""

import os
import pty
import select
import sys
import termios
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from executive.cli.terminal.full_screen import last_words
from executive.cli.terminal.keyboard import key_by_key


@contextmanager
def terminal(monkeypatch: pytest.MonkeyPatch) -> Iterator[tuple[int, int]]:
    """Read a terminal key by key; yield the end at which a person types, and the other one."""
    typed, slave = pty.openpty()
    with os.fdopen(slave, "r") as stdin, os.fdopen(os.dup(slave), "w") as stdout:
        monkeypatch.setattr(sys, "stdin", stdin)
        monkeypatch.setattr(sys, "stdout", stdout)
        with key_by_key() as handle:
            assert handle is not None
            yield typed, handle
        assert is_given_back()
    os.close(typed)


def is_given_back() -> bool:
    echo = termios.tcgetattr(sys.stdin)[3] & (termios.ECHO | termios.ICANON)
    read, _, _ = select.select([sys.stdin], [], [], 0)
    return echo == termios.ECHO | termios.ICANON and not read


def test_keys_that_were_not_read_are_dropped(monkeypatch: pytest.MonkeyPatch) -> None:
    with terminal(monkeypatch) as (typed, handle):
        assert not is_given_back()
        os.write(typed, b"x")
        assert os.read(handle, 9) == b"x"
        os.write(typed, b"rm x\n")
        select.select([handle], [], [])


def test_the_end_of_the_process_gives_it_back_too(monkeypatch: pytest.MonkeyPatch) -> None:
    with terminal(monkeypatch) as (typed, handle):
        os.write(typed, b"rm x\n")
        select.select([handle], [], [])
        last_words("Ended at once")
        assert is_given_back()

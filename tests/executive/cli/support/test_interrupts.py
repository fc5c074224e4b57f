"""Signals to a process whose threads do not return."""

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import IO

import pytest

from executive.cli.support import interrupts
from executive.cli.support.interrupts import STOP, Interrupts
from hardware import RealClock
from tests.support.command_line.screen import Screen, on_screen
from tests.support.paths import ROOT

pytestmark = pytest.mark.slow

PROGRAM = """
import ctypes, sys
from executive.cli.support.interrupts import Interrupts
from hardware import RealClock

class Clock(RealClock):
    time = 0.0

    def now(self):  # of each signal: half a second after the one before
        self.time += 0.5
        return self.time

mutex = ctypes.create_string_buffer(64)

def stick(word):
    print(word, flush=True)
    for _ in range(2):
        ctypes.CDLL(None).pthread_mutex_lock(mutex)

with Interrupts("last words", Clock()) as interrupts:
    interrupts.on_cancel(lambda: stick("canceling"))
    stick("running")
"""


@contextmanager
def started(program: str, first: str) -> Iterator[tuple["subprocess.Popen[str]", IO[str]]]:
    """A process that has printed its first line, and its output."""
    command = [sys.executable, "-c", program]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=ROOT) as process:
        assert process.stdout
        assert process.stdout.readline() == first
        try:
            yield process, process.stdout
        finally:
            process.kill()


def test_a_second_signal_ends_a_process_that_is_stuck_everywhere() -> None:
    with started(PROGRAM, "running\n") as (process, output):
        process.send_signal(signal.SIGINT)
        assert output.readline() == "canceling\n"
        process.send_signal(signal.SIGTERM)
        assert process.wait(60) == 143


class Clock(RealClock):
    """Every signal has its time [s]."""

    def __init__(self, *times: float) -> None:
        super().__init__()
        self._times, self.last = iter(times), 0.0

    def now(self) -> float:
        self.last = next(self._times)
        return self.last


@pytest.fixture
def keep_handlers() -> Iterator[None]:
    numbers = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
    before = {number: signal.getsignal(number) for number in numbers}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


def test_a_second_signal_counts_half_a_second_after_the_first(
    monkeypatch: pytest.MonkeyPatch, keep_handlers: None
) -> None:
    """GNU `timeout` sends two at once: to the process, and to its group."""
    clock, ended = Clock(7.0, 7.0, 7.49, 7.5, 7.4, 7.6), list[float]()
    monkeypatch.setattr(interrupts, "last_words", lambda _text: None)
    monkeypatch.setattr(interrupts, "end_process", lambda _status: ended.append(clock.last))
    with Interrupts("last words", clock) as handled:
        handled.on_cancel(lambda: None)
        for number in (signal.SIGTERM, signal.SIGINT, signal.SIGTERM, signal.SIGINT):
            signal.raise_signal(number)
    assert ended == [7.5]
    for number in (signal.SIGHUP, signal.SIGTERM, signal.SIGINT):  # they come after the context
        signal.raise_signal(number)
    assert ended == [7.5, 7.6]


def test_a_persons_first_signal_after_a_stop_does_not_end_the_process() -> None:
    """The person has not typed Ctrl-C before, and the arm may not have stopped yet."""
    with started(PROGRAM, "running\n") as (process, output):
        for number in (STOP, signal.SIGINT):
            process.send_signal(number)
            assert output.readline() == "canceling\n"
        process.send_signal(STOP)  # has no further effect
        process.send_signal(signal.SIGINT)
        assert process.wait(60) == 130
        assert output.read() == ""


STARTS = """
import os, signal
from executive.cli.support.interrupts import Interrupts

class Late:
    def __init__(self, number):
        self.number, self.kill, self.own = number, os.kill, os.getpid()

    def __del__(self):  # as Python ends, after it has removed its handlers
        self.kill(self.own, self.number)

late = [Late(signal.SIGTERM), Late(signal.SIGINT), Late(signal.SIGHUP)]
with Interrupts() as interrupts:
    for _ in range(2):
        os.kill(os.getpid(), signal.SIGTERM)
    print("too late", flush=True)
"""


def test_a_signal_ends_what_is_read_at_the_start_and_later_ones_keep_the_exit_status() -> None:
    """GNU `timeout` sends two at once; a third one comes while Python ends."""
    program = [sys.executable, "-c", STARTS]
    done = subprocess.run(program, cwd=ROOT, timeout=60, check=False, capture_output=True)
    assert (done.returncode, done.stdout, done.stderr) == (143, b"", b"")


ENDS = (
    PROGRAM.partition("mutex")[0]
    + """
import atexit, os, signal, threading

@atexit.register  # as a user's library may
def stick():
    print("ending", flush=True)
    threading.Event().wait()

with Interrupts("last words", Clock()) as interrupts:
    interrupts.on_cancel(interrupts.end)
    os.kill(os.getpid(), signal.SIGINT)
    interrupts.wait()
"""
)


def test_a_second_signal_ends_a_process_that_is_stuck_at_its_exit() -> None:
    with started(ENDS, "ending\n") as (process, _):
        process.send_signal(signal.SIGINT)
        assert process.wait(30) == 130


HUNG_UP = """
import os, signal
from executive.cli.support.interrupts import Interrupts

with Interrupts() as interrupts:
    interrupts.on_cancel(interrupts.end)
    for _ in range(3):
        os.kill(os.getpid(), signal.SIGHUP)
    interrupts.wait()
"""


def test_the_hang_ups_of_a_closed_terminal_cancel_once() -> None:
    """One comes from the kernel, and others from the shell that also ends."""
    done = subprocess.run([sys.executable, "-c", HUNG_UP], cwd=ROOT, timeout=60, check=False)
    assert done.returncode == 0


HIDE_CURSOR = r'print("\x1b[?25l", end="")'
FULL_SCREEN = """
    from executive.cli.terminal.full_screen import FullScreen
    FullScreen(sys.stdout).__enter__()"""


@pytest.mark.parametrize("hide", [HIDE_CURSOR, FULL_SCREEN])
@pytest.mark.parametrize(
    "signals", [{"running": signal.SIGINT, "canceling": signal.SIGINT}, {"running": signal.SIGQUIT}]
)
def test_the_end_at_once_leaves_a_terminal_as_it_was(
    hide: str, signals: dict[str, signal.Signals]
) -> None:
    """At a second Ctrl-C, or at Ctrl-\\."""
    hidden = PROGRAM.replace('    stick("running")', f'    {hide.strip()}\n    stick("running")')
    screen, signals = Screen(80, 24), dict(signals)

    def react(screen: Screen, process: "subprocess.Popen[bytes]") -> None:
        whole = screen.lines[:-1]  # the end of a line may arrive later
        for word in [word for word in signals if word in whole]:
            os.kill(process.pid, signals.pop(word))

    program = [sys.executable, "-c", hidden]
    assert on_screen(program, screen, {"PYTHONPATH": str(ROOT)}, react) == 130
    assert screen.lines[-2:] == ["last words", ""]
    assert screen.cursor
    assert not screen.alternate

"""Commands for a server that accepts connections, but does not answer."""

import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from armtree import Client
from executive.cli.support import server_requests
from executive.client import transport
from tests.executive.cli.test_server_commands import Shell
from tests.support.command_line.pseudo_terminal import PseudoTerminal
from tests.support.command_line.typed import typed

pytestmark = pytest.mark.slow

MOVE = ("move", "joint_1=80deg", "--speed", "0.05")


def impatient(longest: float = transport.ANSWER_TIMEOUT) -> list[str]:
    """A program that is armtree, and shows a missing answer early. An answer may take so long."""
    code = (
        "from armtree import main\n"
        "from executive.cli.support import interrupts, server_goals\n"
        "from executive.client import transport\n"
        "server_goals._CHECK_PERIOD = 0.3\n"
        "server_goals._LATE = interrupts._AGAIN + 0.1\n"  # a second Ctrl-C is that much later
        f"transport.ANSWER_TIMEOUT = {longest}\n"
        "main()"
    )
    return [sys.executable, "-P", "-c", code]


@pytest.fixture(scope="module")
def one_shell(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Shell]:
    made = Shell(tmp_path_factory.mktemp("silent"))
    made.serve("--activate")
    yield made
    assert made.end(signal.SIGTERM) == 0


@pytest.fixture
def shell(one_shell: Shell, monkeypatch: pytest.MonkeyPatch) -> Iterator[Shell]:
    """The server of all rows; a row may pause it."""
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(one_shell.folder))
    yield one_shell
    resume(one_shell)
    with client(one_shell) as connected:
        connected.stop()
        for goal in connected.goals():
            connected.result(goal.identity)


def client(shell: Shell) -> Client:
    return Client(f"http://127.0.0.1:{shell.environment['ARMTREE_TCP_PORT']}")


@pytest.fixture
def moving(shell: Shell) -> Iterator[PseudoTerminal]:
    """A terminal with a move on a server that is paused in the middle of it."""
    with terminal(shell, *MOVE) as moving:
        moving.until("executing")
        with client(shell) as connected:
            connected.goals()  # the command has the answer to its goal, which was asked before
        pause(shell)
        yield moving
        resume(shell)


@contextmanager
def terminal(shell: Shell, *words: str, longest: float = 2.0) -> Iterator[PseudoTerminal]:
    environment = {"ARMTREE_TCP_PORT": shell.environment["ARMTREE_TCP_PORT"]}
    program = impatient(longest)
    with PseudoTerminal(shell.folder, *words, environment=environment, program=program) as made:
        yield made


def pause(shell: Shell) -> None:
    shell.server.send_signal(signal.SIGSTOP)
    os.waitid(os.P_PID, shell.server.pid, os.WSTOPPED | os.WNOWAIT)


def resume(shell: Shell) -> None:
    shell.server.send_signal(signal.SIGCONT)


def test_a_move_says_that_its_server_does_not_answer(shell: Shell, moving: PseudoTerminal) -> None:
    moving.until("has not answered since", "If the arm moves, switch off")
    resume(shell)
    moving.type("\x03")
    assert moving.end()[0] == 7


def test_so_does_a_move_in_a_pipe(shell: Shell) -> None:
    with shell.begin([*impatient(), *MOVE]) as process:
        assert process.stdout
        # The command prints this when it has the answer to its goal.
        assert any(line.startswith("move joint_1") for line in process.stdout)
        pause(shell)
        silent = r"The server has not answered since \d\d:\d\d:\d\d. If the arm moves, "
        assert any(re.match(silent, line) for line in process.stdout)
        resume(shell)
        process.send_signal(signal.SIGINT)
        assert process.wait() == 7


def test_so_does_watch_which_soon_ends_at_a_ctrl_c(shell: Shell) -> None:
    with client(shell) as connected:
        connected.send(10)
    with terminal(shell, "watch", longest=transport.ANSWER_TIMEOUT) as watching:
        watching.until("arm active")
        pause(shell)
        watching.until("has not answered since", "If the arm moves, switch off")
        watching.type("\x03")
        began = time.monotonic()
        status, _ = watching.end()
        spent = time.monotonic() - began
    assert status == 130
    assert spent < transport.ANSWER_TIMEOUT / 2


def test_a_ctrl_c_waits_for_a_server_that_does_not_answer(
    shell: Shell, moving: PseudoTerminal
) -> None:
    moving.type("\x03")
    moving.until("has not answered since", "so the cancel")
    with pytest.raises(subprocess.TimeoutExpired):  # the first cancel is given up
        moving.process.wait(2.0)
    resume(shell)
    status, printed = moving.end()
    assert (status, "CANCELED" in printed) == (7, True)


def test_a_second_ctrl_c_ends_a_command_whose_server_does_not_answer(
    moving: PseudoTerminal,
) -> None:
    moving.type("\x03")
    moving.until("has not answered since", "Another Ctrl-C ends")
    moving.type("\x03")
    status, printed = moving.end()
    assert (status, "The goal may still run on the server" in printed) == (130, True)


def test_a_move_that_was_not_sent_ends_at_once(shell: Shell) -> None:
    with client(shell) as connected:
        known = connected.goals()
        pause(shell)
        with terminal(shell, "home", longest=transport.ANSWER_TIMEOUT) as waiting:
            waiting.until("does not answer yet. Nothing was sent")
            waiting.type("\x03")
            assert waiting.end()[0] == 130
        resume(shell)
        assert connected.goals() == known


def test_stop_says_that_a_server_does_not_answer(
    shell: Shell, monkeypatch: pytest.MonkeyPatch
) -> None:
    pause(shell)
    with monkeypatch.context() as patch:
        patch.setattr(transport, "ANSWER_TIMEOUT", 2.0)
        patch.setattr(server_requests, "_LATE", 0.1)
        status, out, error = typed(shell.folder, "stop")
    assert (status, out) == (13, "")
    assert error.startswith("No answer yet. If the arm moves, switch off its power\n")
    port = shell.environment["ARMTREE_TCP_PORT"]
    why = f"the server at http://127.0.0.1:{port} does not answer: nothing came for 2 s"
    way = "check the arm, and switch off its power if it moves [server.unreachable]"
    assert f"Error: {why}. It may execute the request later; {way}" in " ".join(error.split())
    assert "armtree serve" not in error

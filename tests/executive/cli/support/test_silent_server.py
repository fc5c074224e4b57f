"""Commands for a server that accepts connections, but does not answer."""

import os
import re
import signal
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from executive.cli.support import server_requests
from executive.client import transport
from tests.executive.cli.test_server_commands import ARMTREE, Shell, shell
from tests.support.command_line.pseudo_terminal import PseudoTerminal
from tests.support.command_line.typed import typed

pytestmark = pytest.mark.slow

__all__ = ["shell"]


@pytest.fixture
def moving(shell: Shell) -> Iterator[PseudoTerminal]:
    """A terminal with a move on a server that is paused in the middle of it."""
    shell.serve("--activate")
    move = ["move", "joint_1=80deg", "--speed", "0.05"]
    environment = {"ARMTREE_TCP_PORT": shell.environment["ARMTREE_TCP_PORT"]}
    with PseudoTerminal(shell.folder, *move, environment=environment) as terminal:
        terminal.until("executing")
        pause(shell)
        yield terminal
        shell.server.send_signal(signal.SIGCONT)


def pause(shell: Shell) -> None:
    shell.server.send_signal(signal.SIGSTOP)
    os.waitid(os.P_PID, shell.server.pid, os.WSTOPPED | os.WNOWAIT)


def test_a_move_says_that_its_server_does_not_answer(shell: Shell, moving: PseudoTerminal) -> None:
    moving.until("has not answered since", "If the arm moves, switch off")
    shell.server.send_signal(signal.SIGCONT)
    moving.type("\x03")
    assert moving.end()[0] == 7


def test_so_does_a_move_in_a_pipe(shell: Shell) -> None:
    shell.serve("--activate")
    move = [*ARMTREE, "move", "joint_1=80deg", "--speed", "0.05"]
    with shell.begin([*ARMTREE, "watch", "--json"]) as watch, shell.begin(move) as process:
        assert watch.stdout
        assert process.stdout
        assert any('"executing"' in line for line in watch.stdout)
        pause(shell)
        watch.kill()
        silent = r"The server has not answered since \d\d:\d\d:\d\d. If the arm moves, "
        assert any(re.match(silent, line) for line in process.stdout)
        shell.server.send_signal(signal.SIGCONT)
        process.send_signal(signal.SIGINT)
        assert process.wait() == 7


def test_so_does_watch_which_soon_ends_at_a_ctrl_c(shell: Shell) -> None:
    shell.serve("--activate")
    environment = {"ARMTREE_TCP_PORT": shell.environment["ARMTREE_TCP_PORT"]}
    assert shell.type("send", "10").returncode == 0
    with PseudoTerminal(shell.folder, "watch", environment=environment) as terminal:
        terminal.until("arm active")
        pause(shell)
        terminal.until("has not answered since", "If the arm moves, switch off")
        terminal.type("\x03")
        began = time.monotonic()
        status, _ = terminal.end()
        spent = time.monotonic() - began
    shell.server.send_signal(signal.SIGCONT)
    assert status == 130
    assert spent < transport.ANSWER_TIMEOUT / 2


def test_a_ctrl_c_waits_for_a_server_that_does_not_answer(
    shell: Shell, moving: PseudoTerminal
) -> None:
    moving.type("\x03")
    moving.until("has not answered since", "so the cancel")
    with pytest.raises(subprocess.TimeoutExpired):  # the first cancel is given up
        moving.process.wait(transport.ANSWER_TIMEOUT)
    shell.server.send_signal(signal.SIGCONT)
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
    shell.serve("--activate")
    pause(shell)
    environment = {"ARMTREE_TCP_PORT": shell.environment["ARMTREE_TCP_PORT"]}
    with PseudoTerminal(shell.folder, "home", environment=environment) as terminal:
        terminal.until("does not answer yet. Nothing was sent")
        terminal.type("\x03")
        assert terminal.end()[0] == 130
    shell.server.send_signal(signal.SIGCONT)
    assert "Goal      none" in shell.type("status").stdout


def test_stop_says_that_a_server_does_not_answer(
    shell: Shell, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(transport, "ANSWER_TIMEOUT", 0.5)
    monkeypatch.setattr(server_requests, "_LATE", 0.1)
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    shell.serve()
    pause(shell)
    status, out, error = typed(tmp_path, "stop")
    shell.server.send_signal(signal.SIGCONT)
    assert (status, out) == (13, "")
    assert error.startswith("No answer yet. If the arm moves, switch off its power\n")
    port = shell.environment["ARMTREE_TCP_PORT"]
    why = f"the server at http://127.0.0.1:{port} does not answer: nothing came for 0.5 s"
    way = "check the arm, and switch off its power if it moves [server.unreachable]"
    assert f"Error: {why}. It may execute the request later; {way}" in " ".join(error.split())
    assert "armtree serve" not in error

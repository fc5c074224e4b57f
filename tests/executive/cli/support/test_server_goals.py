"""Goals and events of a server, as they are shown."""

import io
import threading
from collections.abc import Iterator
from contextlib import nullcontext
from typing import Any
from unittest.mock import MagicMock

import pytest
from rich.console import Console

from executive.api.events import Event, Where
from executive.api.move import Move
from executive.cli.support import server_goals
from executive.cli.terminal.live.live_view import LiveView
from executive.errors import ServerLost, ServerUnreachable
from hardware import State, load_robot


class Terminal(io.StringIO):
    """A terminal that notes when the boot of a board is on it."""

    def __init__(self) -> None:
        super().__init__()
        self.boots = threading.Event()

    def write(self, text: str) -> int:
        if "the board boots  2.0 s left" in text:
            self.boots.set()
        return super().write(text)


class Client:
    """A client whose arm is active when the terminal has shown its boot."""

    def __init__(self, terminal: Terminal) -> None:
        self._terminal = terminal

    def where(self) -> Where:
        return Where.of(load_robot(None), State.INACTIVE, None)

    def arm(self, transition: str, pose: str | None, stops: int) -> str:
        assert self._terminal.boots.wait(20.0)
        return "active"


def test_a_server_that_is_lost_during_a_move_leaves_the_pose_unknown(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    client: Any = MagicMock()
    client.events.return_value.__enter__.return_value = _failing(ServerUnreachable("http://a", "x"))
    monkeypatch.setattr(server_goals, "view_for", lambda *_: nullcontext(MagicMock()))
    with pytest.raises(ServerLost, match=r"so the pose of the arm is unknown$") as error:
        server_goals.send_and_wait(client, Move(("home",)), (), False, False, False)
    assert error.value.code == "server.unreachable"
    assert error.value.hint.startswith("check the arm, start the server again")


def _failing(error: Exception) -> Iterator[Event]:
    """Events of which the first one is an error."""
    raise error
    yield


def test_the_boot_of_an_arm_that_is_activated_is_shown(monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = Terminal()
    console = Console(file=terminal, width=80, height=24, force_terminal=True, no_color=True)
    view = LiveView(console, lambda: 0.0)
    monkeypatch.setattr(server_goals, "view_for", lambda *_: view)
    client: Any = Client(terminal)
    assert server_goals.activate(client, None, 0, False) == "active"
    assert terminal.getvalue().endswith("\x1b[?25h\x1b[?1049l")

"""Goals and events of a server, as they are shown."""

import io
import threading
from typing import Any

import pytest
from rich.console import Console

from executive.api.events import Where
from executive.cli.support import server_goals
from executive.cli.terminal.live.live_view import LiveView
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

    def arm(self, transition: str, pose: str | None) -> str:
        assert self._terminal.boots.wait(20.0)
        return "active"


def test_the_boot_of_an_arm_that_is_activated_is_shown(monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = Terminal()
    console = Console(file=terminal, width=80, height=24, force_terminal=True, no_color=True)
    view = LiveView(console, lambda: 0.0)
    monkeypatch.setattr(server_goals, "view_for", lambda *_: view)
    client: Any = Client(terminal)
    assert server_goals.activate(client, None, False) == "active"
    assert terminal.getvalue().endswith("\x1b[?25h\x1b[?1049l")

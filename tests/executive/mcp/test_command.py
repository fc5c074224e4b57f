"""`armtree mcp` without its packages, and its end."""

import asyncio
import contextlib
import signal
import sys
from collections.abc import Coroutine

import pytest
from click.testing import CliRunner

from executive.cli.main import cli


def test_without_its_packages_the_command_says_how_to_install_them(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for name in [name for name in sys.modules if name.startswith(("executive.mcp.", "mcp."))]:
        monkeypatch.delitem(sys.modules, name)  # that other tests have loaded
    monkeypatch.setitem(sys.modules, "mcp", None)
    result = CliRunner().invoke(cli, ["mcp"])
    assert result.exit_code == 2
    assert "install the wheel again with [mcp] behind its name" in result.output


@pytest.mark.parametrize(("number", "status"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_signal_ends_the_command_with_its_exit_status(
    monkeypatch: pytest.MonkeyPatch, number: signal.Signals, status: int
) -> None:
    monkeypatch.setattr("executive.cli.mcp.end_process", sys.exit)  # in place of this process

    def run(work: Coroutine[None, None, None]) -> None:
        work.close()
        signal.raise_signal(number)

    monkeypatch.setattr(asyncio, "run", run)
    with contextlib.ExitStack() as stack:
        for each in (signal.SIGINT, signal.SIGTERM):
            stack.callback(signal.signal, each, signal.getsignal(each))
        result = CliRunner().invoke(cli, ["mcp", "--server", "http://127.0.0.1:1"])
    assert result.exit_code == status

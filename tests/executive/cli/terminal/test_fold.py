"""Texts of the commands in narrow terminals: lines break at spaces, and words stay whole."""

import io
import os
import pty
import termios
from contextlib import redirect_stdout
from pathlib import Path
from unittest.mock import patch

import pytest

from executive.cli.main import cli
from executive.cli.terminal.streams import fold
from tests.logs.writing.test_compaction import run_journal

COMMANDS = [
    ["tasks"],
    ["skills"],
    ["show", "pick"],
    ["check"],
    ["pose", "ls"],
    ["pose", "show", "folded"],
    ["config"],
    ["log", "ls"],
    ["log", "info", "20261123T151517.770Z-1.mcap"],
    ["log", "show", "20261123T151517.770Z-1.mcap"],
]


class Terminal(io.StringIO):
    """A terminal of a number of columns."""

    def __init__(self, columns: int) -> None:
        super().__init__()
        self._master, self._slave = pty.openpty()
        termios.tcsetwinsize(self._slave, (24, columns))

    def isatty(self) -> bool:
        return True

    def fileno(self) -> int:
        return self._slave

    def close(self) -> None:
        os.close(self._master)
        os.close(self._slave)
        super().close()


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("recordings")
    run_journal(path / "20261123T151517.770Z-1.mcap")
    return path


def printed(stream: io.StringIO, command: list[str], folder: Path) -> list[str]:
    environment = {"XDG_RUNTIME_DIR": str(folder), "XDG_CONFIG_HOME": str(folder)}
    before = Path.cwd()
    os.chdir(folder)
    try:
        with patch.dict(os.environ, environment), redirect_stdout(stream):
            cli.main(command, standalone_mode=False)
    except SystemExit:
        pass
    finally:
        os.chdir(before)
    return stream.getvalue().splitlines()


@pytest.mark.parametrize("columns", [60, 80])
@pytest.mark.parametrize("command", COMMANDS, ids=" ".join)
def test_tables_break_at_spaces(command: list[str], columns: int, folder: Path) -> None:
    whole = printed(io.StringIO(), command, folder)
    terminal = Terminal(columns)
    shown = printed(terminal, command, folder)
    terminal.close()
    assert [word for line in shown for word in line.split()] == [
        word for line in whole for word in line.split()
    ]
    assert all(len(line) <= columns or len(line.split()) == 1 for line in shown)
    assert whole


def test_json_and_short_lines_stay_as_they_are(folder: Path) -> None:
    terminal = Terminal(60)
    (line,) = printed(terminal, ["log", "ls", "--json"], folder)
    terminal.close()
    assert len(line) > 60
    assert fold("joint_1 -80.2 deg", 10) == fold("joint_1 -80.2 deg", 20) == "joint_1 -80.2 deg"
    assert fold("joint_1 0.0 deg, joint_2 10.5 deg", 30) == "joint_1 0.0 deg, joint_2\n    10.5 deg"
    tree = "│  ├─ \x1b[31m✗ Fail\x1b[0m  the box is not there"
    assert fold(tree, 20).split("\n") == [
        "│  ├─ \x1b[31m✗ Fail\x1b[0m  the",
        "│  │      box is not",
        "│  │      there",
    ]
    assert fold("a\tb  c \nd", 60) == "a\tb  c \nd"

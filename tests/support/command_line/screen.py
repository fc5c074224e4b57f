"""A command in a terminal of a size, and what its screen then shows."""

import fcntl
import os
import pty
import re
import signal
import struct
import subprocess
import termios
from collections.abc import Callable, Mapping, Sequence

_SEQUENCE = re.compile("\x1b\\[(\\??[0-9;]*)([A-Za-z])|(.)", re.DOTALL)


class Screen:
    """A terminal as far as the live view uses one; any other control sequence is an error.

    Args:
        columns, rows: Its size.

    Attributes:
        cursor: False while the cursor is hidden.
        styles: The styles that were set, as the numbers of SGR sequences.
        pictures: What the alternate screen showed each time that it was drawn, line by line.
    """

    def __init__(self, columns: int, rows: int) -> None:
        self.columns, self.rows = columns, rows
        self._lines, self._row, self._column = [""], 0, 0
        self._before: list[str] | None = None  # lines of the normal screen, while it is not shown
        self.cursor, self.styles = True, set[str]()
        self.pictures: list[list[str]] = []

    @property
    def lines(self) -> list[str]:
        """All lines, those that were scrolled away included."""
        return [line.rstrip() for line in self._lines]

    @property
    def alternate(self) -> bool:
        """True while the alternate screen is shown."""
        return self._before is not None

    def resize(self, columns: int, rows: int) -> None:
        """Change the size. What no longer fits on the alternate screen is lost."""
        self.columns, self.rows = columns, rows
        if self._before is not None:
            self._lines = [line[:columns] for line in self._lines[:rows]]
            self._row = min(self._row, len(self._lines) - 1)

    def show(self, text: str) -> None:
        """Take what a program writes."""
        for numbers, command, character in _SEQUENCE.findall(text):
            match command:
                case "":
                    self._put(character)
                case "H":
                    assert not numbers
                    assert self._before is not None
                    self._row = self._column = 0
                case "K":
                    assert not numbers
                    self._lines[self._row] = self._lines[self._row][: self._column]
                case "J":
                    assert not numbers
                    del self._lines[self._row + 1 :]
                    self._lines[self._row] = self._lines[self._row][: self._column]
                    self.pictures.append(self.lines)
                case "m":
                    self.styles.update(numbers.split(";"))
                case "h" | "l" if numbers == "?25":
                    self.cursor = command == "h"
                case "h":
                    assert numbers == "?1049"
                    assert self._before is None
                    self._before, self._lines, self._row, self._column = self._lines, [""], 0, 0
                case "l":
                    assert numbers == "?1049"
                    assert self._before is not None
                    self._lines, self._before, self._column = self._before, None, 0
                    self._row = len(self._lines) - 1
                case _:
                    raise AssertionError((numbers, command))

    def _put(self, character: str) -> None:
        if character == "\r":
            self._column = 0
        elif character == "\n" or self._column == self.columns:
            self._row, self._column = self._row + 1, 0
            if self._row == len(self._lines):
                self._lines.append("")
            assert self._before is None or len(self._lines) <= self.rows, "the picture scrolls"
        if character not in "\r\n":
            line = self._lines[self._row].ljust(self._column)
            self._lines[self._row] = line[: self._column] + character + line[self._column + 1 :]
            self._column += 1


def on_screen(
    command: Sequence[str],
    screen: Screen,
    environment: Mapping[str, str],
    react: Callable[[Screen, "subprocess.Popen[bytes]"], None] = lambda screen, process: None,
) -> int:
    """Run a command on a screen; return its exit status.

    Args:
        command: The command.
        screen: Shows what it writes.
        environment: Variables beside those of this process.
        react: Called after each piece of output.
    """
    master, slave = pty.openpty()
    fcntl.ioctl(slave, termios.TIOCSWINSZ, struct.pack("HHHH", screen.rows, screen.columns, 0, 0))
    variables = {**os.environ, "TERM": "xterm-256color", "PYTHONUTF8": "1", **environment}
    for name in "COLUMNS", "LINES":  # pytest sets them; the size of the terminal counts
        variables.pop(name, None)
    process = subprocess.Popen(
        command, stdin=slave, stdout=slave, stderr=slave, env=variables, start_new_session=True
    )
    os.close(slave)
    rest = b""
    try:
        while data := _read(master):
            text, rest = _whole(rest + data)
            screen.show(text)
            react(screen, process)
        return process.wait()
    finally:
        os.close(master)
        if process.poll() is None:
            process.send_signal(signal.SIGKILL)
            process.wait()


def _read(handle: int) -> bytes:
    try:
        return os.read(handle, 65_536)
    except OSError:  # the command has ended
        return b""


def _whole(data: bytes) -> tuple[str, bytes]:
    """Return the text up to the last whole character and whole sequence, and what is left."""
    cut = data.rfind(b"\x1b")
    end = len(data) if cut < 0 or re.search(b"[A-Za-z]", data[cut:]) else cut
    text = data[:end].decode(errors="ignore")
    return text, data[len(text.encode()) :]

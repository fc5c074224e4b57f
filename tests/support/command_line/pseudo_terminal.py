"""A command in a real pseudo-terminal: keys in, and the screen as a person sees it."""

import fcntl
import os
import pty
import re
import struct
import subprocess
import sys
import termios
import threading
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Self

_CONTROL = re.compile("\x1b\\[[0-9;?]*[A-Za-z]|\r")

ARMTREE = [sys.executable, "-P", "-m", "armtree"]


class PseudoTerminal:
    """A terminal in which one command of armtree runs.

    Args:
        folder: Working directory, and runtime folder of the user.
        arguments: The command.
        environment: Further variables of its environment.
        script: What bash runs, with job control; `"$@"` is the command.
        program: How armtree is started.
    """

    def __init__(
        self,
        folder: Path,
        *arguments: str,
        environment: Mapping[str, str] = MappingProxyType({}),
        script: str = "",
        program: Sequence[str] = ARMTREE,
    ) -> None:
        self._keys, slave = pty.openpty()
        self.resize(24, 80)
        sized = ("COLUMNS", "LINES")  # would take the place of the size of this terminal
        kept = {k: v for k, v in os.environ.items() if k not in sized and "ARMTREE" not in k}
        shell = ["bash", "-mc", script, "bash"] if script else []
        self.process = subprocess.Popen(
            ["setsid", "--ctty", *shell, *program, *arguments],  # so Ctrl-C and a hang-up arrive
            stdin=slave,
            stdout=slave,
            stderr=slave,
            cwd=folder,
            env={**kept, "XDG_RUNTIME_DIR": str(folder), "TERM": "xterm", **environment},
        )
        os.close(slave)
        self._heard = ""
        # A test that waits for what never comes fails, because the command ends.
        self._watchdog = threading.Timer(100.0, self.process.kill)
        self._watchdog.daemon = True
        self._watchdog.start()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *raised: object) -> None:
        self._watchdog.cancel()
        self.process.kill()
        self.process.wait()
        if self._keys >= 0:
            self.close()

    @property
    def screen(self) -> str:
        """What the screen shows: all since it was last drawn from its first line."""
        return _CONTROL.sub("", self._heard.rpartition("\x1b[H")[2])

    @property
    def whole(self) -> bool:
        """Whether the last full screen was drawn to its end."""
        _, begin, drawn = self._heard.rpartition("\x1b[H")
        return not begin or "\x1b[J" in drawn

    def resize(self, rows: int, columns: int) -> None:
        """Give the terminal another size."""
        fcntl.ioctl(self._keys, termios.TIOCSWINSZ, struct.pack("HHHH", rows, columns, 0, 0))

    def type(self, keys: str) -> None:
        """Press keys."""
        os.write(self._keys, keys.encode())

    def until(self, *words: str) -> str:
        """Read until the screen shows all of these words; return it."""
        while not (self.whole and all(each in self.screen for each in words)):
            assert self.read(), f"{words} are not on the screen: {self.screen}"
        return self.screen

    def at_rest(self, *words: str) -> str:
        """Read until the screen shows all of these words, and no motion; return it."""
        while "moving" in self.until(*words):
            assert self.read(), f"the arm still moves: {self.screen}"
        return self.screen

    def end(self) -> tuple[int, str]:
        """Read until the command ends; return its exit status, and what it printed last."""
        while self.read():
            pass
        return self.process.wait(), self._heard.rpartition("\x1b[?1049l")[2].replace("\r", "")

    def close(self) -> None:
        """Close the terminal, as a person closes its window."""
        os.close(self._keys)
        self._keys = -1

    def read(self) -> bool:
        """Read what comes next; return False at the end."""
        try:
            data = os.read(self._keys, 65536)
        except OSError:  # the last process that had it open has ended
            return False
        self._heard += data.decode(errors="replace")
        return bool(data)

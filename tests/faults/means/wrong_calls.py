"""Calls that fail where the kernel would not: small libraries, compiled here, loaded first."""

import atexit
import contextlib
import functools
import os
import shutil
import subprocess
import tempfile
from collections.abc import Mapping
from pathlib import Path

_SOURCES = Path(__file__).with_name("preload")


@functools.cache
def library(name: str) -> Path:
    """Compile `preload/NAME.c`; return the library."""
    folder = Path(tempfile.mkdtemp(prefix="armtree-preload-"))
    atexit.register(shutil.rmtree, folder)
    built = folder / f"{name}.so"
    command = ["gcc", "-O1", "-Wall", "-Werror", "-shared", "-fPIC", "-o", str(built)]
    subprocess.run([*command, str(_SOURCES / f"{name}.c"), "-ldl"], check=True)
    return built


class WrongCalls:
    """Spoils calls on one file of a command, from the moment that a test chooses.

    Args:
        folder: Folder of the switch.
        path: Text in the name of the file: of the pseudo-terminal, or `.mcap`.
        calls: `write`, or `sync` for fsync and fdatasync.
        name: Name of the switch.
    """

    def __init__(
        self, folder: Path, path: str | Path, calls: str = "write", name: str = "fault"
    ) -> None:
        self._switch = folder / f"{name}.switch"
        self.environment = {
            "LD_PRELOAD": str(library("calls")),
            "FAULT_PATH": os.path.realpath(path) if os.path.islink(path) else str(path),
            "FAULT_TRIGGER": str(self._switch),
            "FAULT_CALLS": calls,
        }

    def start(self, how: str) -> None:
        """From now on `errno 5`, `delay 4000`, `hang 200`, `zero`, `short 7`, or `errno 5 once`."""
        new = self._switch.with_suffix(".new")
        new.write_text(how)
        new.rename(self._switch)

    def calls(self) -> list[float]:
        """When each call was spoiled [s, monotonic]."""
        noted = self._switch.with_suffix(".switch.calls")
        return [float(line) for line in noted.read_text().split()] if noted.exists() else []

    def stop(self) -> None:
        with contextlib.suppress(FileNotFoundError):
            self._switch.unlink()


def together(*environments: Mapping[str, str]) -> dict[str, str]:
    """The environment of a command with all these faults."""
    names = dict.fromkeys(name for each in environments for name in each)
    lists = {name: [each[name] for each in environments if name in each] for name in names}
    return {
        name: ":".join(dict.fromkeys(texts) if name == "LD_PRELOAD" else texts)
        for name, texts in lists.items()
    }


class WallClock:
    """A wall clock that this process can turn."""

    def __init__(self, folder: Path) -> None:
        self._file = folder / "clock.shift"
        self.environment = {"LD_PRELOAD": str(library("clock")), "FAULT_CLOCK": str(self._file)}

    def turn(self, seconds: int) -> None:
        new = self._file.with_suffix(".new")
        new.write_text(str(seconds))
        new.rename(self._file)

"""The niceness of a process that moves an arm, and who can end the process of `armtree`."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from executive.api.codes import INTERRUPTED_EXIT
from executive.cli.support import process
from tests.support.paths import ROOT

PROGRAM = """
import os, posix, sys
from executive.cli.support.process import protected_process
protection = protected_process()
protection.__enter__()
for call, *words in (
    (os._exit, 0), (posix._exit, 0), (os.execv, "/bin/true", ["true"]), (os.execlp, "true", "true"),
    (posix.execve, "/bin/true", ["true"], {}), (os.chdir, "/"), (os.fchdir, 0),
):
    try:
        call(*words)
    except SystemExit as error:
        print(error, flush=True)
for call, *words in ((os._exit, 5), (os.execv, "/bin/sh", ["sh", "-c", "exit 6"])):
    if not os.fork():
        os.chdir("/")
        call(*words)
    print(os.waitstatus_to_exitcode(os.wait()[1]), flush=True)
protection.__exit__(None, None, None)
os.chdir("/")
posix._exit(7)
"""


def test_only_a_child_process_can_end_or_go_elsewhere() -> None:
    run = subprocess.run(
        [sys.executable, "-c", PROGRAM], cwd=ROOT, capture_output=True, check=False
    )
    end = "would end armtree without a result; raise an exception"
    leave = "would change the folder of armtree's relative paths; use absolute paths instead"
    assert run.stdout.decode().splitlines() == [
        *(f"os.{name} {end}" for name in ("_exit", "_exit", "execv", "execv", "execve")),
        *(f"os.{name} {leave}" for name in ("chdir", "fchdir")),
        *("5", "6"),
    ]
    assert (run.returncode, run.stderr) == (7, b"")


LOST = """
import threading
import armtree
from executive.cli import main

class Late:
    def __del__(self):
        raise KeyboardInterrupt  # as a Ctrl-C does that comes here

def command():
    Late()
    threading.Event().wait(20.0)

main.main = command
armtree.main()
"""


def test_a_ctrl_c_that_python_ignores_is_repeated() -> None:
    done = subprocess.run(
        [sys.executable, "-c", LOST], cwd=ROOT, check=False, capture_output=True, text=True
    )
    assert (done.returncode, done.stderr) == (INTERRUPTED_EXIT, "")


class Niceness:
    """The niceness of this process and of its session, as an operating system without limits."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, folder: Path, chosen: int) -> None:
        self.own, self.session = chosen, folder / "autogroup"
        self.session.write_text("0")
        monkeypatch.setattr(process, "NICE", -10)
        monkeypatch.setattr(process, "_GROUP", self.session)
        monkeypatch.setattr(os, "getpriority", lambda which, who: self.own)
        monkeypatch.setattr(os, "setpriority", self._set)

    def _set(self, which: int, who: int, niceness: int) -> None:
        self.own = niceness


@pytest.mark.parametrize(
    ("leader", "chosen", "own", "session"),
    [(True, 0, -10, "-10"), (False, 0, -10, "0"), (True, 5, 5, "0"), (True, -20, -20, "0")],
)
def test_only_what_is_its_own_and_not_chosen_is_changed(
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    leader: bool,
    chosen: int,
    own: int,
    session: str,
) -> None:
    niceness = Niceness(monkeypatch, tmp_path, chosen)
    monkeypatch.setattr(os, "getsid", lambda pid: os.getpid() + (not leader))
    process.make_punctual()
    assert niceness.own == own
    assert niceness.session.read_text() == session


def test_a_refusal_is_ignored(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    niceness = Niceness(monkeypatch, tmp_path, 0)

    def refuse(which: int, who: int, niceness: int) -> None:
        raise PermissionError

    monkeypatch.setattr(os, "setpriority", refuse)
    process.make_punctual()
    assert niceness.own == 0
    assert niceness.session.read_text() == "0"

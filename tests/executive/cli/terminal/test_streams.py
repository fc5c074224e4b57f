"""Standard streams that are closed, or whose reader ends first."""

import os
import pty
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import pytest

from executive.api.codes import READER_ENDED_EXIT

pytestmark = pytest.mark.slow

ARMTREE = [sys.executable, "-P", "-m", "armtree"]


def run_on_terminal(folder: Path, arguments: Sequence[str], words: bytes) -> int:
    """Run a command on a terminal, close it when these words are shown; return the exit status."""
    master, slave = pty.openpty()
    command = [sys.executable, "-c", _ON_TERMINAL, *ARMTREE, *arguments]
    environment = {**os.environ, "TERM": "xterm"}
    process = subprocess.Popen(
        command, cwd=folder, env=environment, stdin=slave, stdout=slave, stderr=slave
    )
    os.close(slave)
    shown = b""
    while words not in shown:
        shown += os.read(master, 4096)
    os.close(master)
    return process.wait(60)


_ON_TERMINAL = """
import fcntl, os, signal, sys, termios
if os.fork():
    signal.signal(signal.SIGHUP, signal.SIG_IGN)
    sys.exit(os.waitstatus_to_exitcode(os.wait()[1]))
os.setsid()
fcntl.ioctl(0, termios.TIOCSCTTY, 0)
os.execv(sys.argv[1], sys.argv[1:])
"""


@pytest.mark.parametrize("arguments", [["tasks"], ["--help"], ["check"]])
def test_a_command_whose_reader_has_ended_is_quiet(arguments: list[str], tmp_path: Path) -> None:
    reader, writer = os.pipe()
    os.close(reader)
    command = [*ARMTREE, *arguments]
    done = subprocess.run(
        command, check=False, cwd=tmp_path, stdout=writer, stderr=subprocess.PIPE, timeout=60
    )
    os.close(writer)
    assert (done.returncode, done.stderr) == (READER_ENDED_EXIT, b"")


@pytest.mark.parametrize(
    ("arguments", "redirections"),
    [
        ("tasks", ">&-"),
        ("run 0 --port virtual", "<&- >&- 2>&-"),
        ("run 0 --port virtual --json", ">&-"),
    ],
)
def test_closed_streams_change_nothing(arguments: str, redirections: str, tmp_path: Path) -> None:
    shell = f'"$@" {arguments} {redirections}'
    command = ["sh", "-c", shell, "sh", *ARMTREE]
    done = subprocess.run(command, check=False, cwd=tmp_path, capture_output=True, timeout=60)
    assert (done.returncode, done.stderr) == (0, b"")


@pytest.fixture(params=["", "1"], ids=["buffered", "unbuffered"])
def _buffered(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONUNBUFFERED", request.param)


@pytest.mark.usefixtures("_buffered")
@pytest.mark.parametrize("arguments", ["tasks", "tasks --json", "skills --json", "check --json"])
def test_a_command_that_only_prints_names_the_full_disk(tmp_path: Path, arguments: str) -> None:
    command = ["sh", "-c", f'"$@" {arguments} >/dev/full', "sh", *ARMTREE]
    done = subprocess.run(command, check=False, cwd=tmp_path, capture_output=True, timeout=60)
    words = b"Error: the disk is full; delete files, then try again [file]\n"
    assert (done.returncode, done.stderr) == (3, words)


@pytest.mark.usefixtures("_buffered")
@pytest.mark.parametrize("how", [">/dev/full", "--json 2>&1 >/dev/full", ">/dev/full 2>&1"])
def test_a_run_goes_on_without_its_output_if_the_disk_is_full(tmp_path: Path, how: str) -> None:
    shell = f'"$@" run 0 --port virtual {how}'
    command = ["sh", "-c", shell, "sh", *ARMTREE]
    done = subprocess.run(command, check=False, cwd=tmp_path, capture_output=True, timeout=60)
    warning = b"warning: the disk is full; the rest of the output is lost\n"
    said = b"" if how.endswith("2>&1") else warning
    assert (done.returncode, done.stdout + done.stderr) == (0, said)


def test_no_file_gets_the_number_of_a_closed_stream(tmp_path: Path) -> None:
    """What a library prints must not reach the port of the arm."""
    code = (
        "from executive.cli.terminal.streams import open_closed_streams as f; f(); import os\n"
        "handle = os.open('there', os.O_CREAT | os.O_WRONLY)\n"
        "os.write(1, b'to nobody')\n"
        "raise SystemExit(handle)"
    )
    command = ["sh", "-c", '"$@" <&- >&- 2>&-', "sh", sys.executable, "-c", code]
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[3])}
    assert subprocess.run(command, check=False, cwd=tmp_path, env=environment).returncode == 3
    assert (tmp_path / "there").read_bytes() == b""


@pytest.mark.parametrize("words", [b"arm activating", b"Execute"])
def test_a_closed_terminal_cancels_a_run(tmp_path: Path, words: bytes) -> None:
    assert run_on_terminal(tmp_path, ["run", "1", "--port", "virtual"], words) == 7

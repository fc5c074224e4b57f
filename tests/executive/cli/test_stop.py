"""`armtree stop` while another process of this user moves an arm of its own."""

import errno
import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from executive.cli.support import server_requests
from executive.cli.support.own_arms import own_runs
from tests.end_to_end.test_command_line import robot, start
from tests.support.command_line.pseudo_terminal import PseudoTerminal
from tests.support.command_line.typed import typed
from tests.support.paths import ROOT

pytestmark = pytest.mark.slow

__all__ = ["robot"]


@pytest.fixture
def run(
    tmp_path: Path, robot: Path, monkeypatch: pytest.MonkeyPatch
) -> Iterator["subprocess.Popen[str]"]:
    """A slow move."""
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    slow = "move", "joint_1=80deg", "--speed", "0.2", "--port", "virtual"
    with start(tmp_path, *slow, "--robot", str(robot), "--json") as run:
        assert run.stdout
        while json.loads(run.stdout.readline())["event"] != "sent":
            pass
        yield run
        run.kill()


def test_stop_cancels_a_run_and_waits_for_its_end(
    run: "subprocess.Popen[str]", tmp_path: Path
) -> None:
    status, out, error = typed(tmp_path, "stop")
    assert (status, error) == (0, "")
    stopped = f"Stopped the arm of armtree move (process {run.pid}), which has ended\n"
    assert out == stopped
    printed, _ = run.communicate(timeout=60)
    outcome = json.loads(printed.splitlines()[-1])
    assert (run.returncode, outcome["code"]) == (7, "goal.canceled")
    assert not list((tmp_path / "armtree").iterdir())
    assert typed(tmp_path, "stop")[0] == 13


def test_stop_says_that_a_run_does_not_end(
    run: "subprocess.Popen[str]", tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A second stop does not end it at once, so its recording is complete in the end."""
    monkeypatch.setattr(server_requests, "_LONGEST_END", 0.1)
    run.send_signal(signal.SIGSTOP)
    os.waitid(os.P_PID, run.pid, os.WSTOPPED)
    for _ in range(2):
        status, out, error = typed(tmp_path, "stop")
        assert (status, out) == (8, "")
        assert f"armtree move (process {run.pid}) was asked to stop, but has not ended" in error
    run.send_signal(signal.SIGCONT)
    typed(tmp_path, "stop")
    printed, _ = run.communicate(timeout=60)
    assert json.loads(printed.splitlines()[-1])["code"] == "goal.canceled"


def test_stop_signals_no_process_but_a_run(run: "subprocess.Popen[str]", tmp_path: Path) -> None:
    """The id of a killed run may be that of another process later."""
    (file,) = (tmp_path / "armtree").iterdir()
    run.kill()
    run.wait()
    with subprocess.Popen(["cat"], stdin=subprocess.PIPE) as other:
        later = file.rename(file.with_stem(f"run-{other.pid}"))
        status, out, error = typed(tmp_path, "stop")
        assert (status, out) == (13, "")
        found = f"no armtree command and no server of yours was found in {tmp_path}/armtree"
        assert f"nothing was stopped: {found}" in " ".join(error.split())
        assert not later.exists()
        assert other.poll() is None
        other.communicate()
    assert other.returncode == 0


@pytest.mark.parametrize("number", [errno.EMFILE, errno.ENOSYS, errno.EPERM])
def test_an_error_of_the_system_does_not_hide_a_run(
    run: "subprocess.Popen[str]", tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: int
) -> None:
    def fail(pid: int) -> int:
        raise OSError(number, os.strerror(number))

    with monkeypatch.context() as patch:
        patch.setattr(os, "pidfd_open", fail)
        with pytest.raises(OSError, match=os.strerror(number)), own_runs():
            pass
    with own_runs() as runs:
        assert [found.pid for found in runs] == [run.pid]


def test_two_stops_take_each_other_for_no_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Both find the file of a killed command whose process id another process has now."""
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    folder = tmp_path / "armtree"
    folder.mkdir(mode=0o700)
    program = """
from pathlib import Path
from executive.cli.support import own_arms
unlink = Path.unlink
def wait(path, missing_ok=False):  # with the lock of the probe
    print("probed", flush=True)
    input()
    unlink(path, missing_ok)
Path.unlink = wait
with own_arms.own_runs() as runs:
    assert not runs
"""
    with subprocess.Popen(["cat"], stdin=subprocess.PIPE) as foreign:
        (folder / f"run-{foreign.pid}.lock").write_text("armtree run")
        with subprocess.Popen(
            [sys.executable, "-c", program],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            cwd=ROOT,
        ) as stop:
            assert stop.stdout
            assert stop.stdout.readline() == "probed\n"
            with own_runs() as runs:
                assert runs == []
            stop.communicate("\n", timeout=60)
        assert stop.returncode == 0
        foreign.communicate()


def test_a_foreign_file_in_the_folder_is_ignored(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    (tmp_path / "armtree").mkdir(mode=0o700)
    for name in ("run-x.lock", "run-7x.lock"):
        (tmp_path / "armtree" / name).touch()
    with own_runs() as runs:
        assert runs == []


def test_stop_ends_a_jog(tmp_path: Path, robot: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    jog = ["jog", "--port", "virtual", "--robot", str(robot)]
    with PseudoTerminal(tmp_path, *jog) as terminal:
        terminal.until("The first step opens the port")
        status, out, _ = typed(tmp_path, "stop", "--json")
        said = json.loads(out)
        assert (status, said["command"]) == (0, "armtree jog")
        status, printed = terminal.end()
    assert status == 130
    assert "The arm holds at" in printed

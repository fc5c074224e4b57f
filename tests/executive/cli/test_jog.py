"""`armtree jog` in a real pseudo-terminal: each step, and every way in which it ends."""

import errno
import re
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
from click.testing import CliRunner

from armtree import Client
from executive.api.token_file import running
from executive.cli.main import cli
from executive.cli.support.own_arms import own_runs
from executive.replay.verification import verify
from logs import Recording, Sent
from tests.end_to_end.test_command_line import robot
from tests.faults.means.wrong_calls import WrongCalls
from tests.support.command_line.pseudo_terminal import ARMTREE, PseudoTerminal
from tests.support.recordings.finished import finished
from tests.support.servers.serving import Serve

pytestmark = pytest.mark.slow

pytest_plugins = ["tests.support.servers.server_fixtures"]

__all__ = ["robot"]

RIGHT = "\x1b[C"


@pytest.fixture
def command(robot: Path) -> list[str]:
    """A jog of an arm of its own, on the virtual board."""
    return ["jog", "--port", "virtual", "--robot", str(robot)]


@pytest.fixture
def own(tmp_path: Path, command: list[str]) -> Iterator[PseudoTerminal]:
    """The jog, in a terminal."""
    with PseudoTerminal(tmp_path, *command) as terminal:
        terminal.until("The first step opens the port")
        yield terminal


def recordings(folder: Path) -> list[Path]:
    return sorted((folder / "recordings").glob("*-move.mcap"))


def test_every_step_is_a_recorded_move(own: PseudoTerminal, tmp_path: Path) -> None:
    own.type(RIGHT)
    own.at_rest("joint_1              2.0 deg", "arm active")
    own.type("2+" + RIGHT)
    own.at_rest("joint_2              5.0 deg")
    own.type("z" + RIGHT)
    lifted = own.at_rest("joint_3              2.0 deg")
    assert ">  z tool z             147.3 mm" in lifted
    own.type("sthere\r")
    own.until("Saved there (arm without gripper) to trees/arduinobot/poses.yaml")
    own.type("sthere\r")
    own.until("Replace the pose there? y/n")
    own.type(RIGHT + "n")
    own.until("Nothing has changed", "joint_3              2.0 deg")
    own.type("sthere\r")
    own.until("Replace the pose there? y/n")
    own.type("y")
    own.until("Saved there (arm without gripper) to trees/arduinobot/poses.yaml")
    own.type("q")
    status, printed = own.end()
    assert status == 0
    assert "The arm holds at joint_1 2.0 deg, joint_2 5.0 deg, joint_3 2.0 deg" in printed
    assert (
        "there: {joint_1: 2 deg, joint_2: 5"
        in (tmp_path / "trees" / "arduinobot" / "poses.yaml").read_text()
    )
    assert len(recordings(tmp_path)) == 3
    assert all(verify(path).holds for path in recordings(tmp_path))


def test_a_step_out_of_bounds_is_refused(own: PseudoTerminal) -> None:
    own.type("4" + RIGHT)
    shown = own.until("goal.out_of_bounds")
    assert "joint_4 = 2 deg is outside its limits, " in " ".join(shown.split())
    own.type("\x1b[D")
    own.until("joint_4             -2.0 deg")


@pytest.mark.parametrize("way", ["Ctrl-C", "space", "q", "closed terminal"])
def test_the_arm_holds_whatever_ends_a_move(command: list[str], tmp_path: Path, way: str) -> None:
    with PseudoTerminal(tmp_path, *command, "--speed", "0.05") as terminal:
        terminal.until("The first step opens the port")
        terminal.type("--" + RIGHT)
        terminal.at_rest("joint_1              0.5 deg")
        terminal.type("h")
        terminal.until("moving to home")
        if way == "closed terminal":
            terminal.close()
            terminal.process.wait()
        else:
            terminal.type({"Ctrl-C": "\x03", "space": " ", "q": "q"}[way])
            if way == "space":
                terminal.until("Stopped", "speed 0.05   width 0.8 mm\n")
                terminal.type("q")
            status, printed = terminal.end()
            assert (status, "The arm holds at" in printed) == (130 * (way == "Ctrl-C"), True)
    frames = [each for path in recordings(tmp_path) for each in Recording(path).records(Sent)]
    assert all(each.positions[3] > -0.69 for each in frames if isinstance(each, Sent))
    assert all(verify(path).holds for path in recordings(tmp_path))


@pytest.mark.skipif(not shutil.which("gcc"), reason="needs gcc")
def test_a_full_disk_stops_the_step(command: list[str], tmp_path: Path) -> None:
    disk = WrongCalls(tmp_path, "-move.mcap")
    slow = (*command, "--speed", "0.05")
    with PseudoTerminal(tmp_path, *slow, environment=disk.environment) as terminal:
        terminal.until("The first step opens the port")
        terminal.type("++" + RIGHT)
        between(terminal)
        disk.start(f"errno {errno.ENOSPC}")
        shown = " ".join(terminal.at_rest("log.disk_full: ").split())
        assert "the disk is full, so the run was stopped. Remove old recordings, or give" in shown
        assert "joint_1 10.0 deg" not in shown  # the arm holds
        disk.stop()
        terminal.type("1--" + RIGHT)
        terminal.until("moving joint_1 by +2 deg")
        terminal.type("q")
        assert terminal.end()[0] == 0


def test_a_jog_on_a_server(serve: Serve, tmp_path: Path) -> None:
    served = serve()
    (info,) = running()
    with PseudoTerminal(tmp_path, "jog") as terminal, Client(info.url) as client:
        terminal.until("arm active", "joint_1              0.0 deg")
        with own_runs() as runs:
            assert runs == []  # it has no arm of its own
        terminal.type(RIGHT)
        terminal.at_rest("joint_1              2.0 deg")
        assert client.where().commanded == served.executive.where().commanded
        goal = client.send(10)
        terminal.type(RIGHT)
        shown = " ".join(terminal.until("goal.busy").split())
        assert f"goal {goal} for task 10 is under way -> wait" in shown
        client.cancel(goal)
        client.result(goal)
        client.move(joint_1="-5 deg")
        terminal.until("joint_1             -5.0 deg")
        client.move(joint_1="-5.3 deg")  # the frame of -5 deg
        terminal.until("joint_1             -5.3 deg")
        client.arm("deactivate")
        terminal.until("arm inactive")
        terminal.type(RIGHT)
        terminal.until("hw.not_active")
        served.stop()
        gone = "the server does not answer any more, so the pose of the arm is unknown"
        shown = " ".join(terminal.until("arm unknown", "q leave").split())
        assert f"server.unreachable: {gone} -> check the arm" in shown
        terminal.type("rm x\r" + RIGHT + "q")
        status, printed = terminal.end()
    assert status == 13
    assert f"Error: {gone}" in " ".join(printed.split())
    assert "rm x" not in printed
    assert "Traceback" not in printed


def between(terminal: PseudoTerminal) -> None:
    """Read until the first joint is on its way to 10 deg."""
    while not (terminal.whole and re.search(r"joint_1 +[1-9]\.\d deg", terminal.screen)):
        assert terminal.read()


def step_is_shown_live(terminal: PseudoTerminal) -> None:
    """Move 10 deg slowly: the joint is on the screen at a position between."""
    terminal.type("1++" + RIGHT)
    terminal.until("moving joint_1 by +10 deg")
    between(terminal)
    assert "moving joint_1 by +10 deg" in terminal.screen
    terminal.type(RIGHT + "z" + RIGHT)
    terminal.until("1 key waits: tool up 10 mm; 1 key ignored")
    terminal.type(" ")
    terminal.until("Stopped")


def test_joints_move_on_the_screen_during_a_step(command: list[str], tmp_path: Path) -> None:
    with PseudoTerminal(tmp_path, *command, "--speed", "0.05") as terminal:
        terminal.until("The first step opens the port")
        step_is_shown_live(terminal)


def test_joints_of_a_server_move_on_the_screen(serve: Serve, tmp_path: Path) -> None:
    serve()
    with PseudoTerminal(tmp_path, "jog", "--speed", "0.05") as terminal:
        terminal.until("arm active")
        step_is_shown_live(terminal)


def test_the_screen_follows_the_size_of_the_terminal(own: PseudoTerminal) -> None:
    for rows, columns in ((12, 60), (40, 120), (24, 80)):
        own.resize(rows, columns)
        while not (fits(own.screen, rows, columns) and "joint_1" in own.screen):
            assert own.read()
    own.type("q")
    assert own.end()[0] == 0


def test_ctrl_z_gives_the_terminal_back_until_the_jog_continues(
    command: list[str], tmp_path: Path
) -> None:
    script = '"$@"; stty -a | grep -o .icanon; read answer; echo "answer: $answer"; fg'
    with PseudoTerminal(tmp_path, *command, script=script) as terminal:
        terminal.until("The first step opens the port")
        terminal.type("\x1a")
        suspended = terminal.until("icanon")
        assert "-icanon" not in suspended
        terminal.type("yes\n")
        terminal.until("answer: yes")
        terminal.type(" 1" + RIGHT)
        terminal.at_rest("2.0 deg")
        terminal.type("q")
        assert terminal.end()[0] == 0


def fits(screen: str, rows: int, columns: int) -> bool:
    lines = screen.split("\n")
    return len(lines) <= rows and max(map(len, lines)) <= columns and screen.endswith("leave")


@pytest.mark.parametrize("way", ["Ctrl-C", "closed terminal"])
def test_the_arm_of_a_server_holds_whatever_ends_a_jog(
    serve: Serve, tmp_path: Path, way: str
) -> None:
    served = serve()
    with PseudoTerminal(tmp_path, "jog", "--speed", "0.05") as terminal:
        terminal.until("arm active")
        terminal.type("++" + RIGHT)
        between(terminal)
        if way == "Ctrl-C":
            terminal.type("\x03")
            assert terminal.end()[0] == 130
        else:
            terminal.close()
            terminal.process.wait()
    (goal,) = served.executive.goals()
    outcome = served.executive.result(goal.identity)
    assert outcome.code == "goal.canceled"
    held = served.executive.where().commanded
    assert held
    assert 0.0 < held["joint_1"] < 0.17
    finished(tmp_path / "recordings")
    assert verify(Path(outcome.recording)).holds


def test_a_jog_needs_a_terminal(tmp_path: Path) -> None:
    done = subprocess.run(
        [*ARMTREE, "jog", "--port", "virtual"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        stdin=subprocess.DEVNULL,
        check=False,
    )
    assert (done.returncode, done.stdout) == (2, "")
    assert "a jog needs a terminal" in done.stderr
    within = CliRunner().invoke(cli, ["jog", "--port", "virtual"])
    assert (within.exit_code, within.stdout) == (2, "")

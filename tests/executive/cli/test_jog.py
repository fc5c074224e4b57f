"""`armtree jog` in a real pseudo-terminal: each step, and every way in which it ends."""

import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from armtree import Client
from executive.api.token_file import running
from executive.replay.verification import verify
from logs import Recording, Sent
from tests.end_to_end.test_command_line import robot
from tests.support.command_line.pseudo_terminal import ARMTREE, PseudoTerminal
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
    own.until("joint_1              2.0 deg", "arm active")
    own.type("2+" + RIGHT)
    own.until("joint_2              5.0 deg")
    own.type("z" + RIGHT)
    lifted = own.until("joint_3              2.0 deg")
    assert ">  z tool z             147.3 mm" in lifted
    own.type("sthere\r")
    own.until("Saved the pose there of the arm to trees/poses.yaml")
    own.type("sthere\r")
    own.until("has a pose there already")
    own.type("q")
    status, printed = own.end()
    assert status == 0
    assert "The arm holds at joint_1 2.0 deg, joint_2 5.0 deg, joint_3 2.0 deg" in printed
    assert "there: {joint_1: 2 deg, joint_2: 5" in (tmp_path / "trees" / "poses.yaml").read_text()
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
    with PseudoTerminal(tmp_path, *command, "--speed", "0.02") as terminal:
        terminal.until("The first step opens the port")
        terminal.type("--" + RIGHT)
        terminal.until("joint_1              0.5 deg")
        terminal.type("h")
        terminal.until("moving home")
        if way == "closed terminal":
            terminal.close()
            terminal.process.wait()
        else:
            terminal.type({"Ctrl-C": "\x03", "space": " ", "q": "q"}[way])
            if way == "space":
                terminal.until("Stopped", "speed 0.02\n")
                terminal.type("q")
            status, printed = terminal.end()
            assert (status, "The arm holds at" in printed) == (130 * (way == "Ctrl-C"), True)
    frames = [each for path in recordings(tmp_path) for each in Recording(path).records(Sent)]
    assert all(each.positions[3] > -0.69 for each in frames if isinstance(each, Sent))
    assert all(verify(path).holds for path in recordings(tmp_path))


def test_a_jog_on_a_server(serve: Serve, tmp_path: Path) -> None:
    served = serve()
    (info,) = running()
    with PseudoTerminal(tmp_path, "jog") as terminal, Client(info.url) as client:
        terminal.until("arm active", "joint_1              0.0 deg")
        terminal.type(RIGHT)
        terminal.until("joint_1              2.0 deg")
        assert client.where().commanded == served.executive.where().commanded
        goal = client.send(10)
        terminal.type(RIGHT)
        shown = " ".join(terminal.until("goal.busy").split())
        assert f"goal {goal} for task 10 is under way; wait, or cancel it" in shown
        client.cancel(goal)
        client.result(goal)
        client.arm("deactivate")
        terminal.type(RIGHT)
        terminal.until("hw.not_active", "arm inactive")
        served.stop()
        terminal.type(RIGHT)
        status, printed = terminal.end()
    assert status == 13
    assert "no server answers at" in printed
    assert "Traceback" not in printed


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

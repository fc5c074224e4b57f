"""`armtree teach` in a real pseudo-terminal: the task that it leaves runs."""

import subprocess
from pathlib import Path

import pytest

from executive.cli.teach import summary
from executive.replay.verification import verify
from executive.testing import SimulatedArm
from hardware import load_robot
from tests.end_to_end.test_command_line import robot
from tests.support.arms.bus_arms import push, so101_bus, so101_file
from tests.support.command_line.pseudo_terminal import ARMTREE, PseudoTerminal
from tests.support.command_line.typed import typed
from tests.support.servers.serving import Serve, Served
from trees.writing.taught_task import TaughtTask

pytestmark = pytest.mark.slow

pytest_plugins = ["tests.support.servers.server_fixtures"]

__all__ = ["robot"]

RIGHT = "\x1b[C"
HEAD = "tree:\n  sequence:\n"
FIRST = (
    "    - subtree: move_joints\n"
    "      with: {joints: {joint_1: 2 deg, joint_2: 0 deg, joint_3: 0 deg}}\n"
    "    - subtree: move_joints\n"
    "      with: {joints: closed}\n"
)
WAIT = "    - Wait: {duration: 0.5 s}\n"
OPEN = "    - subtree: move_joints\n      with: {joints: open}\n"


@pytest.fixture
def command(robot: Path) -> list[str]:
    return ["teach", "5", "fetch", "--port", "virtual", "--robot", str(robot)]


def begin(terminal: PseudoTerminal) -> None:
    """Move a step, and take it."""
    terminal.until("The first step opens the port")
    terminal.type("t")
    terminal.until("move it first")
    for key in "fr":
        terminal.type(key)
        terminal.until("measure nothing, so it cannot be moved by hand")
    terminal.type("?")
    terminal.until("t takes this pose as a step", "w adds a wait")
    terminal.type(RIGHT)
    terminal.at_rest("joint_1              2.0 deg", "arm active")
    terminal.type("t")
    terminal.until("Step 1: move to joint_1: 2 deg")


def steps(folder: Path) -> str:
    return (folder / "trees" / "arduinobot" / "5_fetch.yaml").read_text().partition(HEAD)[2]


def test_a_task_is_taught_and_runs(command: list[str], tmp_path: Path, robot: Path) -> None:
    with PseudoTerminal(tmp_path, *command) as terminal:
        terminal.until("armtree teach fetch   arm unconfigured", "| no step yet")
        begin(terminal)
        terminal.until("| 1 move to joint_1: 2 deg")
        assert steps(tmp_path) == FIRST
        terminal.type("t")
        terminal.until("The arm has not moved since the last step")
        terminal.type("w500 ms\r")
        terminal.until("Step 2: wait 0.5 s")
        terminal.type("wsoon\r")
        terminal.until(
            "How long, such as 500ms: soon_", "a duration in s, ms, min or h, such as 2 s; Escape"
        )
        terminal.type("\x1b")
        terminal.type("o")
        terminal.at_rest("joint_4            -40.1 deg")
        terminal.type("t")
        terminal.until("Step 3: move to open")
        terminal.type("u")
        assert "3 move to" not in terminal.until("Undone: move to open", "| 2 wait 0.5 s")
        assert steps(tmp_path) == FIRST + WAIT
        terminal.type("t")
        terminal.until("Step 3: move to open")
        terminal.type("sthere\r")
        terminal.until("Saved there (arm without gripper) to trees/arduinobot/poses.yaml")
        terminal.type("q")
        status, printed = terminal.end()
    assert status == 0
    assert (
        "trees/arduinobot/5_fetch.yaml has 3 steps (4 nodes). Next, type: armtree run 5 --robot"
        in printed
    )
    assert " ".join(printed.split()).endswith("--port virtual")
    assert steps(tmp_path) == FIRST + WAIT + OPEN
    assert typed(tmp_path, "check", "--trees", str(tmp_path / "trees"))[0] == 0
    with SimulatedArm(tmp_path / "trees", robot=robot) as arm:
        outcome = arm.run("fetch")
        assert outcome.success, outcome.text()
        assert arm.frames[-1] == "b092,s090,e090,g080,"
        assert verify(Path(outcome.recording)).holds


def test_an_inactive_arm_of_a_server_is_activated_first(serve: Serve) -> None:
    served = serve()
    assert typed(served.folder, "arm", "deactivate")[0] == 0
    with PseudoTerminal(served.folder, "teach", "5", "fetch") as terminal:
        terminal.until("arm inactive")
        terminal.type("t")
        terminal.until("is not known; activate it: `armtree arm activate`")
        terminal.type("q")
        assert terminal.end()[0] == 0


def taught(served: Served, folder: Path) -> str:
    """Teach task 5 on the arm of a server, in this folder. Return the last line."""
    with PseudoTerminal(served.folder, "teach", "5", "fetch", "--trees", str(folder)) as terminal:
        terminal.until("armtree teach fetch   arm active")
        terminal.type("t")
        terminal.until("Step 1: move to")
        terminal.type("q")
        return " ".join(terminal.end()[1].split())


def test_what_runs_a_task_that_is_taught_on_a_server(serve: Serve) -> None:
    served = serve()
    printed = taught(served, served.tasks)
    assert printed.endswith("has 1 step (2 nodes). Next, type: armtree send 5 --wait")
    with served.client() as client:
        assert client.send(5)


def test_a_server_that_does_not_read_the_folder_needs_another_start(serve: Serve) -> None:
    served = serve()
    printed = taught(served, Path("mine 2"))
    assert printed.endswith(
        "has 1 step (2 nodes). The server does not list this task: start armtree serve with "
        "--trees 'mine 2'. Then, type: armtree send 5 --wait"
    )


def test_what_runs_a_task_names_the_server_of_the_command(serve: Serve, robot: Path) -> None:
    served = serve(active=False)
    task = TaughtTask(load_robot(robot), served.tasks, 5, "fetch")
    task.wait("1s")
    for url, has in ((served.server.url, "step. Next"), ("http://127.0.0.1:9", "serve with")):
        said = summary(task, served.tasks, url, url, {"--trees": "mine"})
        assert has in said
        assert said.endswith(f", type: armtree send 5 --wait --server {url}")


def test_what_runs_a_taught_task_names_its_folder_and_robot(tmp_path: Path, robot: Path) -> None:
    task = TaughtTask(arm := load_robot(robot), tmp_path, 5, "fetch")
    task.move({joint.name: -0.1 for joint in arm.actuated})
    for given, words in (
        ({"--robot": None, "--trees": Path("mine 2")}, " --trees 'mine 2'"),
        ({"--robot": "so101", "--trees": None}, " --robot so101"),
    ):
        said = summary(task, tmp_path, None, None, given)
        assert said.endswith(f"has 1 step (2 nodes). Next, type: armtree run 5{words}")


@pytest.mark.parametrize("way", ["Ctrl-C", "closed terminal", "killed"])
def test_nothing_is_lost(command: list[str], tmp_path: Path, way: str) -> None:
    with PseudoTerminal(tmp_path, *command) as terminal:
        begin(terminal)
        if way == "Ctrl-C":
            terminal.type("\x03")
            status, printed = terminal.end()
            assert (status, "5_fetch.yaml has 1 step (2 nodes). Next" in printed) == (
                130,
                True,
            )
        elif way == "closed terminal":
            terminal.close()
            terminal.process.wait()
        else:
            terminal.process.kill()
            terminal.process.wait()
    assert steps(tmp_path) == FIRST
    assert typed(tmp_path, "check", "--trees", str(tmp_path / "trees"))[0] == 0


def test_without_a_step_there_is_no_task(command: list[str], tmp_path: Path) -> None:
    with PseudoTerminal(tmp_path, *command) as terminal:
        terminal.until("The first step opens the port")
        terminal.type("u")
        terminal.until("There is no step to undo")
        terminal.type("q")
        assert "No step was taken, so there is no new task" in terminal.end()[1]
    assert not list((tmp_path / "trees").glob("*.yaml"))


def test_a_task_is_taught_by_hand_and_runs(tmp_path: Path) -> None:
    words = ["teach", "5", "fetch", "--robot", str(so101_file(tmp_path))]
    with so101_bus() as bus, PseudoTerminal(tmp_path, *words, "--port", bus.port) as terminal:
        terminal.until("The first step opens the port")
        terminal.type("r")
        terminal.until("f switches the torque off")
        terminal.type("f")
        terminal.until("falls unless you hold it. Do you hold it? y/n")
        terminal.type("n")
        terminal.until("Nothing has changed", "arm unconfigured")
        terminal.type("fy")
        terminal.until("torque off", "Move the arm by hand")
        push(bus, shoulder_pan=30, gripper=20)
        terminal.until("shoulder_pan        30.0 deg", "gripper             20.0 deg")
        terminal.type("t")
        terminal.until("Step 1: move to shoulder_pan: 29.97 deg")
        terminal.type(RIGHT)
        terminal.until("hw.torque_off")
        push(bus, shoulder_lift=163)
        terminal.until("shoulder_lift      163.0 deg")
        terminal.type("t")
        terminal.until("shoulder_lift is at 163.0 deg", "end at 100.0", "inwards by")
        terminal.type("f9")  # the error about 9 shows that f is done
        terminal.until("torque off", "there is no joint 9")
        push(bus, shoulder_lift=0)
        terminal.until("shoulder_lift        0.0 deg")
        terminal.type("r")
        terminal.until("r ends the path")
        for degrees in (10, -10, -30):
            push(bus, shoulder_pan=degrees, shoulder_lift=-abs(degrees))
            terminal.until(f"shoulder_pan    {degrees:8.1f} deg")
        terminal.type("r")
        terminal.until("Step 2: path of 3 points")
        terminal.type("f")
        terminal.until("The arm holds")
        assert all(bus.state().torque.values())
        terminal.type(RIGHT)
        terminal.at_rest("shoulder_pan       -28.0 deg")
        terminal.type("q")
        status, printed = terminal.end()
    assert status == 0
    assert "has 2 steps (3 nodes). Next, type: armtree run 5 --robot " in printed
    with SimulatedArm(tmp_path / "trees", robot=Path("so101")) as arm:
        outcome = arm.run("fetch")
        assert outcome.success, outcome.text()
        assert verify(Path(outcome.recording)).holds


def test_an_arm_that_is_moved_by_hand_holds_at_the_end(tmp_path: Path) -> None:
    words = ["teach", "5", "fetch", "--robot", str(so101_file(tmp_path))]
    with so101_bus() as bus, PseudoTerminal(tmp_path, *words, "--port", bus.port) as terminal:
        terminal.until("The first step opens the port")
        terminal.type("fy")
        terminal.until("Move the arm by hand")
        push(bus, shoulder_pan=30)
        terminal.until("shoulder_pan        30.0 deg")
        terminal.type("\x03")
        status, printed = terminal.end()
        assert status == 130
        assert "The arm holds at shoulder_pan 30.0 deg" in printed
        assert all(bus.state().torque.values())


@pytest.mark.parametrize(
    ("words", "status", "why"),
    [
        (["1", "fetch"], 3, "task 1 is in "),
        (["5", "pick"], 3, "task 1 is called pick already; give another name"),
        (["5", "a b"], 3, "'a b' is not a name"),
        (["x", "fetch"], 2, "x is not a whole number"),
        (["5", "fetch"], 2, "a jog needs a terminal"),
    ],
)
def test_what_is_wrong_is_refused_before_anything_moves(
    tmp_path: Path, words: list[str], status: int, why: str
) -> None:
    done = subprocess.run(
        [*ARMTREE, "teach", *words, "--port", "virtual"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        stdin=subprocess.DEVNULL,
        check=False,
    )
    assert done.returncode == status
    assert why in done.stderr
    assert not list(tmp_path.glob("**/*.yaml"))
    assert not (tmp_path / "recordings").exists()

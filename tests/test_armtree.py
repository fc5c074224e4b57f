"""The public interface: an arm in a program or a notebook, without a server."""

import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from threading import Lock
from typing import Any

import pytest

import armtree
import logs
from executive.api.events import Event
from executive.arm import Arm
from executive.executive import Executive
from executive.session import open_executive
from executive.setup import Setup
from executive.task_runner import TaskRunner
from hardware import BoardLink, Robot, SimulatedClock
from skills.motion import Pool
from tests.support.arms.virtual_boards import virtual_board
from tests.support.paths import EXAMPLES, ROOT
from trees import Library

WAIT = "task: 8\nname: wait\ndescription: Wait.\ntree:\n  Wait: {duration: 1 h}\n"
ASK = "task: 9\nname: ask\ndescription: Ask.\ntree:\n  Ask: {question: Go on?, wanted: yes}\n"


@pytest.fixture
def tasks(tmp_path: Path) -> Path:
    """A folder with the task files of the examples."""
    folder = tmp_path / "tasks"
    shutil.copytree(EXAMPLES, folder)
    return folder


class _SimulatedArm(Arm):
    """An arm on an executive in simulated time."""

    def __init__(self, executive: Executive) -> None:
        self.executive, self._runner, self._lock = executive, TaskRunner(executive), Lock()
        executive.start()

    def close(self) -> None:
        """Leave the executive open; its context closes it."""


@pytest.fixture
def arm(
    robot: Robot, shared_clock: SimulatedClock, shared_pool: Pool, tasks: Path, tmp_path: Path
) -> Iterator[Arm]:
    """An arm on the in-process board, in simulated time."""
    setup = Setup(robot=robot, trees=tasks, recordings=tmp_path, single_user=True)
    link = BoardLink(virtual_board(robot), shared_clock)
    with (
        shared_clock.working(),
        open_executive(setup, clock=shared_clock, link=link, pool=shared_pool) as executive,
        _SimulatedArm(executive) as one,
    ):
        yield one


def test_a_task_by_name_or_number(arm: Arm) -> None:
    first = arm.run("pick")
    second = arm.run("wave", swing="30 deg", times=1)
    third = arm.run(0)
    assert [each.task for each in (first, second, third)] == [1, 3, 0]
    for outcome in (first, second, third):
        records = list(logs.Recording(Path(outcome.recording)).records(logs.Goal, logs.Sent))
        goals = [record.task for record in records if isinstance(record, logs.Goal)]
        assert goals == [outcome.task]
        assert outcome.frames == sum(isinstance(each, logs.Sent) for each in records)
    assert min(first.frames, second.frames) > 10
    boots = [
        record
        for record in logs.Recording(Path(second.recording)).records(logs.Transition)
        if isinstance(record, logs.Transition) and record.goal == "active"
    ]
    assert [(each.start, each.goal) for each in boots] == [("active", "active")]  # stays active


def test_a_goal_that_fails_raises_its_cause(arm: Arm) -> None:
    with pytest.raises(armtree.GoalFailed, match=r"arguments: swing: .3 m.: ") as raised:
        arm.run("wave", swing="3 m")
    assert raised.value.cause.code == raised.value.code == "goal.bad_arguments"
    assert raised.value.cause.hint == raised.value.hint != ""
    assert raised.value.outcome.task == 3
    assert arm.attempt("wave", swing="3 m").code == "goal.bad_arguments"
    assert arm.run("home").success  # the arm can still be used


def test_an_unknown_task_is_named_with_those_there_are(arm: Arm) -> None:
    with pytest.raises(armtree.UnknownTask, match=r"Invalid task name pik; .*pick") as no:
        arm.run("pik")
    assert "did you mean pick?" in str(no.value)
    with pytest.raises(armtree.UnknownTask, match="Invalid task number 99; the nearest of"):
        arm.run(99)
    for wrong in (True, 1.5, None):
        with pytest.raises(TypeError, match="a task is a number or a name"):
            arm.run(wrong)  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="argument swing = <object"):
        arm.run("wave", swing=object())


def test_an_example_is_found_or_its_folder_is_named(tmp_path: Path) -> None:
    with pytest.raises(armtree.UnknownTask) as no:
        Library().number("wave")
    assert str(no.value).endswith(
        f". wave is an example: add --trees {armtree.EXAMPLES} (in Python, trees=)"
    )
    assert Library(armtree.EXAMPLES).number("wave") == 3


def test_an_edited_task_counts_from_the_next_run(arm: Arm, tasks: Path) -> None:
    text = "task: 9\nname: hello\ndescription: Say it.\ntree:\n  Fail: {reason: REASON}\n"
    for reason in ("one", "two"):
        (tasks / "9_hello.yaml").write_text(text.replace("REASON", reason))
        assert reason in arm.attempt("hello").message


def test_stop_from_another_thread(arm: Arm, shared_clock: SimulatedClock) -> None:
    def stop(event: Event) -> None:
        if isinstance(event, logs.Sent) and event.joints:
            shared_clock.spawn(arm.stop, "stop")

    arm.executive.subscribe(stop)
    with pytest.raises(armtree.GoalFailed) as raised:
        arm.run("pick")
    assert raised.value.code == "goal.canceled"
    assert raised.value.outcome.state.name == "CANCELED"


def test_a_closed_arm_runs_nothing(arm: Arm) -> None:
    arm.executive.close()
    with pytest.raises(armtree.GoalFailed) as raised:
        arm.run("home")
    assert raised.value.code == "server.closing"


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"seed": 0}, "seed = 0 is invalid; give a whole number from 1"),
        ({"seed": 1.5}, "seed = 1.5 is invalid"),
        ({"planning_timeout": True}, "planning_timeout = True is invalid; give a number from 0.1"),
        ({"planning_timeout": 0}, "planning_timeout = 0 is invalid; give a number from 0.1"),
        ({"world": 5}, "world = 5 is invalid; give a path or None"),
        ({"pose": "bot"}, "pose = 'bot' is invalid; give boot, last or None"),
        ({"port": ""}, "port = '' is invalid; give a serial port, or virtual"),
        ({"port": 3}, "port = 3 is invalid"),
        ({"port": "/dev/none"}, "no serial port /dev/none.* give another port"),
        ({"pose": "last"}, 'the pose "last" is for robots'),
    ],
)
def test_a_wrong_argument_is_rejected_at_once(options: dict[str, Any], words: str) -> None:
    with pytest.raises((ValueError, armtree.HardwareError), match=words) as raised:
        armtree.Arm(**options)
    assert "--" not in str(raised.value)  # options of the command line do not help here


def test_settings_of_the_command_line_do_not_count(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("ARMTREE_PORT", "/dev/other")
    (tmp_path / "armtree.toml").write_text('port = "/dev/other"\nseed = 5\nrobot = "other"')
    with armtree.Arm() as arm:
        assert arm.executive.port == "virtual"
        assert (arm.executive.setup.seed, arm.executive.robot.name) == (1, "arduinobot")


def test_a_broken_skill_is_reported(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text("import there_is_no_such_module\n")
    with pytest.raises(ValueError, match="there_is_no_such_module"):
        armtree.Arm(skills=tmp_path)


def test_an_unknown_name_of_the_module() -> None:
    with pytest.raises(AttributeError, match="no attribute 'Leg'"):
        armtree.Leg  # type: ignore[attr-defined]  # noqa: B018
    everything: dict[str, object] = {}
    exec("from armtree import *", everything)
    assert set(armtree.__all__) == set(dir(armtree)) == set(everything) - {"__builtins__"}
    assert {"Arm", "GoalFailed", "Skill"} < set(everything)


def test_importing_it_loads_nothing_else() -> None:
    code = "import sys, armtree; print(*(name.partition('.')[0] for name in sys.modules))"
    command = [sys.executable, "-P", "-c", code]
    loaded = subprocess.run(command, capture_output=True, text=True, check=True).stdout.split()
    rooms = {"executive", "hardware", "logs", "skills", "trees"}
    assert (rooms | {"ast", "numpy", "py_trees", "pinocchio", "httpcore"}).isdisjoint(loaded)
    assert "armtree" in loaded


def test_the_command_line_is_a_module_away() -> None:
    command = [sys.executable, "-m", "armtree", "--version"]
    done = subprocess.run(command, capture_output=True, text=True, check=True, cwd=ROOT)
    assert done.stdout.startswith("armtree, version ")


@pytest.mark.parametrize("loading", ["executive.cli", "threading", "click"])
def test_a_ctrl_c_while_the_command_is_loading(loading: str) -> None:
    code = f"""
import sys, armtree
class Interrupt:
    def find_spec(self, name, *_):
        if name == {loading!r}:
            raise KeyboardInterrupt
sys.meta_path.insert(0, Interrupt())
armtree.main()
"""
    command = [sys.executable, "-P", "-c", code]
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=ROOT)
    assert (done.returncode, done.stderr) == (130, "")


# As a notebook does it: on a main thread whose event loop runs, without `with`.
NOTEBOOK = """\
import asyncio, signal
import armtree

class Yes:
    def ask(self, question):
        question.answer("yes")

    def withdraw(self, question):
        pass

async def cells():
    handler = signal.getsignal(signal.SIGINT)
    arm = armtree.Arm(trees={trees!r}, recordings={recordings!r}, operator=Yes())
    print(arm.run("home").success and arm.run("ask").success, flush=True)
    assert signal.getsignal(signal.SIGINT) is handler
    arm.executive.subscribe(lambda event: "EXECUTING" in str(event) and print("runs", flush=True))
    try:
        arm.run("wait")
    except KeyboardInterrupt:
        print("interrupted", arm.executive.goals()[-1].state.name, flush=True)
    print(arm.run(0).success, flush=True)

asyncio.new_event_loop().run_until_complete(cells())
"""


@pytest.mark.slow  # two boots in real time
def test_the_tasks_are_those_of_the_command_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with armtree.Arm() as arm, pytest.raises(armtree.UnknownTask, match="wave is an example"):
        arm.run("wave")
    (tmp_path / "trees").mkdir()
    (tmp_path / "trees" / "9_ask.yaml").write_text(ASK)
    with armtree.Arm() as arm, pytest.raises(armtree.GoalFailed, match="operator"):
        arm.run("ask")


@pytest.mark.slow
def test_a_notebook(tmp_path: Path) -> None:
    (tmp_path / "8_wait.yaml").write_text(WAIT)
    (tmp_path / "9_ask.yaml").write_text(ASK)
    recordings = tmp_path / "recordings"
    script = NOTEBOOK.format(trees=str(tmp_path), recordings=str(recordings))
    with subprocess.Popen(
        [sys.executable, "-P", "-c", script],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as notebook:
        assert notebook.stdout
        assert notebook.stdout.readline() == "True\n"
        assert notebook.stdout.readline() == "runs\n"
        notebook.send_signal(signal.SIGINT)
        out, err = notebook.communicate(timeout=60)
    assert (out.replace("runs\n", ""), err, notebook.returncode) == (
        "interrupted CANCELED\nTrue\n",
        "",
        0,
    )
    states = []
    for file in sorted(recordings.glob("*.mcap")):
        recording = logs.Recording(file)
        assert recording.complete
        states += [each.state for each in recording.records(logs.Result)]  # type: ignore[union-attr]
    assert states == ["SUCCEEDED", "SUCCEEDED", "CANCELED", "SUCCEEDED"]


def test_moves_without_a_task(arm: Arm) -> None:
    assert arm.move("upright", joint_1="20 deg", joint_4=-0.2).success
    assert arm.move(0, 0, 0.005, relative=True, speed=0.5).success
    assert arm.home().success
    found = arm.where()
    assert found.commanded == {"joint_1": 0.0, "joint_2": 0.0, "joint_3": 0.0, "joint_4": -0.7}
    with pytest.raises(armtree.GoalFailed, match="joint_1 = 100 deg is outside") as failed:
        arm.move(joint_1="100 deg")
    assert failed.value.code == "goal.out_of_bounds"

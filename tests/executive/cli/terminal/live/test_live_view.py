"""The live view: pictures of real runs, and a run in a terminal."""

import io
import math
import os
import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from rich.console import Console

import logs
from executive.api.events import QuestionStatus, Where
from executive.api.outcome import GoalState, Outcome, cause_of
from executive.cli.terminal.live.live_view import LiveView
from executive.cli.terminal.live.run_state import RunState
from executive.cli.terminal.view import Prompt
from executive.errors import GoalCanceled
from hardware import State, load_robot
from tests.end_to_end.test_command_line import robot
from tests.support.command_line.screen import Screen, on_screen
from tests.support.generated import live_pictures
from tests.support.paths import EXAMPLES

__all__ = ["robot"]

SIZES = [(60, 12), (80, 24), (200, 50)]
RED, YELLOW, CYAN, COLOURS = "31", "33", "36", {str(k) for k in range(30, 38)}


@pytest.mark.slow
def test_the_pictures() -> None:
    """After a wanted change: `python -m tests.support.generated.live_pictures`."""
    assert live_pictures.pictures() == live_pictures.TARGET.read_text()


def test_no_line_of_a_picture_is_wider_and_no_picture_higher_than_its_terminal() -> None:
    for section in live_pictures.TARGET.read_text().split("==== ")[1:]:
        title, *lines = section.rstrip("\n").split("\n")
        columns, rows = (int(words.split()[-2]) for words in title.split(",")[-2:])
        assert max(map(len, lines)) <= columns, title
        assert len(lines) < rows, title


def test_times_of_another_clock() -> None:
    """A server on another machine counts its seconds from another moment."""
    now = 5.0
    console = Console(file=io.StringIO(), width=80, height=24)
    view = LiveView(console, lambda: now)
    view.show(logs.Goal(1000.0, "ab" * 16, 1, "pick", 1))
    now = 8.0
    view.show(logs.Feedback(1003.0, "ab" * 16, 5, "executing", ""))
    now = 65.5
    assert "1 min 00 s elapsed" in live_pictures.drawn(view.picture(), (80, 24))
    view.show(Outcome.of(1, GoalState.CANCELED, cause_of(GoalCanceled())))
    now = 100.0
    assert "1 min 00 s elapsed" in live_pictures.drawn(view.picture(), (80, 24))


class Terminal(io.StringIO):
    """Writes to a screen."""

    def __init__(self, screen: Screen) -> None:
        super().__init__()
        self.screen = screen

    def write(self, text: str) -> int:
        self.screen.show(text.replace("\n", "\r\n"))
        return len(text)


@pytest.mark.parametrize(("task", "nodes"), [(1, 1), (logs.MOVE, 0)])
def test_a_move_has_no_tree(task: int, nodes: int) -> None:
    state = RunState().begun(logs.Goal(0.0, "ab" * 16, task, "a", 1))
    state.update(logs.NodeStatus(1.0, "a/ReachPoint", "ReachPoint", "FAILURE", "out of reach"))
    assert len(state.nodes) == nodes


@pytest.mark.slow
def test_a_terminal_that_changes_its_size_shows_one_whole_picture() -> None:
    screen = Screen(80, 24)
    console = Console(file=Terminal(screen), width=80, height=24, force_terminal=True)
    view = LiveView(console, lambda: 0.0)
    view.show("Port virtual")
    assert screen.lines == ["Port virtual", ""]
    for record in live_pictures.events(1, EXAMPLES):
        view.show(record)
        if isinstance(record, logs.Sent):
            size = SIZES[len(screen.pictures) % len(SIZES)]
            console.size = size
            screen.resize(*size)
            view.refresh()
            picture = screen.pictures[-1]
            assert [line.startswith("task 1 pick ") for line in picture].count(True) == 1
            assert picture[0].startswith("task 1 pick ")
            assert any("Execute" in line for line in picture)
    assert len({max(map(len, picture)) for picture in screen.pictures}) > 1
    view.show("Canceling")
    view.refresh()
    assert screen.pictures[-2][-1] == "Port virtual"
    assert screen.pictures[-1][-1] == "Canceling"
    view.show(Outcome.of(1, GoalState.SUCCEEDED, None))
    assert screen.lines[:2] == ["Port virtual", "Canceling"]
    assert screen.lines[2].startswith("task 1 pick ")
    assert [line.startswith("task 1 pick ") for line in screen.lines].count(True) == 1


@pytest.mark.slow
@pytest.mark.parametrize("size", [(10, 2), (20, 4), (300, 6)])
def test_a_tiny_terminal_does_not_scroll(size: tuple[int, int]) -> None:
    screen = Screen(*size)
    console = Console(file=Terminal(screen), width=size[0], height=size[1], force_terminal=True)
    view = LiveView(console, lambda: 0.0)
    for record in live_pictures.events(1, EXAMPLES):
        view.show(record)
    view.show("Canceling: the arm stops")
    view.refresh()
    assert screen.pictures[-1][0].startswith("task 1")
    view.close()


def test_a_question_is_typed_on_the_normal_screen() -> None:
    screen = Screen(80, 24)
    view = LiveView(Console(file=Terminal(screen), width=80, height=24, force_terminal=True))
    view.show(logs.Goal(0.0, "ab" * 16, 1, "pick", 1))
    view.refresh()
    assert screen.lines[0] == "task 1 pick   arm unconfigured"
    view.show(Prompt("? Is the box there? [yes/no]"))
    view.refresh()
    assert screen.lines == ["? Is the box there? [yes/no]", ""]
    assert screen.cursor
    view.show(Prompt(""))
    view.refresh()
    assert screen.lines[0] == "task 1 pick   arm unconfigured"
    question = QuestionStatus(1.0, "12345678", "Ready?", (), True)
    view.show(question)
    view.refresh()
    assert screen.lines[-1] == "? Ready?  (armtree answer 12345678 WORDS)"
    view.show(replace(question, open=False))
    view.refresh()
    assert "Ready?" not in "".join(screen.lines)
    view.close()


def test_the_boot_of_a_server_is_shown_without_a_goal() -> None:
    screen = Screen(80, 24)
    console = Console(file=Terminal(screen), width=80, height=24, force_terminal=True)
    view = LiveView(console, lambda: 0.0)
    view.show(Where.of(load_robot(None), State.INACTIVE, None))
    view.show(logs.Transition(0.0, "activate", "inactive", "activating"))
    view.refresh()
    assert screen.lines[0] == "arm activating"
    assert "the board boots  2.0 s left" in screen.lines[1]
    view.show(logs.Transition(2.0, "transition_success", "activating", "active"))
    view.refresh()
    assert screen.lines == [""]


@pytest.mark.slow
def test_the_angles_at_the_end_are_those_of_the_end_of_the_motion(tmp_path: Path) -> None:
    """The last frame is sent before the motion ends: both are 70 servo degrees."""
    task = "task: 70\nname: end\ndescription: End.\ntree:\n  subtree: move_joints\n"
    (tmp_path / "70_end.yaml").write_text(task + "  with: {joints: {joint_1: 70.9 deg}}\n")
    state = RunState()
    for record in live_pictures.events(70, tmp_path):
        state.update(record)
    assert state.positions["joint_1"] == pytest.approx(math.radians(70.9))


def command(folder: Path, robot: Path, *tasks: str) -> list[str]:
    program = [sys.executable, "-P", "-m", "armtree", "run", *tasks, "--port", "virtual"]
    files = ["--robot", str(robot), "--recordings", str(folder / "recordings")]
    return [*program, *files, "--trees", str(EXAMPLES)]


@pytest.mark.slow
def test_a_run_in_a_terminal(tmp_path: Path, robot: Path) -> None:
    screen = Screen(80, 24)
    assert on_screen(command(tmp_path, robot, "1", "4"), screen, {}) == 0
    for task in "task 1 pick ", "task 4 pick_and_place ":  # each picture replaces the one before
        assert [line.startswith(task) for line in screen.lines].count(True) == 1
    assert [line.partition(" (")[0] for line in screen.lines if "SUCCEEDED" in line] == [
        "task 1 SUCCEEDED",
        "task 4 SUCCEEDED",
    ]
    assert any(line.startswith("joint_1 -80.2 deg") for line in screen.lines)
    assert "b009" not in "\n".join(screen.lines)
    assert screen.cursor
    assert CYAN in screen.styles
    assert RED not in screen.styles


@pytest.mark.slow
def test_without_colours(tmp_path: Path, robot: Path) -> None:
    screen = Screen(80, 24)
    assert on_screen(command(tmp_path, robot, "1"), screen, {"NO_COLOR": "1"}) == 0
    assert not screen.styles & COLOURS
    assert any("━━━" in line and "100 %" in line for line in screen.lines)


@pytest.mark.slow
@pytest.mark.parametrize(
    "environment", [{"TERM": "dumb"}, {"PYTHONUTF8": "0", "PYTHONIOENCODING": "ascii"}]
)
def test_a_terminal_that_cannot_show_pictures_gets_lines(
    tmp_path: Path, robot: Path, environment: dict[str, str]
) -> None:
    screen = Screen(80, 24)
    assert on_screen(command(tmp_path, robot, "1"), screen, environment) == 0
    assert screen.lines[1] == "task 1 pick"
    assert not screen.styles


@pytest.mark.slow
def test_after_ctrl_c_it_is_said_what_became_of_the_run(tmp_path: Path) -> None:
    screen, canceled = Screen(80, 24), False

    def cancel(screen: Screen, process: "subprocess.Popen[bytes]") -> None:
        nonlocal canceled
        if not canceled and any(
            line.startswith("━") and "executing" in line for line in screen.lines
        ):
            canceled = True
            os.kill(process.pid, signal.SIGINT)

    assert on_screen(command(tmp_path, Path("arduinobot"), "4", "1"), screen, {}, cancel) == 7
    shown = "\n".join(screen.lines)
    assert "Canceling: the arm stops." in shown
    assert "task 4 CANCELED" in shown
    assert "  stopped at joint_1 " in shown
    assert not any(line.startswith("joint_") for line in screen.lines)  # where it is, is said once
    assert " frames of its motion" in " ".join(shown.split())
    assert "not started: task 1" in shown
    assert screen.cursor
    assert YELLOW in screen.styles
    assert RED not in screen.styles

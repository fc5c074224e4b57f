"""A task that is taught: its file runs after every step."""

import os
from math import radians
from pathlib import Path

import pytest

from executive.testing import SimulatedArm
from hardware import Robot
from trees import FileError, Library
from trees.check import check
from trees.writing import taught_task
from trees.writing.saved_poses import save_pose
from trees.writing.taught_task import TaughtTask

HERE = {"joint_1": radians(20.0), "joint_2": 0.1, "joint_3": 0.0, "joint_4": -0.7}
LIFTED = HERE | {"joint_2": 0.0}
CLOSED = LIFTED | {"joint_4": 0.0}


@pytest.mark.slow
def test_a_task_is_taught_and_runs(robot: Robot, tmp_path: Path) -> None:
    save_pose(robot, tmp_path, "lifted", {name: LIFTED[name] for name in list(LIFTED)[:3]})
    task = TaughtTask(robot, tmp_path, 5, "fetch")
    assert not task.path.exists()
    taught = [task.move(HERE), task.wait("250 ms"), task.move(LIFTED), task.move(CLOSED)]
    assert [step.words for step in taught if step] == [
        "move to joint_1: 20 deg, joint_2: 5.73 deg, joint_3: 0 deg, open",
        "wait 0.25 s",
        "move to lifted",
        "move to closed",
    ]
    assert task.path == tmp_path / "arduinobot" / "5_fetch.yaml"
    assert task.path.read_text() == (
        "# yaml-language-server: $schema=task.schema.json\n"
        "task: 5\n"
        "name: fetch\n"
        "description: Taught in 4 steps.\n"
        "tree:\n"
        "  sequence:\n"
        "    - subtree: move_joints\n"
        "      with: {joints: {joint_1: 20 deg, joint_2: 5.73 deg, joint_3: 0 deg}}\n"
        "    - subtree: move_joints\n"
        "      with: {joints: open}\n"
        "    - Wait: {duration: 0.25 s}\n"
        "    - subtree: move_joints\n"
        "      with: {joints: lifted}\n"
        "    - subtree: move_joints\n"
        "      with: {joints: closed}\n"
    )
    assert check(robot, tmp_path).mistakes == []
    with SimulatedArm(tmp_path) as arm:
        outcome = arm.run("fetch")
        assert outcome.success, outcome.text()
        assert arm.frames[-1] == "b110,s090,e090,g000,"
        assert any(frame.endswith("g080,") for frame in arm.frames)


def test_the_last_step_is_undone(robot: Robot, tmp_path: Path) -> None:
    task = TaughtTask(robot, tmp_path, 5, "fetch")
    assert task.undo() is None
    task.move(HERE)
    before = task.path.read_text()
    assert task.move(HERE) is None
    task.wait("1")
    last = task.move(CLOSED)
    assert task.undo() is last
    task.undo()
    assert task.path.read_text() == before
    task.undo()
    assert not task.path.exists()
    task.move(CLOSED)  # every joint again
    assert "closed" in task.path.read_text()
    assert task.path.read_text().count("move_joints") == 2


def test_what_exists_is_refused(robot: Robot, tmp_path: Path) -> None:
    for number, name, why in (
        (1, "fetch", "task 1 is in .*1_pick.yaml already; give another number, such as 3$"),
        (5, "pick", "task 1 is called pick already"),
        (
            5,
            "a b",
            "'a b' is not a name; use a letter, then letters, digits, _ or -; did you mean a_b",
        ),
    ):
        with pytest.raises(FileError, match=why):
            TaughtTask(robot, tmp_path, number, name)
    TaughtTask(robot, tmp_path, 5, "fetch").wait("1")
    ways = "already; edit that file, or delete it, or give another number, such as 6$"
    with pytest.raises(FileError, match=rf"task 5 is in .*5_fetch.yaml {ways}"):
        TaughtTask(robot, tmp_path, 5, "other")
    with pytest.raises(FileError, match=rf"5_fetch.yaml: task 5 is here {ways}"):
        TaughtTask(robot, tmp_path, 5, "fetch")
    assert Library(tmp_path).mistakes == []


@pytest.mark.parametrize(
    ("duration", "why"),
    [
        ("x", "'x' is not a duration"),
        ("-1", "-1 s is less than 0 s"),
        ("", "empty"),
        ("{", "brackets"),
        ("5 deg", "5 deg"),
        ("true", "true|True"),
    ],
)
def test_a_wrong_wait_is_refused(robot: Robot, tmp_path: Path, duration: str, why: str) -> None:
    task = TaughtTask(robot, tmp_path, 5, "fetch")
    with pytest.raises(FileError, match=f"^wait: .*{why}"):
        task.wait(duration)
    assert not task.path.exists()


def test_an_arm_with_other_joints_is_refused(robot: Robot, tmp_path: Path) -> None:
    task = TaughtTask(robot, tmp_path, 5, "fetch")
    with pytest.raises(FileError, match="but the arm has joint_1, elbow; give --robot"):
        task.move({"joint_1": 0.0, "elbow": 0.0})


def test_a_step_that_cannot_be_written_is_not_taken(
    robot: Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    task = TaughtTask(robot, tmp_path, 5, "fetch")
    task.move(HERE)
    before = task.path.read_text()

    def full(*_: object) -> None:
        raise OSError(28, os.strerror(28))

    monkeypatch.setattr(taught_task, "write_file", full)
    with pytest.raises(
        FileError, match=r"5_fetch.yaml: cannot be written: No space left on device"
    ):
        task.wait("1")
    assert len(task.steps) == 1
    assert task.path.read_text() == before

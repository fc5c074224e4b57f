"""Progress of a goal: null at first, growing within an attempt, and 100 only with success."""

import dataclasses
from itertools import groupby, pairwise
from pathlib import Path

import pytest

import logs
from executive.api.outcome import GoalState
from hardware import Robot
from hardware.drivers.arduino.firmware_profile import FIRMWARES
from tests.conftest import Rig, RigMaker

REPEAT = """\
task: 15
name: swings
description: There and back, three times.
tree:
  repeat:
    sequence:
      - subtree: reach
        with: {arm: {joint_1: 0.2, joint_2: 0, joint_3: 0}, gripper: {joint_4: 0}}
      - subtree: reach
        with: {arm: {joint_1: -0.2, joint_2: 0, joint_3: 0}, gripper: {joint_4: 0}}
  times: 3
"""

RETRY = """\
task: 16
name: stubborn
description: A motion, and what fails after it, three times.
tree:
  retry:
    sequence:
      - subtree: move_joints
        with: {joints: {joint_1: 20 deg}}
      - subtree: move_joints
        with: {joints: {joint_1: -20 deg}}
      - Fail: {reason: meant}
  attempts: 3
  backoff: 1 s
"""


WAIT = """\
task: 17
name: wait
description: A wait.
tree:
  sequence:
    - Wait: {duration: 1 s}
    - Fail: {reason: meant}
"""


@pytest.fixture
def tasks(tmp_path: Path) -> Path:
    folder = tmp_path / "tasks"
    folder.mkdir()
    (folder / "15_swings.yaml").write_text(REPEAT)
    (folder / "16_stubborn.yaml").write_text(RETRY)
    (folder / "17_wait.yaml").write_text(WAIT)
    return folder


def check(rig: Rig) -> list[logs.Feedback]:
    """Check what holds for every run; returns the recorded progress."""
    reported = rig.recorded(logs.Feedback)
    attempts = [feedback.attempt for feedback in reported]
    assert attempts == sorted(attempts)
    for _, within in groupby(reported, key=lambda feedback: feedback.attempt):
        shares = [feedback.percentage for feedback in within]
        numbers = [share for share in shares if share is not None]
        assert shares[: len(shares) - len(numbers)] == [None] * (len(shares) - len(numbers))
        assert numbers == sorted(numbers)
    for feedback in reported:
        assert (feedback.phase == "planning") == (feedback.percentage is None)
        assert (feedback.percentage == 100) == (feedback.phase == "succeeded")
        assert feedback.node
    return reported


def test_one_motion(rig: RigMaker) -> None:
    arm = rig()
    arm.run(1)
    reported = check(arm)
    assert reported[0].percentage is None
    assert reported[-1].percentage == 100
    frames = len(arm.recorded(logs.Sent))
    executing = {f.percentage for f in reported if f.phase == "executing"}
    assert executing == {min(99, 100 * n // frames) for n in range(frames + 1)}


def test_rounds_of_a_loop(rig: RigMaker, tasks: Path) -> None:
    arm = rig(tasks)
    (outcome,) = arm.run(15)
    assert outcome.success, outcome.message
    reported = check(arm)
    assert {feedback.attempt for feedback in reported} == {1}
    assert reported[-1].percentage == 100
    # Each round is a third, and each motion of a round half of that.
    ends = [f.percentage for f, after in pairwise(reported) if f.node != after.node]
    for share in (16, 33, 50, 66, 83):
        assert any(abs((end or 0) - share) <= 1 for end in ends), (share, ends)


def test_a_retry_is_another_attempt(rig: RigMaker, tasks: Path) -> None:
    arm = rig(tasks)
    (outcome,) = arm.run(16)
    assert outcome.state is GoalState.ABORTED
    reported = check(arm)
    assert {feedback.attempt for feedback in reported} == {1, 2, 3}
    for attempt in (1, 2, 3):
        within = [f.percentage for f in reported if f.attempt == attempt]
        assert max(share or 0 for share in within) >= 95
    assert 100 not in {feedback.percentage for feedback in reported}


def test_acknowledged_frames_count(rig: RigMaker, robot: Robot) -> None:
    arm = rig(robot=dataclasses.replace(robot, firmware=FIRMWARES["armtree"]))
    seen: list[tuple[int, int | None]] = []

    def watch(record: logs.Record) -> None:
        if isinstance(record, logs.Feedback) and record.phase == "executing":
            sent = sum(bool(frame.joints) for frame in arm.recorded(logs.Sent))
            seen.append((sent, record.percentage))

    arm.on_record = watch
    (outcome,) = arm.run(1)
    assert outcome.success
    check(arm)
    total = outcome.frames
    assert all((share or 0) <= 100 * sent // total for sent, share in seen)


def test_a_canceled_goal_keeps_its_progress(rig: RigMaker) -> None:
    arm = rig()

    def watch(record: logs.Record) -> None:
        if isinstance(record, logs.Sent) and len(arm.recorded(logs.Sent)) == 15:
            arm.soon(arm.cancel)

    arm.on_record = watch
    arm.run(1)
    assert (check(arm)[-1].percentage or 0) < 60


def test_a_wait_is_no_planning(rig: RigMaker, tasks: Path) -> None:
    arm = rig(tasks=tasks)
    arm.run(17)
    reported = [(each.percentage, each.phase, each.node) for each in arm.recorded(logs.Feedback)]
    assert reported == [(None, "waiting", "Wait")]

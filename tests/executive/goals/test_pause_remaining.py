"""The rest of a motion after a pause, also of a replay, and when it is refused."""

import json
import math
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import pytest

import logs
from executive.api.outcome import GoalState
from executive.replay.send_again import Replay, _parts
from executive.replay.verification import verify
from hardware import compile_schedule
from tests.conftest import Rig, RigMaker
from tests.executive.goals.test_pause import at_frame, pause_for, running, unpaused

BLOCK = """\
task: 14
name: block
description: Something comes while the arm moves.
tree:
  parallel:
    - subtree: reach
      with: {arm: {joint_1: -1.4, joint_2: 0, joint_3: 0}, gripper: {joint_4: 0}}
    - sequence:
        - Wait: {duration: 0.5 s}
        - AddSphere: {body: ball, radius: 0.05, position: [0.14, 0.03, 0.12]}
"""

REPLAY = """\
task: 15
name: again
description: The frames of a recording.
tree:
  sequence:
    - SKILL: {recording: PATH, part: 0, speed: 1}
"""


@pytest.fixture
def tasks(tmp_path: Path, picked: Path) -> Path:
    folder = tmp_path / "tasks"
    folder.mkdir()
    (folder / "14_block.yaml").write_text(BLOCK)
    again = REPLAY.replace("SKILL", Replay.__name__).replace("PATH", json.dumps(str(picked)))
    (folder / "15_again.yaml").write_text(again)
    return folder


def push(arm: Rig) -> None:
    """Turn the base by 2 degrees without the knowledge of the goal."""
    hardware, degrees = arm.executive._arm, math.radians(2.0)
    first, *others = start = hardware.commanded
    schedule = compile_schedule(
        arm.robot, start, lambda times: [[first + degrees * time, *others] for time in times], 1.0
    )
    hardware.play(schedule, lambda: None, "push", hardware.generation)
    arm.rest(2.0)


def refused(arm: Rig, task: int, meanwhile: Callable[[], None]) -> str:
    """Why a motion is not gone on with after something has happened in a pause."""
    sent: list[int] = []

    def act() -> None:
        arm.executive.pause(running(arm))
        arm.rest(1.0)
        meanwhile()
        sent.append(len(arm.frames))
        arm.executive.resume(running(arm))

    at_frame(arm, 10, act)
    (outcome,) = arm.run(task)
    assert outcome.state is GoalState.ABORTED
    assert outcome.cause
    assert outcome.cause.node.endswith(("/Execute", "/Replay"))
    assert sent == [len(arm.frames)]
    return outcome.code


def test_the_rest_is_refused_if_an_obstacle_appeared(rig: RigMaker, tasks: Path) -> None:
    arm = rig(tasks)
    assert refused(arm, 14, lambda: None) == "plan.motion_collides"
    verification = verify(Path(arm.outcomes[0].recording))
    assert verification.holds, verification.text()


@pytest.mark.parametrize("task", [1, 15])
def test_the_rest_is_refused_if_the_arm_was_moved(rig: RigMaker, tasks: Path, task: int) -> None:
    arm = rig(tasks)
    assert refused(arm, task, lambda: push(arm)) == "plan.start_moved"


@pytest.mark.slow
@pytest.mark.parametrize("number", [1, 10, 30, 31])
def test_a_replay_resumes_from_standstill(rig: RigMaker, tasks: Path, number: int) -> None:
    straight, arm = rig(tasks), rig(tasks)
    straight.run(15)
    at_frame(arm, number, pause_for(arm, 60.0))
    (outcome,) = arm.run(15)
    assert outcome.success, outcome.message
    assert unpaused(arm) == straight.frames
    assert [f for f in arm.frames if f.startswith("(")] == [f"({arm.frames[number - 1]})"]
    verification = verify(Path(outcome.recording))
    assert verification.holds, verification.text()
    (part,) = _parts(Path(outcome.recording), arm.robot.path)
    assert len(part.setpoints) == len(straight.frames)

    first, rest = arm.recorded(logs.Schedule)
    gaps = [b - a for a, b in pairwise(first.times[number - 1 :])]
    slow = [b - a for a, b in pairwise((0.0, *rest.times))]
    ratios = [b / a for a, b in zip(gaps, slow, strict=True)]
    assert ratios == sorted(ratios, reverse=True)
    assert all(ratio >= 1.0 - 1e-9 for ratio in ratios)
    if number == 10:
        assert ratios[0] > 4.0
        assert ratios[-1] == pytest.approx(1.0)

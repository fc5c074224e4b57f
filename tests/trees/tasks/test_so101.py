"""The tasks that ship for the SO-101, on the model of its bus."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from executive.replay.verification import verify
from executive.testing import SimulatedArm
from hardware import load_robot
from logs import Measured, Recording, table
from trees import Library

TASKS = Library(robot="so101").names()


@pytest.fixture(scope="module")
def arm() -> Iterator[SimulatedArm]:
    with SimulatedArm(robot=Path("so101")) as arm:
        yield arm


@pytest.mark.slow
@pytest.mark.parametrize("task", TASKS)
def test_a_task_succeeds(arm: SimulatedArm, task: str) -> None:
    outcome = arm.run(task)
    assert outcome.success, outcome.message
    assert arm.frames


@pytest.mark.slow
def test_a_run_is_verified_and_its_recording_is_small(arm: SimulatedArm) -> None:
    path = Path(arm.run("rest").recording)
    assert path.stat().st_size < 2**20
    verified = verify(path)
    assert verified.holds, verified.text()


@pytest.mark.slow
def test_a_recording_has_the_measured_motion_beside_the_commanded_one(arm: SimulatedArm) -> None:
    path = Path(arm.run("rest").recording)
    commanded, measured = table(path, "/joint_states"), table(path, "/joint_states/measured")
    assert len(measured["time_ns"]) >= len(commanded["time_ns"])
    records = [r for r in Recording(path).records() if isinstance(r, Measured)]
    events = [r for r in arm.records if isinstance(r, Measured)][-len(records) :]
    assert [r.position for r in records] == [r.position for r in events]
    sent = next(r for r in reversed(list(Recording(path).frames())))
    assert records[-1].position == pytest.approx(sent.positions, abs=0.05)


TURN = """
task: 9
name: turn
description: Turn the tool up in place.
tree:
  subtree: move_tool
  with: {point: [0, 0, 0], relative: true, turn: [0, 5 deg, 0]}
"""


@pytest.mark.slow
def test_a_task_turns_the_tool_in_place(tmp_path: Path) -> None:
    (tmp_path / "9_turn.yaml").write_text(TURN)
    with SimulatedArm(tmp_path, robot=Path("so101")) as arm:
        outcome = arm.run(9)
        assert outcome.success, outcome.message
        frames = list(Recording(Path(outcome.recording)).frames())
        robot = load_robot(Path("so101"))
        names = [joint.name for joint in robot.actuated]
        first, last = (
            robot.tool_position(dict(zip(names, each.positions, strict=True)))
            for each in (frames[0], frames[-1])
        )
    assert last == pytest.approx(first, abs=0.002)
    assert frames[0].positions != pytest.approx(frames[-1].positions, abs=0.02)


def test_the_places_are_three() -> None:
    assert set(TASKS) == {"home", "pick", "rest", "wave"}
    poses = {name for file in Library(robot="so101").draft_poses()[0] for name in file.poses}
    assert {"left", "front", "right", "open", "closed"} <= poses

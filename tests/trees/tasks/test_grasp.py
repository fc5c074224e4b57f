"""The SO-101 grasps an object, which blocks its gripper, on the model of its bus."""

import math
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from executive.replay.send_again import write_replay_task
from executive.replay.verification import verify
from executive.session import open_executive
from executive.setup import Setup
from executive.task_runner import TaskRunner
from executive.testing import SharedPool
from hardware import BoardLink, SimulatedClock, load_robot
from hardware.drivers.feetech.virtual.bus import Bus
from logs import Measured, NodeStatus, Recording, Sent
from logs.records.cdr import decode, encode
from tests.support.recordings.alterations import altered, each

_TOPIC, _MEASURED = "/joint_states/measured", "arduinobot_msgs/msg/MeasuredJoints"
SWING = """\
task: 30
name: swing
description: Close the gripper while the arm moves.
tree:
  sequence:
    - subtree: open_gripper
    - SetStart: {start: $start}
    - CheckBounds:
        arm: {shoulder_pan: 40 deg, shoulder_lift: 0, elbow_flex: 0, wrist_flex: 0, wrist_roll: 0}
        gripper: closed
        goal: $goal
    - parallel:
        - PlanArm: {start: $start, goal: $goal, plan: $arm}
        - PlanGripper: {start: $start, goal: $goal, plan: $gripper}
    - Execute: {arm_plan: $arm, gripper_plan: $gripper, together: true}
"""
SQUEEZE = 1.5  # [deg]
SOFT, HARD = 1 / 60, 1.0  # load of a blocked servo for each tick to its goal


def run(setup: Setup, task: int, width: float, most: int = 1000) -> Recording:
    """Runs a task with an object of this width [deg]."""
    robot, clock = load_robot(Path("so101")), SimulatedClock()
    model = robot.model()
    assert isinstance(model, Bus)
    for servo in model.servos:
        servo.put("max_torque", most)
    there = robot.wire_format.encode([0.0] * 5 + [math.radians(width)]).servos[5]
    model.servos[5].stops = there, math.inf
    setup, link = replace(setup, robot=robot), BoardLink(model, clock)
    with (
        closing(SharedPool(robot, 1, clock)) as pool,
        clock.working(),
        open_executive(setup, clock=clock, link=link, pool=pool) as executive,
    ):
        executive.start()
        outcome = TaskRunner(executive).run(task)
        assert outcome.success, outcome.text()
    return Recording(Path(outcome.recording))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("width", "most", "push"),
    [
        (25.0, 1000, SOFT),
        (1.0, 1000, SOFT),
        (6.0, 500, HARD),
    ],
)
def test_a_pick_holds_the_object_and_overloads_no_servo(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, width: float, most: int, push: float
) -> None:
    monkeypatch.setattr("hardware.drivers.feetech.virtual.servo._PUSH", push)
    recording = run(Setup(recordings=tmp_path, single_user=True), 1, width, most)
    nodes = [r for r in recording.records(NodeStatus) if isinstance(r, NodeStatus)]
    said = [node.message for node in nodes if "the gripper holds an object" in node.message]
    _, holds = positions(recording)
    loosened = width > SQUEEZE or push == HARD  # else the end of the motion is near enough
    assert (len(said), len(holds) >= 3) == (3 * loosened, loosened)
    for q in holds:
        assert width - SQUEEZE - 0.2 <= q <= width
    verified = verify(recording.path)
    assert verified.holds, verified.text()
    if width > SQUEEZE:  # without the object that was measured, these frames are wrong
        elsewhere = altered(recording.path, each([_TOPIC], measured_closed))
        assert "does not repeat" in verify(elsewhere).text()


@pytest.fixture(scope="module")
def gripped(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    """A pick of objects with a width of 25 deg."""
    folder = tmp_path_factory.mktemp("gripped")
    return run(Setup(recordings=folder, single_user=True), 1, 25.0)


@pytest.mark.slow
@pytest.mark.parametrize("width", [25.0, 20.0, 1.0])
def test_a_run_that_gripped_is_sent_again(tmp_path: Path, gripped: Recording, width: float) -> None:
    """The object may be larger or smaller, or missing. The gripper then holds it elsewhere."""
    number = write_replay_task(gripped.path, 1.0, load_robot(Path("so101")), tmp_path)
    again = run(Setup(recordings=tmp_path, trees=tmp_path, single_user=True), number, width)
    (then, _), (now, holds) = positions(gripped), positions(again)
    assert {q[:5] for q in now} <= {q[:5] for q in then}
    assert now[-1][:5] == then[-1][:5]
    assert (now == then) == (width == 25.0)
    assert len(holds) == (0 if width == 1.0 else 3)
    for q in holds:
        assert width - SQUEEZE - 0.2 <= q <= width
    verified = verify(again.path)
    assert verified.holds, verified.text()


def positions(recording: Recording) -> tuple[list[tuple[float, ...]], list[float]]:
    """The commanded positions of a run, and those of the gripper where it was loosened [deg]."""
    sent = [r for r in recording.records(Sent) if isinstance(r, Sent) and r.joints]
    holds = [math.degrees(r.positions[5]) for r in sent if r.hold]
    return [r.positions for r in sent if not r.hold], holds


def measured_closed(record: Any) -> None:
    """Changes a measurement: the gripper is closed."""
    measured = decode(_MEASURED, record.data)
    measured.position = [*list(measured.position)[:5], math.radians(-9)]
    record.data = encode(_MEASURED, measured)


@pytest.mark.slow
def test_a_gripper_that_pushes_in_a_pause_is_loosened_and_the_task_goes_on(tmp_path: Path) -> None:
    paused_while_it_pushes(Setup(recordings=tmp_path, single_user=True), 1)


@pytest.mark.slow
def test_a_pause_of_arm_and_gripper_while_it_grips(tmp_path: Path) -> None:
    (tmp_path / "30_swing.yaml").write_text(SWING)
    setup = Setup(recordings=tmp_path, single_user=True, trees=tmp_path)
    recording = paused_while_it_pushes(setup, 30)
    *_, last = (r for r in recording.records(Sent) if isinstance(r, Sent) and r.joints)
    pan, gripper = (math.degrees(last.positions[k]) for k in (0, 5))
    assert pan == pytest.approx(40.0, abs=0.1)  # a tick
    assert 25.0 - SQUEEZE - 0.2 <= gripper <= 25.0
    nodes = [r for r in recording.records(NodeStatus) if isinstance(r, NodeStatus)]
    assert any("the gripper holds an object" in node.message for node in nodes)


@pytest.mark.slow
def test_a_pause_while_frames_of_arm_and_gripper_are_sent_again(tmp_path: Path) -> None:
    (tmp_path / "30_swing.yaml").write_text(SWING)
    setup = Setup(recordings=tmp_path, single_user=True, trees=tmp_path)
    swung = run(setup, 30, 25.0)
    number = write_replay_task(swung.path, 1.0, load_robot(Path("so101")), tmp_path)
    again = paused_while_it_pushes(setup, number)
    assert positions(again)[0][-1][:5] == positions(swung)[0][-1][:5]


def paused_while_it_pushes(setup: Setup, task: int) -> Recording:
    """Runs a task, and pauses it for a while when the gripper pushes against an object."""
    robot, clock = load_robot(Path("so101")), SimulatedClock()
    model = robot.model()
    assert isinstance(model, Bus)
    there = robot.wire_format.encode([0.0] * 5 + [math.radians(25.0)]).servos[5]
    model.servos[5].stops = there, math.inf
    signal, pushed = clock.signal(), list[float]()
    measured, left = [0.0], list[float]()

    def watch(event: Any) -> None:
        if isinstance(event, Measured):
            measured[0] = event.position[5]
        if isinstance(event, Sent) and event.joints:
            push = math.degrees(measured[0] - event.positions[5])
            if push > 2.5 * SQUEEZE and not pushed:
                pushed.append(push)
                clock.spawn(pause, "pause")
            left[:] = [push]

    def pause() -> None:
        goal = executive.status().goal
        assert goal
        executive.pause(goal.identity)
        until = clock.now() + 2.0
        with signal:
            while clock.now() < until:
                signal.wait(until)
        pushed.append(*left)
        executive.resume(goal.identity)

    setup = replace(setup, robot=robot)
    link = BoardLink(model, clock)
    with (
        closing(SharedPool(robot, 1, clock)) as pool,
        clock.working(),
        open_executive(setup, clock=clock, link=link, pool=pool, subscriber=watch) as executive,
    ):
        executive.start()
        outcome = TaskRunner(executive).run(task)
        assert outcome.success, outcome.text()
    before, after = pushed
    assert after < SQUEEZE + 0.2 < before
    verified = verify(Path(outcome.recording))
    assert verified.holds, verified.text()
    return Recording(Path(outcome.recording))

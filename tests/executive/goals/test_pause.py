"""Goals that are paused, stepped through and gone on with: the arm, the recording, the time."""

import dataclasses
from collections.abc import Callable
from functools import partial
from itertools import pairwise
from pathlib import Path

import pytest

import logs
from executive.api import Policy
from executive.api.outcome import GoalState
from executive.errors import NotExecuting, NotPaused, TooManyBreakpoints, UnknownGoal
from executive.executive import BREAKPOINTS
from executive.replay.verification import verify
from hardware import Robot, SimulatedClock
from logs.views.narrative import narrative
from logs.views.timeline import timeline
from skills.motion import Pool
from tests.conftest import Rig, RigMaker

ROUND = """\
task: 12
name: round
description: By way of a point between, with the gripper.
tree:
  sequence:
    - SetStart: {start: $start}
    - CheckBounds:
        arm: {joint_1: 0.6, joint_2: 0.3, joint_3: -0.4}
        gripper: {joint_4: -0.5}
        goal: $goal
    - parallel:
        - PlanArm:
            start: $start
            goal: $goal
            via: [{joint_1: 0.5, joint_2: -0.2, joint_3: 0.1}]
            plan: $arm
        - PlanGripper: {start: $start, goal: $goal, plan: $gripper}
    - Execute: {arm_plan: $arm, gripper_plan: $gripper, together: TOGETHER}
"""

WAITING = """\
task: 13
name: waiting
description: A time-out around a wait.
tree:
  timeout:
    Wait: {duration: 1.5 s}
  after: 2 s
"""


@pytest.fixture
def tasks(tmp_path: Path) -> Path:
    folder = tmp_path / "tasks"
    folder.mkdir()
    return folder


def at_frame(rig: Rig, number: int, act: Callable[[], None]) -> None:
    """Do something, on another thread, when that many frames were sent."""

    def watch(record: logs.Record) -> None:
        if isinstance(record, logs.Sent) and len(rig.recorded(logs.Sent)) == number:
            rig.soon(act)

    rig.on_record = watch


def running(rig: Rig) -> str:
    status = rig.executive.status().goal
    assert status
    return status.identity


def pause_for(rig: Rig, seconds: float) -> Callable[[], None]:
    def act() -> None:
        goal = running(rig)
        rig.executive.pause(goal)
        resume_after(rig, goal, seconds)

    return act


def resume_after(rig: Rig, goal: str, seconds: float) -> None:
    rig.rest(seconds)
    assert rig.executive.status().paused
    rig.executive.resume(goal)


def unpaused(rig: Rig) -> list[str]:
    """The frames without holds."""
    return [frame for frame in rig.frames if not frame.startswith("(")]


@pytest.mark.slow
@pytest.mark.parametrize("number", [1, 2, 9, 17, 30, 31])
def test_a_pause_at_a_frame(rig: RigMaker, number: int) -> None:
    straight, arm = rig(), rig()
    straight.run(1)
    at_frame(arm, number, pause_for(arm, 60.0))
    (outcome,) = arm.run(1)
    assert outcome.success, outcome.message
    assert arm.frames[-1].strip("()") == straight.frames[-1]
    held = [frame for frame in arm.frames if frame.startswith("(")]
    assert held == [f"({arm.frames[number - 1]})"]
    first, *others = arm.recorded(logs.Schedule)
    assert first.resumed is None
    assert [schedule.resumed is None for schedule in others] == [False]
    times = [sent.time for sent in arm.recorded(logs.Sent)]
    assert max(b - a for a, b in pairwise(times)) > 59.999 or number == 31
    verification = verify(Path(outcome.recording))
    assert verification.holds, verification.text()


def test_a_pause_is_recorded_and_drawn(rig: RigMaker) -> None:
    arm = rig()
    at_frame(arm, 9, pause_for(arm, 4.0))
    (outcome,) = arm.run(1)
    path = Path(outcome.recording)
    reported = [
        (time, words) for time, words in narrative(path, False) if words in ("paused", "resumed")
    ]
    assert [words for _, words in reported] == ["paused", "resumed"]
    assert reported[1][0] - reported[0][0] == pytest.approx(4.0, abs=0.1)
    marks = [mark for mark in timeline(path).marks if mark[1] in ("paused", "resumed")]
    assert [words for _, words in marks] == [words for _, words in reported]
    assert [time for time, _ in marks] == pytest.approx([time for time, _ in reported])


@pytest.mark.slow
@pytest.mark.parametrize("together", ["true", "false"])
@pytest.mark.parametrize("number", [3, 11, 19, 28, 40])
def test_a_pause_round_a_corner(rig: RigMaker, tasks: Path, together: str, number: int) -> None:
    (tasks / "12_round.yaml").write_text(ROUND.replace("TOGETHER", together))
    straight, arm = rig(tasks), rig(tasks)
    straight.run(12)
    if number > len(straight.frames):
        number = len(straight.frames) - 2
    at_frame(arm, number, pause_for(arm, 5.0))
    (outcome,) = arm.run(12)
    assert outcome.success, outcome.message
    assert arm.frames[-1] == straight.frames[-1]
    verification = verify(Path(outcome.recording))
    assert verification.holds, verification.text()


@pytest.mark.slow
def test_many_pauses(rig: RigMaker, tasks: Path) -> None:
    (tasks / "12_round.yaml").write_text(ROUND.replace("TOGETHER", "false"))
    straight, arm = rig(tasks), rig(tasks)
    straight.run(12)

    def watch(record: logs.Record) -> None:
        if isinstance(record, logs.Sent) and not record.hold and len(unpaused(arm)) % 4 == 0:
            arm.soon(pause_for(arm, 1.0))

    arm.on_record = watch
    (outcome,) = arm.run(12)
    assert outcome.success, outcome.message
    assert arm.frames[-1].strip("()") == straight.frames[-1]  # a pause may come after it
    assert len(arm.recorded(logs.Schedule)) > 5
    reported = [f.percentage for f in arm.recorded(logs.Feedback) if f.percentage is not None]
    assert reported == sorted(reported)
    assert reported.count(100) == 1
    assert "paused" in {feedback.phase for feedback in arm.recorded(logs.Feedback)}
    verification = verify(Path(outcome.recording))
    assert verification.holds, verification.text()


def test_a_pause_with_a_brake(
    robot: Robot, shared_clock: SimulatedClock, shared_pool: Pool, tmp_path: Path
) -> None:
    arm = Rig(dataclasses.replace(robot, brake=0.5), shared_clock, shared_pool, tmp_path)
    at_frame(arm, 10, pause_for(arm, 0.1))  # it still slows down when it is gone on with
    (outcome,) = arm.run(1)
    assert outcome.success, outcome.message
    assert arm.frames[-1] == "b009,s125,e085,g000,"
    assert arm.frames.index(next(f for f in arm.frames if f.startswith("("))) > 10
    verification = verify(Path(outcome.recording))
    assert verification.holds, verification.text()


def test_the_rest_of_a_motion_starts_from_standstill(rig: RigMaker) -> None:
    arm = rig()
    at_frame(arm, 15, pause_for(arm, 1.0))
    arm.run(1)
    _, again = arm.recorded(logs.Schedule)
    steps = [
        max(abs(b - a) for a, b in zip(one, other, strict=True))
        for one, other in pairwise(again.samples)
    ]
    times = again.sample_times
    first_speed = steps[0] / (times[1] - times[0])
    assert first_speed < 0.5 * max(steps) / (times[1] - times[0])


def test_a_cancel_while_paused(rig: RigMaker) -> None:
    arm = rig()

    def act() -> None:
        arm.executive.pause(running(arm))
        arm.rest(3.0)
        arm.cancel()

    at_frame(arm, 10, act)
    (outcome,) = arm.run(1)
    assert outcome.state is GoalState.CANCELED
    assert arm.frames[-1] == f"({arm.frames[-2]})"
    assert len(arm.frames) == 11


def test_unplugged_while_paused(rig: RigMaker) -> None:
    arm = rig()

    def act() -> None:
        arm.executive.pause(running(arm))
        arm.rest(3.0)
        arm.link.unplug()

    at_frame(arm, 10, act)
    (outcome,) = arm.run(1)
    assert outcome.code == "hw.port_lost"


@pytest.mark.parametrize("node", ["PlanArm", "PlanGripper", "Execute"])
def test_a_pause_before_it_moves(rig: RigMaker, node: str) -> None:
    straight, arm = rig(), rig()
    straight.run(1)

    def watch(record: logs.Record) -> None:
        if isinstance(record, logs.NodeStatus) and (record.name, record.status) == (
            node,
            "RUNNING",
        ):
            arm.on_record = lambda _: None
            goal = running(arm)
            arm.executive.pause(goal)  # on the thread of the tree, so that no frame comes first
            arm.soon(partial(resume_after, arm, goal, 30.0))

    arm.on_record = watch
    (outcome,) = arm.run(1)
    assert outcome.success, outcome.message
    assert arm.frames == straight.frames


def test_timeouts_are_paused(rig: RigMaker, tasks: Path) -> None:
    (tasks / "13_waiting.yaml").write_text(WAITING)
    arm = rig(tasks)

    def watch(record: logs.Record) -> None:
        if isinstance(record, logs.NodeStatus) and record.name == "Wait":
            arm.on_record = lambda _: None
            arm.soon(pause_for(arm, 60.0))

    arm.on_record = watch
    (outcome,) = arm.run(13)
    assert outcome.success, outcome.message
    assert outcome.duration == pytest.approx(2.0 + 1.5 + 60.0)


def test_steps(rig: RigMaker) -> None:
    arm = rig()
    begun: list[list[str]] = []

    def begins() -> list[str]:
        """Started nodes, and those at a breakpoint."""
        last = {node.name: node for node in arm.recorded(logs.NodeStatus)}
        return [n for n, node in last.items() if node.message == "waits to begin"]

    def watch(record: logs.Record) -> None:
        if isinstance(record, logs.Feedback) and record.phase == "paused":
            begun.append(begins())
            arm.soon(lambda: arm.executive.step(record.goal_id))

    arm.on_record = watch
    arm.executive.break_at("pick")
    (outcome,) = arm.run(1)
    assert outcome.success, outcome.message
    assert arm.executive.status().breakpoints == ("pick",)
    planners = ["PlanArm", "PlanGripper"]
    assert begun == [["SetStart"], ["CheckBounds"], planners, ["Execute"], ["Succeed"]]


def test_a_breakpoint(rig: RigMaker) -> None:
    arm = rig()
    held: list[int] = []

    def act() -> None:
        arm.rest(5.0)
        held.append(len(arm.frames))
        arm.executive.resume(running(arm))

    def watch(record: logs.Record) -> None:
        if isinstance(record, logs.Feedback) and record.phase == "paused":
            arm.soon(act)

    arm.on_record = watch
    arm.executive.break_at("pick/Execute")
    arm.executive.break_at("pick/PlanArm")
    arm.executive.break_at("pick/PlanArm", on=False)
    arm.executive.break_at("nowhere")
    (outcome,) = arm.run(1)
    assert outcome.success
    assert held == [0]


def test_breakpoints_are_limited(rig: RigMaker) -> None:
    arm = rig()
    paths = [f"pick/{number}" for number in range(BREAKPOINTS)]
    for path in (*paths, *paths):
        arm.executive.break_at(path)
    with pytest.raises(TooManyBreakpoints, match="100 breakpoints"):
        arm.executive.break_at("pick/Execute")
    arm.executive.break_at(paths[0], on=False)
    arm.executive.break_at("pick/Execute")


def test_invalid_requests_are_refused(rig: RigMaker) -> None:
    arm = rig()
    refused: list[type[Exception]] = []

    def watch(record: logs.Record) -> None:
        if isinstance(record, logs.Sent) and not refused:
            for act in (arm.executive.resume, arm.executive.step):
                with pytest.raises(NotPaused) as caught:
                    act(running(arm))
                refused.append(caught.type)

    arm.on_record = watch
    arm.run(1)
    assert refused == [NotPaused, NotPaused]
    (status,) = arm.executive.goals()
    for act in (arm.executive.pause, arm.executive.resume, arm.executive.step):
        with pytest.raises(NotExecuting, match="is SUCCEEDED"):
            act(status.identity)
        with pytest.raises(UnknownGoal):
            act("f" * 32)


def test_a_paused_goal_gives_way(server: RigMaker) -> None:
    arm = server(policy=Policy.PREEMPT)

    def act() -> None:
        arm.on_record = lambda _: None
        arm.executive.pause(running(arm))
        arm.rest(2.0)
        arm.executive.send(0)

    at_frame(arm, 10, act)
    first = arm.executive.send(1).identity
    assert arm.executive.result(first).code == "goal.preempted"
    assert arm.executive.result(arm.executive.goals()[-1].identity).success
    assert not arm.executive.status().paused


def test_a_step_in_the_middle_of_a_motion_ends_before_the_next_skill(rig: RigMaker) -> None:
    arm = rig()
    waited: list[str] = []

    def act() -> None:
        goal = running(arm)
        arm.executive.pause(goal)
        arm.rest(1.0)
        arm.executive.step(goal)

    def watch(record: logs.Record) -> None:
        if isinstance(record, logs.Sent) and len(arm.recorded(logs.Sent)) == 10:
            arm.soon(act)
        if isinstance(record, logs.NodeStatus) and record.message == "waits to begin":
            waited.append(record.name)
            arm.soon(lambda: arm.executive.resume(running(arm)))

    arm.on_record = watch
    (outcome,) = arm.run(1)
    assert outcome.success
    assert waited == ["Succeed"]


def test_a_running_step_can_be_resumed(rig: RigMaker) -> None:
    arm = rig()

    def act() -> None:
        goal = running(arm)
        arm.executive.pause(goal)
        arm.executive.step(goal)
        with pytest.raises(NotPaused):
            arm.executive.step(goal)
        arm.executive.resume(goal)
        with pytest.raises(NotPaused):
            arm.executive.resume(goal)

    def watch(record: logs.Record) -> None:
        if isinstance(record, logs.Sent) and len(arm.recorded(logs.Sent)) == 10:
            arm.soon(act)

    arm.on_record = watch
    (outcome,) = arm.run(1)
    assert outcome.success
    assert "waits to begin" not in {node.message for node in arm.recorded(logs.NodeStatus)}

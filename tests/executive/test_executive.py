"""Whole runs on the in-process board, in simulated time: frames, events and recordings."""

import dataclasses
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import pytest
from mcap.reader import make_reader

import logs
from executive.api.outcome import GoalState
from hardware import Robot, SimulatedClock
from hardware.drivers.arduino.firmware_profile import FIRMWARES
from skills.motion import NoPath, Pool, Query, Result
from tests.conftest import Rig, RigMaker

REACH = """\
task: {number}
name: {name}
description: A reach.
tree:
  subtree: reach
  with:
    arm: {{joint_1: {arm[0]}, joint_2: {arm[1]}, joint_3: {arm[2]}}}
    gripper: {{joint_4: {gripper}}}
"""


def reach(folder: Path, number: int, arm: tuple[float, ...], gripper: float = 0.0) -> Path:
    """Write a task file; returns its folder."""
    text = REACH.format(number=number, name=f"reach{number}", arm=arm, gripper=gripper)
    (folder / f"{number}_reach{number}.yaml").write_text(text)
    return folder


@pytest.fixture
def tasks(tmp_path: Path) -> Path:
    folder = tmp_path / "tasks"
    folder.mkdir()
    return folder


def percentages(rig: Rig) -> list[int]:
    return [f.percentage for f in rig.recorded(logs.Feedback) if f.percentage is not None]


def last_frames(recordings: list[str]) -> list[bytes]:
    """The last message on /serial/tx of every file, read by the stock reader."""
    ends = []
    for path in recordings:
        with open(path, "rb") as stream:
            messages = make_reader(stream).iter_messages(topics=["/serial/tx"])
            ends.append([message.data for _, _, message in messages][-1])
    return ends


# What is done


def test_the_four_tasks(rig: RigMaker) -> None:
    arm = rig()
    outcomes = arm.run(0, 1, 2, 0)
    assert [outcome.state for outcome in outcomes] == [GoalState.SUCCEEDED] * 4
    assert arm.outcomes == outcomes
    assert arm.opened == 1
    ends = (b"b090,s090,e090,g080,", b"b009,s125,e085,g000,", b"b000,s090,e038,g000,")
    for end, data in zip(
        (*ends, ends[0]), last_frames([outcome.recording for outcome in outcomes]), strict=True
    ):
        assert end in data
    assert [record.state for record in arm.recorded(logs.Result)] == ["SUCCEEDED"] * 4
    assert arm.recorded(logs.Transition)[-1].goal == "finalized"


def test_success_is_reported_when_the_board_has_finished(rig: RigMaker) -> None:
    arm = rig()
    ended: list[tuple[float, ...]] = []
    arm.on_record = lambda record: (
        ended.append(arm.link.board.state(arm.clock.now()).servos)
        if isinstance(record, logs.Result)
        else None
    )
    arm.run(1)
    assert ended == [(9.0, 125.0, 85.0, 0.0)]


def test_the_gripper_moves_when_the_arm_has_arrived(rig: RigMaker, tasks: Path) -> None:
    arm = rig(reach(tasks, 10, (0.2, 0.0, 0.0), -0.3))
    arm.run(10)
    turned = [{frame[:4], frame[15:19]} for frame in arm.frames]
    moving = ["b" if now[:4] != before[:4] else "g" for before, now in pairs(arm.frames)]
    assert turned
    assert moving == sorted(moving)
    assert {"b", "g"} == set(moving)


def pairs(frames: list[str]) -> list[tuple[str, str]]:
    return list(pairwise(frames))


TOGETHER = """\
task: 11
name: together
description: Arm and gripper at once.
tree:
  sequence:
    - SetStart: {start: $start}
    - CheckBounds: {arm: {joint_1: 0.2, joint_2: 0, joint_3: 0}, gripper: {joint_4: -0.2}, goal: $g}
    - PlanArm: {start: $start, goal: $g, plan: $arm_plan}
    - PlanGripper: {start: $start, goal: $g, plan: $gripper_plan}
    - Execute: {arm_plan: $arm_plan, gripper_plan: $gripper_plan, together: true}
"""


def test_together_moves_both_at_once(rig: RigMaker, tasks: Path) -> None:
    (tasks / "11_together.yaml").write_text(TOGETHER)
    arm = rig(tasks)
    assert arm.run(11)[0].success
    both = [
        1 for before, now in pairs(arm.frames) if before[:4] != now[:4] and before[15:] != now[15:]
    ]
    assert both


def test_the_same_goal_twice_gives_the_same_bytes(rig: RigMaker) -> None:
    first, second = rig(), rig()
    first.run(1)
    second.run(1)
    assert first.frames == second.frames
    due = [[sent.scheduled for sent in r.recorded(logs.Sent)] for r in (first, second)]
    starts = [d[0] for d in due if d[0] is not None]
    assert [round(t - starts[0], 9) for t in due[0] if t is not None] == [
        round(t - starts[1], 9) for t in due[1] if t is not None
    ]


def test_a_goal_at_the_current_pose_sends_nothing(rig: RigMaker, tasks: Path) -> None:
    arm = rig(reach(tasks, 10, (0.0, 0.0, 0.0), 0.0))
    (outcome,) = arm.run(10)
    assert outcome.success
    assert (arm.frames, outcome.frames) == ([], 0)
    assert percentages(arm)[-1] == 100


def test_a_task_again_sends_nothing(rig: RigMaker) -> None:
    arm = rig()
    outcomes = arm.run(1, 1)
    assert [outcome.success for outcome in outcomes] == [True, True]
    assert outcomes[1].frames == 0


@pytest.mark.parametrize("number", [0, 1, 2])
def test_progress_only_grows_and_100_means_done(rig: RigMaker, number: int) -> None:
    arm = rig()
    arm.run(number)
    reported = percentages(arm)
    assert reported == sorted(reported)
    assert reported.count(100) == 1
    assert arm.recorded(logs.Feedback)[-1].phase == "succeeded"
    assert len(set(reported)) > 15
    planning = [f.percentage for f in arm.recorded(logs.Feedback) if f.phase == "planning"]
    assert planning
    assert set(planning) == {None}


TWICE = """\
task: 12
name: twice
description: There and back.
tree:
  sequence:
    - subtree: reach
      with: {arm: {joint_1: 0.2, joint_2: 0, joint_3: 0}, gripper: {joint_4: 0}}
    - subtree: reach
      with: {arm: {joint_1: 0, joint_2: 0, joint_3: 0}, gripper: {joint_4: 0}}
"""


def test_progress_of_two_motions(rig: RigMaker, tasks: Path) -> None:
    (tasks / "12_twice.yaml").write_text(TWICE)
    arm = rig(tasks)
    (outcome,) = arm.run(12)
    assert outcome.success
    reported = percentages(arm)
    assert reported == sorted(reported)
    assert 49 <= reported[len(reported) // 2] <= 60
    paths = [node.path for node in arm.recorded(logs.NodeStatus)]
    assert {"twice/reach/Execute", "twice/1:reach/Execute"} <= set(paths)


# What is refused


def test_an_unknown_task(rig: RigMaker) -> None:
    arm = rig()
    (outcome,) = arm.run(77)
    assert (outcome.state, outcome.code) == (GoalState.ABORTED, "goal.unknown_task")
    assert outcome.message == "Invalid task number 77; there are 0, 1, 2"
    assert not outcome.success
    assert (arm.opened, arm.frames, arm.recorded(logs.Transition)) == (0, [], [])
    assert Path(outcome.recording).exists()


def test_all_tasks_are_validated_before_the_first_moves(rig: RigMaker) -> None:
    arm = rig()
    outcomes = arm.run(1, 7)
    assert [(outcome.task, outcome.code) for outcome in outcomes] == [(7, "goal.unknown_task")]
    assert arm.opened == 0


def test_a_target_out_of_bounds_names_every_joint(rig: RigMaker, tasks: Path) -> None:
    arm = rig(reach(tasks, 10, (2.0, 0.0, -3.0), 0.5))
    (outcome,) = arm.run(10)
    assert (outcome.state, outcome.code) == (GoalState.ABORTED, "goal.out_of_bounds")
    assert outcome.message.startswith("Target position out of boundaries: ")
    for word in (
        "joint_1 = 114.59 deg",
        "joint_3 = -171.89 deg",
        "joint_4 = 28.648 deg",
        "-90 deg to 90",
    ):
        assert word in outcome.message
    assert "joint_2" not in outcome.message
    assert arm.opened == 0


@pytest.mark.parametrize("value", [".nan", ".inf", "-.inf", "1e9", "1e308"])
def test_no_number_is_too_odd_to_be_refused(rig: RigMaker, tasks: Path, value: str) -> None:
    text = REACH.format(number=10, name="odd", arm=(value, 0, 0), gripper=0)
    (tasks / "10_odd.yaml").write_text(text)
    arm = rig(tasks)
    (outcome,) = arm.run(10)
    assert outcome.code == "goal.out_of_bounds"
    assert "joint_1" in outcome.message
    assert arm.opened == 0


def test_a_mimic_joint_that_contradicts_its_leader(rig: RigMaker, tasks: Path) -> None:
    text = REACH.format(number=10, name="twist", arm=(0, 0, 0), gripper="-0.7, joint_5: 0.6")
    (tasks / "10_twist.yaml").write_text(text)
    arm = rig(tasks)
    (outcome,) = arm.run(10)
    assert outcome.code == "goal.bad_target"
    assert "joint_5 = 34.377 deg contradicts joint_4 = -40.107 deg" in outcome.message
    assert arm.opened == 0


def test_a_wrong_file(rig: RigMaker, tasks: Path) -> None:
    (tasks / "10_wrong.yaml").write_text("task: 10\nname: wrong\ndescription: x\ntree: Sukseed\n")
    arm = rig(tasks)
    (outcome,) = arm.run(10)
    assert (outcome.state, outcome.code) == (GoalState.ABORTED, "file.task")
    assert "10_wrong.yaml:4:7: no skill Sukseed" in outcome.message
    assert "did you mean Succeed?" in outcome.message
    assert arm.opened == 0


@pytest.mark.parametrize(
    ("wrong", "settings", "code", "words"),
    [
        ("", ["far=1"], "ok", ""),
        ("", [], "goal.bad_arguments", "arguments: the parameter far must be given"),
        ("", ["far=yes"], "goal.bad_arguments", "--set far=yes: far: 'yes' is not a number"),
        ("", ["far=1,5"], "goal.bad_arguments", "--set far=1,5: far: '1,5' is not a number"),
        (
            "",
            ["far=1", "near=2"],
            "goal.bad_arguments",
            "near is not a parameter of task 10; there is only far",
        ),
        ("Sukseed", ["far=yes"], "file.task", "no skill Sukseed"),
    ],
)
def test_who_is_to_blame_for_arguments(
    rig: RigMaker, tasks: Path, wrong: str, settings: list[str], code: str, words: str
) -> None:
    (tasks / "10_far.yaml").write_text(
        "task: 10\nname: far\ndescription: x\nparameters: {far: {type: number}}\n"
        f"tree:\n  sequence: [Wait: {{duration: $far}}, {wrong or 'Succeed'}]\n"
    )
    (outcome,) = rig(tasks).run(10, settings=settings)
    assert outcome.code == code, outcome.message
    assert words in outcome.message
    assert not outcome.cause or "armtree check" not in outcome.cause.hint or code == "file.task"
    started = code not in ("goal.bad_arguments", "file.task")
    assert (bool(outcome.recording), "not started" in outcome.text()) == (started, not started)


def test_both_planners_fail(rig: RigMaker, tasks: Path) -> None:
    arm = rig(reach(tasks, 10, (0.0, -1.5, 0.0)))
    (outcome,) = arm.run(10)
    assert outcome.state is GoalState.ABORTED
    assert outcome.code == "plan.goal_in_collision"
    head, _, causes = outcome.message.partition(": ")
    assert head == "One or more planners failed"
    assert causes.startswith("PlanArm, PlanGripper: At the goal, ")
    assert causes.count("At the goal, ") == 1
    plans = arm.recorded(logs.Plan)
    assert [(plan.group, bool(plan.code)) for plan in plans] == [("arm", True), ("gripper", True)]
    assert arm.frames == []


class OneFails:
    """Planners of which one finds nothing at once, and the other takes its time."""

    def __init__(self, pool: Pool, clock: SimulatedClock, fails: str) -> None:
        self._pool, self._clock, self._fails = pool, clock, fails

    def start(self) -> None:
        self._pool.start()

    def submit(self, request: Query, done: Callable[[Result], None]) -> None:
        def fail() -> None:
            done(NoPath(9, 1, 3, 2))

        def plan() -> None:
            signal = self._clock.signal()
            with signal:
                signal.wait(self._clock.now() + 0.5)
            self._pool.submit(request, done)

        self._clock.spawn(fail if request.group == self._fails else plan, "planner")


@pytest.mark.parametrize(("fails", "name"), [("arm", "PlanArm"), ("gripper", "PlanGripper")])
def test_one_planner_fails(
    rig: RigMaker, shared_pool: Pool, shared_clock: SimulatedClock, fails: str, name: str
) -> None:
    arm = rig(pool=OneFails(shared_pool, shared_clock, fails))
    (outcome,) = arm.run(1)
    assert (outcome.state, outcome.code) == (GoalState.ABORTED, "plan.no_path")
    assert outcome.message == f"One or more planners failed: {name}: {NoPath(9, 1, 3, 2)}"
    ended = {plan.group: plan.code for plan in arm.recorded(logs.Plan)}
    assert ended == {"arm": "", "gripper": "", fails: "plan.no_path"}
    assert arm.frames == []


def test_a_planner_out_of_time(rig: RigMaker) -> None:
    arm = rig(planning_timeout=1e-9)
    (outcome,) = arm.run(1)
    assert (outcome.state, outcome.code) == (GoalState.ABORTED, "plan.timeout")
    assert outcome.message.startswith("One or more planners failed: PlanArm, PlanGripper: ")
    assert arm.frames == []


def test_a_folder_for_recordings_that_cannot_be_made(rig: RigMaker, tmp_path: Path) -> None:
    arm = rig()
    arm.executive._recordings._folder = tmp_path / "file"
    (tmp_path / "file").write_text("")
    (outcome,) = arm.run(1)
    assert outcome.code == "log.not_created"
    assert arm.opened == 0


def test_a_failed_task_ends_the_sequence(rig: RigMaker, tasks: Path) -> None:
    arm = rig(reach(tasks, 10, (0.0, -1.5, 0.0)))
    outcomes = arm.run(10, 1)
    assert [outcome.task for outcome in outcomes] == [10]


def test_the_request_to_acknowledge_is_not_a_frame(
    robot: Robot, shared_clock: SimulatedClock, shared_pool: Pool, tmp_path: Path
) -> None:
    ours = dataclasses.replace(robot, firmware=FIRMWARES["armtree"])
    arm = Rig(ours, shared_clock, shared_pool, tmp_path)
    (outcome,) = arm.run(1)
    (schedule,) = arm.recorded(logs.Schedule)
    assert outcome.success
    assert outcome.frames == len(schedule.frames)
    first, *frames = arm.recorded(logs.Sent)
    assert (first.data, first.joints, first.hold) == (b"bA01;", (), False)
    assert [frame.data.decode() for frame in frames] == list(schedule.frames)


def test_a_timeout_says_how_long_its_motion_takes(rig: RigMaker, tasks: Path) -> None:
    move = "{subtree: move_joints, with: {joints: {joint_1: 1.2}}}"
    (tasks / "10_far.yaml").write_text(
        f"task: 10\nname: far\ndescription: x\ntree: {{timeout: {move}, after: 1 s}}\n"
    )
    (outcome,) = rig(tasks).run(10)
    assert (outcome.code, outcome.hint) == ("task.timeout", "allow more than 4 s")

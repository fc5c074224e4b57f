"""Planning in a worker: asked once, halted at once, late answers reach nobody."""

import pytest
from py_trees.common import Status

from skills import BadTarget, PlanArm, PlanGripper, Planned, Positions
from skills.motion import (
    GoalInCollision,
    NoPath,
    Plan,
    PlanCanceled,
    PlanTimeout,
    Query,
    StartInCollision,
)
from tests.conftest import Bench

START = Positions(joint_1=0.0, joint_2=0.0, joint_3=0.0, joint_4=0.0)
GOAL = Positions(joint_1=0.3, joint_2=0.0, joint_3=0.0, joint_4=-0.2)
Plans = tuple[Plan, Plan]


@pytest.fixture
def skill(bench: Bench) -> PlanArm:
    made: PlanArm = bench.skill(PlanArm, start=START, goal=GOAL)
    return made


def test_what_the_arm_is_asked(bench: Bench, skill: PlanArm) -> None:
    skill.tick_once()
    assert skill.status is Status.RUNNING
    assert [job.request for job in bench.desk.jobs] == [
        Query("arm", (0.0, 0.0, 0.0, 0.0), (0.3, 0.0, 0.0), 1, 5.0)
    ]


def test_the_gripper_begins_where_the_arm_ends(bench: Bench) -> None:
    bench.skill(PlanGripper, start=START, goal=GOAL).tick_once()
    assert bench.desk.jobs[0].request == Query("gripper", (0.3, 0.0, 0.0, 0.0), (-0.2,), 1, 5.0)


@pytest.mark.parametrize("port", ["start", "goal"])
def test_a_configuration_that_lacks_a_joint(bench: Bench, port: str) -> None:
    given = {"start": START, "goal": GOAL, port: Positions(joint_1=0.0)}
    with pytest.raises(BadTarget, match=f"the {port} lacks joint_2, joint_3, joint_4") as caught:
        PlanArm.judge(bench.robot, given)
    assert caught.value.way == (port,)
    skill = bench.skill(PlanArm, **given)
    skill.tick_once()
    assert str(skill.failure) == str(caught.value)


def test_it_waits_for_the_answer(bench: Bench, skill: PlanArm, plans: Plans) -> None:
    for _ in range(3):
        skill.tick_once()
        assert (skill.status, skill.busy) == (Status.RUNNING, True)
    bench.desk.jobs[0].answer(plans[0])
    assert bench.wakes == 1
    skill.tick_once()
    assert (skill.status, skill.busy) == (Status.SUCCESS, False)
    assert bench.output("plan") is plans[0]
    assert len(bench.desk.jobs) == 1
    (told,) = bench.told
    assert isinstance(told, Planned)
    assert told.answer is plans[0]
    assert "s of motion, found in" in skill.feedback_message


def test_a_planner_that_fails(bench: Bench, skill: PlanArm) -> None:
    error = PlanTimeout(5.0)
    skill.tick_once()
    bench.desk.jobs[0].answer(error)
    skill.tick_once()
    assert (skill.status, skill.failure) == (Status.FAILURE, error)
    (told,) = bench.told
    assert isinstance(told, Planned)
    assert told.answer is error


def test_the_gripper_blames_the_arms_goal_where_it_begins(bench: Bench) -> None:
    skill = bench.skill(PlanGripper, start=START, goal=GOAL)
    skill.tick_once()
    bench.desk.jobs[0].answer(StartInCollision("base_plate", "horizontal_arm", -0.009, 0.005))
    skill.tick_once()
    assert isinstance(skill.failure, GoalInCollision)
    assert skill.feedback_message.startswith("At the goal, base_plate would be 9.0 mm deep")


def test_halted(bench: Bench, skill: PlanArm) -> None:
    skill.tick_once()
    skill.stop(Status.INVALID)
    assert bench.desk.jobs[0].canceled == 1
    assert skill.busy
    bench.desk.jobs[0].answer(NoPath(9))
    assert not skill.busy
    assert (skill.status, skill.failure) == (Status.INVALID, None)
    (told,) = bench.told  # of a canceled plan, too
    assert isinstance(told, Planned)
    assert isinstance(told.answer, PlanCanceled)


def test_a_late_answer_is_dropped(bench: Bench, skill: PlanArm, plans: Plans) -> None:
    skill.tick_once()
    skill.stop(Status.INVALID)
    skill.tick_once()
    statuses = []
    for job in (bench.desk.jobs[0], bench.desk.jobs[1]):
        job.answer(plans[0])
        skill.tick_once()
        statuses.append(skill.status)
    assert statuses == [Status.RUNNING, Status.SUCCESS]
    assert [type(event) for event in bench.told] == [Planned, Planned]


def test_a_finished_planner_is_not_canceled(bench: Bench, skill: PlanArm, plans: Plans) -> None:
    skill.tick_once()
    bench.desk.jobs[0].answer(plans[0])
    skill.tick_once()
    skill.stop(Status.INVALID)
    assert bench.desk.jobs[0].canceled == 0

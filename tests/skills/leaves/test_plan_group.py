"""Planning in a worker: one request, halted at once; late answers are ignored."""

from dataclasses import replace

import pytest
from py_trees.common import Status

from hardware import Robot, compile_schedule
from skills import BadTarget, Planned, Positions
from skills.leaves.plan_group import PlanArm, PlanGripper
from skills.merged_motion import MergedMotion, verify_query
from skills.motion import (
    BadQuery,
    Body,
    Box,
    GoalInCollision,
    MotionCollides,
    NoPath,
    Plan,
    PlanCanceled,
    PlanTimeout,
    Query,
    StartInCollision,
    Verify,
    World,
)
from skills.motion.planner import Planner
from skills.motion.trajectory.time_law import TimeLaw
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
        PlanArm.validate(bench.robot, given)
    assert caught.value.location == (port,)
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
    (reported,) = bench.reported
    assert isinstance(reported, Planned)
    assert reported.answer is plans[0]
    assert "s of motion, found in" in skill.feedback_message


def test_a_planner_that_fails(bench: Bench, skill: PlanArm) -> None:
    error = PlanTimeout(5.0)
    skill.tick_once()
    bench.desk.jobs[0].answer(error)
    skill.tick_once()
    assert (skill.status, skill.failure) == (Status.FAILURE, error)
    (reported,) = bench.reported
    assert isinstance(reported, Planned)
    assert reported.answer is error


def test_the_gripper_blames_the_arms_goal_where_it_begins(bench: Bench) -> None:
    skill = bench.skill(PlanGripper, start=START, goal=GOAL)
    skill.tick_once()
    bench.desk.jobs[0].answer(StartInCollision("base_plate", "horizontal_arm", -0.009, 0.005))
    skill.tick_once()
    assert isinstance(skill.failure, GoalInCollision)
    assert skill.feedback_message.startswith("At the goal, base_plate would be up to 9.0 mm deep")


def test_halted(bench: Bench, skill: PlanArm) -> None:
    skill.tick_once()
    skill.stop(Status.INVALID)
    assert bench.desk.jobs[0].canceled == 1
    assert skill.busy
    bench.desk.jobs[0].answer(NoPath(9, 1, 3, 2))
    assert not skill.busy
    assert (skill.status, skill.failure) == (Status.INVALID, None)
    (reported,) = bench.reported  # also for a canceled plan
    assert isinstance(reported, Planned)
    assert isinstance(reported.answer, PlanCanceled)


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
    assert [type(event) for event in bench.reported] == [Planned, Planned]


def test_a_finished_planner_is_not_canceled(bench: Bench, skill: PlanArm, plans: Plans) -> None:
    skill.tick_once()
    bench.desk.jobs[0].answer(plans[0])
    skill.tick_once()
    skill.stop(Status.INVALID)
    assert bench.desk.jobs[0].canceled == 0


# Round a box so closely that the frames, in whole degrees, come too near it.
BOX = Body("box", Box((0.0715, 0.077, 0.0376)), (-0.1128, 0.0795, 0.1911))
CLOSE = {
    "start": Positions(joint_1=-0.04, joint_2=1.09, joint_3=1.54, joint_4=0.0),
    "goal": Positions(joint_1=0.91, joint_2=-0.54, joint_3=-0.35, joint_4=0.0),
}
HIT = MotionCollides(3, 1.0, "claw_support", "box", 0.0, 0.001)


@pytest.fixture(scope="module")
def planner(robot: Robot) -> Planner:
    return Planner(robot)


@pytest.fixture
def detour(bench: Bench, planner: Planner) -> tuple[PlanArm, Plan]:
    """A skill that has received a plan around an obstacle."""
    bench.context.scene.world = World((BOX,))
    skill: PlanArm = bench.skill(PlanArm, **CLOSE)
    skill.tick_once()
    (job,) = bench.desk.jobs
    assert isinstance(job.request, Query)
    plan = planner.plan(job.request)
    job.answer(plan)
    skill.tick_once()
    return skill, plan


def planned_by(bench: Bench) -> tuple[float, object]:
    """The extra distance and the answer of the only published plan."""
    (reported,) = bench.reported
    assert isinstance(reported, Planned)
    return reported.query.spare, reported.answer


def test_a_wider_way_where_frames_would_touch(
    bench: Bench, planner: Planner, detour: tuple[PlanArm, Plan]
) -> None:
    skill, first = detour
    frames = bench.desk.jobs[1].request
    assert isinstance(frames, Verify)
    with pytest.raises(MotionCollides) as caught:
        planner.verify(frames)
    bench.desk.jobs[1].answer(caught.value)
    skill.tick_once()
    query = bench.desk.jobs[2].request
    assert isinstance(query, Query)
    assert replace(query, spare=0.0) == bench.desk.jobs[0].request
    wider = planner.plan(query)
    bench.desk.jobs[2].answer(wider)
    skill.tick_once()
    bench.desk.jobs[3].answer(None)
    skill.tick_once()
    assert (skill.status, bench.output("plan"), len(bench.desk.jobs)) == (Status.SUCCESS, wider, 4)
    assert planned_by(bench) == (query.spare, wider)
    assert first.duration < wider.duration < 1.2 * first.duration
    merged = MergedMotion(bench.robot, query.start, [wider], together=False)
    schedule = compile_schedule(bench.robot, query.start, merged.sample, merged.duration)
    planner.verify(verify_query(bench.robot, query.start, schedule, 5.0, query.world))


def test_the_first_way_where_there_is_no_wider_one(
    bench: Bench, detour: tuple[PlanArm, Plan]
) -> None:
    skill, first = detour
    bench.desk.jobs[1].answer(HIT)
    skill.tick_once()
    bench.desk.jobs[2].answer(NoPath(9, 1, 3, 2))
    skill.tick_once()
    assert (skill.status, bench.output("plan")) == (Status.SUCCESS, first)  # Execute rejects it
    assert planned_by(bench) == (0.0, first)


def test_a_wider_way_each_time_frames_would_touch(
    bench: Bench, detour: tuple[PlanArm, Plan]
) -> None:
    skill, first = detour
    spares = list[float]()
    while skill.status is Status.RUNNING:
        bench.desk.jobs[-1].answer(HIT)
        skill.tick_once()
        if skill.status is Status.RUNNING:
            query = bench.desk.jobs[-1].request
            assert isinstance(query, Query)
            spares.append(query.spare)
            bench.desk.jobs[-1].answer(replace(first, seed=len(spares)))
            skill.tick_once()
    assert spares == [0.002, 0.004, 0.008]
    assert (skill.status, bench.output("plan")) == (Status.SUCCESS, first)  # Execute rejects it
    assert planned_by(bench) == (0.0, first)


def test_the_frames_of_a_straight_motion_beside_an_obstacle(bench: Bench, planner: Planner) -> None:
    """The plan keeps 2.5 mm, but its frames, in whole degrees, come within 0.7 mm of the box."""
    beside = Body("beside", Box((0.0247, 0.0755, 0.0423)), (-0.1004, 0.1559, 0.0904))
    bench.context.scene.world = World((beside,))
    goal = Positions(joint_1=1.441, joint_2=-1.218, joint_3=1.329, joint_4=0.0)
    skill = bench.skill(PlanArm, start=START, goal=goal)
    skill.tick_once()
    straight = []
    while skill.status is Status.RUNNING:
        request = bench.desk.jobs[-1].request
        try:
            answer = planner.answer(request)
        except MotionCollides as error:
            bench.desk.jobs[-1].answer(error)
        else:
            straight += [answer.curve.straight] if isinstance(answer, Plan) else []
            bench.desk.jobs[-1].answer(answer)
        skill.tick_once()
    assert (skill.status, straight) == (Status.SUCCESS, [True, False])
    assert [type(job.request) for job in bench.desk.jobs] == [Query, Verify, Query, Verify]
    assert planned_by(bench)[0] == 0.002


def test_a_way_whose_frames_are_free(bench: Bench, detour: tuple[PlanArm, Plan]) -> None:
    skill, first = detour
    bench.desk.jobs[1].answer(None)
    skill.tick_once()
    assert (skill.status, bench.output("plan"), len(bench.desk.jobs)) == (Status.SUCCESS, first, 2)
    assert planned_by(bench) == (0.0, first)


@pytest.mark.parametrize("answer", [None, HIT])
def test_halted_while_its_frames_are_checked(
    bench: Bench, detour: tuple[PlanArm, Plan], answer: MotionCollides | None
) -> None:
    skill, first = detour
    if answer:
        bench.desk.jobs[1].answer(answer)
    skill.stop(Status.INVALID)
    assert planned_by(bench) == (0.0, first)


def test_halted_while_a_wider_way_is_looked_for(bench: Bench, detour: tuple[PlanArm, Plan]) -> None:
    skill, _ = detour
    bench.desk.jobs[1].answer(HIT)
    skill.tick_once()
    skill.stop(Status.INVALID)
    spare, answer = planned_by(bench)
    assert (spare > 0.0, type(answer)) == (True, PlanCanceled)


@pytest.mark.parametrize("spare", [-0.001, float("nan"), float("inf"), "2 mm"])
def test_how_much_more_may_be_kept(planner: Planner, spare: float) -> None:
    with pytest.raises(BadQuery, match="The spare is"):
        planner.plan(Query("arm", (0.0,) * 4, (0.3, 0.0, 0.0), spare=spare))


def test_a_group_that_is_at_its_goal_says_so(bench: Bench, skill: PlanArm, plans: Plans) -> None:
    skill.tick_once()
    bench.desk.jobs[0].answer(replace(plans[0], profile=TimeLaw.standstill()))
    skill.tick_once()
    assert skill.feedback_message == "is there already"

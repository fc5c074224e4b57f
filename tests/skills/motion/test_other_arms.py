"""Other arms: six and seven axes, a mesh, sliding fingers, continuous joints."""

import dataclasses

import numpy as np
import pinocchio as pin
import pytest

from hardware import Robot, load_robot
from skills.motion import (
    Body,
    Box,
    GoalOutOfBounds,
    Query,
    StartOutOfBounds,
    ToolQuery,
    Unreachable,
    World,
)
from skills.motion.collision.checker import CollisionChecker
from skills.motion.collision.planning_scene import PlanningScene
from skills.motion.inverse_kinematics import ToolChain
from skills.motion.path.blend import VIA_TOLERANCE
from skills.motion.planner import Planner
from skills.motion.robot_model.joint_group import JointGroup
from tests.support.arms.robots import ARMS, foreign, free_poses

POST = World((Body("post", Box((0.1, 0.1, 1.2)), (0.4, 0.0, 0.4)),))
TURN = 2.0 * np.pi
planners: dict[str, Planner] = {}


@pytest.fixture(params=ARMS)
def robot(request: pytest.FixtureRequest) -> Robot:
    return foreign(request.param)


@pytest.fixture
def planner(robot: Robot) -> Planner:
    if robot.name not in planners:
        planners[robot.name] = Planner(robot)
    return planners[robot.name]


@pytest.mark.parametrize("world", [World(), POST], ids=["bare", "post"])
def test_plans_of_random_pairs_are_free_and_keep_the_limits(
    robot: Robot, planner: Planner, world: World
) -> None:
    checker = CollisionChecker(PlanningScene(robot, world))
    poses = free_poses(robot, 12, 1, checker)
    own = [i for i, j in enumerate(robot.actuated) if j in robot.actuated_in("arm")]
    for start, goal in zip(poses[::2], poses[1::2], strict=True):
        query = Query("arm", tuple(start), tuple(goal[own]), world=world)
        plan = planner.plan(query)
        times = np.arange(0.0, plan.duration + 0.001, 0.001)
        rows = np.tile(start, (len(times), 1))
        rows[:, own] = plan.sample(times)
        assert checker.first_collision(rows, 0.0) is None
        assert np.all(abs(plan.velocities(times)) <= 1.001 * plan.velocity)
        assert np.all(abs(plan.accelerations(times)) <= 1.001 * plan.acceleration)
        turns = (
            (rows[-1, own] - goal[own]) / TURN * [j.continuous for j in robot.actuated_in("arm")]
        )
        assert rows[-1, own] == pytest.approx(goal[own] + TURN * np.round(turns), abs=1e-12)


def test_the_bound_on_travel_holds_between_samples(robot: Robot, planner: Planner) -> None:
    """The distance of the closest links shrinks by no more than the bound on their travel."""
    model = PlanningScene(robot, POST)
    checker = CollisionChecker(model)
    random = np.random.default_rng(3)
    for pose in free_poses(robot, 30, 3, checker):
        move = random.uniform(-0.1, 0.1, len(pose))
        before, after = checker.nearest(pose), checker.nearest(pose + move)
        assert before
        assert after
        assert after.distance >= before.distance - (model.lever_arms @ abs(move)).max() - 1e-5


def test_inverse_kinematics(robot: Robot, planner: Planner) -> None:
    """A pose known to be reachable, and a point far out of reach."""
    model = PlanningScene(robot)
    start, there = free_poses(robot, 2, 5, planner.checker)
    own = [i for i, j in enumerate(robot.actuated) if j in robot.actuated_in("arm")]
    there = np.where(np.isin(np.arange(len(start)), own), there, start)
    query = ToolQuery("arm", tuple(start), (0.0, 0.0, 0.0))
    point, axis = ToolChain(robot, model.robot_model, JointGroup(robot, "arm"), query).tool_pose(
        there
    )
    query = ToolQuery("arm", tuple(start), tuple(point), direction=tuple(axis))
    found = planner.reach(query)
    again = start.copy()
    again[own] = found.positions
    reached, turned = ToolChain(
        robot, model.robot_model, JointGroup(robot, "arm"), query
    ).tool_pose(again)
    assert reached == pytest.approx(point, abs=2e-6)
    assert turned == pytest.approx(axis, abs=2e-4)
    assert planner.reach(query) == found
    for length in (1e-200, 1e200):
        scaled = dataclasses.replace(query, direction=tuple(length * axis))
        assert planner.reach(scaled).positions == pytest.approx(found.positions, abs=1e-3)
    with pytest.raises(Unreachable) as caught:
        planner.reach(ToolQuery("arm", tuple(start), (9.0, 0.0, 0.0)))
    assert 7.0 < caught.value.distance < 9.0


def test_the_robot_files_tool_reaches_the_point() -> None:
    robot = load_robot()
    assert robot.tool
    point, start = (0.1, 0.05, 0.08), (0.0, 0.0, 0.0, 0.0)
    found = Planner(robot).reach(ToolQuery("arm", start, point))
    model = PlanningScene(robot)
    data = model.kinematics.createData()
    q = model.robot_model.coordinates(np.array([[*found.positions, 0.0]]))[:, 0]
    pin.framesForwardKinematics(model.kinematics, data, q)
    place = data.oMf[model.kinematics.getFrameId(robot.tool.link)]
    assert place.act(np.array(robot.tool.offset)) == pytest.approx(point, abs=2e-6)
    beyond = Planner(robot).reach(ToolQuery("arm", start, point, offset=(0.0, 0.01, 0.0)))
    assert beyond.positions != found.positions


def test_sliding_fingers_with_a_mimic_joint() -> None:
    robot = foreign("seven_axes")
    planner = planners.setdefault(robot.name, Planner(robot))
    start = [0.0, 0.0, 0.0, -1.5, 0.0, 1.5, 0.0, 0.0]
    plan = planner.plan(Query("gripper", tuple(start), (0.04,)))
    assert plan.joints == ("finger_1",)
    assert PlanningScene(robot).lever_arms[:, 7].max() == 1.0


def test_a_slide_passes_near_its_via_point() -> None:
    """The motion reverses there, so only the via point keeps it from reversing earlier."""
    robot = foreign("seven_axes")
    planner = planners.setdefault(robot.name, Planner(robot))
    start = (0.0, 0.0, 0.0, -1.5, 0.0, 1.5, 0.0, 0.0)
    plan = planner.plan(Query("gripper", start, (0.001,), via=((0.04,),)))
    furthest = plan.sample(np.linspace(0.0, plan.duration, 400)).max()
    assert 0.04 - VIA_TOLERANCE - 1e-6 <= furthest <= 0.04


@pytest.mark.parametrize(
    ("begins", "goal", "ends"),
    [
        (0.0, 7.0, 7.0 - TURN),
        (3.1, -3.1, TURN - 3.1),
        (0.1, -0.2, -0.2),
        (20.0, 0.5, 3 * TURN + 0.5),
    ],
)
def test_a_continuous_joint_takes_the_shorter_direction(
    begins: float, goal: float, ends: float
) -> None:
    robot = foreign("endless")
    planner = planners.setdefault(robot.name, Planner(robot))
    rest = (0.5, 0.5, 0.0, 1.0, 0.0)
    plan = planner.plan(Query("arm", (begins, *rest), (goal, *rest)))
    assert plan.goal.tolist() == pytest.approx([ends, *rest], abs=1e-12)
    assert plan.sample([plan.duration])[0].tolist() == plan.goal.tolist()


@pytest.mark.parametrize("far", [1e7, -1e18, 1e300])
def test_a_continuous_joint_rejects_absurd_angles(far: float) -> None:
    robot, rest = foreign("endless"), (0.5, 0.5, 0.0, 1.0, 0.0)
    planner = planners.setdefault(robot.name, Planner(robot))
    with pytest.raises(
        GoalOutOfBounds, match=r"outside its limits, -5\.72958e\+07 deg to 5\.72958e\+07 deg"
    ):
        planner.plan(Query("arm", (0.0, *rest), (far, *rest)))
    with pytest.raises(StartOutOfBounds):
        planner.plan(Query("arm", (far, *rest), (0.0, *rest)))


def test_via_points_allow_a_whole_turn() -> None:
    robot, rest = foreign("endless"), (0.5, 0.5, 0.0, 1.0, 0.0)
    planner = planners.setdefault(robot.name, Planner(robot))
    via = ((2.0, *rest), (4.0, *rest))
    plan = planner.plan(Query("arm", (0.0, *rest), (0.0, *rest), via=via))
    assert plan.goal[0] == pytest.approx(TURN)


def test_a_continuous_joint_takes_the_longer_direction_if_the_shorter_is_blocked() -> None:
    robot, rest = foreign("endless"), (1.2, 0.0, 0.0, 0.0, 0.0)
    planner = planners.setdefault(robot.name, Planner(robot))
    wall = World((Body("wall", Box((2.0, 0.04, 6.0)), (1.08, 0.0, 0.0)),))
    query = Query("arm", (1.2, *rest), (-1.2, *rest), world=wall)
    assert planner.plan(Query("arm", query.start, query.goal)).goal[0] == -1.2
    assert planner.plan(query).goal[0] == pytest.approx(TURN - 1.2)

"""Commercial arms with meshes: six and seven axes, sliding fingers, continuous joints."""

import dataclasses

import coal
import numpy as np
import pinocchio as pin
import pytest
from numpy.typing import NDArray

from hardware import Robot
from skills.motion import (
    Body,
    Box,
    GoalInCollision,
    GoalOutOfBounds,
    Query,
    Sphere,
    StartInCollision,
    ToolQuery,
    World,
)
from skills.motion.collision.checker import CollisionChecker
from skills.motion.collision.planning_scene import PlanningScene
from skills.motion.inverse_kinematics import ToolChain
from skills.motion.planner import Planner
from skills.motion.robot_model.joint_group import JointGroup
from skills.motion.robot_model.robot_model import RobotModel
from tests.support.arms.independent_checker import IndependentChecker
from tests.support.arms.real_arms import FILES, real
from tests.support.arms.robots import free_poses

pytestmark = pytest.mark.slow

Array = NDArray[np.float64]
POSTS = World((Body("post", Box((0.1, 0.1, 1.2)), (0.35, 0.35, 0.4)),))


@pytest.fixture(scope="module", params=FILES)
def robot(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Robot:
    return real(request.param, tmp_path_factory.mktemp("arm"))


@pytest.fixture(scope="module")
def planner(robot: Robot) -> Planner:
    return Planner(robot)


def test_random_pairs_near_a_post(robot: Robot, planner: Planner) -> None:
    """Plans are free each millisecond and keep the limits. Some are not straight."""
    reference, bent = IndependentChecker(robot, POSTS), 0
    checker = CollisionChecker(PlanningScene(robot, POSTS))
    poses = free_poses(robot, 24, 1, checker)
    own = [i for i, j in enumerate(robot.actuated) if j in robot.actuated_in("arm")]
    for start, goal in zip(poses[::2], poses[1::2], strict=True):
        plan = planner.plan(Query("arm", tuple(start), tuple(goal[own]), world=POSTS))
        times = np.arange(0.0, plan.duration + 0.001, 0.001)
        rows = np.tile(start, (len(times), 1))
        rows[:, own] = plan.sample(times)
        assert not reference.hits(rows).any()
        assert np.all(abs(plan.velocities(times)) <= 1.001 * plan.velocity)
        assert np.all(abs(plan.accelerations(times)) <= 1.001 * plan.acceleration)
        assert np.cos(rows[-1, own] - goal[own]) == pytest.approx(1.0, abs=1e-12)
        bent += not plan.curve.straight
    assert 0 < bent < 12


def test_the_reference_finds_the_collisions_that_the_planner_reports(robot: Robot) -> None:
    checker, draw = CollisionChecker(PlanningScene(robot, POSTS)), np.random.default_rng(2)
    lower = [max(joint.lower, -np.pi) for joint in robot.actuated]
    upper = [min(joint.upper, np.pi) for joint in robot.actuated]
    rows = draw.uniform(lower, upper, (100, len(lower)))
    refused = [checker.first_collision([row], 0.0) == 0 for row in rows]
    assert IndependentChecker(robot, POSTS).hits(rows).tolist() == refused
    assert 2 < sum(refused) < 98


def test_a_body_inside_a_link_is_in_collision(robot: Robot, planner: Planner) -> None:
    """A small sphere in the solid middle of each moving mesh."""
    reference, start, found = IndependentChecker(robot, POSTS), np.array([robot.boot_pose]), 0
    q = reference.coordinates(start)[:, 0]
    placed = reference.shapes.createData()
    pin.updateGeometryPlacements(reference.model, reference.data, reference.shapes, placed, q)
    for shape, place in zip(reference.shapes.geometryObjects, placed.oMg, strict=True):
        if not isinstance(shape.geometry, coal.BVHModelBase) or not shape.parentJoint:
            continue
        corners = np.asarray(shape.geometry.vertices())
        rows = map(shape.geometry.tri_indices, range(shape.geometry.num_tris))
        triangles = corners[np.array([(row[0], row[1], row[2]) for row in rows])]
        middle = _middle(triangles)
        if not _enclosed(triangles, middle):
            continue
        pea = World((Body("pea", Sphere(0.001), tuple(place.act(middle).tolist())),))
        goal = [joint.boot for joint in robot.actuated_in("arm")]
        with pytest.raises(StartInCollision) as caught:
            planner.plan(Query("arm", robot.boot_pose, tuple(goal), world=pea))
        assert {caught.value.first, caught.value.second} >= {"pea"}
        assert caught.value.distance < 0.0
        found += 1
    assert found >= 4


def _middle(triangles: Array) -> Array:
    """Centroid of the enclosed volume (3,), as a sum of tetrahedra from the origin."""
    volumes = np.einsum("fi,fi->f", triangles[:, 0], np.cross(triangles[:, 1], triangles[:, 2]))
    middle: Array = volumes @ triangles.sum(axis=1) / (4.0 * volumes.sum())
    return middle


def _enclosed(triangles: Array, point: Array) -> bool:
    """True if rays from a point cross them an odd number of times, in all directions."""
    corner, first, second = triangles[:, 0], *np.moveaxis(triangles[:, 1:] - triangles[:, :1], 1, 0)
    counts = []
    for ray in np.array([[0.301, 0.507, 0.807], [-0.613, 0.211, 0.761], [0.107, -0.893, 0.437]]):
        planes = np.stack([first, second, np.broadcast_to(-ray, first.shape)], axis=2)
        u, v, distance = np.linalg.solve(planes, (point - corner)[..., None])[..., 0].T
        counts.append(np.sum((u >= 0.0) & (v >= 0.0) & (u + v < 1.0) & (distance > 0.0)))
    return all(count % 2 for count in counts)


def test_invalid_ends(robot: Robot, planner: Planner) -> None:
    start, leaders = robot.boot_pose, robot.actuated_in("arm")
    lower = [max(joint.lower, -np.pi) for joint in leaders]
    upper = [min(joint.upper, np.pi) for joint in leaders]
    rest = start[len(leaders) :]
    draws = np.random.default_rng(2).uniform(lower, upper, (200, len(leaders))).tolist()
    folded = next(
        row for row in draws if planner.checker.first_collision([(*row, *rest)], 0.0) == 0
    )
    with pytest.raises(GoalInCollision, match=r"would be .* mm deep in"):
        planner.plan(Query("arm", start, tuple(folded)))
    with pytest.raises(StartInCollision, match=r"would be .* mm deep in"):
        planner.plan(Query("arm", (*folded, *rest), start[: len(leaders)]))
    bounded = next(i for i, joint in enumerate(leaders) if not joint.continuous)
    beyond = list(start[: len(leaders)])
    beyond[bounded] = leaders[bounded].upper + 0.1
    with pytest.raises(GoalOutOfBounds, match=leaders[bounded].name):
        planner.plan(Query("arm", start, tuple(beyond)))


def test_the_tool_reaches_a_reachable_point(robot: Robot, planner: Planner) -> None:
    """A point known to be reachable; with a block there, all solutions are in collision."""
    there = free_poses(robot, 1, 5, planner.checker)[0]
    start, size = robot.boot_pose, len(robot.actuated_in("arm"))
    there[size:] = start[size:]
    nowhere = ToolQuery("arm", start, (0.0, 0.0, 0.0))
    point, _ = ToolChain(robot, RobotModel(robot), JointGroup(robot, "arm"), nowhere).tool_pose(
        there
    )
    query = dataclasses.replace(nowhere, point=tuple(point.tolist()))
    reached = planner.reach(query).positions
    again, _ = ToolChain(robot, RobotModel(robot), JointGroup(robot, "arm"), query).tool_pose(
        np.array((*reached, *start[size:]))
    )
    assert again == pytest.approx(point, abs=2e-6)
    block = World((Body("block", Box((0.1, 0.1, 0.1)), query.point),))
    with pytest.raises(GoalInCollision, match="block"):
        planner.reach(dataclasses.replace(query, world=block))

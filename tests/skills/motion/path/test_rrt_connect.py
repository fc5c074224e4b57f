"""The search: its edges seem free, shortcuts are free, and equal seeds give equal paths."""

import dataclasses
from itertools import pairwise, product

import numpy as np
import pytest

from hardware import RealClock, load_robot
from skills.motion import Body, Box, PlanTimeout, World
from skills.motion.arrays import Array
from skills.motion.collision.checker import CollisionChecker
from skills.motion.collision.planning_scene import PlanningScene
from skills.motion.deadline import Deadline
from skills.motion.path.motion_validator import MotionValidator
from skills.motion.path.rrt_connect import find_paths
from skills.motion.path.shortcut import shortcut
from skills.motion.robot_model.joint_group import JointGroup

ROBOT = load_robot()
POST = World((Body("post", Box((0.03, 0.03, 0.3)), (0.115, 0.115, 0.15)),))


@pytest.fixture(scope="module")
def validator() -> MotionValidator:
    scene, group = PlanningScene(ROBOT, POST), JointGroup(ROBOT, "arm")
    margin = ROBOT.collision.margin
    return MotionValidator(
        checker=CollisionChecker(scene),
        group=group,
        start=np.zeros(len(ROBOT.actuated)),
        margin=margin,
        guaranteed=0.5 * margin,
        deadline=Deadline(RealClock(), 60.0),
    )


def corners(validator: MotionValidator) -> list[Array]:
    """Free corners of the joint space: samples beyond the limits fall on these very points."""
    sides = zip(validator.group.lower, validator.group.upper, strict=True)
    points = [np.array(point) for point in product(*sides)]
    return [point for point in points if validator.seems_free(point, point)]


def test_the_search_between_corners_of_the_joint_space(validator: MotionValidator) -> None:
    start, *goals = corners(validator)
    assert goals
    for seed in range(10):
        path = next(find_paths(validator, start, np.array(goals), seed))
        assert (path[0] == start).all()
        assert any((path[-1] == goal).all() for goal in goals)
        assert all(validator.seems_free(a, b) for a, b in pairwise(path))
        shorter = shortcut(validator, path)
        assert shorter is not None
        assert (shorter[[0, -1]] == path[[0, -1]]).all()
        assert all(validator.line_is_free(a, b) for a, b in pairwise(shorter))


def test_equal_seeds_give_equal_paths(validator: MotionValidator) -> None:
    start, goal, *_ = corners(validator)
    paths = [next(find_paths(validator, start, goal[None, :], seed)) for seed in (1, 1, 2)]
    assert np.array_equal(paths[0], paths[1])
    assert not np.array_equal(paths[0], paths[2])


def test_a_path_with_an_edge_that_is_not_free_is_not_shortened(validator: MotionValidator) -> None:
    start, *goals = corners(validator)
    blocked = next(goal for goal in goals if not validator.line_is_free(start, goal))
    assert shortcut(validator, np.array([start, blocked])) is None


def test_the_search_continues_after_a_path(validator: MotionValidator) -> None:
    start, goal, *_ = corners(validator)
    paths = find_paths(validator, start, goal[None, :], 1)
    assert all((next(paths)[[0, -1]] == [start, goal]).all() for _ in range(2))


class _Ticking(RealClock):
    """A clock that advances by a second with each reading."""

    _readings = 0.0

    def now(self) -> float:
        """Number of readings."""
        self._readings += 1.0
        return self._readings


def test_a_search_that_runs_out_of_time_says_what_it_tried(validator: MotionValidator) -> None:
    start, *goals = corners(validator)
    blocked = next(goal for goal in goals if not validator.line_is_free(start, goal))
    short = dataclasses.replace(validator, deadline=Deadline(_Ticking(), 3.0))
    with pytest.raises(PlanTimeout) as caught:
        list(find_paths(short, start, blocked[None, :], 1))
    late = caught.value
    assert (late.timeout, late.searches, late.samples) == (3.0, 1, 24)  # three batches
    assert min(late.from_start, late.from_goal) >= 1
    assert max(late.from_start, late.from_goal) > 1

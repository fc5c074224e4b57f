"""A single bend: the stage between the straight line and the search."""

from collections.abc import Iterator

import numpy as np
import pytest

from hardware import SimulatedClock, load_robot
from skills.motion import Body, Box, MotionError, Plan, PlanTimeout, Query, World
from skills.motion.collision.checker import CollisionChecker
from skills.motion.collision.planning_scene import PlanningScene
from skills.motion.deadline import Deadline
from skills.motion.path.motion_validator import MotionValidator
from skills.motion.path.single_via_point import find_bend, find_corner
from skills.motion.planner import Planner
from skills.motion.robot_model.joint_group import JointGroup

ROBOT = load_robot()
POST = World((Body("post", Box((0.03, 0.03, 0.3)), (0.115, 0.115, 0.15)),))
ARM = JointGroup(ROBOT, "arm")
LOWER, UPPER = ARM.lower, ARM.upper
ENDS = np.array((0.3, -0.6, 0.3)), np.array((-1.4, -0.6, -0.07))


def planned(count: int) -> Iterator[Plan]:
    """Plans from one side of the post to the other."""
    planner, random = Planner(ROBOT), np.random.default_rng(5)
    for draw in random.uniform(-0.3, 0.3, (count, 2, 3)):
        start, goal = np.clip(draw + ENDS, LOWER, UPPER)
        try:
            plan = planner.plan(Query("arm", (*start, 0.0), tuple(goal), world=POST))
        except MotionError:
            continue  # one of them touches the post
        if "bend" in plan.milliseconds:
            yield plan


@pytest.mark.slow
def test_bends_are_free_and_within_the_limits() -> None:
    checker, found = CollisionChecker(PlanningScene(ROBOT, POST)), 0
    for plan in planned(60):
        rows = np.zeros((int(plan.duration / 0.001), 4))
        rows[:, :3] = plan.sample(np.linspace(0.0, plan.duration, len(rows)))
        assert np.all((rows[:, :3] >= LOWER) & (rows[:, :3] <= UPPER))
        assert checker.first_collision(rows, 0.5 * ROBOT.collision.margin) is None
        found += "search" not in plan.milliseconds
    assert found > 10


def validator_of(
    world: World, clock: SimulatedClock, timeout: float, group: JointGroup = ARM
) -> MotionValidator:
    scene = PlanningScene(ROBOT, world)
    margin = ROBOT.collision.margin
    return MotionValidator(
        checker=CollisionChecker(scene),
        group=group,
        start=np.zeros(4),
        margin=margin,
        guaranteed=0.5 * margin,
        deadline=Deadline(clock, timeout),
    )


def test_a_bend_avoids_an_obstacle_on_the_line() -> None:
    validator = validator_of(POST, SimulatedClock(), 1.0)
    assert not validator.line_is_free(*ENDS)
    found = find_bend(validator, ENDS)
    assert found
    waypoints, curve = found
    assert len(waypoints) == 3
    assert np.allclose(curve.positions(np.array([0.0, curve.length])), ENDS, rtol=0.0, atol=1e-12)
    assert validator.curve_is_free(curve)


def test_a_corner_has_free_lines() -> None:
    validator = validator_of(POST, SimulatedClock(), 1.0)
    corner = find_corner(validator, ENDS)
    assert corner is not None
    start, via, goal = corner
    assert np.array_equal([start, goal], ENDS)
    assert validator.line_is_free(start, via)
    assert validator.line_is_free(via, goal)


def test_the_legs_of_a_path_have_a_corner_each() -> None:
    """A search would take most of the time."""
    there, back = (tuple(end.tolist()) for end in ENDS)
    query = Query("arm", (*there, 0.0), back, via=(back, there), world=POST)
    plan = Planner(ROBOT).plan(query)
    assert {"bend", "blend"} <= plan.milliseconds.keys()
    assert "search" not in plan.milliseconds
    assert len(plan.waypoints) == 7


def test_the_deadline_is_kept() -> None:
    late = validator_of(POST, SimulatedClock(), -1.0)
    with pytest.raises(PlanTimeout):
        find_bend(late, ENDS)


def test_no_bend_if_the_limits_leave_no_space() -> None:
    tight = JointGroup(ROBOT, "arm")
    tight.lower, tight.upper = np.minimum(*ENDS), np.maximum(*ENDS)
    validator = validator_of(POST, SimulatedClock(), 5.0, tight)
    assert find_bend(validator, ENDS) is None
    assert find_corner(validator, ENDS) is None

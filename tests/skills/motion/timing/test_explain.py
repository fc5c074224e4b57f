"""The limits that are reported set the duration of a motion."""

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from hardware import Robot, load_robot
from skills.motion import EMPTY, Body, Box, MotionError, Plan, Query, World
from skills.motion.planner import Planner
from skills.motion.timing.explain import limits_met
from tests.support.arms.robots import ARMS, foreign, free_poses

POST = World((Body("post", Box((0.03, 0.03, 0.2)), (0.115, 0.115, 0.1)),))
PILLAR = World((Body("pillar", Box((0.1, 0.1, 0.9)), (0.35, 0.25, 0.45)),))


def motions(robot: Robot, world: World) -> Iterator[Plan]:
    """Straight plans, plans with a via point, and plans around a body."""
    planner = Planner(robot)
    poses = free_poses(robot, 12, 5, planner.checker)
    names = [joint.name for joint in robot.actuated_in("arm")]
    columns = [i for i, joint in enumerate(robot.actuated) if joint.name in names]
    via = (tuple(poses[-1][columns]),)
    for one, other in pairwise(poses[:-1]):
        query = Query("arm", tuple(one), tuple(other[columns]), 1)
        for each in (query, replace(query, via=via), replace(query, world=world)):
            with suppress(MotionError):  # an end may be within the body
                yield planner.plan(each)


@pytest.mark.parametrize("name", ["", *ARMS])
def test_the_reported_limits_are_reached_and_explain_the_motion(name: str) -> None:
    robot, world = (foreign(name), PILLAR) if name else (load_robot(), POST)
    shares = []
    for plan in motions(robot, world):
        limits, times = limits_met(plan), np.arange(0.0, plan.duration, 0.001)
        peaks = dict(zip(plan.joints, abs(plan.velocities(times)).max(axis=0), strict=True))
        speeds = [each for each in limits if each.kind == "speed"]
        assert all(peaks[each.joint] > 0.997 * each.value for each in speeds)
        held = [sum(e.seconds for e in limits if e.joint == joint) for joint in plan.joints]
        assert max(held) <= 1.0001 * plan.duration
        shares.append(sum(held) / plan.duration)
    assert min(shares) > 0.93
    assert np.mean(shares) > 0.97


def test_a_speed_below_its_limit_is_not_reported() -> None:
    robot = load_robot()
    start = tuple(-0.5 if joint.name == "joint_1" else 0.0 for joint in robot.actuated)
    plan = Planner(robot).plan(Query("arm", start, (1.4, 0.0, 0.0), 1, world=EMPTY))
    assert abs(plan.velocities(np.array([0.5 * plan.duration]))).max() > 0.97
    (limit,) = limits_met(plan)
    assert (limit.joint, limit.kind) == ("joint_1", "acceleration")
    assert limit.seconds == pytest.approx(plan.duration)

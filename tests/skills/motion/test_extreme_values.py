"""Very large distances and travels: timeouts are kept, and memory stays small."""

import dataclasses
import math
import time
import tracemalloc
from typing import Any

import numpy as np
import pytest

from hardware import Joint, Mimic, Robot, load_robot
from skills.motion import Body, ModelUnusable, PlanTimeout, Query, Sphere, World
from skills.motion.path.motion_validator import _coarse_to_fine
from skills.motion.planner import Planner
from skills.motion.timing.explain import limits_met
from tests.support.arms.robots import foreign

HOME, PICK = (0.0, 0.0, 0.0, 0.0), (-1.4, -0.6, -0.07)


def joined(count: int) -> list[int]:
    return [int(i) for piece in _coarse_to_fine(count) for i in piece]


@pytest.mark.parametrize("count", [*range(1, 70), 1000, 4096, 4097, 33_000])
def test_the_order_of_samples(count: int) -> None:
    """The numbers below the count, by their reversed binary digits."""
    bits = max(1, (count - 1).bit_length())
    assert joined(count) == sorted(range(count), key=lambda i: int(f"{i:0{bits}b}"[::-1], 2))


@pytest.mark.parametrize("count", [10**7, 2**53 + 2**20, 2**62, 10**15, 10**30, 10**300])
def test_the_order_of_more_samples_than_fit_in_memory(count: int) -> None:
    """It begins the same way and takes the memory of one chunk."""
    tracemalloc.start()
    first = next(iter(_coarse_to_fine(count)))
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert most < 2e6
    shares = first / 2.0 ** (count - 1).bit_length()
    assert shares[:3].tolist() == [0.0, 0.5, 0.25]
    assert len(first) >= 4096
    assert first.max() < count
    assert len(np.unique(first)) == len(first)


def late(planner: Planner, query: Query) -> float:
    """Delay of a timeout [s]."""
    query = dataclasses.replace(query, timeout=0.05)
    begun = time.perf_counter()
    with pytest.raises(PlanTimeout):
        planner.plan(query)
    return time.perf_counter() - begun - query.timeout


def test_a_body_far_away_on_a_moving_link() -> None:
    ball = Body("ball", Sphere(0.1), (1e6, 0.0, 1e5), link="base_plate")
    post = Body("post", Sphere(0.01), (1.0, 1.0, 1.0))
    planner = Planner(load_robot())
    query = Query("arm", HOME, PICK, world=World((ball, post)))
    assert any(late(planner, query) < 0.01 for _ in range(20))  # a busy machine may add to it


def sliding(upper: float) -> Robot:
    robot = foreign("seven_axes")
    finger, *rest = (j for j in robot.joints if j.name.startswith("finger"))
    joints = tuple(
        dataclasses.replace(joint, upper=upper) if joint in (finger, *rest) else joint
        for joint in robot.joints
    )
    return dataclasses.replace(robot, joints=joints)


def test_a_prismatic_joint_with_a_long_travel() -> None:
    planner = Planner(sliding(1e6))
    start = (0.0, 0.0, 0.0, -1.5, 0.0, 1.5, 0.0, 0.0)
    assert min(late(planner, Query("gripper", start, (9e5,))) for _ in range(3)) < 0.01


@pytest.mark.parametrize("upper", [1e9, 1e300, math.inf])
def test_a_prismatic_joint_with_an_absurd_travel(upper: float) -> None:
    with pytest.raises(ModelUnusable, match=r"finger_1 has limits \[0, .*\] m.* to 1e\+06 m"):
        Planner(sliding(upper))


def altered(robot: Robot, name: str, **changes: Any) -> Robot:
    def change(joint: Joint) -> Joint:
        return dataclasses.replace(joint, **changes) if joint.name == name else joint

    return dataclasses.replace(robot, joints=tuple(map(change, robot.joints)))


@pytest.mark.parametrize(("times", "plus"), [(1e300, 0.0), (-1e7, 0.0), (1.0, 1e9)])
def test_a_mimic_joint_with_an_absurd_travel(times: float, plus: float) -> None:
    robot = altered(load_robot(), "joint_5", mimic=Mimic("joint_4", times, plus))
    with pytest.raises(ModelUnusable, match=r"joint_5 follows joint_4 with .*; give numbers"):
        Planner(robot)


@pytest.mark.parametrize("odd", [(1e300, 0.0, 0.0), (0.0, -2e6, 0.0), (0.0, math.nan, 0.0)])
def test_a_tool_absurdly_far_away(odd: tuple[float, float, float]) -> None:
    robot = load_robot()
    assert robot.tool
    tool = dataclasses.replace(robot.tool, offset=odd)
    with pytest.raises(ModelUnusable, match=r"the tool's offset is .* give numbers up to"):
        Planner(dataclasses.replace(robot, tool=tool))


def test_the_limits_of_a_motion_of_ten_minutes() -> None:
    robot = load_robot()
    slow = tuple(dataclasses.replace(joint, velocity=2.4e-3) for joint in robot.joints)
    plan = Planner(dataclasses.replace(robot, joints=slow)).plan(Query("arm", HOME, PICK))
    assert plan.duration == pytest.approx(583, rel=1e-3)
    tracemalloc.start()
    limit = max(limits_met(plan), key=lambda limit: limit.seconds)
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert (limit.joint, limit.kind) == ("joint_1", "speed")
    assert limit.seconds == pytest.approx(583, rel=1e-3)
    assert most < 50e6

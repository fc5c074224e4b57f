"""Plans of two groups, merged into one motion of the whole arm."""

import numpy as np
import pytest

from hardware import Robot, compile_schedule
from skills.errors import StartMoved
from skills.merged_motion import MergedMotion
from skills.motion import Plan
from skills.streamed_motion import begun_at

Plans = tuple[Plan, Plan]
START = (0.0, 0.0, 0.0, 0.0)


def test_one_after_the_other(robot: Robot, plans: Plans) -> None:
    arm, gripper = plans
    merged = MergedMotion(robot, START, plans, together=False)
    assert merged.duration == arm.duration + gripper.duration
    rows = merged.sample([0.0, arm.duration / 2, arm.duration, merged.duration])
    assert rows[0] == list(START)
    assert 0.0 < rows[1][0] < 0.3
    assert rows[1][3] == 0.0
    assert rows[2] == [0.3, 0.0, 0.0, 0.0]
    assert rows[3] == [0.3, 0.0, 0.0, -0.2]


def test_together(robot: Robot, plans: Plans) -> None:
    merged = MergedMotion(robot, START, plans, together=True)
    assert merged.duration == max(plan.duration for plan in plans)
    (half,) = merged.sample([min(plan.duration for plan in plans) / 2])
    assert 0.0 < half[0] < 0.3
    assert -0.2 < half[3] < 0.0


@pytest.mark.parametrize("together", [False, True])
def test_before_and_after_the_motion(robot: Robot, plans: Plans, together: bool) -> None:
    merged = MergedMotion(robot, START, plans, together)
    rows = merged.sample([-5.0, 0.0, merged.duration, merged.duration + 5.0])
    assert rows[0] == rows[1] == list(START)
    assert rows[2] == rows[3] == [0.3, 0.0, 0.0, -0.2]


def test_it_begins_where_it_was_planned_to_the_bit(robot: Robot, plans: Plans) -> None:
    assert MergedMotion(robot, START, plans, False).begins_at(START)
    moved = (float(np.nextafter(0.0, 1.0)), 0.0, 0.0, 0.0)
    assert not MergedMotion(robot, moved, plans, False).begins_at(moved)


def test_no_plans(robot: Robot) -> None:
    merged = MergedMotion(robot, START, [], False)
    assert merged.duration == 0.0
    assert merged.sample([0.0]) == [list(START)]


def test_a_gripper_elsewhere_holds_an_object_and_has_no_rest(robot: Robot, plans: Plans) -> None:
    arm, gripper = plans
    merged = MergedMotion(robot, START, plans, together=False)
    assert merged.rest(0.0, START) == [arm, gripper]
    assert merged.rest(0.0, (0.0, 0.0, 0.0, -0.1)) == [arm]


@pytest.mark.parametrize("together", [False, True])
@pytest.mark.parametrize("joint", [0, 1, 2])
def test_an_arm_elsewhere_has_no_rest(
    robot: Robot, plans: Plans, joint: int, together: bool
) -> None:
    merged = MergedMotion(robot, START, plans, together)
    moved = tuple(1.0 if k == joint else q for k, q in enumerate(START))
    with pytest.raises(StartMoved, match=f"joint_{joint + 1} is not at the start of the motion"):
        merged.rest(0.0, moved)


def test_frames_begin_elsewhere_only_with_the_gripper(robot: Robot, plans: Plans) -> None:
    merged = MergedMotion(robot, START, plans, together=True)
    schedule = compile_schedule(robot, START, merged.sample, merged.duration)
    assert begun_at(robot, schedule, START, START) is schedule
    held = begun_at(robot, schedule, START, (0.0, 0.0, 0.0, -0.1))
    assert held.end[3] == schedule.end[3]
    with pytest.raises(StartMoved, match="joint_1 is not at the start of the motion"):
        begun_at(robot, schedule, START, (1.0, 0.0, 0.0, 0.0))


def test_a_rounding_error_does_not_move_a_gripper(robot: Robot, plans: Plans) -> None:
    """The gripper stays at its object until its command changes."""
    arm, _ = plans
    merged = MergedMotion(robot, START, [arm], together=True)
    schedule = compile_schedule(robot, START, merged.sample, merged.duration)
    before = (0.0, 0.0, 0.0, 1e-9)
    assert begun_at(robot, schedule, before, (0.0, 0.0, 0.0, -0.1)).end[3] == -0.1

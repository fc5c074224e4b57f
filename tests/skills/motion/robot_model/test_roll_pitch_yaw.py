"""Turns of a tool in place: what roll, pitch and yaw are, and which arms can do them."""

import math
from pathlib import Path

import numpy as np
import pytest

from hardware import Robot, load_robot
from skills import BadTarget, tool_target_errors
from skills.motion import Reached, ToolQuery, Unreachable
from skills.motion.inverse_kinematics import ToolChain
from skills.motion.planner import Planner
from skills.motion.robot_model.joint_group import JointGroup
from skills.motion.robot_model.robot_model import RobotModel
from skills.motion.robot_model.roll_pitch_yaw import axes_across, turned
from skills.motion.workers.answer_checker import AnswerChecker
from skills.motion.workers.messages import InvalidMessage
from tests.support.arms.robots import foreign

AHEAD, UP = np.array((0.6, 0.8, 0.0)), np.array((0.0, 0.0, 1.0))
SIDE = np.cross(AHEAD, UP)
POINTS = TOOL, WRIST, BASE = AHEAD + 0.01 * SIDE, AHEAD, np.zeros(3)
RIGHT_ANGLE, STEP = math.pi / 2, math.radians(5.0)
STILL = (0.0, 0.0, 0.0)
Turn = tuple[float, float, float]


@pytest.fixture(scope="module")
def so101() -> Robot:
    return load_robot(Path("so101"))


@pytest.fixture(scope="module")
def planner(so101: Robot) -> Planner:
    return Planner(so101)


@pytest.mark.parametrize(
    ("axis", "turn", "after"),
    [
        (AHEAD, (1.0, 0.0, 0.0), AHEAD),
        (AHEAD, (0.0, RIGHT_ANGLE, 0.0), UP),
        (SIDE, (0.0, RIGHT_ANGLE, 0.0), UP),
        (-SIDE, (0.0, RIGHT_ANGLE, 0.0), UP),
        (UP, (0.0, RIGHT_ANGLE, 0.0), -AHEAD),
        (-AHEAD, (0.0, RIGHT_ANGLE, 0.0), -UP),
        (-UP, (0.0, RIGHT_ANGLE, 0.0), AHEAD),
        (AHEAD, (0.0, 0.0, RIGHT_ANGLE), (-0.8, 0.6, 0.0)),
        (-UP, (0.0, 0.0, 1.0), -UP),
    ],
)
def test_the_axis_of_a_tool_after_a_turn(axis: np.ndarray, turn: Turn, after: np.ndarray) -> None:
    axes = turned(axes_across(axis), turn, *POINTS)
    assert axes[0] == pytest.approx(after, abs=1e-12)
    assert axes @ axes.T == pytest.approx(np.eye(2), abs=1e-12)


def test_a_roll_turns_what_is_across_the_axis() -> None:
    axes = axes_across(AHEAD)
    assert turned(axes, (RIGHT_ANGLE, 0.0, 0.0), *POINTS)[1] == pytest.approx(np.cross(*axes))


def test_a_vertical_tool_above_its_base_has_a_pitch() -> None:
    level = turned(axes_across(UP), (0.0, RIGHT_ANGLE, 0.0), UP, 0.5 * UP, BASE)[0]
    assert level @ UP == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("first", [0.0, 0.3, 0.7, 89.5])
def test_pitches_around_the_whole_circle_come_back(first: float) -> None:
    angle = math.radians(first)
    begin = np.array(turned(axes_across(AHEAD), (0.4, angle, 0.0), *POINTS))
    for sign in (1, -1):
        axes = begin
        for count in range(1, 73):
            axes = turned(axes, (0.0, sign * STEP, 0.0), *POINTS)
            now = angle + sign * count * STEP
            assert axes[0] == pytest.approx(math.cos(now) * AHEAD + math.sin(now) * UP)
        assert axes == pytest.approx(begin)


@pytest.mark.parametrize("way", [(1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)])
def test_the_pitch_of_a_tool_near_the_vertical_does_not_depend_on_its_tilt(
    way: tuple[float, float],
) -> None:
    tilt = math.radians(0.5)  # some ticks of a servo
    turn = (0.0, 0.1, 0.0)
    tilted = np.array((*(math.sin(tilt) * each for each in way), math.cos(tilt)))
    axes = axes_across(UP)
    axes = np.array((tilted, axes[1] - (axes[1] @ tilted) * tilted))
    axes[1] /= np.linalg.norm(axes[1])
    after = turned(axes, turn, *POINTS)[0]
    assert after == pytest.approx(turned(axes_across(UP), turn, *POINTS)[0], abs=2 * tilt)


@pytest.mark.parametrize("turn", [(0.2, 0.0, 0.0), (0.0, 0.2, 0.0), (0.0, 0.0, 0.2)])
def test_an_arm_with_six_joints_turns_its_tool_in_any_way(turn: Turn) -> None:
    robot = foreign("six_axes")
    query = ToolQuery("arm", (0.0, 0.5, 0.5, 0.0, 0.5, 0.0), STILL, relative=True, turn=turn)
    reached = Planner(robot).reach(query)
    assert AnswerChecker(robot).check(query, reached) is reached


START = (0.3, -0.4, 0.5, 0.6, 0.4, 0.0)  # of the SO-101


@pytest.mark.parametrize(("turn", "moved"), [((0.0, 0.1, 0.0), (1, 2, 3)), ((0.1, 0.0, 0.0), (4,))])
def test_an_arm_with_five_joints_turns_its_tool_up_and_about_its_axis(
    so101: Robot, planner: Planner, turn: Turn, moved: tuple[int, ...]
) -> None:
    query = ToolQuery("arm", START, STILL, relative=True, turn=turn)
    reached = planner.reach(query)
    far = abs(np.array(reached.positions) - START[:5])
    assert {*np.flatnonzero(far > 0.02).tolist()} == {*moved}
    assert AnswerChecker(so101).check(query, reached) is reached
    other = ToolQuery("arm", START, STILL, relative=True, turn=(-turn[0], -turn[1], 0.0))
    with pytest.raises(InvalidMessage, match=r"with the tool 11\.\d* deg from its orientation"):
        AnswerChecker(so101).check(other, reached)


@pytest.mark.slow
@pytest.mark.parametrize("roll", [0.0, 0.4])
@pytest.mark.parametrize(
    ("robot", "start", "elevation"),
    [
        (load_robot(Path("so101")), (0.4, -0.6, -0.5, -0.466, 0.0, 0.0), 89.7),
        (load_robot(Path("so101")), (0.4, -0.4, 0.766, 1.2, 0.0, 0.0), -89.7),
        (foreign("six_axes"), (0.4, -0.6, 1.2, 0.0, -0.605, 0.0), 90.3),
        (foreign("six_axes"), (0.4, -0.2, 2.07, 0.0, 1.277, 0.0), -90.3),
    ],
)
def test_pitches_over_the_vertical_come_back(
    robot: Robot, start: tuple[float, ...], elevation: float, roll: float
) -> None:
    """To both sides of the vertical, in the plane of the arm, and at the end to the start."""
    planner, checker = Planner(robot), AnswerChecker(robot)
    query = ToolQuery("arm", start, STILL, relative=True)
    chain = ToolChain(robot, RobotModel(robot), JointGroup(robot, "arm"), query)
    now = begin = (*start[:-1], roll) if len(robot.groups["arm"]) == 6 else (*start[:4], roll, 0.0)
    pan = -start[0] if robot.name == "so101" else start[0]
    ahead = np.array((math.cos(pan), math.sin(pan), 0.0))
    for sign in (1, 1, 1, 1, *[-1] * 8, 1, 1, 1, 1):
        query = ToolQuery("arm", now, STILL, relative=True, turn=(0.0, sign * STEP, 0.0))
        reached = checker.check(query, planner.reach(query))
        assert isinstance(reached, Reached)
        now = (*reached.positions, *now[len(reached.positions) :])
        elevation += sign * 5.0
        level, up = math.cos(math.radians(elevation)), math.sin(math.radians(elevation))
        assert chain.tool_pose(np.array(now))[1] == pytest.approx(level * ahead + up * UP, abs=0.01)
    assert now == pytest.approx(begin, abs=0.01)


def test_a_turn_that_the_arm_cannot_make_is_refused_in_words(planner: Planner) -> None:
    query = ToolQuery("arm", START, STILL, relative=True, turn=(0.0, 0.0, 0.1))
    words = r"cannot turn the tool this way .* at least 4\.46 deg off .*; turn it another way"
    with pytest.raises(Unreachable, match=words):
        planner.reach(query)


@pytest.mark.parametrize(
    ("robot", "turns"),
    [
        (load_robot(), ()),
        (load_robot(Path("so101")), ("roll", "pitch")),
        (foreign("six_axes"), ("roll", "pitch", "yaw")),
    ],
)
def test_the_turns_of_an_arm(robot: Robot, turns: tuple[str, ...]) -> None:
    assert robot.turns() == turns
    assert robot.turns("no such group") == ()


def test_targets_that_are_no_turn(so101: Robot) -> None:
    turn = [0.0, 0.1, 0.0]
    assert tool_target_errors(so101, {"turn": turn}) == []
    for robot, inputs, words in (
        (load_robot(), {"turn": turn}, "it has 3 joints, and needs more than 3; move joints"),
        (
            so101,
            {"turn": turn, "direction": [0.0, 0.0, -1.0]},
            "turn and direction exclude each other",
        ),
        (
            so101,
            {"turn": [0.1, math.radians(-200), 0.0]},
            "turn has -200 deg; give -180 to 180 deg",
        ),
    ):
        (error,) = tool_target_errors(robot, inputs)
        assert isinstance(error, BadTarget)
        assert words in str(error)

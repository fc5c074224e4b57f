"""Turns of a tool in place: what roll, pitch and yaw are, and which arms can do them."""

import math
from pathlib import Path

import numpy as np
import pytest

from hardware import Robot, load_robot
from skills import BadTarget, tool_target_errors
from skills.motion import ToolQuery, Unreachable
from skills.motion.planner import Planner
from skills.motion.robot_model.tool_turn import axes_across, turned
from skills.motion.workers.answer_checker import AnswerChecker
from skills.motion.workers.messages import InvalidMessage
from tests.support.arms.robots import foreign

AHEAD, UP = np.array((0.6, 0.8, 0.0)), np.array((0.0, 0.0, 1.0))
RIGHT_ANGLE = math.pi / 2
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
        (AHEAD, (0.0, 0.0, RIGHT_ANGLE), (-0.8, 0.6, 0.0)),
        (-UP, (0.0, 0.0, 1.0), -UP),
    ],
)
def test_the_axis_of_a_tool_after_a_turn(axis: np.ndarray, turn: Turn, after: np.ndarray) -> None:
    axes = turned(axes_across(axis), turn)
    assert axes[0] == pytest.approx(after, abs=1e-12)
    assert axes @ axes.T == pytest.approx(np.eye(2), abs=1e-12)


def test_a_roll_turns_what_is_across_the_axis_and_a_vertical_tool_has_a_pitch() -> None:
    axes = axes_across(AHEAD)
    assert turned(axes, (RIGHT_ANGLE, 0.0, 0.0))[1] == pytest.approx(np.cross(*axes))
    level = turned(axes_across(UP), (0.0, RIGHT_ANGLE, 0.0))[0]
    assert level @ UP == pytest.approx(0.0, abs=1e-12)


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
    after = turned(axes, turn)[0]
    assert after == pytest.approx(turned(axes_across(UP), turn)[0], abs=2 * tilt)


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


def test_a_turn_that_the_arm_cannot_make_is_refused_in_words(planner: Planner) -> None:
    query = ToolQuery("arm", START, STILL, relative=True, turn=(0.0, 0.0, 0.1))
    words = r"cannot turn the tool this way .* at least 4\.46 deg off; turn it another way, or move"
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

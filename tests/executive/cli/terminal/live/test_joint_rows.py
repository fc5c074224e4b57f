"""The joints of an arm, in the rows and columns of a terminal."""

import math
from dataclasses import replace

import pytest

from executive.api.events import Where
from executive.cli.terminal.live.joint_rows import joint_rows
from hardware import Joint, State, load_robot

ROBOT = load_robot(None)


def arm(*joints: Joint) -> Where:
    return Where.of(replace(ROBOT, joints=joints), State.ACTIVE, None)


ARM = arm(*ROBOT.actuated)
REST = dict.fromkeys(ARM.units, 0.0)


def many(count: int) -> tuple[Where, dict[str, float]]:
    names = [f"joint_{k}" for k in range(1, count + 1)]
    joints = (replace(ROBOT.actuated[0], name=name) for name in names)
    return arm(*joints), dict.fromkeys(names, 0.5)


def shown(*given: object) -> list[str]:
    return [text.plain for text in joint_rows(*given)]  # type: ignore[arg-type]


def test_a_joint_stands_between_its_limits() -> None:
    joint = ROBOT.actuated[0]
    ends = [shown(ARM, REST | {joint.name: q}, {}, 80, 9)[0] for q in (joint.lower, joint.upper)]
    assert ends[0].startswith("joint_1 -90.0 deg ├●─")
    assert ends[1].endswith("─●┤")


def test_measured_and_commanded_positions_are_named() -> None:
    (row, *_) = [text.plain for text in joint_rows(ARM, REST, {}, 80, 9, REST | {"joint_1": 0.1})]
    assert row.startswith("joint_1   0.0 deg commanded    5.7 deg measured ├")


def test_the_target_is_marked_until_it_is_reached() -> None:
    assert "○" in shown(ARM, REST, REST | {"joint_1": 0.7}, 80, 9)[0]
    assert "○" not in "".join(shown(ARM, REST, REST, 80, 9))


@pytest.mark.parametrize("width", [40, 60, 80, 200])
@pytest.mark.parametrize("most", [1, 2, 3, 10])
@pytest.mark.parametrize("count", [1, 4, 7, 40])
def test_rows_fit(width: int, most: int, count: int) -> None:
    joints, positions = many(count)
    rows = shown(joints, positions, {}, width, most)
    assert len(rows) <= most
    assert all(len(row) <= width for row in rows)
    named = sum(f"joint_{k} " in f"{row} " for k in range(1, count + 1) for row in rows)
    rest = [row.rpartition("… ")[2] for row in rows if "more" in row]
    assert named + sum(int(words.split()[0]) for words in rest) == count


def test_joints_that_move_come_first() -> None:
    joints, positions = many(40)
    assert "joint_39" in shown(joints, positions, positions | {"joint_39": 1.0}, 40, 2)[0]


def test_a_prismatic_joint_is_in_mm_and_a_joint_without_limits_within_a_turn() -> None:
    slide = replace(ROBOT.actuated[0], name="slide", unit="m", lower=0.0, upper=0.1)
    wheel = replace(ROBOT.actuated[0], name="wheel", lower=-math.inf, upper=math.inf)
    rows = shown(arm(slide, wheel), {"slide": 0.05, "wheel": 7.0}, {}, 60, 2)
    assert rows[0].startswith("slide   50.0 mm ├")
    assert rows[1].startswith("wheel 401.1 deg ├")
    assert rows[1].index("●") - rows[1].index("├") > 10


def test_a_joint_without_known_limits_has_no_bar() -> None:
    assert shown(Where(), {"joint_1": math.pi}, {}, 60, 2) == ["joint_1 180.0 deg"]


def test_no_positions_no_rows() -> None:
    assert shown(ARM, {}, {}, 60, 2) == []

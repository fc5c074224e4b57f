"""Errors in the arguments of `armtree plan`, which are reported before anything is planned."""

import re
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from executive.cli.main import cli
from executive.code_table import look_up
from hardware import load_robot
from skills.motion.errors import ModelUnusable


def plan(*arguments: str) -> Result:
    return CliRunner().invoke(cli, ["plan", *arguments])


def test_a_urdf_that_cannot_be_planned_with_is_a_wrong_file(tmp_path: Path) -> None:
    shipped = load_robot()
    robot = tmp_path / "robot.toml"
    robot.write_text(shipped.path.read_text())
    first = r"(<collision>.*?<geometry>)<.*?/>"
    urdf = re.sub(first, r"\1<capsule/>", shipped.urdf.read_text(), count=1, flags=re.DOTALL)
    (tmp_path / shipped.urdf.name).write_text(urdf)
    result = plan("right", "--robot", str(robot))
    assert isinstance(result.exception, ModelUnusable)
    assert "has a capsule" in str(result.exception)
    assert look_up(result.exception.code).exit_status == 3


@pytest.mark.parametrize(
    ("goal", "why"),
    [
        (
            ("right", "--start", "joint_4=-0.5", "--via", "joint_4=-0.2"),
            "--via: joint_4 belongs to the gripper, but the arm moves; leave it out, or give "
            "--group gripper",
        ),
        (
            ("right", "--group", "gripper"),
            "joint_1 belongs to the arm, but the gripper moves; leave it out, or give --group arm",
        ),
        (("joint_1 = 0.5",), "'joint_1 = 0.5' contains spaces; write joint_1=0.5"),
        (("joint_1 += 0.5",), "'joint_1 += 0.5' contains spaces; write joint_1+=0.5"),
        (("joint_1", "=", "0.5"), "'joint_1' is separated from its value; write joint_1=0.5"),
        (("=1",), "'=1' names no joint; write one word, such as joint_1=0.5"),
        (("right", "--via", "+=1"), "--via: '+=1' names no joint"),
        (
            ("1", "2"),
            "'1' is the number of a task, which must be the only word; plan one",
        ),
        (("0.1", "0.1"), "0.1 0.1 has 2 numbers; the point for the tool has three, x y z, such as"),
        (("joint_1",), "'joint_1' has no =; write joint_1=20deg"),
        (("joint_1", "70deg"), "'joint_1' is separated from its value; write joint_1=70deg"),
        (("joint_1", "+=", "-.5"), "'joint_1' is separated from its value; write joint_1+=-.5"),
        (("joint_1", "=5deg", "joint_2=0"), "'joint_1' is separated from its value; write "),
        (("joint_1", "="), "'joint_1' has no =; write joint_1=20deg"),
        (("joint_1:70deg",), "'joint_1:70deg' has no =; write joint_1=70deg"),
        (("joint_1 70deg",), "'joint_1 70deg' has no =; write joint_1=70deg"),
        (("width",), "'width' has no =; write width=20mm"),
        (("0.1,0.1,8cm",), "'0.1,0.1,8cm' contains commas; write 0.1 0.1 8cm"),
        (("0.1,", "0.1,", "8cm"), "'0.1, 0.1, 8cm' contains commas; write 0.1 0.1 8cm"),
        (("0,1", "0,1", "0,08"), "'0,1 0,1 0,08' contains commas; write 0.1 0.1 0.08"),
        (("right", "5cm"), "5cm has 1 number; the point for the tool has three"),
        (
            ("right", "1cm", "2cm", "-.3"),
            "1cm 2cm -.3 is a point for the tool; leave out the other",
        ),
        (
            ("right", "--start", "0.1"),
            "--start: 0.1 has 1 number; the point for the tool has three",
        ),
        (
            ("right", "--via", "joint_1=9"),
            "--via: joint_1 = 515.66 deg is outside its limits",
        ),
        (("right", "--via", "1 1 1"), "--via: The tool cannot reach (1000.0, 1000.0, 1000.0) mm"),
        (("right", "--start", "1 1 1"), "--start: The tool cannot reach (1000.0, 1000.0, 1000.0)"),
        (("right", "--start", "joint_9=1"), "--start: joint_9 is not an actuated joint"),
    ],
)
def test_what_is_asked_wrongly_is_named_with_its_option(goal: tuple[str, ...], why: str) -> None:
    result = plan(*goal)
    assert str(result.exception).startswith(why)
    assert look_up(getattr(result.exception, "code", "")).exit_status in (4, 5)


@pytest.mark.parametrize(
    ("output", "why"),
    [
        (".", "is a folder; name a file in it, such as"),
        ("nowhere/plan.png", "there is no folder"),
        ("file/plan.png", "there is no folder"),
    ],
)
def test_where_nothing_can_be_drawn_is_reported_before_planning(
    tmp_path: Path, output: str, why: str
) -> None:
    (tmp_path / "file").write_text("")
    result = plan("right", "-o", str(tmp_path / output))
    assert result.exit_code == 2
    assert why in result.output
    assert "Goal " not in result.output

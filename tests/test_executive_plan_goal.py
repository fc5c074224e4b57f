"""What `armtree plan` is asked wrongly, or with a wrong robot: told before anything is planned."""

import re
from pathlib import Path

from click.testing import CliRunner, Result

from executive.codes import look_up
from executive.commands.cli import cli
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
    assert look_up(result.exception.code).exit == 3

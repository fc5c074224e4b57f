"""What is advised about links that touch."""

import dataclasses
import shutil
from pathlib import Path

import pytest
from click.testing import CliRunner

from executive.cli.main import cli
from hardware import load_robot
from hardware.description.neighbours import advice_for_contact, advice_for_missing_shapes

ADVICE = (
    'so add ["base_plate", "forward_drive_arm"] to allowed under [collision] in arduinobot.toml'
)


def test_only_neighbours_are_advised_to_be_allowed() -> None:
    robot = load_robot()
    assert advice_for_contact(robot, "base_plate", "forward_drive_arm").endswith(ADVICE)
    assert advice_for_contact(robot, "base_link", "horizontal_arm") == ""
    assert advice_for_contact(robot, "floor", "horizontal_arm") == ""


def test_links_without_a_shape_are_named(tmp_path: Path) -> None:
    robot, text = load_robot(), load_robot().urdf.read_text()
    assert advice_for_missing_shapes(robot) == ""
    before, claw, after = text.partition('name="claw_support"')
    one = before + claw + after.replace("collision>", "hidden>", 2 * 4)  # its shapes
    for urdf, said in ((one, "for claw_support in"), (text.replace("collision>", "x>"), "in")):
        bare = dataclasses.replace(robot, urdf=tmp_path / "arm.urdf")
        bare.urdf.write_text(urdf)
        assert advice_for_missing_shapes(bare).startswith(f"no <collision> {said} the URDF, so ")


@pytest.mark.slow
def test_doctor_and_check_name_the_line_to_add(tmp_path: Path) -> None:
    shipped = load_robot().path
    shutil.copy(shipped.with_suffix(".urdf"), tmp_path)
    robot = tmp_path / shipped.name
    robot.write_text(shipped.read_text().replace('    ["base_plate", "forward_drive_arm"],\n', ""))
    for command in ("doctor", "check"):
        result = CliRunner().invoke(cli, [command, "--robot", str(robot)])
        assert ADVICE in result.output
        assert result.exit_code != 0

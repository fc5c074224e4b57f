"""What is advised about links that touch."""

import shutil
from pathlib import Path

import pytest
from click.testing import CliRunner

from executive.cli.main import cli
from hardware import load_robot
from hardware.description.neighbours import advice_for_contact

ADVICE = (
    'so add ["base_plate", "forward_drive_arm"] to allowed under [collision] in arduinobot.toml'
)


def test_only_neighbours_are_advised_to_be_allowed() -> None:
    robot = load_robot()
    assert advice_for_contact(robot, "base_plate", "forward_drive_arm").endswith(ADVICE)
    assert advice_for_contact(robot, "base_link", "horizontal_arm") == ""
    assert advice_for_contact(robot, "floor", "horizontal_arm") == ""


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

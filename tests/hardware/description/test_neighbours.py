"""What is advised about links that touch."""

import dataclasses
import shutil
from pathlib import Path

import pytest
from click.testing import CliRunner

from executive.cli.main import cli
from hardware import Robot, load_robot
from hardware.description.neighbours import advice_for_contact, shape_warnings

ADVICE = (
    'so add ["base_plate", "forward_drive_arm"] to allowed under [collision] in arduinobot.toml'
)


def test_only_neighbours_are_advised_to_be_allowed() -> None:
    robot = load_robot()
    assert advice_for_contact(robot, "base_plate", "forward_drive_arm").endswith(ADVICE)
    assert advice_for_contact(robot, "base_link", "horizontal_arm") == ""
    assert advice_for_contact(robot, "floor", "horizontal_arm") == ""


def described(folder: Path, urdf: str) -> Robot:
    """The shipped robot, with another URDF."""
    (folder / "arm.urdf").write_text(urdf)
    return dataclasses.replace(load_robot(), urdf=folder / "arm.urdf")


def test_links_without_a_shape_are_named(tmp_path: Path) -> None:
    robot, text = load_robot(), load_robot().urdf.read_text()
    assert shape_warnings(robot) == []
    before, claw, after = text.partition('name="claw_support"')
    one = before + claw + after.replace("collision>", "hidden>", 2 * 4)  # its shapes
    for urdf, said in ((one, "for claw_support in"), (text.replace("collision>", "x>"), "in")):
        (warning,) = shape_warnings(described(tmp_path, urdf))
        assert warning.startswith(f"no <collision> {said} the URDF, so ")


def test_missing_visual_meshes_are_named(tmp_path: Path) -> None:
    text, seen = load_robot().urdf.read_text(), ""
    for name in ("package://p/a.stl", "package://p/b.stl", "there.obj", ""):
        seen += f'<visual><geometry><mesh filename="{name}"/></geometry></visual>'
    (tmp_path / "there.obj").touch()
    (warning,) = shape_warnings(
        described(tmp_path, text.replace("<collision>", f"{seen}<collision>", 1))
    )
    assert warning.startswith("2 meshes of package://p, such as package://p/a.stl, are not found; ")
    assert warning.endswith(". Only viewers need visual meshes")


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

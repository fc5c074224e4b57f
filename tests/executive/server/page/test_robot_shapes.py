"""The robot as the page draws it: shapes, and meshes by the hash of their content."""

from dataclasses import replace
from pathlib import Path

import pytest

from executive.errors import NotFound
from executive.server.page.robot_shapes import RobotScene
from hardware import load_robot
from tests.support.paths import ROOT

BEAM = ROOT / "tests" / "data" / "beam.stl"
URDF = """<robot name="arm">
  <material name="red"><color rgba="1 0 0 1"/></material>
  <link name="one">
    <visual>
      <origin xyz="1 2 3" rpy="0 0 1"/><geometry>{visual}</geometry><material name="red"/>
    </visual>
    <collision><geometry><box size="0.1 0.2 0.3"/></geometry></collision>
  </link>
</robot>"""


def scene_of(folder: Path, visual: str) -> RobotScene:
    """A robot of one link with a visual shape."""
    (folder / "arm.urdf").write_text(URDF.format(visual=visual))
    return RobotScene(replace(load_robot(None), urdf=folder / "arm.urdf"))


def test_the_shipped_robot_has_all_of_its_shapes() -> None:
    robot = load_robot(None)
    described = RobotScene(robot).description()
    assert described["name"] == "arduinobot"
    assert len(described["shapes"]) == robot.urdf.read_text().count("<visual>")
    assert {shape["link"] for shape in described["shapes"]} <= set(described["links"])
    (gripper,) = [joint for joint in described["joints"] if joint["mimic"]]
    assert gripper["mimic"] == ["joint_4", -1.0, 0.0]


def test_meshes_are_found_by_the_hash_of_their_content(tmp_path: Path) -> None:
    (tmp_path / "a.stl").write_bytes(BEAM.read_bytes())
    (tmp_path / "B.STL").write_bytes(BEAM.read_bytes())
    other = '<mesh filename="B.STL" scale="2 2 2"/></geometry></visual><visual><geometry>'
    scene = scene_of(tmp_path, f'{other}<mesh filename="a.stl"/>')
    two, one = scene.description()["shapes"]
    assert one["mesh"] == two["mesh"]
    assert (one["kind"], one["sizes"], one["color"]) == ("mesh", (1, 1, 1), (1, 0, 0, 1))
    assert (two["sizes"], two["xyz"], two["rpy"]) == ((2, 2, 2), (1, 2, 3), (0, 0, 1))
    assert scene.mesh(one["mesh"]) == BEAM.read_bytes()
    with pytest.raises(NotFound):
        scene.mesh("0" * 32)


@pytest.mark.parametrize(
    "visual",
    [
        '<mesh filename="arm.dae"/>',
        '<mesh filename="missing.stl"/>',
        '<mesh filename="file:///dev/zero"/>',
        '<mesh filename="a.stl" scale="0 1 nan"/>',
        '<sphere radius="-1"/>',
        "<torus/>",
        "",
    ],
)
def test_a_link_whose_visual_cannot_be_shown_has_its_collision_shape(
    tmp_path: Path, visual: str
) -> None:
    (tmp_path / "arm.dae").write_text("<collada/>")
    (tmp_path / "a.stl").write_bytes(BEAM.read_bytes())
    (shape,) = scene_of(tmp_path, visual).description()["shapes"]
    assert (shape["kind"], shape["sizes"], shape["color"]) == ("box", (0.1, 0.2, 0.3), None)


def test_joints_are_in_the_order_of_the_robot_file_with_their_limits() -> None:
    robot = load_robot(Path("so101"))
    joints = RobotScene(robot).description()["joints"]
    actuated = robot.actuated
    assert [each["name"] for each in joints[: len(actuated)]] == [each.name for each in actuated]
    assert joints[0]["limits"] == [actuated[0].lower, actuated[0].upper]

"""Shapes of a URDF that cannot be read are refused: an arm is never planned for without them."""

import json
import re
from pathlib import Path

import pytest

from hardware import Robot, load_robot
from skills.motion import ModelUnusable
from skills.motion.robot_model.robot_model import RobotModel
from tests.support.arms.robots import pair_file
from tests.support.paths import DATA

BOX = '<geometry><box size="0.1 0.1 0.1"/></geometry>'
_LINK = '<link name="{0}"><collision>{1}</collision></link>'
_JOINT = """<joint name="{0}" type="revolute"><parent link="{1}"/><child link="{2}"/>
<origin xyz="0.3 0 0"/><axis xyz="0 0 1"/><limit lower="-2" upper="2" velocity="9" effort="1"/>
{3}</joint>"""


def arm(folder: Path, shape: str, more: str = "") -> Robot:
    """Three links in a row; the one in the middle has a shape of its own."""
    links = _LINK.format("base", BOX) + _LINK.format("tip", BOX)
    links += f'<link name="middle"><collision>{shape}</collision>{more}</link>'
    follows = '<mimic joint="lead"/>'
    joints = _JOINT.format("lead", "base", "middle", "")
    joints += _JOINT.format("mate", "middle", "tip", follows)
    (folder / "arm.urdf").write_text(f'<robot name="arm">{links}{joints}</robot>')
    (folder / "arm.toml").write_text(pair_file("lead", "mate"))
    return load_robot(folder / "arm.toml")


def refusal(robot: Robot) -> str:
    with pytest.raises(ModelUnusable) as caught:
        RobotModel(robot)
    assert caught.value.path == str(robot.urdf)
    return str(caught.value)


@pytest.mark.parametrize(
    ("shape", "why"),
    [
        ('<sphere radius="-0.05"/>', "the radius of the sphere of middle is '-0.05'; give a num"),
        ('<sphere radius="0"/>', "the radius of the sphere of middle is '0'; give"),
        ('<sphere radius="1e400"/>', "is '1e400'; give a number above 0, up to 1e+06 m"),
        ('<sphere radius="nan"/>', "the radius of the sphere of middle is 'nan'"),
        ('<sphere radius="0,1"/>', "the radius of the sphere of middle is '0,1'"),
        ('<sphere radius="1_0"/>', "the radius of the sphere of middle is '1_0'; give a number"),
        ("<sphere/>", "the radius of the sphere of middle is missing; give a number above 0"),
        ('<cylinder radius="-1" length="-1"/>', "the radius of the cylinder of middle is '-1'"),
        ('<cylinder radius="1" length="0"/>', "the length of the cylinder of middle is '0'"),
        ('<box size="0.1 0.1 0"/>', "is '0.1 0.1 0'; give three numbers above 0, up to 1e+06 m"),
        ('<box size="0.1 -0.1 0.1"/>', "the size of the box of middle is '0.1 -0.1 0.1'"),
        ('<box size="nan 0.1 0.1"/>', "the size of the box of middle is 'nan 0.1 0.1'"),
        ('<box size="1e400 1 1"/>', "the size of the box of middle is '1e400 1 1'"),
        ('<box size="1e300 1 1"/>', "the size of the box of middle is '1e300 1 1'"),
        ('<box size="1e-400 1 1"/>', "the size of the box of middle is '1e-400 1 1'"),
        ('<box size="0.1 0.1"/>', "the size of the box of middle is '0.1 0.1'; give three"),
        ('<capsule radius="0.1" length="0.2"/>', "middle has a capsule; give one of box, sphere"),
        ("", "a collision of middle has 0 shapes; give each one shape"),
        ('<box size="1 1 1"/><sphere radius="1"/>', "a collision of middle has 2 shapes; give"),
        ("<mesh/>", "the filename of the mesh of middle is missing; give the name of a file"),
        ('<mesh filename="a.stl" scale="1 0 1"/>', "the scale of the mesh of middle is '1 0 1'"),
        (
            '<mesh filename="a.stl" scale="1 1"/>',
            "three numbers other than 0, from -1e+06 to 1e+06",
        ),
        ('<mesh filename="a.stl"/>', "the mesh a.stl is not found; copy the file"),
    ],
)
def test_a_shape_that_is_none(tmp_path: Path, shape: str, why: str) -> None:
    assert why in refusal(arm(tmp_path, f"<geometry>{shape}</geometry>"))


@pytest.mark.parametrize(
    ("origin", "why"),
    [
        ('xyz="nan 0 0"', "the xyz of an origin of middle is 'nan 0 0'; give three numbers"),
        ('xyz="0 0"', "the xyz of an origin of middle is '0 0'"),
        ('xyz="0 0 1e300"', "three numbers from -1e+06 to 1e+06"),
        ('rpy="inf 0 0"', "the rpy of an origin of middle is 'inf 0 0'"),
    ],
)
def test_a_place_that_is_none(tmp_path: Path, origin: str, why: str) -> None:
    assert why in refusal(arm(tmp_path, f"<origin {origin}/>{BOX}"))


def test_what_only_we_can_read(tmp_path: Path) -> None:
    """Pinocchio would plan without the shape, so it is refused too."""
    why = refusal(arm(tmp_path, '<geometry><sphere radius=" 0.1 "/></geometry>'))
    assert "pinocchio reads 0 of the 1 shapes of middle; give plain numbers" in why


def test_more_than_one_shape(tmp_path: Path) -> None:
    robot = arm(tmp_path, BOX, f"<collision>{BOX}</collision>")
    assert len(RobotModel(robot).exact) == 4
    wrong = '<collision><geometry><sphere radius="-1"/></geometry></collision>'
    assert "the radius of the sphere of middle" in refusal(arm(tmp_path, BOX, wrong))


@pytest.mark.parametrize("mesh", [b"", b"rubbish", b"solid a\nendsolid a\n", bytes(200)])
def test_a_file_that_is_no_mesh(tmp_path: Path, mesh: bytes) -> None:
    (tmp_path / "a.stl").write_bytes(mesh)
    why = refusal(arm(tmp_path, '<geometry><mesh filename="a.stl"/></geometry>'))
    assert "a.stl cannot be read as a mesh" in why


@pytest.mark.parametrize("far", ["1e300 0 0", "0 -2e6 0"])
@pytest.mark.parametrize("kind", ["revolute", "fixed"])
def test_a_link_absurdly_far_off(tmp_path: Path, kind: str, far: str) -> None:
    robot = arm(tmp_path, BOX)
    urdf = robot.urdf.read_text()
    if kind == "revolute":
        urdf = urdf.replace('xyz="0.3 0 0"', f'xyz="{far}"')
    else:
        joint = f"""<joint name="far" type="fixed"><parent link="tip"/><child link="end"/>
            <origin xyz="{far}"/></joint></robot>"""
        urdf = urdf.replace("</robot>", _LINK.format("end", BOX) + joint)
    robot.urdf.write_text(urdf)
    who = "lead is" if kind == "revolute" else "end: a vertex is not"
    assert re.search(f"{who} .* 1e.06", refusal(robot))


def test_joints_that_hang_from_nothing(tmp_path: Path) -> None:
    """As where the URDF was written anew since."""
    robot = arm(tmp_path, BOX)
    urdf = robot.urdf.read_text().replace('<parent link="base"/>', '<parent link="tip"/>')
    robot.urdf.write_text(urdf)
    assert "joint lead is its own ancestor" in refusal(robot)


def chain(folder: Path, joints: int, shapes: int = 0) -> Robot:
    """Links in a row, and shapes of the first one."""
    links = "".join(f'<link name="{i}"/>' for i in range(1, joints + 1))
    base = f'<link name="0">{"<collision>" + BOX + "</collision>" if shapes else ""}</link>'
    base = base.replace("</link>", f"<collision>{BOX}</collision>" * (shapes - 1) + "</link>")
    turning = "".join(_JOINT.format(f"j{i}", i, i + 1, "") for i in range(joints))
    (folder / "arm.urdf").write_text(f'<robot name="arm">{base}{links}{turning}</robot>')
    names = [f"j{i}" for i in range(joints)]
    tables = (f"[joints.{name}]\nvelocity = 1.0\nacceleration = 1.0\nboot = 0.0" for name in names)
    head = 'name = "arm"\nurdf = "arm.urdf"'
    groups = f"[groups]\narm = {json.dumps(names)}"
    rules = "[collision]\nmargin_m = 0.0\nfloor_ignores = []\nallowed = []"
    (folder / "arm.toml").write_text("\n".join((head, groups, *tables, rules)))
    return load_robot(folder / "arm.toml")


def test_an_arm_with_too_many_joints_or_shapes(tmp_path: Path) -> None:
    """Cost and memory grow with the third power of both."""
    assert "it has 101 moving joints; the limit is 100" in refusal(chain(tmp_path, 101))
    many = chain(tmp_path, 2, shapes=1001)
    assert "it has 1001 collision shapes; the limit is 1000" in refusal(many)
    RobotModel(chain(tmp_path, 100))


def test_a_mesh_of_several_links_is_loaded_once(tmp_path: Path) -> None:
    mesh = f'<mesh filename="{DATA}/beam.stl"/>'
    again = f"<collision><geometry>{mesh}</geometry></collision>"
    model = RobotModel(arm(tmp_path, f"<geometry>{mesh}</geometry>", again))
    pairs = zip(model.exact, model.volumes, strict=True)
    meshes = [shape.geometry for shape, volume in pairs if volume]
    assert len(meshes) == 2
    assert len({mesh.id() for mesh in meshes}) == 1

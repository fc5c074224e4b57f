"""The width of a gripper, against the boxes of its fingers."""

import math
from xml.etree import ElementTree

import pytest

from hardware import BadPosition, load_robot
from hardware.description.forward_kinematics import ForwardKinematics
from hardware.description.urdf import Urdf

ROBOT = load_robot()
PAD = "0.0122 0.0092"  # y and z of the boxes of the pads


def inner_face(link: str, side: int) -> list[float]:
    """The middle of the face of a pad that looks to the other finger."""
    root = ElementTree.parse(ROBOT.urdf).getroot()
    for shape in root.findall(f"link[@name='{link}']/collision"):
        size = shape.find("geometry/box").attrib["size"]  # type: ignore[union-attr]
        if size.endswith(PAD):
            x, y, z = map(float, shape.find("origin").attrib["xyz"].split())  # type: ignore[union-attr]
            return [x + side * float(size.split()[0]) / 2, y, z]
    raise AssertionError


def test_the_pads_of_the_arduinobot_are_those_of_its_urdf() -> None:
    assert ROBOT.gripper
    faces = {"gripper_right": inner_face("gripper_right", -1)}
    faces["gripper_left"] = inner_face("gripper_left", 1)
    assert ROBOT.gripper.pads.keys() == faces.keys()
    for link, face in faces.items():
        assert ROBOT.gripper.pads[link] == pytest.approx(face)


@pytest.mark.parametrize("mm", [0.8, 1.0, 20.0, 61.4, 105.8])
def test_a_width_becomes_a_position_and_back(mm: float) -> None:
    assert ROBOT.gripper
    ((name, q),) = ROBOT.at_width(mm / 1e3).items()
    assert name == "joint_4"
    assert -math.pi / 2 <= q <= 0.0
    kinematics = ForwardKinematics(Urdf.read(ROBOT.urdf))
    assert 1e3 * ROBOT.gripper.width(kinematics, q) == pytest.approx(mm, abs=0.01)


@pytest.mark.parametrize("width", [0.0, -0.02, 0.106, 20.0, math.inf])
def test_no_gripper_opens_beyond_its_limits(width: float) -> None:
    with pytest.raises(BadPosition, match=r"outside its limits, 0\.8 mm to 105\.8 mm"):
        ROBOT.at_width(width)

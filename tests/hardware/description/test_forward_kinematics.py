"""Forward kinematics, compared with pinocchio."""

import random
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from hardware import Robot, load_robot
from hardware.description.forward_kinematics import ForwardKinematics, Quaternion
from hardware.description.urdf import Urdf
from logs import Description, Recorder, Sent, read
from tests.logs.test_run import EPOCH_NS, fail


def matrix(q: Quaternion) -> "np.ndarray[tuple[int, ...], np.dtype[np.float64]]":
    x, y, z, w = q
    made: np.ndarray[tuple[int, ...], np.dtype[np.float64]] = pin.Quaternion(w, x, y, z).matrix()
    return made


def test_as_pinocchio_places_them(robot: Robot) -> None:
    kinematics, rng = ForwardKinematics(Urdf.read(robot.urdf)), random.Random(1)
    model = pin.buildModelFromUrdf(str(robot.urdf))
    data = model.createData()
    for _ in range(20):
        positions = {j.name: rng.uniform(j.lower, j.upper) for j in robot.actuated}
        full = {
            j.name: j.mimic.value(positions[j.mimic.leader]) if j.mimic else positions[j.name]
            for j in robot.joints
        }
        q = np.array([full[name] for name in model.names[1:]])
        pin.framesForwardKinematics(model, data, q)
        for place in kinematics.transforms(positions):
            parent, child = (data.oMf[model.getFrameId(n)] for n in (place.parent, place.child))
            wanted = parent.actInv(child)
            assert np.allclose(wanted.translation, place.position, atol=1e-12)
            assert np.allclose(wanted.rotation, matrix(place.rotation), atol=1e-12)
            point = 0.1, -0.2, 0.3
            found = kinematics.locate(place.child, point, positions)
            assert np.allclose(child.act(np.array(point)), found, atol=1e-12)


def test_a_sliding_joint_moves_along_its_turned_axis() -> None:
    joint = '<joint name="a" type="prismatic"><parent link="p"/><child link="c"/>'
    joint += '<origin xyz="1 0 0" rpy="0 0 1.5707963267948966"/><axis xyz="2 0 0"/>'
    joint += '<limit lower="0" upper="1" velocity="1" effort="1"/></joint>'
    urdf = f'<robot name="r"><link name="p"/><link name="c"/>{joint}</robot>'
    (place,) = ForwardKinematics(Urdf(urdf).checked()).transforms({"a": 0.5})
    assert place.position == pytest.approx((1.0, 0.5, 0.0))


def test_late_frames_and_links_are_recorded(tmp_path: Path, robot: Robot) -> None:
    with Recorder(tmp_path / "x.mcap", EPOCH_NS, fail) as recorder:
        recorder.put(Sent(0.0, b"", 0.0, False, ("joint_1",), (0.3,)))
        recorder.put(Description(0.5, robot.urdf.read_text()))
        recorder.put(Sent(1.0, b"", 0.995, False, ("joint_1",), (0.3,)))
        recorder.put(Sent(2.0, b"", 1.95, False, ("joint_1",), (0.3,)))
    found = {topic: list(read(recorder.path, {topic})) for topic in ("/tf", "/diagnostics")}
    assert len(found["/tf"]) == 2
    assert {t.child_frame_id for t in found["/tf"][0].data.transforms} >= {"base_plate"}
    (late,) = found["/diagnostics"]
    assert late.data.status[0].message == "a frame was sent 50.0 ms late"


@pytest.mark.parametrize("name", ["arduinobot", "so101"])
def test_the_reach_is_a_bound_in_any_order_of_joints(name: str) -> None:
    robot, rng = load_robot(Path(name)), random.Random(1)
    far = 0.0
    for _ in range(50):
        tool = robot.tool_position({j.name: rng.uniform(j.lower, j.upper) for j in robot.actuated})
        assert tool
        far = max(far, float(np.linalg.norm(tool)))
    assert robot.tool
    assert far - float(np.linalg.norm(robot.tool.offset)) < robot.reach < 2 * far

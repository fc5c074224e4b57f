"""The calibration file: what it changes, and when an arm may not move without it."""

import math
from pathlib import Path

import pytest

from hardware import SimulatedClock, load_robot, shipped_robots
from hardware.description.calibration import (
    CalibratedJoint,
    calibration_file,
    earlier_values,
    is_robot_file,
    write_calibration,
)
from hardware.drivers.feetech.virtual.bus import Bus
from hardware.drivers.servo_errors import CalibrationDiffers, CalibrationMissing
from hardware.errors import BadPosition, DescriptionError, NotAble
from tests.support.arms.bus_arms import BusRig, bus_arm


def calibrate(robot_file: Path, homing: int = 12, **wires: str) -> Path:
    """Writes the calibration of four joints, from -50 to 40 deg each."""
    joints = {}
    for k in range(1, 5):
        wire = (
            f"{{ id = {k}, sign = 1, offset_deg = 5, homing = {homing}, least = 900, most = 3000 }}"
        )
        name = f"joint_{k}"
        joints[name] = CalibratedJoint(-50.0, 40.0, wires.get(name, wire), {"homing": 0})
    path = calibration_file(robot_file)
    write_calibration(path, "arduinobot", "2026-11-23, by a test", joints)
    return path


def test_a_calibration_takes_precedence_over_the_robot_file(tmp_path: Path) -> None:
    file = bus_arm(tmp_path)
    before = load_robot(file)
    path = calibrate(file)
    robot = load_robot(file)
    assert robot.calibration == path
    assert robot.files == (file, robot.urdf, path)
    first = robot.actuated[0]
    assert (first.lower, first.upper) == pytest.approx((math.radians(-50), math.radians(40)))
    start = (0.0, 0.0, 0.0, 0.0)
    moved = robot.wire_format.encode(start).servos[0] - before.wire_format.encode(start).servos[0]
    assert moved == round(5 * 4096 / 360)
    assert load_robot(file, calibrated=False).actuated == before.actuated
    assert earlier_values(path, robot.name, 4096)["joint_2"] == {"homing": (0, 12)}
    calibrate(file, homing=5000)
    assert earlier_values(path, robot.name, 8192)["joint_2"] == {"homing": (0, 5000)}
    with pytest.raises(DescriptionError, match="5000 is not from -4095 to 4095"):
        earlier_values(path, robot.name, 4096)


def test_a_position_outside_the_calibrated_range_is_refused(tmp_path: Path) -> None:
    file = bus_arm(tmp_path)
    calibrate(file)
    with pytest.raises(BadPosition, match=r"joint_1 = 60 deg is outside its limits, -50 deg to 40"):
        load_robot(file).wire_format.encode((math.radians(60), 0.0, 0.0, 0.0))


def test_an_arm_moves_with_its_calibration(tmp_path: Path) -> None:
    file = bus_arm(tmp_path)
    calibrate(file)
    made = BusRig(file, [])
    with made.clock.working(), made.arm:
        made.arm.configure()
        made.arm.activate()
        assert made.play((0.5, -0.5, 0.3, -0.2), 2.0) is None


def test_the_calibration_of_another_arm_is_refused_before_anything_moves(tmp_path: Path) -> None:
    file = bus_arm(tmp_path)
    calibrate(file)
    made = BusRig(file, [])
    made.bus.servos[2].put("offset", -7)
    with made.clock.working(), made.arm:
        made.arm.configure()
        why = "Servo 3 of joint_3 stores homing = -7; the calibration file has 12. The file"
        with pytest.raises(CalibrationDiffers, match=why):
            made.arm.activate()
        assert not any(made.bus.state(made.clock.now()).torque.values())


@pytest.mark.parametrize(
    ("old", "new", "why"),
    [
        ("version = 1", "version = 2", "version: 2 is not one of 1"),
        ('robot = "arduinobot"', 'robot = "so101"', "the file is for so101, not arduinobot"),
        ("[joints.joint_2]", "[joints.joint_9]", "joint_2"),
        ("lower_deg = -50.000", "lower_deg = 100.0", "this range and the limits"),
        ("id = 1", "id = 2", "its servo 2 is already the servo of"),
        ("homing = 12", 'homing = "12"', "joint_1.wire.homing"),
    ],
)
def test_a_wrong_calibration_is_refused(tmp_path: Path, old: str, new: str, why: str) -> None:
    file = bus_arm(tmp_path)
    path = calibrate(file)
    path.write_text(path.read_text().replace(old, new, 1))
    with pytest.raises(DescriptionError, match=why):
        load_robot(file)


def test_an_arm_that_needs_a_calibration_has_no_real_port_without_it(tmp_path: Path) -> None:
    file = bus_arm(tmp_path)
    file.write_text(f"needs_calibration = true\n{file.read_text()}")
    robot = load_robot(file)
    assert robot.simulated_link(SimulatedClock())
    why = r"needs a calibration, and .*arm\.calibration\.toml does not exist\. Write it with "
    why += rf"`armtree calibrate --robot {file} --port /dev/ttyACM0`"
    with pytest.raises(CalibrationMissing, match=why):
        robot.link("/dev/ttyACM0")
    calibrate(file)
    assert load_robot(file).link("/dev/ttyACM0").port == "/dev/ttyACM0"


def test_the_model_of_a_calibrated_arm_keeps_what_its_servos_keep(tmp_path: Path) -> None:
    file = bus_arm(tmp_path)
    calibrate(file)
    bus = load_robot(file).model()
    assert isinstance(bus, Bus)
    assert {servo.get("min_angle") for servo in bus.servos} == {900}


def test_the_calibration_of_a_robot_that_ships_is_in_the_folder_of_the_user(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    shipped = load_robot(Path("so101"))
    path = calibration_file(shipped.path)
    assert path == tmp_path / "armtree" / "so101.calibration.toml"
    assert shipped.calibration is None
    why = f"{path} does not exist. Write it with `armtree calibrate --robot so101 --port"
    with pytest.raises(CalibrationMissing, match=why):
        shipped.link("/dev/ttyACM0")
    joints = {
        joint.name: CalibratedJoint(-20.0, 20.0, f"{{ id = {id_}, sign = 1, offset_deg = 0 }}", {})
        for joint, id_ in zip(shipped.actuated, range(1, 7), strict=True)
    }
    write_calibration(path, shipped.name, "by a test", joints)
    for named in (Path("so101"), shipped.path):
        robot = load_robot(named)
        assert robot.calibration == path
        assert robot.actuated[0].upper == pytest.approx(math.radians(20))
    monkeypatch.setenv("XDG_CONFIG_HOME", "relative")  # not valid, by the XDG specification
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    own = tmp_path / "home" / ".config" / "armtree" / "so101.calibration.toml"
    assert calibration_file(shipped.path) == own


def test_a_calibration_is_no_robot_of_its_own() -> None:
    shipped = shipped_robots()["so101"]
    assert is_robot_file(shipped)
    assert not is_robot_file(calibration_file(shipped))
    assert load_robot(Path("so101")).needs_calibration


def test_an_arm_without_bus_servos_cannot_be_calibrated() -> None:
    with pytest.raises(NotAble, match="cannot find its servos and name them"):
        _ = load_robot().servos

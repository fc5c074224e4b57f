"""Robot files without a driver: an arm that can be planned for but not moved."""

import re
from pathlib import Path

import pytest

from hardware import Arm, DescriptionError, NoDriver, RealClock, compile_schedule, load_robot
from tests.support.arms.robots import ARMS, foreign
from tests.support.paths import DATA


@pytest.mark.parametrize("name", ARMS)
def test_a_robot_file_may_leave_out_the_board(name: str) -> None:
    robot = foreign(name)
    assert robot.serial.port == ""
    assert [joint.mimic for joint in robot.actuated] == [None] * len(robot.actuated)


def test_prismatic_joints_are_in_metres_and_continuous_joints_have_no_limits() -> None:
    units = {joint.name: joint.unit for joint in foreign("seven_axes").joints}
    assert (units["finger_1"], units["finger_2"], units["axis_1"]) == ("m", "m", "rad")
    assert [joint.name for joint in foreign("endless").joints if joint.continuous]
    assert not any(joint.continuous for joint in load_robot().joints)


def test_it_cannot_be_moved_and_the_error_explains_why() -> None:
    robot = foreign("seven_axes")
    why = re.escape(f"{robot.path} names no driver")
    with pytest.raises(NoDriver, match=why):
        robot.link("virtual")
    with pytest.raises(NoDriver, match=why):
        compile_schedule(robot, robot.boot_pose, lambda times: [], 1.0)
    with pytest.raises(NoDriver, match=why):
        Arm(robot, None, RealClock()).configure()


FINGER = "velocity = 0.2\nacceleration = 2.0\nboot = "
WRONG = {
    "a wire alone": ("boot = 0.0", 'boot = 0\nwire = { letter = "b" }', "wire: needs a driver"),
    "a port alone": ("[groups]", '[serial]\nport = "virtual"\n[groups]', "driver: is missing"),
    "a driver alone": ("[groups]", 'driver = "serial_servo"\n[groups]', "wire: is missing"),
    "a misspelt driver": ("[groups]", "drivr = 1\n[groups]", "drivr: .*did you mean driver"),
    "too fast": ("velocity = 0.2", "velocity = 2", "2 m/s is more than the URDF's limit, 0.2 m/s"),
    "boots outside": (f"{FINGER}0.0", f"{FINGER}0.5", r"boot: 0.5 is outside \[0, 0.04\]"),
}


@pytest.mark.parametrize(("old", "new", "why"), WRONG.values(), ids=WRONG)
def test_half_a_board_is_a_mistake(tmp_path: Path, old: str, new: str, why: str) -> None:
    text = (DATA / "seven_axes.toml").read_text()
    assert old in text
    (tmp_path / "seven_axes.urdf").write_text((DATA / "seven_axes.urdf").read_text())
    (tmp_path / "arm.toml").write_text(text.replace(old, new, 1))
    with pytest.raises(DescriptionError, match=why):
        load_robot(tmp_path / "arm.toml")

"""Robot files without a driver: an arm that moves on the virtual port only."""

import re
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis.strategies import DataObject, data, floats, sampled_from

from hardware import (
    VIRTUAL,
    Clock,
    DescriptionError,
    NoDriver,
    RealClock,
    SimulatedClock,
    load_robot,
)
from tests.support.arms.robots import ARMS, foreign
from tests.support.paths import DATA


@pytest.mark.parametrize("name", ARMS)
def test_a_robot_file_may_leave_out_the_board(name: str) -> None:
    robot = foreign(name)
    assert robot.serial.port == VIRTUAL
    assert robot.link(VIRTUAL).port == VIRTUAL
    assert [joint.mimic for joint in robot.actuated] == [None] * len(robot.actuated)


def test_prismatic_joints_are_in_metres_and_continuous_joints_have_no_limits() -> None:
    units = {joint.name: joint.unit for joint in foreign("seven_axes").joints}
    assert (units["finger_1"], units["finger_2"], units["axis_1"]) == ("m", "m", "rad")
    assert [joint.name for joint in foreign("endless").joints if joint.continuous]
    assert not any(joint.continuous for joint in load_robot().joints)


def test_a_real_port_is_refused_and_the_error_explains_why() -> None:
    robot = foreign("seven_axes")
    with pytest.raises(NoDriver, match=re.escape(f"{robot.path} names no driver")):
        robot.link("/dev/ttyACM0")


@given(data())
def test_frames_are_positions_in_millionths(data: DataObject) -> None:
    robot = foreign(data.draw(sampled_from(ARMS)))
    limits = [(max(j.lower, -10.0), min(j.upper, 10.0)) for j in robot.actuated]
    positions = [data.draw(floats(*each)) for each in limits]
    wire = robot.wire_format
    frame = wire.encode(positions)
    assert wire.frame(frame.servos) == frame
    assert wire.decode(frame) == pytest.approx(positions, abs=1e-6)
    assert wire.encode(wire.decode(frame)) == frame or not all(
        low < q < high for q, (low, high) in zip(positions, limits, strict=True)
    )


@pytest.mark.parametrize("clock", [RealClock(), SimulatedClock()], ids=["real", "simulated"])
def test_a_closed_link_ends_its_reader(clock: Clock) -> None:
    link = foreign("endless").simulated_link(clock)
    link.open()
    read = list[bytes]()
    reader = clock.spawn(lambda: read.append(link.read()), "reader")
    link.write(b"any bytes")
    link.close()
    reader.join()
    assert read == [b""]


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

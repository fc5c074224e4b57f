"""A board that was unplugged comes back, perhaps under another name."""

import dataclasses
import logging
from contextlib import closing
from pathlib import Path

import pytest

from hardware import Arm, PortMissing, RealClock, SerialLink, State, VirtualArduino, load_robot
from hardware import ports as ports_module
from hardware.lookout import Lookout
from tests.hardware_rigs import settled_for

ROBOT = load_robot()
BOARD = ("bseg", (90, 90, 90, 0), dataclasses.replace(ROBOT.firmware, boot_time=0.0), 115200)
PATIENCE = 10.0  # [s]


@pytest.fixture
def by_id(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where udev keeps the lasting names."""
    monkeypatch.setattr(ports_module, "_BY_ID", tmp_path)
    return tmp_path / "usb-Arduino_Uno_1234-if00"


def test_a_board_that_comes_back_under_another_name_is_reported(
    by_id: Path, caplog: pytest.LogCaptureFixture
) -> None:
    robot = dataclasses.replace(ROBOT, serial=dataclasses.replace(ROBOT.serial, boot_wait=0.0))
    first = VirtualArduino(*BOARD)
    by_id.symlink_to(first.port)
    with Arm(robot, SerialLink(first.port, 115200), RealClock()) as arm:
        arm.configure()
        arm.activate()
        by_id.unlink()
        first.close()
        settled_for(arm, State.UNCONFIGURED, PATIENCE)
        with closing(VirtualArduino(*BOARD)) as second, caplog.at_level(logging.WARNING):
            by_id.symlink_to(second.port)
            back = f"The board of port {first.port} is back as {second.port}; configure and"
            until = RealClock().now() + PATIENCE
            signal = RealClock().signal()
            while back not in caplog.text:
                assert RealClock().now() < until
                with signal:
                    signal.wait(RealClock().now() + 0.01)
        assert arm.state is State.UNCONFIGURED  # coming back is a person's act


def test_who_configures_again_looks_out_no_longer(by_id: Path) -> None:
    with closing(VirtualArduino(*BOARD)) as arduino:
        by_id.symlink_to(arduino.port)
        lookout = Lookout(arduino.port, RealClock())
    by_id.unlink()
    thread = lookout.begin()
    assert thread
    lookout.end()
    thread.join(PATIENCE)
    assert not thread.is_alive()


@pytest.mark.usefixtures("by_id")
def test_nobody_looks_out_for_a_port_without_a_lasting_name() -> None:
    with closing(VirtualArduino(*BOARD)) as arduino:
        assert Lookout(arduino.port, RealClock()).begin() is None


def test_a_missing_port_is_told_the_lasting_names(
    by_id: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = [ports_module.SerialPort("/dev/ttyACM1", "Uno", "2341:0043", str(by_id))]
    monkeypatch.setattr("hardware.serial_link.serial_ports", lambda: found)
    with pytest.raises(PortMissing, match=f"present: /dev/ttyACM1 = {by_id}"):
        SerialLink("/dev/ttyACM0", 115200).open()

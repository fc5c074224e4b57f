"""The contracts of drivers and links, kept by what ships."""

import os
import select
from collections import deque
from pathlib import Path

import pytest

from hardware import BoardLink, Link, RealClock, SerialLink, load_robot
from hardware.drivers.arduino.serial_servo import SerialServo
from hardware.testing import DriverContract, LinkContract
from tests.support.arms.hardware_rigs import Pty
from tests.support.paths import DATA

STOCK = load_robot().path


class TestPublishedSketch(DriverContract):
    robot_file = STOCK


class TestFirmwareOfArmtree(DriverContract):
    @pytest.fixture(autouse=True)
    def write(self, tmp_path: Path) -> None:
        text = STOCK.read_text().replace('firmware = "stock"', 'firmware = "armtree"')
        self.robot_file = tmp_path / "robot.toml"
        self.robot_file.write_text(text)
        (tmp_path / "arduinobot.urdf").write_bytes(load_robot().urdf.read_bytes())


class TestSerialPort(LinkContract):
    def make_link(self) -> Link:
        self.pty = Pty()
        return SerialLink(self.pty.port, 115200)

    def send(self, data: bytes) -> None:
        os.write(self.pty.master, data)

    def received(self, count: int) -> bytes:
        data = b""
        while len(data) < count:
            select.select([self.pty.master], [], [])
            data += self.pty.drain()
        return data

    def unplug(self) -> None:
        os.close(self.pty.slave)
        self.pty.slave = -1
        self.pty.vanish()

    def close(self) -> None:
        self.pty.vanish()
        if self.pty.slave >= 0:
            os.close(self.pty.slave)


class Loop:
    """A model of a board that keeps all bytes, and sends what a test wants."""

    def __init__(self) -> None:
        self.got, self.sends = b"", deque[bytes]()

    def open(self, now: float) -> None:
        self.got = b""

    def receive(self, data: bytes, now: float) -> None:
        self.got += data

    def cut_off(self, now: float) -> None:
        pass

    def read_output(self, now: float) -> bytes:
        return self.sends.popleft() if self.sends else b""

    def next_output(self) -> float | None:
        return None

    def state(self, now: float) -> bytes:
        return self.got


class TestBoardInThisProcess(LinkContract):
    def make_link(self) -> Link:
        self.link = BoardLink(Loop(), RealClock())
        return self.link

    def send(self, data: bytes) -> None:
        self.link.board.sends.append(data)

    def received(self, count: int) -> bytes:
        return self.link.board.got

    def unplug(self) -> None:
        self.link.unplug()


def test_the_contract_is_not_kept_by_every_driver(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each test of a driver finds its mistake."""
    kept, wire = TestPublishedSketch(), type(load_robot().wire_format)
    with monkeypatch.context() as patch:
        patch.setattr(wire, "decode", lambda self, frame: (0.0,) * 4)
        with pytest.raises(AssertionError, match="another frame"):
            kept.test_a_frame_decodes_to_positions_that_encode_to_it()
    with monkeypatch.context() as patch:
        patch.setattr(wire, "encode", lambda self, positions: self.frame([90, 90, 90, 0]))
        with pytest.raises(AssertionError, match="raised None"):
            kept.test_bad_positions_are_refused()
    with monkeypatch.context() as patch:
        patch.setattr(SerialServo, "__eq__", object.__eq__)
        with pytest.raises(AssertionError, match="two objects of SerialServo differ"):
            kept.test_robots_of_one_file_have_equal_drivers()
    with monkeypatch.context() as patch:
        patch.setattr(SerialServo, "model", lambda self, joints, firmware, baud: None)
        with pytest.raises(AssertionError, match="this driver has no model"):
            kept.test_motions_are_played_to_their_end()


def test_an_arm_without_a_driver_keeps_what_concerns_frames() -> None:
    class Kept(DriverContract):
        robot_file = DATA / "seven_axes.toml"

    Kept().test_a_frame_decodes_to_positions_that_encode_to_it()
    Kept().test_bad_positions_are_refused()

"""The contracts of drivers and links, kept by what ships."""

import os
import select
from collections import deque
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from hardware import BoardLink, Link, Measurement, RealClock, SerialLink, load_robot
from hardware.drivers.arduino.serial_servo import SerialServo
from hardware.drivers.feetech.protocol import BusProtocol
from hardware.drivers.feetech.wire_format import ServoFormat
from hardware.errors import MeasuredFault
from hardware.testing import DriverContract, LinkContract
from tests.hardware.drivers.feetech.test_driver import TestSts as KeptBySts
from tests.support.arms.bus_arms import bus_arm
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


def never_silent(
    self: BusProtocol, now: float, poll: Callable[[BusProtocol, float], bytes] = BusProtocol.poll
) -> bytes:
    """Polls, and does not count the requests without an answer."""
    for counts in (self._silent, self._unanswered):
        counts.update(dict.fromkeys(counts, 0))
    return poll(self, now)


@pytest.fixture
def kept(tmp_path: Path) -> DriverContract:
    """The contract of a driver that measures."""
    kept = KeptBySts()
    kept.robot_file = bus_arm(tmp_path)
    return kept


@pytest.mark.parametrize("factor", [-1.0, 2.0])
@pytest.mark.parametrize("quantity", ["velocity", "effort", "temperature", "voltage", "current"])
def test_a_driver_that_measures_wrongly_does_not_keep_the_contract(
    kept: DriverContract, monkeypatch: pytest.MonkeyPatch, quantity: str, factor: float
) -> None:
    measurement = ServoFormat.measurement

    def wrong(*arguments: object) -> Measurement:
        right = measurement(*arguments)  # type: ignore[arg-type]
        return replace(right, **{quantity: tuple(factor * v for v in getattr(right, quantity))})

    monkeypatch.setattr(ServoFormat, "measurement", wrong)
    at_rest = kept.test_the_model_at_rest_measures_what_its_author_says
    test = kept.test_a_motion_is_measured if quantity == "velocity" else at_rest
    why = rf"{quantity.removesuffix('y')}|least_v"
    with pytest.raises((AssertionError, MeasuredFault), match=why):
        test()


@pytest.mark.parametrize(
    ("name", "method", "why"),
    [
        ("poll", never_silent, "the arm has faults"),
        ("hold_commands", lambda self: b"", "no command holds"),
        ("hold_commands", lambda self: self._wires.frame([2048] * 4).data, "the arm moved from"),
    ],
)
def test_a_driver_that_ignores_silence_does_not_keep_the_contract(
    kept: DriverContract,
    monkeypatch: pytest.MonkeyPatch,
    name: str,
    method: Callable[[BusProtocol], bytes],
    why: str,
) -> None:
    monkeypatch.setattr(BusProtocol, name, method)
    with pytest.raises(AssertionError, match=why):
        kept.test_a_silent_board_is_a_fault_and_the_joints_hold()


def test_an_arm_without_a_driver_keeps_what_concerns_frames() -> None:
    class Kept(DriverContract):
        robot_file = DATA / "seven_axes.toml"

    Kept().test_a_frame_decodes_to_positions_that_encode_to_it()
    Kept().test_bad_positions_are_refused()

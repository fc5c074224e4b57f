"""An unplugged board comes back, perhaps under another device name."""

import dataclasses
import logging
import os
import threading
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path

import pytest

from hardware import (
    Arm,
    ArmEvent,
    BoardReturned,
    RealClock,
    SerialLink,
    State,
    TransitionRefused,
    load_robot,
)
from hardware.arm.reconnect import ReconnectWatcher
from hardware.drivers.arduino.virtual.board import Board
from hardware.drivers.virtual.board_process import BoardProcess
from hardware.errors import PortMissing
from hardware.link import serial_ports as ports_module
from tests.support.arms.hardware_rigs import settled_for

ROBOT = load_robot()
BOARD = ("bseg", (90, 90, 90, 0), dataclasses.replace(ROBOT.firmware, boot_time=0.0), 115200)
PATIENCE = 60.0  # [s]


@pytest.fixture
def by_id(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder in which udev keeps persistent names."""
    monkeypatch.setattr(ports_module, "_BY_ID", tmp_path)
    return tmp_path / "usb-Arduino_Uno_1234-if00"


class Watch:
    """The events of an arm, and a way to wait for them."""

    def __init__(self) -> None:
        self.events: list[ArmEvent] = []
        self._changed = threading.Condition()

    def __call__(self, event: ArmEvent) -> None:
        with self._changed:
            self.events.append(event)
            self._changed.notify_all()

    def returned(self, patience: float = PATIENCE) -> list[str]:
        """The device names of returned boards. Waits for the first."""

        def devices() -> list[str]:
            return [event.device for event in self.events if isinstance(event, BoardReturned)]

        with self._changed:
            self._changed.wait_for(devices, patience)
        return devices()


@pytest.fixture
def lost(by_id: Path) -> Iterator[tuple[Arm, Watch]]:
    """An arm whose board has just hung up; udev has not taken its name away yet."""
    robot = dataclasses.replace(ROBOT, serial=dataclasses.replace(ROBOT.serial, boot_wait=0.0))
    watch, board = Watch(), BoardProcess(Board(*BOARD))
    by_id.symlink_to(board.port)
    with Arm(robot, SerialLink(board.port, 115200), RealClock(), watch) as arm:
        arm.configure()
        arm.activate()
        held = os.open(board.port, os.O_RDWR | os.O_NOCTTY)  # else the next terminal has its name
        board.close()
        settled_for(arm, State.UNCONFIGURED, PATIENCE)
        yield arm, watch
    os.close(held)


@pytest.mark.slow
def test_a_board_that_comes_back_under_another_name_is_reported(
    by_id: Path, lost: tuple[Arm, Watch], caplog: pytest.LogCaptureFixture
) -> None:
    arm, watch = lost
    assert watch.returned(0.3) == []  # its name is still there, but not its board
    port = os.readlink(by_id)
    by_id.unlink()
    with closing(BoardProcess(Board(*BOARD))) as second:
        assert watch.returned(0.3) == []
        with caplog.at_level(logging.WARNING):
            by_id.symlink_to(second.port)
            assert watch.returned() == [second.port]
        back = f"The board of port {port} is back as {second.port}; configure and activate the arm"
        assert back in caplog.text
    assert arm.state is State.UNCONFIGURED  # only a person can activate it again


def test_the_return_is_reported_even_if_activation_was_refused(
    by_id: Path, lost: tuple[Arm, Watch]
) -> None:
    arm, watch = lost
    with pytest.raises(TransitionRefused):
        arm.activate()
    by_id.unlink()
    with closing(BoardProcess(Board(*BOARD))) as second:
        assert watch.returned(0.3) == []
        by_id.symlink_to(second.port)
        assert watch.returned() == [second.port]


@pytest.mark.parametrize("act", [Arm.configure, Arm.shutdown])
@pytest.mark.parametrize("gone", [False, True])
def test_configuring_stops_the_reconnect_watcher(
    by_id: Path, lost: tuple[Arm, Watch], act: Callable[[Arm], None], gone: bool
) -> None:
    arm, _ = lost
    if gone:
        by_id.unlink()
    (watcher,) = (thread for thread in threading.enumerate() if thread.name == "reconnect")
    act(arm)
    watcher.join(PATIENCE)
    assert not watcher.is_alive()


@pytest.mark.usefixtures("by_id")
def test_a_port_without_a_persistent_name_is_not_watched() -> None:
    with closing(BoardProcess(Board(*BOARD))) as arduino:
        assert ReconnectWatcher(arduino.port, RealClock(), Watch()).start() is None


def test_the_error_of_a_missing_port_lists_persistent_names(
    by_id: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = [ports_module.SerialPort("/dev/ttyACM1", "Uno", "2341:0043", str(by_id))]
    monkeypatch.setattr("hardware.link.serial_link.serial_ports", lambda: found)
    with pytest.raises(PortMissing, match=f"present: /dev/ttyACM1 = {by_id}"):
        SerialLink("/dev/ttyACM0", 115200).open()

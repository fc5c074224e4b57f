"""A link whose driver, or the kernel below it, does not return."""

import os
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from hardware import BoardLink, LinkError, RealClock, SerialLink, SimulatedClock, load_robot
from hardware.errors import PortLost, PortStalled
from hardware.link.timed_link import TimedLink
from tests.support.arms.hardware_rigs import Pty, left, open_files, threads
from tests.support.arms.virtual_boards import virtual_board

FRAME = b"b090,s090,e090,g000,"


class Stuck:
    """A driver. Its calls wait for `leave`."""

    port = "can0"
    unread = False

    def __init__(self) -> None:
        self.leave = threading.Event()
        self.written: list[bytes] = []
        self.entered: Callable[[], None] = lambda: None

    def open(self) -> None: ...

    def write(self, data: bytes) -> None:
        self.entered()
        self.leave.wait(5)
        self.written.append(data)

    def read(self) -> bytes:
        return b""

    def close(self, discard: bool = False) -> None:
        self.leave.wait(5)


def test_a_driver_that_does_not_return_is_a_stalled_port_and_sends_nothing_later(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    wait = "hardware.link.timed_link._WAIT"
    monkeypatch.setattr(wait, 0.1)  # until the write begins, which a busy machine delays
    driver = Stuck()
    driver.entered = lambda: monkeypatch.setattr(wait, 0.002)
    link = TimedLink(driver, RealClock())
    link.open()
    for data in (b"first", b"second"):
        with pytest.raises(PortStalled, match="A write to the port does not return: the port can0"):
            link.write(data)
    with pytest.raises(LinkError, match="the driver of can0 does not return") as failed:
        link.close()
    assert not isinstance(failed.value, PortLost)
    driver.leave.set()
    monkeypatch.setattr(wait, 0.1)
    link.close()
    assert link._writer
    link._writer.join(5)
    assert driver.written == [b"first"]


def test_a_write_that_begins_late_has_its_whole_deadline(monkeypatch: pytest.MonkeyPatch) -> None:
    """As on a busy machine. Else its bytes would be sent after the fault."""
    monkeypatch.setattr("hardware.link.timed_link._WAIT", 0.06)  # so the deadline is 0.6 s
    driver = Stuck()
    link = TimedLink(driver, RealClock())
    begin = link._run

    def begin_late(*call: Any) -> None:
        time.sleep(0.35)  # noqa: TID251, the writer gets no processor time
        threading.Timer(0.35, driver.leave.set).start()
        begin(*call)

    monkeypatch.setattr(link, "_run", begin_late)
    link.open()
    link.write(b"first")
    assert driver.written == [b"first"]
    monkeypatch.setattr(link, "_run", begin)
    link.close()


def test_what_the_driver_raises_is_raised_and_no_thread_is_left(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    driver, before = Stuck(), threads()
    driver.leave.set()

    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    link = TimedLink(driver, RealClock())
    link.open()
    link.write(b"first")
    monkeypatch.setattr(driver, "write", interrupt)
    with pytest.raises(KeyboardInterrupt):
        link.write(b"second")
    link.close()
    assert not left(before)
    monkeypatch.setattr(driver, "close", interrupt)
    with pytest.raises(KeyboardInterrupt):
        link.close()


def test_simulated_time_stands_still_during_a_write(monkeypatch: pytest.MonkeyPatch) -> None:
    """So a machine that is busy, on which a write takes long, stalls no port of a simulation."""
    monkeypatch.setattr("hardware.link.timed_link._WAIT", 1e-9)
    clock = SimulatedClock()
    link = TimedLink(BoardLink(virtual_board(load_robot()), clock), clock)
    with clock.working():
        link.open()
        for _ in range(100):
            link.write(FRAME)
        link.close()
    assert clock.now() == 0.0


@pytest.fixture
def line() -> Iterator[Pty]:
    line = Pty()
    yield line
    line.vanish()
    os.close(line.slave)


def refuse(*_: object) -> int:
    raise BlockingIOError


@pytest.mark.parametrize("progress", [refuse, lambda *_: 0])
def test_a_write_without_progress_is_a_stalled_port(
    line: Pty, progress: object, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The kernel says that the port accepts bytes, and then takes none."""
    link, before = SerialLink(line.port, 9600), open_files()
    link.open()
    with monkeypatch.context() as patch:
        patch.setattr("hardware.link.serial_link.os.write", progress)
        with pytest.raises(PortStalled):
            link.write(FRAME)
    link.close()
    assert open_files() <= before


def test_bytes_that_the_kernel_does_not_send_do_not_delay_closing(
    line: Pty, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A real port would keep them for 30 s."""
    dropped: list[bool] = []
    link = SerialLink(line.port, 9600)
    link.open()
    assert link._serial
    monkeypatch.setattr(type(link._serial), "out_waiting", 20)
    monkeypatch.setattr(link._serial, "reset_output_buffer", lambda: dropped.append(True))
    link.close()
    assert dropped == [True]

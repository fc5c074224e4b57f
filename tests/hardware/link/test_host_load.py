"""Messages about a silent board also name a busy computer, which is as likely a cause."""

import os
import threading

import pytest

from hardware import RealClock, SerialLink
from hardware.drivers.servo_errors import ServoSilent
from hardware.errors import PortStalled
from hardware.link.timed_link import TimedLink
from tests.support.arms.hardware_rigs import Pty

# This thread is always ready to run: one too many for no processor.
PROCESSORS = {"busy": set[int](), "idle": set(range(10**6))}


@pytest.fixture(params=["busy", "idle"])
def busy(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> bool:
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: PROCESSORS[request.param])
    return str(request.param) == "busy"


def check_words(error: Exception, busy: bool) -> None:
    assert "Check the cable" in str(error)
    assert ("Or the computer is busy, with" in str(error)) is busy


def test_a_silent_servo(busy: bool) -> None:
    check_words(ServoSilent(["2 of joint_2"], 6, 5, [], 0), busy)


def test_a_line_that_accepts_no_more_bytes(busy: bool) -> None:
    line = Pty()
    link = SerialLink(line.port, 115200)
    link.open()
    with pytest.raises(PortStalled) as stalled:
        link.write(bytes(1_000_000))  # more than the kernel buffers
    check_words(stalled.value, busy)
    link.close(discard=True)
    line.vanish()
    os.close(line.slave)


def test_a_driver_that_does_not_return(busy: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    wait = "hardware.link.timed_link._WAIT"
    monkeypatch.setattr(wait, 0.1)  # until the write begins, which a busy machine delays
    leave = threading.Event()
    driver = SerialLink("no port", 115200)

    def stick(_: bytes) -> None:
        monkeypatch.setattr(wait, 0.002)
        leave.wait(5)

    monkeypatch.setattr(driver, "write", stick)
    link = TimedLink(driver, RealClock())
    monkeypatch.setattr(driver, "open", lambda: None)
    link.open()
    with pytest.raises(PortStalled) as stalled:
        link.write(b"b090,")
    leave.set()
    monkeypatch.setattr(wait, 0.1)
    link.close()
    check_words(stalled.value, busy)

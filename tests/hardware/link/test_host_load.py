"""Messages about a silent board also name a busy computer, which is as likely a cause."""

import os

import pytest

from hardware.drivers.servo_errors import ServoSilent
from hardware.errors import PortStalled
from hardware.link.host_load import or_overloaded

# This thread is always ready to run: one too many for no processor.
PROCESSORS = {"busy": set[int](), "idle": set(range(10**6))}


@pytest.fixture(params=["busy", "idle"])
def busy(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> bool:
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: PROCESSORS[request.param])
    return str(request.param) == "busy"


def test_silence_on_a_busy_computer_has_two_likely_causes(busy: bool) -> None:
    errors = (
        ServoSilent(["2 of joint_2"], 6, 5, [], 0),
        PortStalled("/dev/ttyACM0", "A write to the port does not return", or_overloaded()),
    )
    for error in errors:
        assert "Check the cable" in str(error)
        assert ("Or the computer is busy, with" in str(error)) is busy

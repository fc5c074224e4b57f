"""Boards by every way, for the tests of the contract that all of them keep."""

import contextlib
from collections.abc import Iterator

import pytest

from hardware import Firmware, SimulatedClock
from hardware.drivers.arduino.firmware_profile import FIRMWARES
from tests.avr import rig
from tests.support.command_line.virtual_shells import Avr, InProcess, Port, Process, Shell, quick

pytest_plugins = ["tests.avr.fixtures"]


@pytest.fixture(params=FIRMWARES)
def firmware(request: pytest.FixtureRequest) -> Firmware:
    return quick(request.param)


SHELLS = [
    InProcess,
    Process,
    Port,
    pytest.param(Avr, marks=pytest.mark.skipif(bool(rig.missing()), reason=rig.missing())),
]


@pytest.fixture(params=SHELLS)
def shell(request: pytest.FixtureRequest, firmware: Firmware) -> Iterator[Shell]:
    """A board with each firmware, by each way."""
    yield from opened(request, firmware)


@pytest.fixture(params=SHELLS)
def ours(request: pytest.FixtureRequest) -> Iterator[Shell]:
    """A booted board with our firmware, by each way; its first line has been heard."""
    for shell in opened(request, quick("armtree")):
        shell.open()
        shell.listen()
        shell.booted()
        shell.hear(lambda lines: len(lines) == 1)
        yield shell


@pytest.fixture(params=SHELLS)
def stock(request: pytest.FixtureRequest) -> Iterator[Shell]:
    """A booted board with the published sketch, by each way."""
    for shell in opened(request, quick("stock")):
        shell.boot()
        yield shell


def opened(request: pytest.FixtureRequest, firmware: Firmware) -> Iterator[Shell]:
    shell: Shell
    if request.param is Avr:
        shell = Avr(firmware, request.getfixturevalue("built"))
    else:
        shell = request.param(firmware)
    clock = shell.clock
    # Simulated time stands still while the test is at work.
    with clock.working() if isinstance(clock, SimulatedClock) else contextlib.nullcontext():
        yield shell
        shell.end()

"""Requests to single servos, on a virtual bus in simulated time."""

from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from hardware import BoardLink, SimulatedClock
from hardware.drivers.feetech.registers import STS
from hardware.drivers.feetech.servo_bus import FeetechBus
from hardware.drivers.feetech.virtual.bus import Bus, Fault
from hardware.drivers.feetech.virtual.servo import Servo
from hardware.drivers.servo_errors import NotKept, NotReleased
from tests.support.recordings.finished import rest


class Stubborn(Servo):
    """A servo that ignores writes to a register."""

    ignored = "torque_enable"

    def write(self, address: int, values: bytes) -> None:
        if address != STS.registers[self.ignored].address:
            super().write(address, values)


class Slow(BoardLink[Bus]):
    """A link whose bytes arrive late."""

    late = 0.001  # [s]

    def read(self) -> bytes:
        data, signal, until = super().read(), self._clock.signal(), self._clock.now() + self.late
        self.late = 0.001
        with signal:
            while data and self._clock.now() < until:
                signal.wait(until)
        return data


class Late(Slow):
    """A link whose first bytes arrive very late, as on a busy machine."""

    late = 0.06


@contextmanager
def opened(
    *servos: Servo,
    faults: tuple[Fault, ...] = (),
    kind: type[BoardLink[Bus]] = BoardLink,
    clock: SimulatedClock | None = None,
) -> Iterator[FeetechBus]:
    clock = clock or SimulatedClock()
    link = kind(Bus(servos, 1_000_000, faults), clock)
    with clock.working(), FeetechBus(STS, link, clock) as bus:
        yield bus


@pytest.mark.parametrize("silent", [False, True])
def test_torque_that_stays_on_is_an_error(silent: bool) -> None:
    second = Servo(STS, 2, 2048) if silent else Stubborn(STS, 2, 2048)
    servos = Servo(STS, 1, 2048), second
    for servo in servos:
        servo.put("torque_enable", 1)
    faults = (Fault("lose", 2, 0.0, 100),) if silent else ()
    why = "do not confirm it: 2. Nothing was written"
    with opened(*servos, faults=faults) as bus, pytest.raises(NotReleased, match=why):
        bus.release([1, 2])
    assert not servos[0].get("torque_enable")


def test_a_value_that_is_not_kept_leaves_the_memory_locked() -> None:
    servo = Stubborn(STS, 1, 2048)
    servo.ignored = "min_angle"
    with opened(servo) as bus, pytest.raises(NotKept):
        bus.keep(1, {"homing": 5, "least": 100, "most": 4000})
    assert servo.get("lock") == 1
    assert (servo.kept["offset"], servo.kept["max_angle"]) == (5, 4095)


def test_a_late_answer_is_not_taken_for_that_of_the_next_servo() -> None:
    with opened(*(Servo(STS, number, 2048) for number in (1, 3)), kind=Late) as bus:
        found = bus.find([1, 2, 3])
        rest(bus._clock, 0.1)  # until the last late answer
    assert (sorted(found.servos), found.strangers) == ([1, 3], {})


class Stalled(SimulatedClock):
    """The clock of a host that does nothing for 0.1 s, once."""

    stall = 0.1  # [s]

    def _jump(self) -> None:
        before = self._now
        super()._jump()
        if self._now > before:
            self._now, self.stall = self._now + self.stall, 0.0
            super()._jump()


def test_a_stall_of_the_host_loses_no_answer() -> None:
    with opened(Servo(STS, 1, 2048), kind=Slow, clock=Stalled()) as bus:
        positions = bus.positions([1])
        rest(bus._clock, 0.1)  # until a late answer
    assert positions == {1: 2048}

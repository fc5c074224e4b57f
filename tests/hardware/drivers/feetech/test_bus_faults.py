"""What is wrong on a bus has a code, a cause and a way out, and nothing moves."""

import math
from collections.abc import Callable
from pathlib import Path

import pytest

from hardware import (
    ActivationStopped,
    Arm,
    ArmEvent,
    BoardLink,
    CommandSent,
    Faulted,
    FrameSent,
    HardwareError,
    SimulatedClock,
    State,
    load_robot,
)
from hardware.drivers.feetech.packets import Instruction, take_packets
from hardware.drivers.feetech.protocol import BusProtocol
from hardware.drivers.feetech.virtual.bus import Bus, Fault
from hardware.drivers.servo_errors import ServoFault, ServoHealth, ServoSilent
from hardware.errors import SupplyTooLow
from tests.support.arms.bus_arms import BusRig, bus_arm, rig
from tests.support.arms.hardware_rigs import PICK

LAST = 10_000  # more answers than there are


def only(*places: int) -> Callable[[Bus], None]:
    return lambda bus: bus.connect(0.0, places)


def same_id(bus: Bus) -> None:
    bus.servos[1].put("id", 3)
    bus.servos[1].push(2500)


def other_ids(bus: Bus) -> None:
    for servo in bus.servos:
        servo.put("id", servo.servo + 10)


def nothing(bus: Bus) -> None:
    """All is well but what the faults do."""


def damage(*servos: int) -> list[Fault]:
    return [Fault("damage", servo, 0.0, LAST) for servo in servos]


@pytest.mark.parametrize(
    ("change", "faults", "code", "cause", "way"),
    [
        (only(), [], "hw.servo_missing", "servos 1 (joint_1), 2 (joint_2)", "the cable"),
        (only(0), [], "hw.servo_missing", "2 (joint_2), 3 (joint_3), 4 (joint_4)", "1 servo answ"),
        (other_ids, [], "hw.servo_missing", "servos 1 (joint_1)", "armtree doctor --open"),
        (same_id, [], "hw.servo_missing", "2 (joint_2), 3 (joint_3)", "two servos may have one id"),
        (nothing, damage(1, 2, 3, 4), "hw.no_servos", "the baud rate is wrong, another", "doctor"),
        (nothing, damage(2), "hw.servo_missing", "servo 2 (joint_2)", "or the line is noisy"),
        (
            nothing,
            [Fault("impersonate", 1, 0.0, 2)],
            "hw.servo_missing",
            "servo 1 (joint_1)",
            "another servo answers with its id",
        ),
        (nothing, [Fault("brown_out", 1, 0.0)], "hw.servo_fault", "limits 4 and 14", "supply"),
    ],
    ids=["none", "1 of 4", "wrong ids", "one id twice", "other baud", "noise", "other id", "volts"],
)
def test_an_arm_on_a_wrong_bus_does_not_start(
    tmp_path: Path,
    change: Callable[[Bus], None],
    faults: list[Fault],
    code: str,
    cause: str,
    way: str,
) -> None:
    with rig(tmp_path, *faults) as made:
        change(made.bus)
        with pytest.raises(HardwareError) as caught:
            made.arm.activate()
        assert caught.value.code == code
        assert cause in str(caught.value)
        assert way in str(caught.value)
        assert made.arm.state in (State.INACTIVE, State.UNCONFIGURED)
        assert set(codes(made)) <= {Instruction.SYNC_READ}


def codes(made: BusRig) -> list[int]:
    sent = [event.data for event in made.events if isinstance(event, CommandSent | FrameSent)]
    return [packet.code for data in sent for packet in take_packets(bytearray(data))]


def test_a_low_voltage_stops_the_arm(tmp_path: Path) -> None:
    with rig(tmp_path, guards="least_v = 11.8\nwarn_v = 11.9") as made:
        made.bus.servos[1].supply = 11.7
        with pytest.raises(SupplyTooLow, match=r"joint_2 has 11\.7 V; the limit is 11\.8 V"):
            made.arm.activate()
        assert made.arm.state is State.INACTIVE
        assert set(codes(made)) == {Instruction.SYNC_READ}


def test_a_pose_outside_the_calibrated_range_is_refused(tmp_path: Path) -> None:
    with rig(tmp_path) as made:
        made.bus.servos[1].push(3900)
        with pytest.raises(HardwareError) as caught:
            made.arm.activate()
        assert caught.value.code == "hw.pose_outside"
        assert load_robot(made.robot.path).firmware.words.advice_outside in str(caught.value)


def test_an_error_before_the_start_is_reported_with_its_limits(tmp_path: Path) -> None:
    """The first request is repeated, because another servo did not answer it."""
    with rig(tmp_path, Fault("brown_out", 1, 0.0), Fault("lose", 2, 0.0, 2)) as made:
        with pytest.raises(HardwareError, match="limits 4 and 14") as caught:
            made.arm.activate()
        assert caught.value.code == "hw.servo_fault"


def test_an_error_between_the_first_requests_is_reported_with_its_value(tmp_path: Path) -> None:
    robot = load_robot(bus_arm(tmp_path))
    bus, protocol = robot.model(), robot.protocol()
    assert isinstance(bus, Bus)

    def cycle(time: float) -> None:
        bus.receive(protocol.poll(time), time)
        protocol.receive(bus.read_output(time + 0.005), time + 0.005)

    bus.servos[1].supply = 7.4
    cycle(0.0)
    bus.servos[1].supply = 3.6
    cycle(0.01)  # the answer has the limits
    with pytest.raises(ServoFault, match=r"error voltage, .* 3\.[56] V \(limits 4 and 14\)"):
        cycle(0.02)


def test_a_fault_has_the_value_of_the_first_error_that_is_about_one() -> None:
    health = ServoHealth(0.5, 1.0, 80.0, 70.0, 12.0, 4.0, 14.0)
    fault = ServoFault(1, "joint_1", ["angle sensor", "temperature"], health)
    assert (fault.value, fault.limit) == (80.0, 70.0)
    assert math.isnan(ServoFault(1, "joint_1", ["angle sensor"], health).value)


def test_only_a_servo_that_answers_every_request_twice_is_named(tmp_path: Path) -> None:
    """A late answer to the request before is no sign of another servo."""
    robot = load_robot(bus_arm(tmp_path))
    bus, protocol = robot.model(), robot.protocol()
    assert isinstance(bus, Bus)
    bus.connect(0.0, [1, 2, 3])
    for cycle in range(20):
        time = 0.1 * cycle
        bus.receive(protocol.poll(time), time)
        answers = bus.read_output(time + 0.05)
        protocol.receive(answers * (2 if cycle % 3 == 0 else 1), time + 0.05)
    with pytest.raises(HardwareError, match="servo 1 ") as caught:
        protocol.check_booted("p", 2.0)
    assert "twice" not in str(caught.value)


def test_a_late_answer_of_a_busy_host_is_no_measurement(tmp_path: Path) -> None:
    """Which of two answers belongs to the request is unknown, so the request is repeated."""
    robot = load_robot(bus_arm(tmp_path))
    bus, protocol = robot.model(), robot.protocol()
    assert isinstance(bus, Bus)

    def cycle(late: bool) -> None:
        time = max(protocol.next_poll, 0.0)
        bus.receive(protocol.poll(time), time)
        answers = bus.read_output(time + 0.05)
        one = answers[: len(answers) // 4]
        protocol.receive(one * late + answers, time + 0.05)

    for _ in range(8):
        cycle(late=True)
    assert protocol.measured is None
    for _ in range(3):
        cycle(late=False)
    assert protocol.measured
    assert min(protocol.measured.voltage) > 11.0
    with pytest.raises(ServoSilent, match="Servo 1 of joint_1"):
        any(cycle(late=True) for _ in range(20))


@pytest.mark.parametrize("pieces", [1, 2, 4])
def test_a_late_answer_of_the_last_servo_is_no_measurement(tmp_path: Path, pieces: int) -> None:
    """It comes before its turn. The other servos complete the request, and one still answers."""
    robot = load_robot(bus_arm(tmp_path))
    bus, protocol = robot.model(), robot.protocol()
    assert isinstance(bus, Bus)
    for _ in range(6):
        time = max(protocol.next_poll, 0.0)
        bus.receive(protocol.poll(time), time)
        answers = bus.read_output(time + 0.05)
        own = len(answers) // 4 * 3
        received = answers[own:] + answers[:own]
        size = len(received) // pieces
        for part in range(pieces):
            protocol.receive(received[part * size : (part + 1) * size], time + 0.005)
        assert protocol.free_at > time + 0.005
        protocol.receive(answers[own:], time + 0.006)
    assert protocol.measured is None
    with pytest.raises(HardwareError, match="Servo 4 answered twice"):
        protocol.check_booted("p", 2.0)


def test_a_position_that_a_servo_cannot_have_reached_is_not_held(tmp_path: Path) -> None:
    """Two servos with one id answer at once. What arrives may be valid by chance."""
    robot = load_robot(bus_arm(tmp_path))
    bus, protocol = robot.model(), robot.protocol()
    assert isinstance(bus, Bus)

    def cycle() -> bytes:
        time = max(protocol.next_poll, 0.0)
        bus.receive(protocol.poll(time), time)
        protocol.receive(bus.read_output(time + 0.003), time + 0.003)
        return protocol.hold_commands()

    held = [cycle() for _ in range(4)][-1]
    assert held
    protocol.torque_commands(True)
    bus.servos[1].push(2500)
    assert [cycle() for _ in range(4)] == [held] * 4
    bus.servos[1].push(2048 + 20)  # 2 degrees
    assert cycle() != held
    bus.servos[1].push(2500)
    with pytest.raises(ServoSilent, match=r"Servo 2 .*another servo answers with its id"):
        any(not cycle() for _ in range(12))


def test_a_fast_servo_whose_answers_were_lost_is_not_doubtful(tmp_path: Path) -> None:
    """It may have moved since the last answer, not only since the last request."""
    robot = load_robot(bus_arm(tmp_path))
    bus, protocol = robot.model(), robot.protocol()
    assert isinstance(bus, Bus)

    def cycle(hears: bool = True) -> None:
        time = max(protocol.next_poll, 0.0)
        bus.receive(protocol.poll(time), time)
        answers = bus.read_output(time + 0.003)
        protocol.receive(answers if hears else b"", time + 0.003)

    for _ in range(4):
        cycle()
    protocol.torque_commands(True)
    cycle()
    for hears in (False, False, True):
        bus.servos[1].push(bus.servos[1].position + 82)  # 7.2 degrees in 20 ms
        cycle(hears)
    assert protocol.measured
    assert protocol.measured.position[1] == pytest.approx(
        math.radians(3 * 82 * 360 / 4096), abs=0.01
    )


def test_two_servos_with_the_last_id_are_named(tmp_path: Path) -> None:
    robot = load_robot(bus_arm(tmp_path))
    bus, protocol = robot.model(), robot.protocol()
    assert isinstance(bus, Bus)
    for cycle in range(6):
        time = 0.1 * cycle
        bus.receive(protocol.poll(time), time)
        answers = bus.read_output(time + 0.05)
        protocol.receive(answers + answers[len(answers) // 4 * 3 :], time + 0.05)
    assert protocol.measured is None
    with pytest.raises(HardwareError, match="Servo 4 answered twice"):
        protocol.check_booted("p", 2.0)


def test_a_servo_that_vanishes_while_the_host_is_busy_is_a_fault(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Every request is late, which may explain a lost answer, but not for long."""
    poll = BusProtocol.poll

    def late(self: BusProtocol, now: float) -> bytes:
        self.next_poll = min(self.next_poll, now - 0.006)
        return poll(self, now)

    monkeypatch.setattr(BusProtocol, "poll", late)
    with rig(tmp_path, Fault("vanish", 3, 2.0)) as made:
        made.arm.activate()
        made.arm.play(made.schedule(PICK, 8.0), made.wake, "test", made.arm.generation)
        made.wait(4.0 - made.clock.now())
        faults = [event for event in made.events if isinstance(event, Faulted)]
        assert [str(each.error)[:19] for each in faults] == ["Servo 3 of joint_3 "]
        assert faults[0].time - 2.0 < made.robot.firmware.silent_time + 0.05


class BusyHost(BoardLink[Bus]):
    """A link of a busy host, which reads the bytes late."""

    late = 0.0  # [s]

    def read(self) -> bytes:
        data, until = super().read(), self._clock.now() + self.late
        with self._changed:
            while self._open and self._clock.now() < until:
                self.unread = True
                self._changed.wait(until)
            self.unread = False
            return data + self.board.read_output(self._clock.now())


@pytest.mark.parametrize(("late", "faults"), [(0.04, 0), (5.0, 1)])
def test_answers_that_the_host_has_not_read_yet_are_not_lost(
    tmp_path: Path, late: float, faults: int
) -> None:
    """The port has them. A host that reads nothing for a second is a fault nevertheless."""
    robot, clock, events = load_robot(bus_arm(tmp_path)), SimulatedClock(), list[ArmEvent]()
    model, signal = robot.model(), clock.signal()
    assert isinstance(model, Bus)
    link = BusyHost(model, clock)
    with clock.working(), Arm(robot, link, clock, events.append) as arm, signal:
        arm.configure()
        arm.activate()
        begin, link.late = clock.now(), late
        while clock.now() < begin + 3.0:
            signal.wait(begin + 3.0)
        found = [event.time - begin for event in events if isinstance(event, Faulted)]
        assert len(found) == faults
        assert all(time < robot.firmware.silent_time + 0.1 for time in found)
        if not faults:
            assert arm.measured
            assert not any(arm.measured.lost)


@pytest.mark.parametrize(
    ("faults", "words"),
    [
        ([("vanish", 3)], "Servo 3 of joint_3 did not answer 5 requests in a row. Check the cable"),
        (
            [("vanish", 3), ("vanish", 4)],
            "Servos 3 of joint_3, 4 of joint_4 did not answer 5 requests in a row. Check the cable "
            "to the first of them and its power",
        ),
        (
            [("vanish", servo) for servo in (1, 2, 3, 4)],
            "No servo answered 10 requests in a row. Check the power supply, the adapter and the "
            "cable to the first servo",
        ),
        (
            [("impersonate", 3)],
            "Servo 3 of joint_3 did not answer 5 requests in a row. Servo 2 answered twice: "
            "another servo answers with its id. `armtree doctor",
        ),
        (
            [("renumber", 3)],
            "Servos 2 of joint_2, 3 of joint_3 did not answer 5 requests in a row. "
            "[0-9]+ bytes were damaged: two servos may have one id, or the line is noisy",
        ),
    ],
    ids=["one", "two", "all", "answers as 2", "became 2"],
)
def test_a_silent_servo_is_named_with_its_likely_cause(
    tmp_path: Path, faults: list[tuple[str, int]], words: str
) -> None:
    with rig(tmp_path, *(Fault(kind, servo, 2.0, 2) for kind, servo in faults)) as made:
        made.arm.activate()
        with pytest.raises(ServoSilent, match=words):
            raise made.play(PICK, 4.0) or AssertionError("it ended well")


def test_servos_are_asked_after_a_callback_that_takes_longer_than_the_boot(tmp_path: Path) -> None:
    with rig(tmp_path) as made:
        made.arm.activate(meanwhile=lambda: made.wait(3.0))
        assert made.arm.state is State.ACTIVE


def test_an_activation_that_its_callback_stops_sends_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with rig(tmp_path) as made:
        sent = list[bytes]()
        monkeypatch.setattr(made.bus, "receive", lambda data, _now: sent.append(data))
        with pytest.raises(ActivationStopped):
            made.arm.activate(meanwhile=made.arm.stop)
        assert (made.arm.state, sent) == (State.INACTIVE, [])

"""The driver of bus servos, on a virtual bus in simulated time."""

import logging
import math
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import pytest

from hardware import (
    Arm,
    BoardLink,
    CommandSent,
    DescriptionError,
    Faulted,
    FrameSent,
    HardwareError,
    Measured,
    Measurement,
    State,
    load_robot,
)
from hardware.arm.connection import Connection
from hardware.arm.streamer import Streamer
from hardware.description.calibration import calibration_file, write_calibration
from hardware.drivers.feetech.packets import Instruction, Packet, take_packets
from hardware.drivers.feetech.virtual.bus import Fault
from hardware.drivers.servo_errors import ServoFault, ServoMissing, ServoSilent
from hardware.errors import (
    ActivationStopped,
    JointNotFollowing,
    JointStalled,
    PoseOutsideLimits,
    ServoTooHot,
)
from hardware.testing import DriverContract
from tests.support.arms.bus_arms import BusRig, bus_arm, rig, written
from tests.support.arms.hardware_rigs import HOME, PICK

REST = Measurement(
    position=HOME,
    velocity=(0.0,) * 4,
    effort=(0.2, 0.2, 0.2, 0.2),  # gravity pulls towards smaller positions
    temperature=(25.0,) * 4,
    voltage=(11.9,) * 4,
    lost=(0.0,) * 4,
)


class TestSts(DriverContract):
    at_rest = replace(REST, current=(0.54,) * 4)

    @pytest.fixture(autouse=True)
    def write(self, tmp_path: Path) -> None:
        self.robot_file = bus_arm(tmp_path)


class TestScs(DriverContract):
    at_rest = REST

    @pytest.fixture(autouse=True)
    def write(self, tmp_path: Path) -> None:
        self.robot_file = bus_arm(tmp_path, "scs")


@pytest.mark.slow
def test_the_servos_follow_a_motion(tmp_path: Path) -> None:
    with rig(tmp_path) as made:
        made.arm.activate()
        assert made.arm.commanded == HOME
        assert made.play(PICK, 4.0) is None
        made.wait(0.5)
        goal = made.robot.wire_format.encode(PICK).servos
        state = made.bus.state(made.clock.now())
        assert list(state.positions.values()) == pytest.approx(goal, abs=2)
        assert state.collisions == 0
        frames = sum(isinstance(event, FrameSent) for event in made.events)
        assert frames > 100
        assert not made.faults


def test_an_arm_starts_where_its_servos_are_and_does_not_jump(tmp_path: Path) -> None:
    with rig(tmp_path) as made:
        there = made.robot.wire_format.encode(PICK).servos
        for servo, ticks in zip(made.bus.servos, there, strict=True):
            servo.put("goal_position", 2048)  # from an earlier run
            servo.push(ticks)
        made.arm.activate()
        assert made.arm.commanded == pytest.approx(PICK, abs=2e-3)
        made.wait(1.0)
        state = made.bus.state(made.clock.now())
        assert list(state.positions.values()) == list(there)
        assert all(state.torque.values())


@pytest.mark.slow
def test_what_the_servos_measure_is_the_state_of_the_arm(tmp_path: Path) -> None:
    with rig(tmp_path) as made:
        assert made.arm.measured is None
        made.arm.activate()
        assert made.play(PICK, 4.0) is None
        made.wait(0.5)
        measured = made.arm.measured
        assert measured
        assert measured.position == pytest.approx(PICK, abs=0.005)
        assert measured.voltage == pytest.approx([12.0] * 4, abs=0.3)
        assert {*measured.temperature} <= {25.0, 26.0}
        assert made.arm.read()["joint_2/measured/position"] == measured.position[1]
        events = [event for event in made.events if isinstance(event, Measured)]
        fastest = max(max(map(abs, event.measurement.velocity)) for event in events)
        assert 0.2 < fastest < 2.0
        frames = sum(isinstance(event, FrameSent) for event in made.events)
        assert len(events) >= frames  # one in each cycle
        made.arm.deactivate()
        assert made.arm.measured is None


def test_a_joint_that_is_blocked_is_commanded_elsewhere_than_measured(tmp_path: Path) -> None:
    with rig(tmp_path, Fault("block", 1, 2.0)) as made:
        made.arm.activate()
        assert isinstance(made.play(PICK, 4.0), JointStalled)
        events = [event for event in made.events if isinstance(event, Measured | FrameSent)]
        frame = next(event for event in reversed(events) if isinstance(event, FrameSent))
        measured = next(event for event in reversed(events) if isinstance(event, Measured))
        assert abs(frame.positions[0] - measured.measurement.position[0]) > math.radians(2)
        assert abs(measured.measurement.effort[0]) == 1.0


def test_the_answer_to_another_request_is_not_a_position() -> None:
    robot = load_robot(Path("so101"))
    protocol = robot.protocol()
    protocol.poll(0.0)
    protocol.receive(b"".join(Packet(servo, 0).data for servo in range(1, 7)), 0.001)
    assert (protocol.boot_frame, protocol.measured) == (None, None)


def test_nothing_is_written_before_the_arm_is_active_but_requests(tmp_path: Path) -> None:
    with rig(tmp_path, Fault("vanish", 3, 0.0)) as made:
        why = r"Within 1 s, .* report the position of servo 3 \(joint_3\). Check its power, id"
        with pytest.raises(ServoMissing, match=why):
            made.arm.activate()
        assert made.arm.state is State.INACTIVE
        sent = [event.data for event in made.events if isinstance(event, CommandSent)]
        codes = {packet.code for data in sent for packet in take_packets(bytearray(data))}
        assert codes == {Instruction.SYNC_READ}


def test_a_pose_outside_the_limits_is_refused(tmp_path: Path) -> None:
    with rig(tmp_path) as made:
        made.bus.servos[0].push(3072 + 35)  # 3.1 deg; settle_deg is 3
        why = r"servo of joint_1 is at 93\.1 deg.* end at 90\.0 deg.*First turn the joint inwards"
        with pytest.raises(PoseOutsideLimits, match=why):
            made.arm.activate()
        assert not made.bus.servos[0].get("torque_enable")


@pytest.mark.parametrize("holds", [False, True])
@pytest.mark.parametrize(("at", "limit"), [(3072 + 34, 3072), (1024 - 34, 1024), (3073, 3072)])
def test_an_arm_that_rests_on_a_stop_starts_at_the_limit(
    tmp_path: Path, at: int, limit: int, holds: bool
) -> None:
    """A stop is a little outside: the limits end before it, and gears have play."""
    with rig(tmp_path) as made:
        rest(made, at, holds)
        made.arm.activate()
        joint = made.robot.actuated[0]
        assert made.arm.commanded[0] == (joint.upper if at > limit else joint.lower)
        assert made.arm.commanded[1:] == HOME[1:]
        moves_in_slowly(made, at, limit)


@pytest.mark.parametrize(("at", "accepted"), [(3072 + 240, True), (3072 + 275, False)])
def test_a_stop_may_be_far_behind_the_limit_of_the_urdf(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, at: int, accepted: bool
) -> None:
    sweep_widely(tmp_path)
    with rig(tmp_path) as made:
        rest(made, at, holds=False)
        if not accepted:
            with pytest.raises(PoseOutsideLimits, match=r"joint_1 is at 114\.2 deg"):
                made.arm.activate()
            return
        made.arm.activate()
        assert made.arm.commanded[0] == made.robot.actuated[0].upper
        way = "joint_1 is at 111.1 deg, and moves to its limit, 90.0 deg; this motion is not"
        assert f"{way} checked for collisions" in caplog.messages
        moves_in_slowly(made, at, 3072)


def test_a_joint_that_is_blocked_on_its_way_to_its_limit_is_stalled(tmp_path: Path) -> None:
    """It holds where it is, before its servo is overloaded and lets it go."""
    sweep_widely(tmp_path)
    with rig(tmp_path) as made:
        rest(made, 3312, holds=False)
        made.bus.servos[0].stops = 3250, math.inf
        with pytest.raises(JointStalled, match=r"joint_1 pushes with .* of its torque"):
            made.arm.activate()
        assert made.arm.state is not State.ACTIVE
        made.wait(1.0)
        made.bus.state(made.clock.now())
        assert made.bus.servos[0].get("goal_position") == pytest.approx(3250, abs=2)
        assert made.bus.servos[0].get("torque_enable")


@pytest.mark.parametrize("on_fault", ["hold", "torque_off"])
def test_a_stop_ends_an_activation_that_moves_a_joint_to_its_limit(
    tmp_path: Path, on_fault: str
) -> None:
    """A stop is no fault, so that it releases no servo."""
    sweep_widely(tmp_path)
    with rig(tmp_path, guards=f'on_fault = "{on_fault}"') as made:
        rest(made, 3312, holds=False)
        made.after(0.8, made.arm.stop)
        with pytest.raises(ActivationStopped, match="before its joints were within") as caught:
            made.arm.activate()
        assert (made.arm.state, caught.value.hint[:13]) == (State.UNCONFIGURED, "configure and")
        made.bus.state(made.clock.now())
        stopped = made.bus.servos[0].position
        made.wait(1.0)
        made.bus.state(made.clock.now())
        assert 3100 < made.bus.servos[0].position < 3300
        assert abs(made.bus.servos[0].position - stopped) < 20
        assert made.bus.servos[0].get("torque_enable")


@pytest.mark.parametrize("moment", [State.ACTIVATING, State.ACTIVE])
def test_a_stop_at_the_end_of_the_boot_moves_no_joint_to_its_limit(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, moment: State
) -> None:
    sweep_widely(tmp_path)
    start, boot = Connection.send_start_commands, Arm._boot

    def stopped_when_active(connection: Connection) -> None:
        made.arm.stop()
        start(connection)

    def stopped_after_boot(arm: Arm, connection: Connection) -> None:
        boot(arm, connection)
        arm.stop()

    if moment is State.ACTIVE:
        monkeypatch.setattr(Connection, "send_start_commands", stopped_when_active)
    else:
        monkeypatch.setattr(Arm, "_boot", stopped_after_boot)
    with rig(tmp_path) as made:
        rest(made, 3312, holds=False)
        with pytest.raises(ActivationStopped) as caught:
            made.arm.activate()
        assert "it holds" not in str(caught.value)
        made.wait(1.5)
        made.bus.state(made.clock.now())
        assert made.bus.servos[0].position == 3312
        assert not made.bus.servos[0].get("torque_enable")
        assert made.arm.state is not State.ACTIVE


def test_a_stop_while_torque_comes_back_leaves_an_arm_that_holds(tmp_path: Path) -> None:
    sweep_widely(tmp_path)
    with rig(tmp_path) as made:
        rest(made, 2048, holds=False)
        made.arm.activate()
        made.arm.switch_torque(False)
        made.bus.servos[0].push(3312)
        made.wait(0.5)
        made.after(0.8, made.arm.stop)
        with pytest.raises(ActivationStopped):
            made.arm.switch_torque(True)
        assert made.arm.state is State.UNCONFIGURED
        made.wait(1.0)
        made.bus.state(made.clock.now())
        assert 3100 < made.bus.servos[0].position < 3300
        assert made.bus.servos[0].get("torque_enable")


def sweep_widely(folder: Path) -> None:
    """Calibrates joints that were swept 21 degrees farther than the URDF has them."""
    robot = load_robot(bus_arm(folder), calibrated=False)
    joints = {
        joint.name: robot.calibrated(joint, {"id": k, "least": 784, "most": 3312}, 360 / 4096)
        for k, joint in enumerate(robot.actuated, 1)
    }
    write_calibration(calibration_file(robot.path), robot.name, "by a test", joints)


def rest(made: BusRig, at: int, holds: bool) -> None:
    """Puts the first servo at a position, with or without torque, and the others in the middle."""
    for servo in made.bus.servos:
        servo.push(2048)
    servo = made.bus.servos[0]
    servo.push(at)
    servo.put("goal_position", at)
    servo.put("torque_enable", holds)


def moves_in_slowly(made: BusRig, at: int, limit: int) -> None:
    """It gets torque where it is, and then moves to the limit in small steps, and to HOME."""
    goals = [row[0] for row in written(made, "goal_position")]
    assert (goals[0], goals[-1]) == (at, limit)
    assert max(abs(b - a) for a, b in pairwise(goals)) <= 0.4 * 4096 / 360 + 1
    made.wait(0.5)
    servo = made.bus.servos[0]
    assert abs(servo.position - limit) <= 1
    assert made.play(HOME, 4.0) is None
    assert made.bus.state(made.clock.now()).positions[1] == pytest.approx(2048, abs=2)
    assert not made.faults


def test_the_joints_stand_still_30_ms_after_a_stop(tmp_path: Path) -> None:
    with rig(tmp_path) as made:
        made.arm.activate()
        made.arm.play(made.schedule(PICK, 1.5), made.wake, "test", made.arm.generation)
        made.wait(0.8)
        places = []
        for pause in (0.03, 1.0, 0.0):
            made.arm.stop()
            places.append(made.bus.state(made.clock.now()).positions)
            made.wait(pause)
        begin, soon, end = places
        for servo, position in end.items():
            assert abs(position - soon[servo]) <= 1
            assert abs(position - begin[servo]) < 2 * 4096 / 360
        assert any(end[servo] != begin[servo] for servo in end)


@pytest.mark.slow
def test_lost_and_damaged_answers_are_asked_for_again(tmp_path: Path) -> None:
    faults = Fault("lose", 2, 2.0, 3), Fault("damage", 4, 3.0, 3)
    with rig(tmp_path, *faults) as made:
        made.arm.activate()
        assert made.play(PICK, 4.0) is None
        assert not made.faults
        assert made.arm.measured
        assert made.arm.measured.lost == (0, 3, 0, 3)


def test_the_robot_file_says_how_many_answers_may_be_lost_and_how_often_it_asks(
    tmp_path: Path,
) -> None:
    keys = "rate_hz = 100\nlost_answers = 2"
    with rig(tmp_path, Fault("lose", 2, 2.0, 2), serial=keys) as made:
        made.arm.activate()
        with pytest.raises(ServoSilent, match="Servo 2 of joint_2 did not answer 2 requests"):
            raise made.play(PICK, 4.0) or AssertionError("it ended well")
        due = [e.scheduled for e in made.events if isinstance(e, FrameSent) and e.scheduled]
        assert min(b - a for a, b in pairwise(due)) == pytest.approx(0.01)


def test_a_higher_rate_asks_more_often_and_moves_no_faster(tmp_path: Path) -> None:
    with rig(tmp_path, serial="rate_hz = 100") as made:
        assert made.robot.firmware.max_step == 200
        made.arm.activate()
        assert made.play(PICK, 4.0) is None
        made.events.clear()
        made.wait(0.5)  # the arm may still move
        times = [event.time for event in made.events if isinstance(event, Measured)]
        assert max(b - a for a, b in pairwise(times)) < 0.015


@pytest.mark.slow
@pytest.mark.parametrize(
    ("fault", "error", "words"),
    [
        (Fault("vanish", 2, 2.0), ServoSilent, "Servo 2 of joint_2 did not answer 5 requests"),
        (Fault("renumber", 2, 2.0, 9), ServoSilent, "Servo 2 of joint_2 did not answer"),
        (
            Fault("block", 1, 2.0),
            ServoFault,
            r"the error overload, at a load of 100% \(limit 100%\)",
        ),
        (
            Fault("brown_out", 1, 2.0),
            ServoFault,
            r"error voltage, .* 3\.\d V \(limits 4 and 14\).*gravity",
        ),
        (
            Fault("overheat", 3, 2.0),
            ServoTooHot,
            "servo of joint_3 has 66 degrees Celsius; .* 65 .*Gravity",
        ),
        (Fault("lose", 4, 2.0, 100), ServoSilent, "Servo 4 of joint_4 did not answer"),
    ],
    ids=lambda value: value.kind if isinstance(value, Fault) else "",
)
def test_a_fault_of_a_servo_ends_the_motion(
    tmp_path: Path, fault: Fault, error: type[HardwareError], words: str
) -> None:
    with rig(tmp_path, fault, guards="stall_effort = 2") as made:  # no joint counts as stalled
        made.arm.activate()
        with pytest.raises(error, match=words):
            raise made.play(PICK, 60.0) or AssertionError("it ended well")
        made.wait(1.0)
        assert made.arm.state is State.UNCONFIGURED
        assert [type(each) for each in made.faults] == [error]


def test_a_blocked_joint_no_longer_pushes_after_the_fault(tmp_path: Path) -> None:
    with rig(tmp_path, Fault("block", 1, 2.0)) as made:
        made.arm.activate()
        assert isinstance(made.play(PICK, 4.0), JointStalled)
        made.wait(1.0)
        made.bus.state(made.clock.now())
        for servo in made.bus.servos:
            assert servo.get("goal_position") == pytest.approx(servo.position, abs=15)
            assert servo.get("torque_enable")
        assert abs(made.bus.servos[0].get("goal_position") - made.bus.servos[0].position) <= 1


@pytest.mark.parametrize("speed", [6, 30, 54])
def test_a_blocked_joint_is_stalled_soon_at_every_speed(tmp_path: Path, speed: float) -> None:
    """Before its servo is overloaded after 0.5 s, and lets the joint go."""
    with rig(tmp_path, Fault("block", 1, 2.0)) as made:
        made.arm.activate()
        goal = (-math.radians(speed) * 1.5, *HOME[1:])
        made.wait(1.7 - made.clock.now())
        assert isinstance(made.play(goal, 1.5), JointStalled)
        made.wait(0.1)
        (stalled,) = [event.time for event in made.events if isinstance(event, Faulted)]
        assert stalled - 2.0 < 0.15


@pytest.mark.parametrize("series", ["sts", "scs"])
def test_a_servo_with_a_low_torque_limit_stalls(tmp_path: Path, series: str) -> None:
    """Its load never reaches the largest torque of its series. Only `sts` measures a current."""
    with rig(tmp_path, Fault("block", 1, 2.0), series=series) as made:
        for servo in made.bus.servos:
            servo.put("max_torque", 300)
        made.arm.activate()
        assert isinstance(made.play(PICK, 4.0), JointStalled)
        assert made.arm.failure
        (measured,) = [e.measurement for e in made.events if isinstance(e, Measured)][-1:]
        assert abs(measured.effort[0]) == 1.0
        assert [round(abs(amps), 2) for amps in measured.current[:1]] == (
            [0.81] if series == "sts" else []
        )


def test_a_full_load_without_current_is_no_stall(tmp_path: Path) -> None:
    with rig(tmp_path, Fault("block", 1, 1.0), guards="stall_a = 9") as made:
        made.arm.activate()
        assert isinstance(made.play(PICK, 2.0), JointNotFollowing)


def test_a_fault_may_let_the_joints_go(tmp_path: Path) -> None:
    with rig(tmp_path, Fault("block", 1, 2.0), guards='on_fault = "torque_off"') as made:
        made.arm.activate()
        error = made.play(PICK, 4.0)
        assert isinstance(error, JointStalled)
        assert "The torque goes off (on_fault), and gravity moves the arm" in str(error)
        made.wait(1.0)
        assert not any(made.bus.state(made.clock.now()).torque.values())


def test_a_joint_that_does_not_follow_is_a_fault(tmp_path: Path) -> None:
    with rig(tmp_path, Fault("block", 1, 1.0), guards="stall_effort = 2") as made:
        made.arm.activate()
        with pytest.raises(JointNotFollowing, match=r"deg apart; the limit is 10 deg") as caught:
            raise made.play(PICK, 2.0) or AssertionError("it ended well")
        assert caught.value.joint == "joint_1"
        assert "Gravity moves a joint whose servo lets go" in str(caught.value)
        assert math.radians(10) == caught.value.limit < caught.value.value < math.radians(20)


def test_a_servo_that_gets_hot_is_warned_of_once_before_the_arm_stops(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.WARNING), rig(tmp_path, Fault("overheat", 3, 2.0)) as made:
        made.arm.activate()
        made.wait(60.0)
    warned = [record.message for record in caplog.records if record.levelname == "WARNING"]
    assert warned == ["The servo of joint_3 has 55 degrees Celsius; the arm stops above 65"]
    assert [type(error) for error in made.faults] == [ServoTooHot]


def test_a_servo_that_vanishes_from_a_resting_arm_is_a_fault(tmp_path: Path) -> None:
    with rig(tmp_path, Fault("vanish", 2, 10.0)) as made:
        made.arm.activate()
        made.wait(20.0)
        assert [type(each) for each in made.faults] == [ServoSilent]


@pytest.mark.parametrize(
    ("old", "new", "why"),
    [
        (
            "[groups]",
            "[guards]\nmost_c = 0\n[groups]",
            "guards.most_c: 0 is not allowed; .* greater than 0",
        ),
        ("[groups]", '[guards]\non_fault = "fall"\n[groups]', "on_fault: .* hold"),
        ("[groups]", "[guards]\nmost_f = 9\n[groups]", "most_f"),
        ("baud =", "rate_hz = 200\nbaud =", "rate_hz: 200 is not allowed"),
        ("baud =", "lost_answers = 0\nbaud =", "lost_answers: 0 is not from 1 to 20"),
        ("id = 2", "id = 1", "joint_2: its servo 1 is already the servo of joint_1"),
        ("id = 2", "id = 254", "id: 254 is not from 0 to 252"),
        ("offset_deg = 0", "offset_deg = 120", "joint_1: servo 1 cannot reach the limit 90 deg"),
        ("sign = 1", "sign = 0", "sign: 0 is not one of -1, 1"),
    ],
)
def test_wrong_wires_are_refused(tmp_path: Path, old: str, new: str, why: str) -> None:
    path = bus_arm(tmp_path)
    path.write_text(path.read_text().replace(old, new, 1))
    with pytest.raises(DescriptionError, match=why):
        load_robot(path)


def test_a_cycle_is_one_write_and_wakes_the_streamer_twice(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """At the first answer, whose request has a new timeout, and at the last one."""
    counts = Counter[str]()
    for kind, name in ((BoardLink, "write"), (BoardLink, "read"), (Streamer, "on_received")):
        monkeypatch.setattr(kind, name, counted(counts, name, getattr(kind, name)))
    with rig(tmp_path) as made:
        made.arm.activate()
        counts.clear()
        made.events.clear()
        assert made.play(PICK, 2.0) is None
        frames = sum(isinstance(event, FrameSent) for event in made.events)
    assert counts["write"] <= 1.1 * frames
    assert counts["on_received"] <= 2.2 * frames < counts["read"]


def counted(
    counts: Counter[str], name: str, function: Callable[..., object]
) -> Callable[..., object]:
    def call(*arguments: object) -> object:
        counts[name] += 1
        return function(*arguments)

    return call

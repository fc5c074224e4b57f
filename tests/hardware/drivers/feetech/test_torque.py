"""Activation, torque that is switched, and arrival, on a virtual bus in simulated time."""

import random
from itertools import pairwise
from pathlib import Path

import pytest

from hardware import CommandSent, State, load_robot
from hardware.drivers.feetech.packets import Instruction, take_packets
from hardware.drivers.feetech.registers import STS
from hardware.drivers.feetech.virtual.bus import Fault
from hardware.drivers.servo_errors import ServoMissing, ServoSilent, TorqueLost, WrongMode
from hardware.errors import NotAble, NotArrived, PoseOutsideLimits, StaleGeneration, TorqueOff
from tests.support.arms.bus_arms import rig, written
from tests.support.arms.hardware_rigs import HOME, PICK, Rig


@pytest.mark.slow
def test_no_activation_jumps(tmp_path: Path) -> None:
    """200 activations of servos, at random poses, with any goal left by an earlier program.

    `bus-activation --times 1000` of `tests/faults` does the same with the SO-101, more often.
    """
    dice = random.Random(1)
    with rig(tmp_path) as made:
        robot, servos = made.robot, made.bus.servos
        most = robot.firmware.max_step
        for _ in range(200):
            pose = [dice.uniform(joint.lower, joint.upper) for joint in robot.actuated]
            there = robot.wire_format.encode(pose).servos
            for servo, ticks in zip(servos, there, strict=True):
                servo.put("torque_enable", 0)
                servo.put("goal_position", dice.randrange(4096))
                servo.push(ticks)
            made.events.clear()
            made.arm.activate()
            goals = written(made, "goal_position")
            assert goals == [list(there)]
            made.wait(0.05)
            moved = [abs(s.position - t) for s, t in zip(servos, there, strict=True)]
            assert sum(moved) < most / 10
            made.arm.deactivate()
        assert not made.faults


def test_torque_rises_in_small_steps(tmp_path: Path) -> None:
    with rig(tmp_path) as made:
        for servo in made.bus.servos:
            servo.put("max_torque", 600)
        made.arm.activate()
        limits = [row[0] for row in written(made, "torque_limit")]
        assert max(after - before for before, after in pairwise([0, *limits])) <= 60
        assert limits[-1] == 600
        order = [written(made, name)[0] for name in ("goal_position", "torque_enable")]
        assert order == [[2048] * 4, [1] * 4]
        assert made.bus.state(made.clock.now()).collisions == 0


@pytest.mark.parametrize("rate", [50, 80, 100])
def test_torque_rises_in_the_same_time_at_every_rate(tmp_path: Path, rate: int) -> None:
    with rig(tmp_path, serial=f"rate_hz = {rate}") as made:
        made.arm.activate()
        head = bytes([STS.registers["torque_limit"].address, 2])
        sent = [e for e in made.events if isinstance(e, CommandSent)]
        times = [
            event.time
            for event in sent
            for packet in take_packets(bytearray(event.data))
            if packet.code == Instruction.SYNC_WRITE and packet.parameters[:2] == head
        ]
        assert times[-1] - times[0] == pytest.approx(0.3, rel=0.2)


def test_an_arm_that_holds_keeps_its_torque(tmp_path: Path) -> None:
    with rig(tmp_path) as made:
        made.arm.activate()
        made.arm.deactivate()
        made.events.clear()
        made.arm.activate()
        assert written(made, "torque_limit") == []


def test_a_ramp_that_was_cut_off_goes_on_from_its_limit(tmp_path: Path) -> None:
    """A program that ended while the torque rose has left a servo with torque and a small limit."""
    with rig(tmp_path) as made:
        for servo in made.bus.servos:
            servo.put("torque_enable", 1)
            servo.put("torque_limit", 66)
        made.bus.servos[0].put("torque_limit", 1000)
        made.arm.activate()
        rows = written(made, "torque_limit")
        assert {row[0] for row in rows} == {1000}
        limits = [66, *(row[1] for row in rows)]
        assert max(after - before for before, after in pairwise(limits)) <= 63
        assert all(servo.get("torque_limit") == 1000 for servo in made.bus.servos)


def test_a_person_moves_an_arm_without_torque(tmp_path: Path) -> None:
    with rig(tmp_path) as made:
        made.arm.activate()
        planned = made.arm.generation
        made.arm.switch_torque(False)
        assert not made.arm.torque
        there = made.robot.wire_format.encode(PICK).servos
        for servo, ticks in zip(made.bus.servos, there, strict=True):
            servo.push(ticks)
        made.wait(0.1)
        assert made.arm.measured
        assert made.arm.measured.position == pytest.approx(PICK, abs=2e-3)
        assert isinstance(made.play(PICK, 1.0), TorqueOff)
        made.arm.switch_torque(True)
        assert made.arm.commanded == pytest.approx(PICK, abs=2e-3)
        assert made.arm.generation > planned
        assert made.play(HOME, 4.0) is None
        assert not made.faults


def test_torque_off_ends_a_motion(tmp_path: Path) -> None:
    with rig(tmp_path) as made:
        made.arm.activate()
        made.after(1.0, lambda: made.arm.switch_torque(False))
        assert made.play(PICK, 4.0) is None
        assert made.arm.state is State.ACTIVE
        with pytest.raises(StaleGeneration):
            made.arm.play(made.schedule(PICK, 1.0), made.wake, "test", 0)


def test_torque_stays_off_outside_the_limits(tmp_path: Path) -> None:
    with rig(tmp_path) as made:
        made.arm.activate()
        made.arm.switch_torque(False)
        made.bus.servos[0].push(4000)
        made.wait(0.1)
        with pytest.raises(PoseOutsideLimits):
            made.arm.switch_torque(True)
        assert not made.bus.servos[0].get("torque_enable")
        made.bus.servos[0].push(2048)
        made.wait(4.0)
        assert not made.faults
        made.arm.switch_torque(True)
        assert made.arm.torque
        assert made.arm.state is State.ACTIVE


@pytest.mark.parametrize(
    ("setting", "left"), [("goal_speed", 50), ("goal_time", 5000), ("acceleration", 1)]
)
def test_settings_that_another_program_left_are_reset(
    tmp_path: Path, setting: str, left: int
) -> None:
    with rig(tmp_path) as made:
        for servo in made.bus.servos:
            servo.put(setting, left)
        made.arm.activate()
        assert made.play(PICK, 2.0) is None
        assert {servo.get(setting) for servo in made.bus.servos} == {0}


def test_a_servo_on_its_slow_way_to_an_old_goal_does_not_jump_there(tmp_path: Path) -> None:
    """The goal comes before the speed: without a limit, it would run to the old goal first."""
    with rig(tmp_path) as made:
        servo = made.bus.servos[0]
        for name, value in (("goal_position", 3000), ("goal_speed", 20), ("torque_enable", 1)):
            servo.put(name, value)
        made.arm.activate()
        made.wait(0.5)
        assert servo.get("goal_speed") == 0
        assert 2048 <= servo.position < 2048 + 10


@pytest.mark.parametrize("mode", [1, 2, 3])
def test_a_servo_in_another_mode_gets_no_torque(tmp_path: Path, mode: int) -> None:
    with rig(tmp_path) as made:
        servo = made.bus.servos[1]
        servo.put("mode", mode)
        servo.put("goal_speed", 500)
        why = f"Servo 2 of joint_2 is in the mode {mode}, and not in the mode for pos.*calibrate"
        with pytest.raises(WrongMode, match=why):
            made.arm.activate()
        made.wait(1.0)
        assert not any(made.bus.state(made.clock.now()).torque.values())


@pytest.mark.parametrize("series", ["sts", "scs"])
def test_nothing_is_written_to_the_memory_that_servos_keep(tmp_path: Path, series: str) -> None:
    with rig(tmp_path, Fault("vanish", 4, 9.0), series=series) as made:
        first, count = made.bus.servos[0].series.blocks[0]
        before = [servo.read(first, count) for servo in made.bus.servos]
        made.arm.activate()
        assert made.play(PICK, 4.0) is None
        for on in (False, True):
            made.arm.switch_torque(on)
        made.arm.deactivate()
        made.arm.activate()
        assert isinstance(made.play(HOME, 8.0), ServoSilent)
        made.wait(0.5)
        made.bus.connect(made.clock.now())
        assert [servo.read(first, count) for servo in made.bus.servos] == before


def test_a_board_without_the_ability_refuses_it() -> None:
    made = Rig()
    with made.clock.working(), made.arm:
        made.arm.configure()
        made.arm.activate()
        with pytest.raises(NotAble, match="cannot switch the torque of its servos off and on"):
            made.arm.switch_torque(False)


def test_torque_that_is_lost_is_a_fault(tmp_path: Path) -> None:
    with rig(tmp_path, Fault("restart", 2, 2.0)) as made:
        made.arm.activate()
        with pytest.raises(TorqueLost, match="Servo 2 of joint_2 no longer holds"):
            raise made.play(HOME, 1.0) or made.faulted()


def test_a_motion_ends_when_it_is_measured_at_its_end(tmp_path: Path) -> None:
    with rig(tmp_path) as made:
        made.arm.activate()
        assert made.play(PICK, 2.0) is None
        measured = made.arm.measured
        assert measured
        assert measured.position == pytest.approx(PICK, abs=0.053)


def test_an_arm_that_does_not_arrive_fails_the_motion_and_stays_active(tmp_path: Path) -> None:
    with rig(tmp_path, guards="following_deg = 90\nsettle_s = 0.3\nsettle_deg = 0.05") as made:
        made.bus.servos[1].put("dead_zone_ccw", 200)
        made.arm.activate()
        why = r"joint_2 moved towards -34\.4 deg and is measured at .* 0\.3 s after the last frame"
        with pytest.raises(NotArrived, match=why):
            raise made.play(PICK, 2.0) or AssertionError("it arrived")
        assert made.arm.state is State.ACTIVE


def test_a_gripper_need_not_arrive(tmp_path: Path) -> None:
    with rig(tmp_path, guards="following_deg = 90\nsettle_s = 0.3\nsettle_deg = 1") as made:
        made.bus.servos[3].put("dead_zone_ccw", 200)
        made.arm.activate()
        goal = (*HOME[:3], load_robot().actuated[3].lower)
        assert made.play(goal, 2.0) is None


def test_a_servo_with_the_id_of_another_never_gives_a_start_pose(tmp_path: Path) -> None:
    with rig(tmp_path, Fault("impersonate", 1, 0.0, 2)) as made:
        made.bus.servos[0].push(2500)
        why = r"servo 1 \(joint_1\).*3 servos answered.*Servo 2 answered twice"
        with pytest.raises(ServoMissing, match=why):
            made.arm.activate()
        assert written(made, "goal_position") == []


def test_a_servo_that_takes_the_id_of_another_moves_nothing_wrong(tmp_path: Path) -> None:
    with rig(tmp_path, Fault("impersonate", 1, 2.0, 2)) as made:
        made.arm.activate()
        with pytest.raises(ServoSilent):
            raise made.play(PICK, 4.0) or AssertionError("it ended well")
        made.wait(1.0)
        positions = made.bus.state(made.clock.now()).positions
        for servo in made.bus.servos:
            assert servo.get("goal_position") == pytest.approx(positions[servo.servo], abs=20)

"""A gripper of bus servos that an object blocks, in simulated time."""

import math
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from hardware import ArmEvent, FrameSent, Playback, PlaybackState
from hardware.drivers.feetech.virtual.bus import Fault
from hardware.errors import JointNotFollowing, JointStalled, NotArrived
from tests.support.arms.bus_arms import BusRig, rig
from tests.support.arms.hardware_rigs import HOME

OPEN, CLOSED = -0.8, -0.1  # of joint_4 [rad]
OBJECT = -0.4  # where it blocks the gripper [rad]
SQUEEZE = math.radians(1.5)
HARD = 1.0  # load of a blocked servo for each tick to its goal


@contextmanager
def holding(
    folder: Path, *faults: Fault, guards: str = "", start: float = OPEN
) -> Iterator[BusRig]:
    """An arm whose gripper finds an object when it leaves its start."""
    with rig(folder, *faults, guards=guards) as made:
        gripper = made.bus.servos[3]
        gripper.push(ticks(made, start))
        near = ticks(made, OBJECT)
        gripper.stops = (-math.inf, near) if ticks(made, start) < near else (near, math.inf)
        made.arm.activate()
        yield made


def ticks(made: BusRig, q: float) -> int:
    return made.robot.wire_format.encode(at(q)).servos[3]


def at(q: float) -> tuple[float, ...]:
    return (*HOME[:3], q)


def begun(made: BusRig, q: float, seconds: float) -> Playback:
    made.events.clear()
    return made.arm.play(made.schedule(at(q), seconds), made.wake, "test", made.arm.generation)


def pushes(made: BusRig) -> float:
    """How far the gripper is commanded past where it is measured [rad]."""
    assert made.arm.measured
    return abs(made.arm.commanded[3] - made.arm.measured.position[3])


def stopped_while_it_pushes(made: BusRig) -> Playback:
    """Stops a closing gripper that pushes, before it counts as stalled."""
    playback = begun(made, CLOSED, 1.0)
    while pushes(made) < 2.5 * SQUEEZE:
        made.wait(0.001)
    made.arm.stop()
    return playback


def end(made: BusRig, playback: Playback) -> Playback:
    with made.woken:
        while playback.state is PlaybackState.PLAYING:
            made.woken.wait(None)
    return playback


def test_a_gripper_opens_that_pushed_when_its_motion_began(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("hardware.arm.streamer.Streamer._pushes", False)  # it was not loosened yet
    with holding(tmp_path) as made:
        stopped_while_it_pushes(made)
        made.wait(0.2)
        assert pushes(made) > 2 * SQUEEZE
        playback = end(made, begun(made, OPEN, 2.0))
        assert (playback.state, playback.gripped) == (PlaybackState.DONE, False)
        assert made.bus.servos[3].position == pytest.approx(ticks(made, OPEN), abs=10)
        assert not made.faults


def test_a_gripper_that_is_blocked_while_it_opens_is_stalled(tmp_path: Path) -> None:
    with holding(tmp_path, start=CLOSED) as made:
        error = made.play(at(OPEN), 2.0)
        assert isinstance(error, JointStalled)
        advice = "Free the joint. If the gripper grips with this motion, change grips in the robot"
        assert advice in str(error)


def test_a_gripper_that_is_blocked_softly_while_it_opens_has_not_arrived(tmp_path: Path) -> None:
    with holding(tmp_path, start=CLOSED) as made:
        assert isinstance(made.play(at(OBJECT - math.radians(3.5)), 2.0), NotArrived)


def test_a_gripper_grips_from_within_if_the_robot_file_says_so(tmp_path: Path) -> None:
    with holding(tmp_path, guards='grips = "opening"', start=CLOSED) as made:
        playback = end(made, begun(made, OPEN, 2.0))
        assert (playback.state, playback.gripped) == (PlaybackState.DONE, True)
        assert pushes(made) < SQUEEZE + 0.01
    with holding(tmp_path, guards='grips = "opening"') as made:
        assert isinstance(made.play(at(CLOSED), 1.0), JointStalled)


def test_a_gripper_that_cannot_leave_its_object_is_stalled(tmp_path: Path) -> None:
    with holding(tmp_path) as made:
        playback = end(made, begun(made, CLOSED, 1.0))
        assert (playback.state, playback.gripped) == (PlaybackState.DONE, True)
        servo = made.bus.servos[3]
        servo.stops = servo.position, servo.position
        assert isinstance(made.play(at(OPEN), 2.0), JointStalled)


def test_a_gripper_that_pushes_after_a_stop_is_loosened(tmp_path: Path) -> None:
    with holding(tmp_path) as made:
        playback = stopped_while_it_pushes(made)
        planned = made.arm.generation
        made.wait(2.0)
        assert pushes(made) < SQUEEZE + 0.01
        assert playback.state is PlaybackState.STOPPED
        assert playback.gripped
        assert made.arm.generation > planned  # a plan from the pose before is refused
        assert not made.faults


def test_a_loosened_gripper_is_known_before_its_frame_is_seen(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An observer of the frame may resume the motion at once."""
    monkeypatch.setattr("hardware.drivers.feetech.virtual.servo._PUSH", HARD)
    with holding(tmp_path) as made:
        playback, known = stopped_while_it_pushes(made), list[bool]()

        def observe(event: ArmEvent) -> None:
            if isinstance(event, FrameSent) and not playback.playing:
                known.append(made.arm.commanded in playback.loosened)

        monkeypatch.setattr(made.arm, "_observe", observe)
        made.wait(2.0)
        assert len(known) > 1
        assert all(known)


def test_a_gripper_that_does_not_move_is_a_fault(tmp_path: Path) -> None:
    with rig(tmp_path) as made:
        made.arm.activate()
        gripper = made.bus.servos[3]
        gripper.put("goal_speed", 1)
        with pytest.raises(JointNotFollowing, match="joint_4"):
            raise made.play(at(OPEN), 1.0) or AssertionError("it ended well")


def test_a_stop_while_a_grip_settles_holds_at_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("hardware.drivers.feetech.virtual.servo._PUSH", HARD)
    with holding(tmp_path) as made:
        playback = begun(made, CLOSED, 1.0)
        with made.woken:
            while not playback.gripped:
                made.woken.wait(made.clock.now() + 0.001)
        assert made.arm._connection
        assert made.arm._connection.streamer
        made.arm._connection.streamer.stop(brake=5.0)
        assert playback.state is PlaybackState.STOPPED
        assert [e.scheduled for e in made.events if isinstance(e, FrameSent)][-1] is None

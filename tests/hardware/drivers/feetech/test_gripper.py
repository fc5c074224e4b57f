"""A gripper of bus servos that an object blocks, in simulated time."""

import math
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from hardware import FrameSent, Playback, PlaybackState
from hardware.drivers.feetech.virtual.bus import Fault
from hardware.errors import JointNotFollowing, JointStalled
from tests.support.arms.bus_arms import BusRig, rig
from tests.support.arms.hardware_rigs import HOME

OPEN, CLOSED = -0.8, -0.1  # of joint_4 [rad]
OBJECT = -0.4  # where it blocks the gripper [rad]
SQUEEZE = math.radians(1.5)
HARD = 1.0  # load of a blocked servo for each tick to its goal


@contextmanager
def holding(folder: Path, *faults: Fault) -> Iterator[BusRig]:
    """An arm whose open gripper finds an object when it closes."""
    with rig(folder, *faults) as made:
        gripper = made.bus.servos[3]
        gripper.push(ticks(made, OPEN))
        first, last = sorted((ticks(made, OPEN), ticks(made, OBJECT)))
        gripper.stops = (-math.inf, last) if ticks(made, OBJECT) == last else (first, math.inf)
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


def test_a_gripper_that_cannot_leave_its_object_is_stalled(tmp_path: Path) -> None:
    with holding(tmp_path) as made:
        playback = end(made, begun(made, CLOSED, 1.0))
        assert (playback.state, playback.gripped) == (PlaybackState.DONE, True)
        servo = made.bus.servos[3]
        servo.stops = servo.position, servo.position
        with pytest.raises(JointStalled, match="joint_4 pushes"):
            raise made.play(at(OPEN), 2.0) or AssertionError("it ended well")


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

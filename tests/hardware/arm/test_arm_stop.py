"""Stopping the arm: in every state, at every instant, once."""

import dataclasses
import math
import threading
from collections.abc import Callable, Iterator
from itertools import pairwise

import pytest

from hardware import (
    ActivationStopped,
    Arm,
    ArmEvent,
    FrameSent,
    Playback,
    PlaybackState,
    State,
    StateChanged,
    TransitionRefused,
)
from hardware.arm.connection import Connection
from hardware.arm.streamer import Streamer
from hardware.errors import PortLost, StaleGeneration
from tests.support.arms.hardware_rigs import HOME, PICK, ROBOT, Rig, motion, nothing


@pytest.fixture
def rig() -> Iterator[Rig]:
    with Rig.alone() as rig:
        yield rig


def test_stop_mid_motion_writes_one_hold_and_nothing_more(rig: Rig) -> None:
    rig.start()
    playback = rig.arm.play(motion(HOME, PICK, 4.0), rig.wake, "test", rig.arm.generation)
    rig.wait(1.234)
    written = len(rig.frames)
    for _ in range(3):
        rig.arm.stop()
    assert playback.state is PlaybackState.STOPPED
    assert len(rig.frames) == written + 1
    assert rig.frames[-1].data == rig.frames[-2].data
    assert rig.frames[-1].scheduled is None
    rig.wait(10)
    assert len(rig.frames) == written + 1
    assert rig.arm.state is State.ACTIVE
    state = rig.link.board.state(rig.clock.now())
    assert (90 - state.servos[0], state.lost) == (90 - int(rig.frames[-1].data[1:4]), 0)


def test_stop_in_every_state_any_number_of_times(rig: Rig) -> None:
    def stopped(state: State) -> None:
        assert rig.arm.state is state
        rig.arm.stop()
        rig.arm.stop()
        assert rig.arm.state is state

    stopped(State.UNCONFIGURED)
    rig.arm.configure()
    stopped(State.INACTIVE)
    rig.arm.activate()
    stopped(State.ACTIVE)
    rig.arm.deactivate()
    stopped(State.INACTIVE)
    rig.arm.shutdown()
    stopped(State.FINALIZED)
    rig.arm.shutdown()
    assert rig.frames == []


def test_stop_during_the_boot_ends_the_activation(rig: Rig) -> None:
    rig.arm.configure()

    def stop() -> None:
        rig.wait(1.0)
        rig.arm.stop()

    rig.clock.spawn(stop, "stopper")
    with pytest.raises(ActivationStopped):
        rig.arm.activate()
    assert rig.arm.state is State.INACTIVE
    assert rig.clock.now() == 1.0
    rig.arm.activate()
    assert rig.arm.commanded == HOME


@pytest.mark.parametrize("goal", [State.ACTIVATING, State.ACTIVE])
def test_a_stop_in_the_first_and_in_the_last_moment_of_an_activation(goal: State) -> None:
    """A stop ends the activation, or finds the arm active."""
    with Rig.alone() as rig:

        def stop(event: ArmEvent) -> None:
            rig.events.append(event)
            if isinstance(event, StateChanged) and event.goal is goal:
                rig.arm.stop()

        rig.arm = Arm(ROBOT, rig.link, rig.clock, stop)
        rig.arm.configure()
        if goal is State.ACTIVATING:
            with pytest.raises(ActivationStopped):
                rig.arm.activate()
            assert rig.clock.now() == 0.0
            assert rig.arm.state is State.INACTIVE
            rig.arm = Arm(ROBOT, rig.link, rig.clock)
        else:
            rig.arm.activate()
            assert rig.arm.generation == 1


def test_a_stop_while_a_board_is_taken_as_booted_ends_the_activation(
    rig: Rig, monkeypatch: pytest.MonkeyPatch
) -> None:
    start = Connection.start

    def stopped(connection: Connection, waited: float) -> None:
        start(connection, waited)
        rig.arm.stop()

    rig.arm.configure()
    with monkeypatch.context() as patch:
        patch.setattr(Connection, "start", stopped)
        with pytest.raises(ActivationStopped):
            rig.arm.activate()
    assert rig.arm.state is State.INACTIVE
    rig.arm.activate()


def test_a_refused_activation_takes_no_stop_back(rig: Rig) -> None:
    rig.arm.configure()

    def stop() -> None:
        rig.wait(1.0)
        rig.arm.stop()
        with pytest.raises(TransitionRefused):
            rig.arm.activate()

    rig.clock.spawn(stop, "stopper")
    with pytest.raises(ActivationStopped):
        rig.arm.activate()


# Observers ------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("reported", ["observer", "watcher"])
@pytest.mark.parametrize("act", [Arm.stop, lambda arm: arm.fault(PortLost("board", "gone"))])
def test_an_observer_may_wait_for_a_lock_whose_owner_stops_the_arm(
    reported: str, act: Callable[[Arm], None]
) -> None:
    theirs, entered, rig = threading.RLock(), threading.Event(), Rig()

    def wants() -> None:
        entered.set()
        with theirs:
            pass

    def observe(event: ArmEvent) -> None:
        if reported == "observer" and isinstance(event, FrameSent):
            wants()

    arm = Arm(ROBOT, rig.link, rig.clock, observe)
    arm.configure()
    arm.activate()
    watch = wants if reported == "watcher" else nothing

    def own() -> None:
        with theirs:
            arm.play(motion(HOME, PICK, 4.0), watch, "test", arm.generation)
            assert entered.wait(5)
            act(arm)

    owner = threading.Thread(target=own, daemon=True)
    owner.start()
    owner.join(5)
    assert not owner.is_alive()
    arm.shutdown()


def test_the_hold_is_reported_before_the_end_of_its_motion() -> None:
    rig, reported, ended = Rig(), list[str](), threading.Event()

    def observe(event: ArmEvent) -> None:
        if not isinstance(event, FrameSent):
            return
        if event.scheduled is None:
            reported.append("hold")
        elif not stopper.ident:
            stopper.start()
            ended.wait(0.1)  # as long as this takes, the hold must wait, and so must the end

    def changed() -> None:
        if playback and playback[0].state is not PlaybackState.PLAYING and not ended.is_set():
            reported.append("end")
            ended.set()

    arm = Arm(ROBOT, rig.link, rig.clock, observe)
    stopper, playback = threading.Thread(target=arm.stop), list[Playback]()
    arm.configure()
    arm.activate()
    playback.append(arm.play(motion(HOME, PICK, 4.0), changed, "test", arm.generation))
    assert ended.wait(5)
    stopper.join(5)
    arm.shutdown()
    assert reported == ["hold", "end"]


def test_stops_at_any_instant_leave_one_hold_and_lose_nothing() -> None:
    for hundredths in range(0, 300, 7):
        rig = Rig()
        with rig.clock.working(), rig.arm:
            rig.start()
            rig.arm.play(
                motion(HOME, (-1.4, -0.6, -0.07, -0.7), 1.0), rig.wake, "test", rig.arm.generation
            )
            rig.wait(hundredths / 100)
            rig.arm.stop()
            written = len(rig.frames)
            rig.wait(5)
            assert len(rig.frames) == written
            holds = [frame for frame in rig.frames if frame.scheduled is None]
            assert len(holds) == (1 if written else 0)
            assert rig.link.board.state(rig.clock.now()).lost == 0


def test_after_a_stop_the_next_motion_starts_at_the_commanded_pose(rig: Rig) -> None:
    rig.start()
    rig.arm.play(motion(HOME, PICK, 4.0), rig.wake, "test", rig.arm.generation)
    rig.wait(1.0)
    rig.arm.stop()
    back = motion(rig.arm.commanded, HOME, 4.0)
    playback = rig.arm.play(back, rig.wake, "test", rig.arm.generation)
    rig.until(lambda: playback.state is not PlaybackState.PLAYING)
    assert playback.state is PlaybackState.DONE
    assert rig.link.board.state(rig.clock.now()).servos == (90, 90, 90, 0)


def test_deactivate_mid_motion_holds_first(rig: Rig) -> None:
    rig.start()
    playback = rig.arm.play(motion(HOME, PICK, 4.0), rig.wake, "test", rig.arm.generation)
    rig.wait(1.0)
    rig.arm.deactivate()
    assert playback.state is PlaybackState.STOPPED
    assert rig.frames[-1].scheduled is None
    written = len(rig.frames)
    rig.arm.stop()
    rig.arm.activate()
    rig.arm.stop()  # no frame was sent in this activation
    rig.wait(5)
    assert len(rig.frames) == written
    assert rig.arm.commanded == HOME


def test_a_motion_decided_on_before_a_stop_is_not_played_after_it(rig: Rig) -> None:
    rig.start()
    decided = rig.arm.generation
    rig.arm.stop()
    with pytest.raises(StaleGeneration):
        rig.arm.play(motion(HOME, PICK, 4.0), rig.wake, "test", decided)
    rig.wait(5)
    assert rig.frames == []


# Braking -------------------------------------------------------------------------------------

BRAKE = 1.0  # [s]
BRAKING = dataclasses.replace(ROBOT, brake=BRAKE)


@pytest.mark.parametrize("stops", [1, 3])
def test_a_robot_that_brakes_slows_down_along_its_schedule(stops: int) -> None:
    with Rig.alone(BRAKING) as rig:
        rig.start()
        schedule, began = motion(HOME, (-1.4, 0, 0, 0), 4.0), rig.clock.now()
        playback = rig.arm.play(schedule, rig.wake, "test", rig.arm.generation)
        rig.wait(1.0)
        for _ in range(stops):
            rig.arm.stop()
            rig.wait(0.1)
        stop = began + 1.0
        rig.until(lambda: playback.state is not PlaybackState.PLAYING)
        assert playback.state is PlaybackState.STOPPED
        *frames, hold = rig.frames
        assert [frame.data for frame in frames] == [
            s.frame.data for s in schedule.setpoints if s.time < 1.0 + BRAKE / 2
        ]
        assert (hold.data, hold.scheduled) == (frames[-1].data, None)
        assert hold.time <= stop + BRAKE
        for frame, setpoint in zip(frames, schedule.setpoints, strict=False):
            since = frame.time - stop
            on_time = since - since**2 / (2 * BRAKE) if since > 0 else since
            assert setpoint.time == pytest.approx(1.0 + on_time)
        gaps = [b.time - a.time for a, b in pairwise(frames) if a.time > stop]
        assert gaps == sorted(gaps)
        assert rig.link.board.state(rig.clock.now() + 10).lost == 0


def test_nothing_is_left_to_slow_down_after_the_last_frame() -> None:
    with Rig.alone(BRAKING) as rig:
        rig.start()
        schedule = motion(HOME, (-0.1, 0, 0, 0), 1.0)
        playback = rig.arm.play(schedule, rig.wake, "test", rig.arm.generation)
        rig.until(lambda: playback.written == len(schedule.setpoints))
        rig.arm.stop()
        assert playback.state is PlaybackState.STOPPED
        assert rig.frames[-1].scheduled is None


def test_deactivate_does_not_wait_for_the_brake() -> None:
    with Rig.alone(BRAKING) as rig:
        rig.start()
        rig.arm.play(motion(HOME, PICK, 4.0), rig.wake, "test", rig.arm.generation)
        rig.wait(1.0)
        rig.arm.stop()
        now = rig.clock.now()
        rig.arm.deactivate()
        assert rig.clock.now() == now
        assert rig.frames[-1].scheduled is None


def test_the_end_of_braking_leaves_alone_a_motion_that_began_in_that_moment(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    with Rig.alone(BRAKING) as rig:
        rig.start()
        playbacks, due = list[Playback](), Streamer._due

        def stop_and_play() -> None:
            rig.arm._connection.hold()  # type: ignore[union-attr]  # as `deactivate` does
            there, generation = motion(rig.arm.commanded, HOME, 4.0), rig.arm.generation
            playbacks.append(rig.arm.play(there, rig.wake, "next", generation))

        def meanwhile(streamer: Streamer, planned: float) -> float:
            """Between the wait for the next frame and its end, another thread stops and plays."""
            time = due(streamer, planned)
            if time == math.inf and threading.current_thread().name == "streamer":
                asked.append(time)
                if len(asked) == 2:
                    thread = threading.Thread(target=stop_and_play)
                    thread.start()
                    thread.join()
            return time

        asked = list[float]()
        monkeypatch.setattr(Streamer, "_due", meanwhile)
        rig.arm.play(motion(HOME, PICK, 4.0), rig.wake, "test", rig.arm.generation)
        rig.wait(1.0)
        rig.arm.stop()
        rig.until(lambda: bool(playbacks) and playbacks[0].state is not PlaybackState.PLAYING)
        assert playbacks[0].state is PlaybackState.DONE
        assert len([frame for frame in rig.frames if frame.scheduled is None]) == 1

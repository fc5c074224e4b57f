"""The arm as a whole, in simulated time on an in-process board."""

import dataclasses
import logging
from collections.abc import Iterator

import pytest

from hardware import (
    Arm,
    ArmEvent,
    BoardLink,
    BytesReceived,
    NotActive,
    PlaybackState,
    PortNotGiven,
    SimulatedClock,
    State,
    StateChanged,
)
from hardware.drivers.arduino.firmware_profile import FIRMWARES
from hardware.errors import ArmClaimed, TooFast
from tests.support.arms.hardware_rigs import HOME, PICK, ROBOT, Rig, motion, nothing, settled
from tests.support.arms.virtual_boards import virtual_board


@pytest.fixture
def rig() -> Iterator[Rig]:
    with Rig.alone() as rig:
        yield rig


def test_configure_without_a_port_is_refused(caplog: pytest.LogCaptureFixture) -> None:
    arm = Arm(ROBOT, None, SimulatedClock())
    with pytest.raises(PortNotGiven, match=r"^No serial port provided"):
        arm.configure()
    assert arm.state is State.UNCONFIGURED
    assert "No serial port provided" in caplog.text


def test_configure_never_opens_the_port(rig: Rig) -> None:
    rig.arm.configure()
    rig.arm.cleanup()
    rig.arm.configure()
    assert rig.arm.state is State.INACTIVE
    assert rig.resets == 0


def test_activate_waits_for_the_boot_and_sends_nothing(rig: Rig) -> None:
    rig.start()
    assert rig.arm.state is State.ACTIVE
    assert rig.clock.now() == ROBOT.serial.boot_wait
    assert rig.arm.commanded == ROBOT.boot_pose
    assert rig.resets == 1
    assert rig.frames == []


def test_the_caller_works_while_the_board_boots(rig: Rig) -> None:
    found: list[tuple[State, int, float]] = []
    rig.arm.configure()
    rig.arm.activate(meanwhile=lambda: found.append((rig.arm.state, rig.resets, rig.clock.now())))
    assert found == [(State.ACTIVATING, 1, 0.0)]


def test_edges_are_reported_in_order(rig: Rig) -> None:
    rig.start()
    rig.arm.deactivate()
    rig.arm.shutdown()
    edges = [event for event in rig.events if isinstance(event, StateChanged)]
    assert [edge.label for edge in edges] == [
        "configure", "transition_success", "activate", "transition_success",
        "deactivate", "transition_success", "shutdown", "transition_success",
    ]  # fmt: skip
    assert [edge.time for edge in edges] == [0, 0, 0, 2, 2, 2, 2, 2]


def test_writing_outside_active_is_refused(rig: Rig) -> None:
    schedule, activate = motion(HOME, PICK, 3.0), "`armtree arm activate`"

    def refused(state: State, advice: str, hint: str) -> None:
        with pytest.raises(NotActive, match=f"^the arm is {state.value}; {advice}$") as error:
            rig.arm.play(schedule, nothing, "test", rig.arm.generation)
        assert error.value.hint == hint
        with pytest.raises(NotActive):
            _ = rig.arm.commanded

    refused(
        State.UNCONFIGURED,
        "configure and activate it first",
        f"`armtree arm configure`, then {activate}",
    )
    rig.arm.configure()
    refused(State.INACTIVE, "activate it first", activate)
    rig.arm.activate()
    rig.arm.deactivate()
    refused(State.INACTIVE, "activate it first", activate)
    rig.arm.shutdown()
    refused(State.FINALIZED, "start armtree again", "start armtree again")
    assert rig.frames == []


def test_a_motion_plays_at_its_times_to_its_end(rig: Rig) -> None:
    rig.start()
    schedule, began = motion(HOME, PICK, 4.0), rig.clock.now()
    playback = rig.arm.play(schedule, rig.wake, "test", rig.arm.generation)
    rig.until(lambda: playback.state is not PlaybackState.PLAYING)
    assert playback.state is PlaybackState.DONE
    assert playback.written == len(schedule.setpoints) == len(rig.frames)
    assert playback.max_lateness == pytest.approx(0, abs=1e-9)
    for frame, setpoint in zip(rig.frames, schedule.setpoints, strict=True):
        assert frame.time == pytest.approx(began + setpoint.time)
        assert frame.data == setpoint.frame.data
    assert rig.arm.commanded == PICK
    assert rig.clock.now() == pytest.approx(began + schedule.duration)
    state = rig.link.board.state(rig.clock.now())
    assert state.servos == (9, 125, 85, 0)  # done means that the board is done, too
    assert state.lost == 0


def test_a_motion_to_the_present_pose_is_done_at_once(rig: Rig) -> None:
    rig.start()
    goal = (1e-4, 0.0, 0.0, 0.0)
    playback = rig.arm.play(motion(HOME, goal, 1.0), rig.wake, "test", rig.arm.generation)
    rig.until(lambda: playback.state is PlaybackState.DONE)
    assert rig.frames == []
    assert rig.arm.commanded == goal
    assert rig.clock.now() == 2.0


def test_a_second_motion_is_refused_while_one_plays(rig: Rig) -> None:
    rig.start()
    first = rig.arm.play(motion(HOME, PICK, 4.0), rig.wake, "first", rig.arm.generation)
    rig.wait(1.0)
    back = motion(rig.arm.commanded, HOME, 2.0)
    with pytest.raises(ArmClaimed, match="claimed by first, so second cannot"):
        rig.arm.play(back, rig.wake, "second", rig.arm.generation)
    rig.until(lambda: first.state is not PlaybackState.PLAYING)
    assert first.state is PlaybackState.DONE
    back = motion(rig.arm.commanded, HOME, 2.0)
    second = rig.arm.play(back, rig.wake, "second", rig.arm.generation)
    rig.until(lambda: second.state is not PlaybackState.PLAYING)
    assert second.state is PlaybackState.DONE


def test_the_state_is_the_command_and_a_follower_follows(rig: Rig) -> None:
    rig.start()
    goal = (-1.4, -0.6, -0.07, -0.7)
    playback = rig.arm.play(motion(HOME, goal, 4.0), rig.wake, "test", rig.arm.generation)
    rig.until(lambda: playback.state is PlaybackState.DONE)
    assert rig.arm.read() == {
        "joint_1/position": -1.4,
        "joint_2/position": -0.6,
        "joint_3/position": -0.07,
        "joint_4/position": -0.7,
        "joint_5/position": 0.7,
    }
    rig.arm.deactivate()
    with pytest.raises(NotActive):
        rig.arm.read()


def test_a_motion_from_elsewhere_is_refused_and_the_arm_stays_active(rig: Rig) -> None:
    rig.start()
    playback = rig.arm.play(motion(PICK, HOME, 4.0), rig.wake, "test", rig.arm.generation)
    rig.until(lambda: playback.state is not PlaybackState.PLAYING)
    assert playback.state is PlaybackState.FAILED
    assert isinstance(playback.error, TooFast)
    assert rig.frames == []
    assert rig.arm.state is State.ACTIVE


def test_the_log(rig: Rig, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.INFO, "hardware"):
        rig.start()
        rig.arm.deactivate()
        rig.arm.activate()
        rig.link.unplug()
        settled(rig, State.UNCONFIGURED)
    lines = [f"{record.levelname} {record.getMessage()}" for record in caplog.records]
    assert lines == [
        "INFO Starting the arm on port board: it moves to its boot pose",
        "INFO The arm on port board is ready to take commands",
        "INFO Stopping the arm on port board",
        "INFO The arm on port board is stopped",
        "INFO Starting the arm on port board: it moves to its boot pose",
        "INFO The arm on port board is ready to take commands",
        "ERROR Something went wrong while listening: the port board is gone. "
        "Check the cable and the power",
    ]


def test_leaving_the_context_shuts_down(rig: Rig) -> None:
    with rig.arm as arm:
        rig.start()
        arm.play(motion(HOME, PICK, 4.0), rig.wake, "test", arm.generation)
        rig.wait(1.0)
    assert rig.arm.state is State.FINALIZED
    assert rig.link.read() == b""  # closed
    assert rig.frames[-1].scheduled is None


def test_bytes_from_the_board_are_reported() -> None:
    clock, events = SimulatedClock(), list[ArmEvent]()
    robot = dataclasses.replace(ROBOT, firmware=FIRMWARES["armtree"])
    with clock.working():
        link = BoardLink(virtual_board(robot), clock)
        with Arm(robot, link, clock, events.append) as arm:
            arm.configure()
            arm.activate()
    banner = b"\narmtree 1 AVW? kept b090,s090,e090,g000,\n"
    said = 1.0 + len(banner) * (10 / 115200)
    assert [event for event in events if isinstance(event, BytesReceived)] == [
        BytesReceived(said, banner)
    ]


def late(rig: Rig, frame: int, seconds: float) -> list[float]:
    """Plays a steady motion whose sender is late once; returns by how much each frame was [s]."""
    rig.start()
    began = rig.clock.now()
    schedule = motion(HOME, (-0.5, 0, 0, 0), 3.0)

    def hinder() -> None:
        if len(rig.frames) == frame:
            signal, until = rig.clock.signal(), rig.clock.now() + seconds
            with signal:
                while rig.clock.now() < until:
                    signal.wait(until)
        rig.wake()

    playback = rig.arm.play(schedule, hinder, "test", rig.arm.generation)
    rig.until(lambda: playback.state is not PlaybackState.PLAYING)
    assert playback.state is PlaybackState.DONE
    assert [event.data for event in rig.frames] == [s.frame.data for s in schedule.setpoints]
    assert playback.max_lateness == pytest.approx(max(0.0, seconds - 0.1))
    pairs = zip(rig.frames, schedule.setpoints, strict=True)
    return [event.time - began - setpoint.time for event, setpoint in pairs]


def test_lateness_up_to_a_period_is_absorbed(rig: Rig) -> None:
    lateness = late(rig, 10, 0.17)
    assert lateness[10] == pytest.approx(0.07)
    assert lateness[:10] + lateness[11:] == pytest.approx([0.0] * 28, abs=1e-9)


def test_lateness_beyond_a_period_shifts_the_rest(rig: Rig) -> None:
    lateness = late(rig, 10, 0.35)
    assert lateness[:10] == pytest.approx([0.0] * 10, abs=1e-9)
    assert lateness[10:] == pytest.approx([0.25] * 19)

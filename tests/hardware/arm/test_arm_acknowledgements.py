"""The arm with a board that acknowledges frames."""

import contextlib
import dataclasses
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import pytest

from hardware import (
    Arm,
    ArmEvent,
    BoardLink,
    CommandSent,
    Faulted,
    Firmware,
    FrameSent,
    Joint,
    Playback,
    PlaybackState,
    Robot,
    SimulatedClock,
    State,
    TransitionRefused,
    load_robot,
)
from hardware.drivers.arduino.acknowledgements import ANSWER_TIMEOUT
from hardware.drivers.arduino.firmware_profile import FIRMWARES
from hardware.drivers.arduino.frames import Codec
from hardware.drivers.arduino.virtual.board import Board
from hardware.errors import BoardReset, BoardSilent, FrameLost, PoseOutsideLimits, WrongFirmware
from tests.support.arms.hardware_rigs import HOME, PICK, motion
from tests.support.arms.virtual_boards import virtual_board
from tests.support.paths import ROOT

OURS = FIRMWARES["armtree"]
ROBOT = dataclasses.replace(load_robot(), firmware=OURS)
CODEC = Codec(ROBOT.actuated)


class Rig:
    """An arm with armtree's firmware on an in-process board, with a line that can be damaged."""

    def __init__(self, runs: Firmware, robot: Robot = ROBOT) -> None:
        self.clock = SimulatedClock()
        board = virtual_board(dataclasses.replace(ROBOT, firmware=runs))
        self.link = Noisy(board, self.clock)
        self.events: list[ArmEvent] = []
        self.arm = Arm(robot, self.link, self.clock, self.events.append)
        self.signal = self.clock.signal()

    def changed(self) -> None:
        with self.signal:
            self.signal.notify()

    def play(self, goal: tuple[float, ...], seconds: float) -> Playback:
        """Plays a motion to its end."""
        there = motion(self.arm.commanded, goal, seconds, ROBOT)
        playback = self.arm.play(there, self.changed, "test", self.arm.generation)
        with self.signal:
            while playback.state is PlaybackState.PLAYING:
                self.signal.wait(None)
        return playback

    def settle(self) -> None:
        """Waits until the fault has taken the arm out of *active*."""
        with self.signal:
            while self.arm.state is not State.UNCONFIGURED:
                self.signal.wait(self.clock.now() + 0.01)

    @property
    def frames(self) -> int:
        return sum(isinstance(event, FrameSent) for event in self.events)


class Noisy(BoardLink[Board]):
    """Loses one byte of the line."""

    writes = 0
    damages = -1

    def write(self, data: bytes) -> None:
        self.writes += 1
        super().write(data[:-3] + data[-2:] if self.writes == self.damages else data)


@contextmanager
def active(runs: Firmware = OURS) -> Iterator[Rig]:
    rig = Rig(runs)
    with rig.clock.working(), rig.arm:
        rig.arm.configure()
        rig.arm.activate()
        yield rig


def test_the_arm_starts_at_the_pose_that_the_board_reports() -> None:
    with active() as rig:
        assert 1.0 < rig.clock.now() < 1.01  # it waits for the boot and the line only
        assert rig.arm.commanded == HOME
        assert rig.play(PICK, 4.0).state is PlaybackState.DONE
        rig.arm.deactivate()
        rig.arm.activate()
        assert str(CODEC.encode(rig.arm.commanded)) == "b009,s125,e085,g000,"
        assert rig.link.board.state(rig.clock.now()).servos == (9, 125, 85, 0)


def test_progress_counts_what_the_board_acknowledged() -> None:
    with active() as rig:
        greetings = [event for event in rig.events if isinstance(event, CommandSent)]
        assert greetings == [CommandSent(rig.clock.now(), b"bA01;")]
        counts: list[tuple[int, int]] = []
        there = motion(HOME, PICK, 4.0, ROBOT)

        def changed() -> None:
            counts.append((playback.arrived, rig.frames))
            rig.changed()

        playback = rig.arm.play(there, changed, "test", rig.arm.generation)
        with rig.signal:
            while playback.state is PlaybackState.PLAYING:
                rig.signal.wait(None)
        arrived = [count for count, _ in counts]
        assert arrived == sorted(arrived)
        assert arrived[-1] == playback.written == len(there.setpoints)
        assert any(count < sent for count, sent in counts)


@pytest.mark.parametrize("ends", [Arm.stop, Arm.deactivate, Arm.shutdown])
def test_a_lost_hold_frame_is_a_fault(ends: Callable[[Arm], None]) -> None:
    with active() as rig:
        there = motion(HOME, PICK, 4.0, ROBOT)
        playback = rig.arm.play(there, rig.changed, "test", rig.arm.generation)
        with rig.signal:
            while rig.frames < 20:
                rig.signal.wait(None)
        rig.link.damages = rig.link.writes + 1
        stopped = rig.clock.now()
        with contextlib.suppress(TransitionRefused):  # the fault came first
            ends(rig.arm)
        assert playback.state is PlaybackState.STOPPED
        if ends is Arm.stop:
            rig.settle()
        (fault,) = [event.error for event in rig.events if isinstance(event, Faulted)]
        assert isinstance(fault, FrameLost)
        assert ANSWER_TIMEOUT <= rig.clock.now() - stopped <= ANSWER_TIMEOUT * 1.25


@pytest.mark.parametrize("ends", [Arm.stop, Arm.deactivate, Arm.shutdown])
def test_a_hold_frame_that_arrives_is_waited_for_and_no_longer(
    ends: Callable[[Arm], None],
) -> None:
    with active() as rig:
        there = motion(HOME, PICK, 4.0, ROBOT)
        rig.arm.play(there, rig.changed, "test", rig.arm.generation)
        with rig.signal:
            while rig.frames < 20:
                rig.signal.wait(None)
        stopped = rig.clock.now()
        ends(rig.arm)
        assert rig.clock.now() - stopped == pytest.approx(
            0.0 if ends is Arm.stop else 0.003, abs=2e-3
        )
        with rig.signal:
            while rig.clock.now() < stopped + 1:
                rig.signal.wait(stopped + 1)
        assert not [event for event in rig.events if isinstance(event, Faulted)]


LAST = len(motion(HOME, PICK, 4.0, ROBOT).setpoints)


@pytest.mark.parametrize("damaged", [1, 40, LAST])
def test_a_lost_frame_ends_the_motion(damaged: int) -> None:
    with active() as rig:
        rig.link.damages = 1 + damaged  # after the first command
        playback = rig.play(PICK, 4.0)
        assert playback.state is PlaybackState.FAILED
        assert isinstance(playback.error, FrameLost)
        rig.settle()
        assert rig.frames <= rig.link.damages + 1
        assert not [e for e in rig.events if isinstance(e, FrameSent) and e.scheduled is None]


def test_a_board_that_resets_in_mid_motion_ends_it() -> None:
    with active() as rig:
        reset = rig.clock.now() + 0.5

        def press() -> None:
            with rig.signal:
                while rig.clock.now() < reset:
                    rig.signal.wait(reset)
            rig.link.board.reset(rig.clock.now())

        rig.clock.spawn(press, "button")
        playback = rig.play(PICK, 4.0)
        assert isinstance(playback.error, FrameLost)
        assert "and then nothing for 0.25 s" in str(playback.error)
        rig.settle()
        assert rig.clock.now() < reset + 0.35


def test_a_reset_while_nothing_moves_is_a_fault() -> None:
    with active() as rig:
        rig.link.board.reset(rig.clock.now())
        rig.link.write(b"")  # wakes the reader
        rig.settle()
        assert [type(e.error) for e in rig.events if isinstance(e, Faulted)] == [BoardReset]


def test_a_stop_right_before_a_motion_leaves_its_count_alone() -> None:
    with active() as rig:
        playback = rig.play(PICK, 4.0)
        rig.arm.stop()
        assert rig.play(HOME, 4.0).arrived == playback.arrived


def test_a_board_with_another_firmware_is_refused_and_the_error_names_it() -> None:
    rig = Rig(OURS, load_robot())
    with rig.clock.working(), rig.arm:
        rig.arm.configure()
        why = 'The board runs armtree, but the robot file names stock. Write firmware = "armtree"'
        with pytest.raises(WrongFirmware, match=why):
            rig.arm.activate()
        assert rig.clock.now() < ROBOT.serial.boot_wait  # it stops waiting early
        assert rig.arm.state is State.UNCONFIGURED
        assert rig.frames == 0


@pytest.mark.parametrize(
    ("letter", "angle", "nearest"), [("b", 0, 45), ("b", 44, 45), ("s", 180, 135), ("s", 136, 135)]
)
def test_a_board_that_holds_a_servo_outside_the_limits_is_refused(
    letter: str, angle: int, nearest: int
) -> None:
    """Otherwise the first frame would make the arm jump into its limits."""
    angles = {"b": 90, "s": 90, "e": 90, "g": 0}
    narrow = dataclasses.replace(ROBOT, joints=tuple(map(narrowed, ROBOT.joints)))
    rig = Rig(OURS, narrow)
    with rig.clock.working(), rig.arm:
        rig.link.open()
        hold(rig, "".join(f"{name}{deg:03d}," for name, deg in {**angles, letter: angle}.items()))
        rig.arm.configure()
        joint = "joint_1" if letter == "b" else "joint_2"
        why = (
            f"The servo of {joint} is at {angle} degrees, outside the limits of the joint, which "
            f"end at {nearest} degrees.* switch the board off and on"
        )
        with pytest.raises(PoseOutsideLimits, match=why):
            rig.arm.activate()
        assert rig.arm.state is State.INACTIVE
        assert rig.link.read() == b""  # closed
        rig.link.open()
        hold(rig, "".join(f"{name}{deg:03d}," for name, deg in {**angles, letter: nearest}.items()))
        rig.arm.activate()


def narrowed(joint: Joint) -> Joint:
    lower, upper = max(joint.lower, -0.785), min(joint.upper, 0.785)
    return dataclasses.replace(joint, lower=lower, upper=upper)


def hold(rig: Rig, frame: str) -> None:
    """Leaves a frame in the memory of a board that is booting, and closes its line."""
    with rig.signal:
        until = rig.clock.now() + 1.5
        while rig.clock.now() < until:
            rig.signal.wait(until)
        rig.link.write(frame.encode())
        until += 0.1
        while rig.clock.now() < until:
            rig.signal.wait(until)
    rig.link.close()


def test_a_board_that_does_not_run_the_firmware_of_the_robot_file_is_refused() -> None:
    rig = Rig(FIRMWARES["stock"])
    with rig.clock.working(), rig.arm:
        rig.arm.configure()
        why = "did not report that it runs the firmware armtree"
        with pytest.raises(BoardSilent, match=why):
            rig.arm.activate()
        assert rig.arm.state is State.INACTIVE
        assert rig.link.read() == b""  # closed


STALLED = """
import dataclasses, os, signal, threading
from hardware import Arm, PlaybackState, RealClock, load_robot
from hardware.drivers.arduino.firmware_profile import FIRMWARES
from tests.support.arms.hardware_rigs import PICK, motion

robot = dataclasses.replace(load_robot(), firmware=FIRMWARES["armtree"])
link, ended = robot.link("virtual"), threading.Event()
write, frames = link.write, iter(range(40))

def stall(data):
    write(data)
    if next(frames, None) == 30:
        os.kill(os.getpid(), signal.SIGSTOP)

def changed():
    if playback.state is not PlaybackState.PLAYING:
        ended.set()

link.write = stall
with Arm(robot, link, RealClock()) as arm:
    arm.configure()
    arm.activate()
    schedule = motion(arm.commanded, PICK, 1.5, robot)
    playback = arm.play(schedule, changed, "test", arm.generation)
    ended.wait(20)
    print(playback.state.value, playback.error)
"""


@pytest.mark.slow
def test_a_host_that_stood_still_is_no_lost_frame() -> None:
    """It stops right after it has sent a frame, and the answer waits for it."""
    with subprocess.Popen(
        [sys.executable, "-c", STALLED],
        stdout=subprocess.PIPE,
        text=True,
        cwd=ROOT,
    ) as process:
        _, status = os.waitpid(process.pid, os.WUNTRACED)
        assert os.WIFSTOPPED(status)
        threading.Event().wait(2 * ANSWER_TIMEOUT)  # the stall
        process.send_signal(signal.SIGCONT)
        said, _ = process.communicate(timeout=30)
    assert said == "done None\n"

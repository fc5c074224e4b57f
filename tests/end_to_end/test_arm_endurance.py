"""Many repetitions on real pseudo-terminals: nothing leaks, nothing hangs."""

import dataclasses
import os
import pty
import random
import tty
from contextlib import closing

import pytest

from hardware import Arm, ArmEvent, Faulted, FrameSent, RealClock, SerialLink, State, load_robot
from hardware.drivers.arduino.virtual.board import Board
from hardware.drivers.virtual.board_process import BoardProcess
from hardware.errors import PortLost
from tests.support.arms.hardware_rigs import left, motion, nothing, open_files, settled_for, threads

pytestmark = pytest.mark.slow

SHIPPED = load_robot()
# A board that never blocks and boots at once, so that a thousand of them take no time.
QUICK = dataclasses.replace(SHIPPED.firmware, rate=50.0, unit_time=0.0, boot_time=0.0)
ROBOT = dataclasses.replace(
    SHIPPED, firmware=QUICK, serial=dataclasses.replace(SHIPPED.serial, boot_wait=0.0)
)
PATIENCE = 60.0  # [s]


def pulled(seconds: float) -> list[ArmEvent]:
    """Disconnects the cable some time after the start of a motion; returns what happened."""
    master, slave = pty.openpty()
    tty.setraw(slave)
    link, events, clock = SerialLink(os.ttyname(slave), 115200), list[ArmEvent](), RealClock()
    os.close(slave)
    with Arm(ROBOT, link, clock, events.append) as arm:
        arm.configure()
        arm.activate()
        there = motion(arm.commanded, (-1.4, -0.6, -0.07, -0.7), 2.0, ROBOT)
        arm.play(there, nothing, "test", arm.generation)
        signal, until = clock.signal(), clock.now() + seconds
        with signal:
            while clock.now() < until:
                signal.wait(until)
        os.close(master)
        settled_for(arm, State.UNCONFIGURED, PATIENCE)
        arm.stop()
    return events


def test_a_cable_pulled_at_any_instant_is_a_fault_and_no_frame_follows() -> None:
    dice, files, before = random.Random(1), open_files(), threads()
    written = 0
    for _ in range(200):
        events = pulled(dice.uniform(0.0, 0.05))
        faults = [event for event in events if isinstance(event, Faulted)]
        assert [type(fault.error) for fault in faults] == [PortLost]
        frames = [event for event in events if isinstance(event, FrameSent)]
        assert all(frame.time <= faults[0].time for frame in frames)
        assert not [frame for frame in frames if frame.scheduled is None]
        written += len(frames)
    assert written
    assert open_files() <= files
    assert not left(before)


def test_a_thousand_activations_leave_nothing_behind() -> None:
    with closing(BoardProcess(Board("bseg", (90, 90, 90, 0), QUICK, 115200))) as arduino:
        with Arm(ROBOT, SerialLink(arduino.port, 115200), RealClock()) as arm:
            arm.configure()
            files, before = open_files(), threads()
            for _ in range(1000):
                arm.activate()
                arm.deactivate()
            assert open_files() <= files
            assert not left(before)
        assert arduino.state().lost == 0

"""Processes of virtual boards: none spins, leaks or outlives its owner."""

import dataclasses
import os
import re
import select
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from hardware import Arm, ArmEvent, Faulted, LinkError, RealClock, SerialLink, State, StateChanged
from hardware.drivers.arduino.firmware_profile import FIRMWARES
from hardware.drivers.arduino.virtual.board import Board, BoardState
from hardware.drivers.virtual.board_process import BoardProcess, VirtualLink
from hardware.errors import PortMissing
from tests.support.arms.hardware_rigs import ROBOT, left, open_files, threads
from tests.support.paths import ROOT

pytestmark = pytest.mark.slow

BAUD = 115200
STATUS = 131  # length of our firmware's answer to a question [bytes]
PATIENCE = 60.0  # longer than anything here takes [s]
EAGER = dataclasses.replace(ROBOT, serial=dataclasses.replace(ROBOT.serial, boot_wait=0.0))


def test_a_virtual_port_that_does_not_open_ends_its_process(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    link = ROBOT.link("virtual")
    assert isinstance(link, VirtualLink)
    pids: list[int] = []

    def missing(self: SerialLink) -> None:
        assert link.board
        pids.append(link.board.pid)
        raise PortMissing("virtual", [])

    monkeypatch.setattr(SerialLink, "open", missing)
    with pytest.raises(PortMissing):
        link.open()
    assert link.board is None
    with pytest.raises(ProcessLookupError):
        os.kill(pids[0], 0)


def test_a_board_that_is_switched_on_is_the_one_that_opens() -> None:
    link = ROBOT.link("virtual")
    assert isinstance(link, VirtualLink)
    board = link.switch_on()
    assert link.switch_on() is board
    link.open()
    assert link.board is board
    link.close()
    assert link.board is None
    with pytest.raises(ProcessLookupError):
        os.kill(board.pid, 0)


def test_the_state_of_an_ended_virtual_board_is_an_error() -> None:
    arduino = BoardProcess(Board("bseg", (90, 90, 90, 0), ROBOT.firmware, BAUD))
    os.kill(arduino.pid, signal.SIGKILL)
    for _ in range(2):
        with pytest.raises(LinkError, match="the virtual board has ended"):
            arduino.state()
        arduino.close()


def test_an_idle_board_costs_next_to_nothing() -> None:
    """The process does not spin, neither with a client nor after one has closed the port."""
    arduino = BoardProcess(Board("bseg", (90, 90, 90, 0), FIRMWARES["armtree"], BAUD))
    link, clock = SerialLink(arduino.port, BAUD), RealClock()
    link.open()
    for opened in (True, False):
        if not opened:
            link.close()
        arduino.state()
        before = cpu_seconds(arduino.pid)
        with (wait := clock.signal()):
            until = clock.now() + 0.2
            while clock.now() < until:
                wait.wait(until)
        assert cpu_seconds(arduino.pid) - before < 0.05
    arduino.close()


def test_a_client_that_never_reads_stops_nothing() -> None:
    """Bytes without room in the kernel are lost, as on a real line, and the board continues."""
    asked = 1000
    ours = dataclasses.replace(FIRMWARES["armtree"], boot_time=0.0)
    arduino = BoardProcess(Board("bseg", (90, 90, 90, 0), ours, 4_000_000))
    port = os.open(arduino.port, os.O_RDWR | os.O_NOCTTY)
    until(arduino, lambda state: state.resets == 1)
    for _ in range(asked):
        os.write(port, b"?".ljust(STATUS, b"\n"))
    os.write(port, b"b091,s089,e091,g001,")
    until(arduino, lambda state: state.servos == (91, 89, 91, 1))
    heard = b""
    while select.select([port], [], [], 0)[0]:
        heard += os.read(port, 4096)
    assert 0 < len(heard) < 0.75 * asked * STATUS
    os.write(port, b"?")
    heard = b""
    while not heard.endswith(b"at=b091,s089,e091,g001,\n"):
        assert select.select([port], [], [], PATIENCE)[0]
        heard += os.read(port, 4096)
    os.close(port)
    arduino.close()


def until(arduino: BoardProcess, so: Callable[[BoardState], bool]) -> None:
    """Reads the state of the board until a condition holds."""
    deadline = time.monotonic() + PATIENCE
    while not so(state := arduino.state()):
        assert time.monotonic() < deadline, state


def cpu_seconds(pid: int) -> float:
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def test_a_hundred_activations_leak_nothing() -> None:
    arduino = BoardProcess(Board("bseg", (90, 90, 90, 0), ROBOT.firmware, BAUD))
    arduino.state()
    with Arm(EAGER, SerialLink(arduino.port, BAUD), RealClock()) as arm:
        arm.configure()
        files, before = open_files(), threads()
        for _ in range(100):
            arm.activate()
            started = {each.name for each in threads() - before} - {"releaser"}
            assert started == {"listener", "streamer", "writer"}
            arm.deactivate()
            assert not left(before)
        assert open_files() <= files
    arduino.close()


def test_an_arm_whose_port_is_lost_leaves_active() -> None:
    for _ in range(5):
        files, left, faults = open_files(), threading.Event(), list[Faulted]()

        def see(
            event: ArmEvent, left: threading.Event = left, faults: list[Faulted] = faults
        ) -> None:
            if isinstance(event, Faulted):
                faults.append(event)
            if isinstance(event, StateChanged) and event.start is State.ERRORPROCESSING:
                left.set()

        link = EAGER.link("virtual")
        assert isinstance(link, VirtualLink)
        with Arm(EAGER, link, RealClock(), see) as arm:
            arm.configure()
            arm.activate()
            assert link.board
            link.board.close()
            assert left.wait(5)
            assert arm.state is State.UNCONFIGURED
        assert len(faults) == 1
        assert open_files() <= files


def test_a_virtual_port_activated_ten_times_leaks_nothing() -> None:
    files = open_files()
    with Arm(EAGER, EAGER.link("virtual"), RealClock()) as arm:
        arm.configure()
        for _ in range(10):
            arm.activate()
            arm.deactivate()
        assert open_files() <= files
    assert arm.state is State.FINALIZED


def test_the_end_of_the_interpreter_closes_the_port() -> None:
    program = """
import dataclasses
from hardware import Arm, RealClock, load_robot
robot = load_robot()
robot = dataclasses.replace(robot, serial=dataclasses.replace(robot.serial, boot_wait=0.0))
link = robot.link("virtual")
arm = Arm(robot, link, RealClock(), lambda event: print(event, flush=True))
arm.configure()
arm.activate()
print(link.board.pid)
"""
    done = subprocess.run(
        [sys.executable, "-c", program],
        capture_output=True,
        text=True,
        cwd=ROOT,
        check=True,
    )
    assert done.stderr == ""
    assert "shuttingdown" in done.stdout
    pid = int(re.findall(r"^\d+$", done.stdout, re.MULTILINE)[0])
    with pytest.raises(ProcessLookupError):
        os.kill(pid, 0)


def test_a_killed_owner_takes_its_board_along() -> None:
    program = """
import sys
from hardware import load_robot
robot = load_robot()
link = robot.link("virtual")
link.open()
link.board.state()
print(link.board.pid, flush=True)
sys.stdin.read()
"""
    with subprocess.Popen(
        [sys.executable, "-c", program],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        cwd=ROOT,
    ) as owner:
        assert owner.stdout
        pid = int(owner.stdout.readline())
        watch = os.pidfd_open(pid)
        owner.kill()
    poll = select.poll()
    poll.register(watch, select.POLLIN)
    assert poll.poll(5000)
    os.close(watch)

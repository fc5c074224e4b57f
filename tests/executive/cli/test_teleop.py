"""`armtree teleop` in a real pseudo-terminal: two virtual buses, and a hand moves the leader."""

import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from executive.replay.verification import verify
from hardware.drivers.feetech.virtual.bus import Fault
from hardware.drivers.virtual.board_process import BoardProcess
from logs import LeaderState, Recording, Sent
from tests.support.arms.bus_arms import push, so101_bus, so101_file
from tests.support.command_line.pseudo_terminal import PseudoTerminal

pytestmark = pytest.mark.slow

FOLLOWS, HOLDS = "arm active, follows", "arm active, holds"


@pytest.fixture
def buses() -> Iterator[tuple[BoardProcess, BoardProcess]]:
    """The bus of the arm that follows, and that of the leader."""
    with so101_bus() as arm, so101_bus() as leader:
        yield arm, leader


@pytest.fixture
def command(buses: tuple[BoardProcess, BoardProcess], tmp_path: Path) -> list[str]:
    (arm, leader), robot = buses, str(so101_file(tmp_path))
    return ["teleop", "--robot", robot, "--port", arm.port, "--leader", leader.port]


def row(joint: str, leader: str, commanded: str) -> str:
    return f"{joint:<16}{leader:>10}{commanded:>11}"


def follow(terminal: PseudoTerminal) -> None:
    terminal.until("falls unless you hold it. Do you hold it? y/n")
    terminal.type("y")
    terminal.until(FOLLOWS)


def recordings(folder: Path) -> list[Path]:
    return sorted((folder / "recordings").glob("*-move.mcap"))


def test_an_arm_follows_holds_and_stops_before_a_collision(
    command: list[str], buses: tuple[BoardProcess, BoardProcess], tmp_path: Path
) -> None:
    arm, leader = buses
    push_before = leader.state().positions[1]
    with PseudoTerminal(tmp_path, *command) as terminal:
        follow(terminal)
        assert not any(leader.state().torque.values())
        push(leader, shoulder_pan=20, gripper=30)
        terminal.until(row("shoulder_pan", "20.0", "20.0"), row("gripper", "30.0", "30.0"))
        push(leader, shoulder_lift=90)
        shown = terminal.until("Blocked: ", "free")
        free = dict(re.findall(r"^(\w+) .* deg  (.*)$", shown, re.MULTILINE))
        assert (free["shoulder_lift"], free["wrist_roll"]) == ("<-", "<- ->")
        push(leader, shoulder_lift=0)
        terminal.until(row("shoulder_lift", "0.0", "0.0"))
        terminal.type(" ")
        terminal.until(HOLDS, "space follow")
        push(leader, shoulder_pan=-20)
        terminal.until(row("shoulder_pan", "-20.0", "20.0"))
        terminal.type(" ")  # on a planned path
        terminal.until(FOLLOWS, row("shoulder_pan", "-20.0", "-20.0"))
        terminal.type("q")
        status, printed = terminal.end()
    assert status == 0
    assert "The arm holds at shoulder_pan -20.0 deg" in printed
    assert "The leader holds its position" in printed
    assert all(arm.state().torque.values())
    assert all(leader.state().torque.values())
    assert leader.state().positions[1] != push_before
    made = recordings(tmp_path)
    assert all(verify(path).holds for path in made)
    assert any(next(Recording(path).records(LeaderState), None) for path in made)


def test_a_leader_outside_the_limits_leads_to_the_limit(
    command: list[str], buses: tuple[BoardProcess, BoardProcess], tmp_path: Path
) -> None:
    """It is never commanded. Here it is 3 degrees above one limit, and far above another."""
    arm, leader = buses
    push(leader, wrist_roll=175, gripper=103)
    with PseudoTerminal(tmp_path, *command) as terminal:
        follow(terminal)
        terminal.until(row("wrist_roll", "175.0", "162.8"), row("gripper", "103.0", "100.0"))
        push(leader, wrist_roll=150)
        terminal.until(row("wrist_roll", "150.0", "150.0"))
        push(leader, wrist_roll=170)
        terminal.until(row("wrist_roll", "170.0", "162.8"))
        terminal.type("q")
        status, printed = terminal.end()
    assert (status, "The leader holds its position" in printed) == (0, True)
    assert leader.state().positions[5] == pytest.approx(2048 + 170 * 4096 / 360, abs=1)
    assert all(arm.state().torque.values())


@pytest.mark.parametrize("way", ["Ctrl-C", "closed terminal", "arm fails", "leader unplugged"])
def test_the_arm_holds_whatever_ends_it(
    command: list[str], buses: tuple[BoardProcess, BoardProcess], tmp_path: Path, way: str
) -> None:
    arm, leader = buses
    with PseudoTerminal(tmp_path, *command, "--speed", "0.05") as terminal:
        follow(terminal)
        push(leader, shoulder_pan=80)
        terminal.until("shoulder_pan          80.0")
        if way == "Ctrl-C":
            terminal.type("\x03")
            assert terminal.end()[0] == 130
        elif way == "closed terminal":
            terminal.close()
            terminal.process.wait()
        elif way == "arm fails":
            arm.call("fail", Fault("vanish", 6, 0.0))
            terminal.until("hw.servo_silent", "q leave, then start armtree teleop again")
            terminal.type("q")
            assert "The leader holds its position" in terminal.end()[1]
        else:
            leader.close()
            shown = terminal.until("the leader is lost", "q leave")
            assert re.search(r"shoulder_pan +\? ", shown)
            terminal.type("q")
            assert "The leader has no torque: hold it" in terminal.end()[1]
    frames = [each for path in recordings(tmp_path) for each in Recording(path).records(Sent)]
    assert all(each.positions[0] < 1.3 for each in frames if isinstance(each, Sent) if each.joints)
    state = arm.state()
    assert all(state.torque.values())
    assert state.positions[1] < 2048 + 75 * 4096 / 360


def test_an_arm_of_a_server_is_refused_before_the_leader_loses_its_torque(
    command: list[str], buses: tuple[BoardProcess, BoardProcess], tmp_path: Path
) -> None:
    held = ["serve", *command[1:5], "--tcp-port", "0", "--activate"]
    with PseudoTerminal(tmp_path, *held) as server:
        server.until("is ready to take commands")
        with PseudoTerminal(tmp_path, *command) as terminal:
            status, printed = terminal.end()
        words = " ".join(printed.split())
        assert status == 9
        assert "Do you hold it?" not in words
        (release,) = re.findall(r"`armtree (arm deactivate --server \S+)`", words)
        assert words.count("End that program first") == 1
        assert buses[1].state().torque == dict.fromkeys(range(1, 7), False)  # it was never opened
        with PseudoTerminal(tmp_path, *release.split()) as terminal:
            assert terminal.end()[0] == 0
        with PseudoTerminal(tmp_path, *command) as terminal:
            terminal.until("Do you hold it? y/n")
            terminal.type("n")
            assert terminal.end()[0] == 0


def test_no_virtual_arm_follows_in_place_of_that_of_a_server(
    command: list[str], tmp_path: Path
) -> None:
    robot, leader = command[1:3], command[5:]
    with PseudoTerminal(tmp_path, "serve", *robot, "--tcp-port", "0", "--activate") as server:
        server.until("is ready to take commands")
        with PseudoTerminal(tmp_path, "teleop", *robot, *leader) as terminal:
            status, printed = terminal.end()
        words = " ".join(printed.split())
        assert status == 2
        assert "then give that port with --port. To have a virtual arm follow" in words
        with PseudoTerminal(tmp_path, "teleop", *robot, *leader, "--port", "virtual") as terminal:
            terminal.until("Do you hold it? y/n")
            terminal.type("n")
            assert terminal.end()[0] == 0


def test_what_is_wrong_is_refused(command: list[str], tmp_path: Path) -> None:
    with PseudoTerminal(tmp_path, *command[:-1], "/dev/ttyNone") as terminal:
        status, printed = terminal.end()
        assert (status, "/dev/ttyNone" in printed) == (6, True)
    with PseudoTerminal(tmp_path, "teleop", "--leader", "virtual") as terminal:
        status, printed = terminal.end()
        assert (status, "hw.not_able" in printed) == (3, True)
    other = ["--leader-robot", "arduinobot"]
    with PseudoTerminal(tmp_path, *command, *other) as terminal:
        status, printed = terminal.end()
        assert (status, "joints of the leader (joint_1" in printed) == (2, True)

"""`armtree calibrate` in a real pseudo-terminal, on a virtual bus whose joints a hand moves."""

import json
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest
import serial

from hardware import load_robot
from hardware.description.calibration import calibration_file
from hardware.drivers.feetech.packets import sync_write
from hardware.drivers.feetech.registers import STS
from hardware.drivers.feetech.virtual.bus import Bus, Fault
from hardware.drivers.virtual.board_process import BoardProcess
from tests.support.arms.bus_arms import bus_arm, so101_bus
from tests.support.command_line.pseudo_terminal import PseudoTerminal

pytestmark = pytest.mark.slow

# Ends of each joint [ticks], as a hand turns it; a servo starts at 2048.
ENDS = {1: (1000, 3100), 2: (1100, 2900), 3: (1010, 3000), 4: (1200, 2100)}


class Arm:
    """A robot file and a bus behind a port."""

    def __init__(self, folder: Path, homing: int = 0) -> None:
        self.folder, self.file = folder, bus_arm(folder)
        robot = load_robot(self.file)
        model = robot.model()
        assert isinstance(model, Bus)
        for servo in model.servos:
            servo.put("torque_enable", 1)  # from an earlier run
            servo.put("offset", homing)
        self.board = BoardProcess(model, robot.serial.baud)
        self.board.state()  # it has started

    def calibrate(self, *options: str) -> PseudoTerminal:
        given = "--robot", str(self.file), "--port", self.board.port
        return PseudoTerminal(self.folder, "calibrate", *given, *options)

    def kept(self) -> list[tuple[int, int, int]]:
        """Offset and limits that each servo keeps without power."""
        names = "offset", "min_angle", "max_angle"
        return [tuple(each[name] for name in names) for each in self.board.call("kept")]

    def physical(self) -> list[float]:
        """Where the shaft of each servo is, without the offset that it subtracts [ticks]."""
        positions = self.board.state().positions.values()
        return [q + offset for q, (offset, *_) in zip(positions, self.kept(), strict=True)]

    def torque_on(self) -> None:
        """Holds the arm where it is, as a program does that ended before."""
        goals = {k: round(q) for k, q in self.board.state().positions.items()}
        with serial.Serial(self.board.port, 1_000_000) as port:
            for name, values in (
                ("goal_position", goals),
                ("torque_enable", dict.fromkeys(goals, 1)),
            ):
                packed = {servo: STS.pack(name, value) for servo, value in values.items()}
                port.write(sync_write(STS.registers[name].address, packed))
                port.flush()
            assert any(all(self.board.state().torque.values()) for _ in range(10_000))

    def hold(self, terminal: PseudoTerminal) -> None:
        """Says that a person holds the arm, which has torque until then."""
        terminal.until("Do you hold it?")
        assert all(self.board.state().torque.values())
        terminal.type("y\r")

    def turn(self, terminal: PseudoTerminal, servo: int, *places: int) -> None:
        """Turns a servo by hand to places, one after the other, in steps that the table sees."""
        now = round(self.board.state().positions[servo])
        for place in places:
            while now != place:
                now += max(min(place - now, 1500), -1500)
                self.board.call("push", {servo: now})
                terminal.until(f"{now % 4096}")

    def sweep(self, terminal: PseudoTerminal) -> None:
        terminal.until("Do you hold it?")
        terminal.type("y\r")
        terminal.until("Turn every joint by hand")
        for servo, ends in ENDS.items():
            self.turn(terminal, servo, *ends)


@pytest.fixture
def arm(tmp_path: Path) -> Iterator[Arm]:
    made = Arm(tmp_path)
    yield made
    made.board.close()


def test_an_arm_is_calibrated_and_restored(arm: Arm) -> None:
    with arm.calibrate() as terminal:
        arm.hold(terminal)
        shown = terminal.until("turn it", "2048")
        assert not any(arm.board.state().torque.values())
        terminal.type("\r")
        shown = terminal.until("Not turned yet: joint_1, joint_2")
        for servo, ends in ENDS.items():
            arm.turn(terminal, servo, *ends)
        shown = terminal.until("joint_4           4  2100   1200   2100")
        assert "joint_1           1  3100   1000   3100  185 deg  180 deg  103% of" in shown
        terminal.type("\r")
        shown = terminal.until("Write 8 values to the servos, and the file")
        assert "servo 1   joint_1          least        0 -> 1000" in shown
        assert not calibration_file(arm.file).exists()
        assert arm.kept() == [(0, 0, 4095)] * 4
        terminal.type("y\r")
        status, printed = terminal.end()
        assert (status, "the servos hold the same values" in printed) == (0, True)
    assert arm.kept() == [(0, *ends) for ends in ENDS.values()]
    robot = load_robot(arm.file)
    assert robot.calibration == calibration_file(arm.file)
    # The middle of each range is the middle of the URDF's, and no limit is at a stop.
    middle = [(low + high) // 2 for low, high in ENDS.values()]
    urdf = [(j.lower + j.upper) / 2 for j in load_robot(arm.file, calibrated=False).actuated]
    assert robot.wire_format.encode(urdf).servos == pytest.approx(middle, abs=1)
    for joint, (low, high) in zip(robot.actuated, ENDS.values(), strict=True):
        assert joint.upper - joint.lower < (high - low - 20) * 2 * 3.1416 / 4096

    arm.torque_on()
    with arm.calibrate("--restore") as terminal:
        arm.hold(terminal)
        terminal.until("Write 8 values to the servos, and delete")
        assert not any(arm.board.state().torque.values())
        terminal.type("y\r")
        assert terminal.end()[0] == 0
    assert arm.kept() == [(0, 0, 4095)] * 4
    assert not calibration_file(arm.file).exists()


def test_a_seam_inside_a_range_is_refused_and_centring_is_the_way_out(arm: Arm) -> None:
    over = 2900, 4700
    for options in ([], ["--centre"]):
        with arm.calibrate(*options) as terminal:
            arm.sweep(terminal)
            arm.turn(terminal, 2, *over, 2900)
            arm.turn(terminal, 2, 2900)
            terminal.until("the seam is inside")
            terminal.type("\r")
            if not options:
                status, printed = terminal.end()
                assert status == 6
                assert "The range of joint_2 contains the seam" in printed
                assert "Nothing was written. Run `armtree calibrate --centre`" in " ".join(
                    printed.split()
                )
                assert arm.kept() == [(0, 0, 4095)] * 4
            else:
                terminal.until("to the servos, and the file")
                terminal.type("y\r")
                assert terminal.end()[0] == 0
    homing, least, most = arm.kept()[1]
    assert (least + most) // 2 == pytest.approx(2048, abs=1)
    assert homing
    assert load_robot(arm.file).calibration


def test_servos_get_their_ids_one_by_one(arm: Arm) -> None:
    arm.board.call("connect", [2])
    with arm.calibrate("--ids") as terminal:
        terminal.until("Connect only the servo of joint_1 (id 1)")
        terminal.type("\r")
        terminal.until("Write the id 1 to the servo, which has 3?")
        terminal.type("y\r")
        terminal.until("The servo reads back the id 1", "Connect only the servo of joint_2 (id 2)")
        terminal.type("\x03")
        assert terminal.end()[0] == 130
    arm.board.call("fail", Fault("restart", 1, 0.0))  # it loses its torque
    arm.board.call("push", {1: 1900})  # servos with equal values would look as one
    arm.board.call("connect")
    with arm.calibrate() as terminal:
        status, printed = terminal.end()
        assert (status, "hw.servo_twice" in printed) == (6, True)
    with arm.calibrate("--ids") as terminal:
        for joint, place in enumerate((0, 1, 2, 3), start=1):
            terminal.until(f"Connect only the servo of joint_{joint} (id {joint})")
            if joint == 2:
                arm.board.call("connect", [0, 1])
                terminal.type("\r")
                terminal.until("Exactly one servo must answer; ids that answer: 1, 2")
                arm.board.call("connect", [0, 2])
                terminal.type("\r")
                terminal.until("ids that answer: none; damaged, as if two answer")
            arm.board.call("connect", [place])
            terminal.type("\r")
            if joint == 3:
                terminal.until("Write the id 3 to the servo, which has 1?")
                terminal.type("y\r")
        assert terminal.end()[0] == 0
    arm.board.call("connect")
    assert [each["id"] for each in arm.board.call("kept")] == [1, 2, 3, 4]


def test_servos_get_their_earlier_ids_back(arm: Arm) -> None:
    arm.board.call("connect", [2])
    for given in (True, False):  # the second time, the servo has its id already
        with arm.calibrate("--ids") as terminal:
            terminal.until("Connect only the servo of joint_1 (id 1)")
            terminal.type("\r")
            if given:
                terminal.until("Write the id 1 to the servo, which has 3?")
                terminal.type("y\r")
                terminal.until("The servo reads back the id 1. It had 3; --ids --restore")
            terminal.until("Connect only the servo of joint_2 (id 2)")
            terminal.type("\x03")
            terminal.end()
    with arm.calibrate("--ids", "--restore") as terminal:
        terminal.until("Connect only the servo of joint_1 (id 3)")
        terminal.type("\r")
        terminal.until("Write the id 3 to the servo, which has 1?")
        terminal.type("y\r")
        assert terminal.end()[0] == 0
    arm.board.call("connect")
    assert [each["id"] for each in arm.board.call("kept")] == [1, 2, 3, 4]
    with arm.calibrate("--ids", "--restore") as terminal:
        status, printed = terminal.end()
        assert (status, "nothing to restore" in " ".join(printed.split())) == (3, True)


def lerobot(path: Path, **changes: object) -> Path:
    values = {
        f"joint_{k}": {
            "id": k, "drive_mode": 0, "homing_offset": 10 * k, "range_min": low, "range_max": high
        }
        for k, (low, high) in ENDS.items()
    }  # fmt: skip
    values["joint_1"].update(changes)  # type: ignore[arg-type]
    path.write_text(json.dumps(values))
    return path


def test_a_calibration_by_lerobot_is_taken_and_restored_without_torque(
    arm: Arm, tmp_path: Path
) -> None:
    """A new offset moves a servo with torque, so the torque is off first."""
    there = arm.physical()
    with arm.calibrate("--import", str(lerobot(tmp_path / "arm.json"))) as terminal:
        arm.hold(terminal)
        terminal.until("Write 12 values to the servos")
        terminal.type("y\r")
        status, printed = terminal.end()
        assert (status, "Servos have no torque: hold the arm." in printed) == (0, True)
    assert arm.kept() == [(10 * k, *ends) for k, ends in ENDS.items()]
    assert load_robot(arm.file).calibration
    assert not any(arm.board.state().torque.values())
    assert arm.physical() == there

    arm.torque_on()
    before = arm.physical()
    with arm.calibrate("--restore") as terminal:
        arm.hold(terminal)
        terminal.until("Write 12 values to the servos, and delete")
        terminal.type("y\r")
        status, printed = terminal.end()
        assert (status, "Servos have no torque: hold the arm." in printed) == (0, True)
    assert arm.kept() == [(0, 0, 4095)] * 4
    assert not any(arm.board.state().torque.values())
    assert arm.physical() == before


def test_the_file_of_another_arm_is_named_before_it_is_replaced(arm: Arm, tmp_path: Path) -> None:
    other, file = Arm(tmp_path, homing=-88), calibration_file(arm.file)
    imported = "--import", str(lerobot(tmp_path / "arm.json"))
    with closing(other.board):
        with arm.calibrate(*imported) as terminal:
            arm.hold(terminal)
            assert "another arm" not in terminal.until("and the file")
            terminal.type("y\r")
            assert terminal.end()[0] == 0
        with other.calibrate(*imported) as terminal:
            other.hold(terminal)
            terminal.until("stores homing = -88; the calibration file has 10", "To use --restore")
            terminal.type("n\r")
            assert terminal.end()[0] == 130
        with other.calibrate("--restore") as terminal:
            status, printed = terminal.end()
            assert (status, "hw.calibration_differs" in printed) == (6, True)
        assert other.kept() == [(0, 0, 4095)] * 4
    assert file.exists()


@pytest.mark.parametrize("options", [(), ("--import", "arm.json")])
def test_whoever_does_not_hold_the_arm_calibrates_nothing(
    arm: Arm, tmp_path: Path, options: tuple[str, ...]
) -> None:
    lerobot(tmp_path / "arm.json")
    with arm.calibrate(*options) as terminal:
        terminal.until("Do you hold it?")
        terminal.type("n\r")
        assert terminal.end()[0] == 130
    assert all(arm.board.state().torque.values())
    assert arm.kept() == [(0, 0, 4095)] * 4


@pytest.mark.parametrize(
    ("changes", "why"),
    [
        ({"id": 9}, "joint_1 has id 9; the robot file has 1"),
        ({"drive_mode": 1}, "joint_1 has drive_mode 1; it must be 0"),
        ({"range_max": 5000}, "needed: 0 <= range_min < range_max < 4096"),
        ({"range_min": 0.5}, "they must be whole numbers; calibrate without --import"),
    ],
)
def test_a_wrong_calibration_by_lerobot_is_refused(
    arm: Arm, tmp_path: Path, changes: dict[str, object], why: str
) -> None:
    with arm.calibrate("--import", str(lerobot(tmp_path / "arm.json", **changes))) as terminal:
        status, printed = terminal.end()
        assert (status, why in " ".join(printed.split())) == (3, True)
    assert arm.kept() == [(0, 0, 4095)] * 4


def test_the_calibration_of_a_robot_that_ships_belongs_to_the_user(tmp_path: Path) -> None:
    kept = {"drive_mode": 0, "homing_offset": 0, "range_min": 1000, "range_max": 3000}
    joints = load_robot(Path("so101")).actuated
    file = tmp_path / "arm.json"
    file.write_text(json.dumps({each.name: {"id": k, **kept} for k, each in enumerate(joints, 1)}))
    words = ["calibrate", "--robot", "so101", "--import", str(file), "--port"]
    own = {"XDG_CONFIG_HOME": str(tmp_path / "config")}
    with (
        so101_bus() as bus,
        PseudoTerminal(tmp_path, *words, bus.port, environment=own) as terminal,
    ):
        terminal.until("Do you hold it?")
        terminal.type("y\r")
        terminal.until("to the servos, and the file")
        terminal.type("y\r")
        status, printed = terminal.end()
    assert status == 0, printed
    assert [path.name for path in (tmp_path / "config/armtree").iterdir()] == [
        "so101.calibration.toml"
    ]


def test_a_release_that_fails_after_some_servos_says_to_hold_the_arm(arm: Arm) -> None:
    with arm.calibrate() as terminal:
        terminal.until("Do you hold it?")
        arm.board.call("connect", [0, 1, 2])
        terminal.type("y\r")
        status, printed = terminal.end()
        shown = " ".join(printed.split())
        assert (status, "do not confirm it: 4. Nothing was written" in shown) == (6, True)
        assert "Servos have no torque: hold the arm." in shown
    assert [*arm.board.state().torque.values()][:3] == [False] * 3


@pytest.mark.parametrize(("answer", "status"), [("n\r", 130), ("\x03", 130)])
def test_whoever_declines_the_write_learns_that_nothing_was_written(
    arm: Arm, tmp_path: Path, answer: str, status: int
) -> None:
    imported = "--import", str(lerobot(tmp_path / "arm.json"))
    with arm.calibrate(*imported) as terminal:
        arm.hold(terminal)
        terminal.until("to the servos, and the file")
        terminal.type(answer)
        ended, printed = terminal.end()
        assert (ended, "Nothing was written." in printed) == (status, True)
    assert arm.kept() == [(0, 0, 4095)] * 4
    with arm.calibrate(*imported) as terminal:
        terminal.until("Do you hold it?")
        terminal.type("y\r")
        terminal.until("to the servos, and the file")
        terminal.type("y\r")
        assert terminal.end()[0] == 0
    written = arm.kept()
    with arm.calibrate("--restore") as terminal:
        terminal.until("Do you hold it?")
        terminal.type("y\r")
        terminal.until("to the servos, and delete")
        terminal.type(answer)
        ended, printed = terminal.end()
        assert (ended, "Nothing was written." in printed) == (status, True)
    assert arm.kept() == written


@pytest.mark.parametrize(("key", "status"), [("q", 0), ("\x03", 130)])
def test_whoever_leaves_learns_that_the_servos_have_no_torque(
    arm: Arm, key: str, status: int
) -> None:
    with arm.calibrate() as terminal:
        arm.hold(terminal)
        terminal.until("Turn every joint by hand")
        terminal.type(key)
        ended, printed = terminal.end()
        assert ended == status
        for left in ("Nothing was written.", "Servos have no torque: hold the arm."):
            assert left in printed
    assert arm.kept() == [(0, 0, 4095)] * 4

"""A driver of another package: it is found by name, and works behind the same write guard."""

import dataclasses
import sys
from pathlib import Path

import pytest

from hardware import (
    Arm,
    BadPosition,
    DescriptionError,
    PlaybackState,
    Robot,
    SimulatedClock,
    load_robot,
)
from hardware.drivers.arduino.serial_servo import SerialServo
from tests.support.arms.hardware_rigs import motion

DRIVER = '''
"""Servos on a bus that take their positions in ticks, such as `1:0512 2:0300;`."""

import re
import threading
from dataclasses import dataclass

from hardware import BoardProtocol, Firmware, Frame

MIDDLE, PER_RADIAN = 512, 100


@dataclass(frozen=True)
class Ticks:
    firmwares = {"bus": Firmware("bus", rate=20.0, max_step=90)}

    def wire(self, joint, lower, upper):
        table = joint.table("wire")
        number = table.integer("id", choices=(1, 2, 3, 4))
        table.done()
        return number

    def check(self, root, joints, firmware):
        pass

    def wire_format(self, joints):
        return Format(joints)

    def protocol(self, joints, firmware, robot_file):
        return BoardProtocol()

    def link(self, joints, firmware, baud, port):
        return Bus(port)


class Format:
    def __init__(self, joints):
        self.joints = joints

    def encode(self, positions):
        return self.frame([MIDDLE + int(q * PER_RADIAN) for q in positions])

    def frame(self, servos):
        words = [f"{joint.wire}:{t:04d}" for joint, t in zip(self.joints, servos, strict=True)]
        return Frame(tuple(servos), (" ".join(words) + ";").encode())

    def parse(self, data):
        return self.frame([int(ticks) for ticks in re.findall(rb":(\\d{4})", data)])

    def decode(self, frame):
        return tuple((ticks - MIDDLE) / PER_RADIAN for ticks in frame.servos)


class Bus:
    """Keeps the written bytes; no board answers."""

    def __init__(self, port):
        self.port, self.written = port, []
        self.closed = threading.Event()

    def open(self):
        self.closed.clear()

    def write(self, data):
        self.written.append(data)

    def read(self):
        self.closed.wait()
        return b""

    def close(self, discard=False):
        self.closed.set()
'''


def installed(folder: Path, source: str = DRIVER) -> None:
    """Creates the files of an installed package with a driver."""
    (folder / "ticks_driver.py").write_text(source)
    info = folder / "ticks_driver-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: ticks-driver\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[armtree.hardware]\nticks = ticks_driver:Ticks\n")


def described(folder: Path) -> Path:
    """The Arduinobot with another driver."""
    shipped = Path(load_robot().path)
    text = shipped.read_text().replace('driver = "serial_servo"', 'driver = "ticks"')
    text = text.replace('firmware = "stock"', 'firmware = "bus"')
    lines = text.splitlines()
    wires = [number for number, line in enumerate(lines) if line.startswith("wire = ")]
    for servo, number in enumerate(wires, 1):
        lines[number] = f"wire = {{ id = {servo} }}"
    (folder / "robot.toml").write_text("\n".join(lines))
    (folder / "arduinobot.urdf").write_bytes(shipped.with_suffix(".urdf").read_bytes())
    return folder / "robot.toml"


@pytest.fixture
def robot(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Robot:
    monkeypatch.delitem(sys.modules, "ticks_driver", raising=False)
    installed(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    return load_robot(described(tmp_path))


class Silence:
    """An event that is waited for on the simulated clock."""

    def __init__(self, clock: SimulatedClock) -> None:
        self.signal, self.over = clock.signal(), False

    def clear(self) -> None:
        self.over = False

    def set(self) -> None:
        with self.signal:
            self.over = True
            self.signal.notify()

    def wait(self) -> None:
        with self.signal:
            while not self.over:
                self.signal.wait(None)


def test_a_driver_of_another_package_drives_the_arm(robot: Robot) -> None:
    clock = SimulatedClock()
    link = robot.link("can0")
    link.closed = Silence(clock)  # type: ignore[attr-defined]
    ended = clock.signal()

    def changed() -> None:
        with ended:
            ended.notify()

    with clock.working(), Arm(robot, link, clock) as arm:
        arm.configure()
        arm.activate()
        goal = (0.5, -0.3, 0.0, -0.2)
        schedule = motion(arm.commanded, goal, 2.0, robot)
        playback = arm.play(schedule, changed, "test", arm.generation)
        with ended:
            while playback.state is PlaybackState.PLAYING:
                ended.wait(clock.now() + 5.0)
        assert playback.state is PlaybackState.DONE
        written: list[bytes] = link.written  # type: ignore[attr-defined]
        assert written[-1] == b"1:0562 2:0482 3:0512 4:0492;"
        assert len(written) == len(schedule.setpoints)
        outside = motion(arm.commanded, (2.0, 0.0, 0.0, 0.0), 2.0, robot)
        playback = arm.play(outside, changed, "test", arm.generation)
        with ended:
            while playback.state is PlaybackState.PLAYING:
                ended.wait(clock.now() + 5.0)
        assert isinstance(playback.error, BadPosition)
        assert max(int(frame[2:6]) for frame in written) <= 512 + 157


def test_a_driver_reads_its_own_keys(robot: Robot) -> None:
    text = robot.path.read_text().replace("{ id = 3 }", "{ id = 9 }")
    robot.path.write_text(text)
    with pytest.raises(DescriptionError, match=r"joint_3.wire.id: 9 is not one of 1, 2, 3, 4"):
        load_robot(robot.path)


@pytest.mark.usefixtures("robot")
def test_an_unknown_driver_gets_a_list_of_the_installed_ones(tmp_path: Path) -> None:
    path = tmp_path / "robot.toml"
    path.write_text(path.read_text().replace('driver = "ticks"', 'driver = "tiks"'))
    why = r"robot.toml:5: driver: 'tiks' is not one of (serial_servo, ticks|ticks, serial_servo)"
    with pytest.raises(DescriptionError, match=why):
        load_robot(path)


def test_a_driver_that_cannot_be_loaded_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delitem(sys.modules, "ticks_driver", raising=False)
    installed(tmp_path, "import no_such_module_of_anybody")
    monkeypatch.syspath_prepend(str(tmp_path))
    why = "driver: ticks cannot be loaded from ticks_driver:Ticks: ModuleNotFoundError"
    with pytest.raises(DescriptionError, match=why):
        load_robot(described(tmp_path))


def test_robots_of_one_file_are_equal() -> None:
    assert load_robot() == load_robot()
    assert dataclasses.replace(load_robot()).driver == SerialServo()

"""Arms with bus servos: the Arduinobot with them in place of its own, and a hand for the SO-101."""

import contextlib
import re
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path

from hardware import (
    Arm,
    ArmEvent,
    BoardLink,
    CommandSent,
    Faulted,
    FrameSent,
    HardwareError,
    PlaybackState,
    Schedule,
    SimulatedClock,
    load_robot,
)
from hardware.drivers.feetech.packets import Instruction, take_packets
from hardware.drivers.feetech.registers import STS
from hardware.drivers.feetech.virtual.bus import Bus, Fault
from hardware.drivers.virtual.board_process import BoardProcess
from tests.support.arms.hardware_rigs import motion

_SERIAL = """[serial]
port = "virtual"
baud = 1000000
boot_wait_s = 1.0
firmware = "{}"

"""


def bus_arm(folder: Path, series: str = "sts") -> Path:
    """Writes the robot file and its URDF, and returns the robot file. Ids count from 1."""
    shipped = load_robot()
    text = shipped.path.read_text().replace('driver = "serial_servo"', 'driver = "feetech"')
    text = re.sub(r"\[serial\]\n.*?\n\n", _SERIAL.format(series), text, flags=re.S)
    ids = iter(range(1, 5))
    text = re.sub(
        r"wire = .*", lambda _: f"wire = {{ id = {next(ids)}, sign = 1, offset_deg = 0 }}", text
    )
    (folder / "arm.toml").write_text(text)
    (folder / shipped.urdf.name).write_bytes(shipped.urdf.read_bytes())
    return folder / "arm.toml"


class BusRig:
    """An arm on a virtual bus with faults."""

    def __init__(self, robot_file: Path, faults: list[Fault]) -> None:
        self.robot = load_robot(robot_file)
        model = self.robot.model()
        assert isinstance(model, Bus)
        self.bus = Bus(model.servos, self.robot.serial.baud, faults)
        self.clock = SimulatedClock()
        self.events: list[ArmEvent] = []
        self.arm = Arm(self.robot, BoardLink(self.bus, self.clock), self.clock, self.events.append)
        self.woken = self.clock.signal()

    def wake(self) -> None:
        with self.woken:
            self.woken.notify()

    def play(self, goal: tuple[float, ...], seconds: float) -> HardwareError | None:
        """Plays a motion to its end, and returns its error."""
        playback = self.arm.play(
            self.schedule(goal, seconds), self.wake, "test", self.arm.generation
        )
        with self.woken:
            while playback.state is PlaybackState.PLAYING:
                self.woken.wait(None)
        return playback.error

    def schedule(self, goal: tuple[float, ...], seconds: float) -> Schedule:
        return motion(self.arm.commanded, goal, seconds, self.robot)

    def after(self, seconds: float, act: Callable[[], None]) -> None:
        """Calls a function later, on another thread."""
        signal, until = self.clock.signal(), self.clock.now() + seconds

        def run() -> None:
            with signal:
                signal.wait(until)
            act()

        self.clock.spawn(run, "later")

    def faulted(self, seconds: float = 5.0) -> HardwareError:
        """Waits, and returns the fault that came."""
        self.wait(seconds)
        return self.faults[0]

    def wait(self, seconds: float) -> None:
        until = self.clock.now() + seconds
        with self.woken:
            while self.clock.now() < until:
                self.woken.wait(until)

    @property
    def faults(self) -> list[HardwareError]:
        return [event.error for event in self.events if isinstance(event, Faulted)]


@contextlib.contextmanager
def rig(
    folder: Path, *faults: Fault, guards: str = "", serial: str = "", series: str = "sts"
) -> Iterator[BusRig]:
    robot_file = bus_arm(folder, series)
    text = robot_file.read_text().replace("[serial]", f"[serial]\n{serial}")
    robot_file.write_text(f"{text}\n[guards]\n{guards}\n")
    made = BusRig(robot_file, list(faults))
    with made.clock.working(), made.arm:
        made.arm.configure()
        yield made


def written(made: BusRig, register: str) -> list[list[int]]:
    """The values of a register that were written to all servos, in order."""
    place = STS.registers[register]
    sent = [e.data for e in made.events if isinstance(e, CommandSent | FrameSent)]
    packets = [p for data in sent for p in take_packets(bytearray(data))]
    head = bytes([place.address, place.size])
    rows = []
    for packet in packets:
        if packet.code == Instruction.SYNC_WRITE and packet.parameters[:2] == head:
            body, step = packet.parameters[2:], place.size + 1
            parts = [body[i + 1 : i + step] for i in range(0, len(body), step)]
            rows.append([STS.unpack(register, part, place.address) for part in parts])
    return rows


def so101_file(folder: Path) -> Path:
    """Writes a robot file of an SO-101 that needs no calibration, and returns it.

    It allows the most lost answers: on a busy machine, the process of the bus may answer late.
    """
    shipped = load_robot(Path("so101"))
    text = re.sub("needs_calibration = .*", "", shipped.path.read_text())
    text = text.replace("baud =", "lost_answers = 20\nbaud =")
    path = folder / "so101.toml"
    path.write_text(text.replace('"so101.urdf"', f'"{shipped.urdf}"'))
    return path


@contextmanager
def so101_bus() -> Iterator[BoardProcess]:
    """The virtual bus of an SO-101, behind a pseudo-terminal."""
    model = load_robot(Path("so101")).model()
    assert model
    with closing(BoardProcess(model, 1_000_000)) as bus:
        bus.state()  # it has started
        yield bus


def push(bus: BoardProcess, **joints: float) -> None:
    """Moves joints of an SO-101 by hand, all at once [deg], as soon as none has torque."""
    names = [joint.name for joint in load_robot(Path("so101")).actuated]
    ticks = {names.index(name) + 1: 2048 + round(q * 4096 / 360) for name, q in joints.items()}
    while any(bus.state().torque.values()):
        pass  # the command that ends it is on its way
    bus.call("push", ticks)

"""A bus with servos is not what the robot file says, or something happens to it during a motion."""

import contextlib
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path

from hardware import load_robot
from hardware.description.calibration import CalibratedJoint, calibration_file, write_calibration
from hardware.drivers.feetech.packets import Instruction, take_packets
from hardware.drivers.feetech.virtual.bus import Bus, Fault
from hardware.drivers.virtual.board_process import BoardProcess
from tests.faults.means.logged_bus import LoggedBus, logged
from tests.faults.process import Command
from tests.faults.row import LATE_S, TASKS, Scene, frames_of, last_line, messages, row
from tests.support.arms.bus_arms import bus_arm

ALWAYS = 1_000_000  # answers
PERIOD = 0.02  # between two frames [s]
NEAR = 34  # 3 degrees, which a servo may be off where it is held [ticks]
COMMANDS = {Instruction.WRITE, Instruction.SYNC_WRITE}
# Faults during a motion, and the codes with which it may end.
SUDDEN = {
    "vanish": {"hw.servo_silent"},
    "impersonate": {"hw.servo_silent"},
    "damage": {"hw.servo_silent"},
    "block": {"hw.stalled", "hw.not_following", "hw.servo_fault"},
    "brown_out": {"hw.servo_fault", "hw.voltage_low"},
    "restart": {"hw.torque_lost", "hw.not_following"},
}


def wrong_ids(bus: Bus, _: Path) -> None:
    for servo in bus.servos:
        servo.put("id", servo.servo + 10)


def damaged(bus: Bus, _: Path) -> None:
    for servo in bus.servos:
        bus.fail(0.0, Fault("damage", servo.servo, 0.0, ALWAYS))


def low_voltage(bus: Bus, _: Path) -> None:
    for servo in bus.servos:
        servo.supply = 4.2


def another_arm(_: Bus, file: Path) -> None:
    wire = "sign = 1, offset_deg = 0, homing = 77 }"
    joints = {
        f"joint_{k}": CalibratedJoint(-80.0, 80.0, f"{{ id = {k}, {wire}", {}) for k in range(1, 5)
    }
    write_calibration(calibration_file(file), "arduinobot", "by a row", joints)


def not_calibrated(_: Bus, file: Path) -> None:
    file.write_text(f"needs_calibration = true\n{file.read_text()}")


# Faults before the start: the code with which a run then ends, and what makes the bus wrong.
WRONG: dict[str, tuple[str, Callable[[Bus, Path], object]]] = {
    "none answers": ("hw.servo_missing", lambda bus, _: bus.connect(0.0, [])),
    "1 of 4 answers": ("hw.servo_missing", lambda bus, _: bus.connect(0.0, [0])),
    "wrong ids": ("hw.servo_missing", wrong_ids),
    "one id twice": ("hw.servo_missing", lambda bus, _: bus.servos[1].put("id", 3)),
    "damaged": ("hw.no_servos", damaged),
    "impersonate": (
        "hw.servo_missing",
        lambda bus, _: bus.fail(0.0, Fault("impersonate", 1, 0.0, 2)),
    ),
    "low voltage": ("hw.voltage_low", low_voltage),
    "outside": ("hw.pose_outside", lambda bus, _: bus.servos[0].push(4000)),
    "another arm": ("hw.calibration_differs", another_arm),
    "not calibrated": ("hw.not_calibrated", not_calibrated),
}


@contextlib.contextmanager
def running(
    folder: Path, change: Callable[[Bus, Path], object] | None = None
) -> Iterator[tuple[Path, BoardProcess]]:
    """A robot file, and the bus of its arm behind a port. Its log is `bus.log` in the folder."""
    file = bus_arm(folder)
    model = load_robot(file).model()
    assert isinstance(model, Bus)
    if change:
        change(model, file)
    board = BoardProcess(LoggedBus(model, folder / "bus.log"), 1_000_000)
    board.state()  # it has started
    try:
        yield file, board
    finally:
        board.close()


def run(
    scene: Scene, file: Path, board: BoardProcess, environment: Mapping[str, str] | None = None
) -> Command:
    port = "--port", board.port, "--robot", file, "--trees", TASKS
    return scene.armtree("run", "20", "--json", *port, environment=environment)


def in_motion(
    scene: Scene, file: Path, board: BoardProcess, environment: Mapping[str, str] | None = None
) -> Command:
    """A run, a random part of a period after a random number of writes during its motion."""
    command = run(scene, file, board, environment)
    command.until_event("schedule")
    before = len(command.events("sent"))  # requests and commands of the activation
    command.until_event("sent", before + scene.random.randint(5, 60))
    time.sleep(scene.random.uniform(0.0, PERIOD))  # noqa: TID251, a random moment
    return command


@row(
    "bus-wrong",
    "a run on a bus without servos, with 1 of 4, wrong ids, one id twice, damaged answers, a servo"
    " that answers for another, low voltage, a joint outside its limits, the calibration of another"
    " arm or none",
    "the run ends with the code of the cause; no servo gets torque, or moves; the recording has the"
    " code, except of an arm that is not calibrated: its run does not start",
    times=10,
)
def wrong(scene: Scene) -> None:
    for kind in scene.share(WRONG):
        code, change = WRONG[kind]
        with running(scene.folder, change) as (file, board):
            before = board.state()
            command = run(scene, file, board)
            status, after = command.wait(), board.state()
            ended = [each["code"] for each in command.events() if "code" in each]
            scene.check(status in (3, 6), f"{kind}: exit status {status}")
            scene.check(code in ended, f"{kind}: {ended}, {last_line(command)}")
            scene.check(not any(after.torque.values()), f"{kind}: a servo has torque")
            scene.check(after.positions == before.positions, f"{kind}: a servo has moved")
            results = [messages(path, "/result") for path in scene.recordings()[-1:]]
            found = any(code.encode() in data for each in results for _, data in each)
            scene.check(found is (kind != "not calibrated"), f"{kind}: in the recording: {found}")


@row(
    "bus-fault-port",
    "during a motion a servo vanishes, answers for another, sends damaged answers, is blocked,"
    " has a low voltage, or restarts",
    "the goal ends with the code of the cause; the servos hold their positions; the log of the bus"
    " has nothing afterwards, and before it the commands that are recorded",
    times=6,
)
def sudden(scene: Scene) -> None:
    (kind,) = scene.share(SUDDEN)
    with running(scene.folder) as (file, board):
        command = in_motion(scene, file, board)
        board.call("fail", Fault(kind, 2, 0.0, 3 if kind == "impersonate" else ALWAYS))
        failed = scene.faulted(command, *SUDDEN[kind])
        before = board.state().positions
        time.sleep(0.5)  # noqa: TID251, so long a servo could still move
        after = board.state().positions
        moved = max(abs(after[servo] - before[servo]) for servo in after)
        scene.check(moved < NEAR, f"{kind}: a servo moves by {moved:.0f} ticks after the end")
        read = logged(scene.folder / "bus.log")
    late = [data for when, data in read if when > failed + LATE_S]
    scene.check(not late, f"{kind}: {len(late)} pieces reached the bus after the fault")
    wanted = commands(each.data for path in scene.recordings() for each in frames_of(path))
    found = commands(data for _, data in read)
    scene.check(found, "the bus has read no command")
    scene.check(found == wanted, f"{kind}: {len(found)} commands, {len(wanted)} recorded")
    scene.verified()


def commands(pieces: Iterable[bytes]) -> list[bytes]:
    """The whole packets among these bytes that command servos, in their order."""
    packets = take_packets(bytearray(b"".join(pieces)))
    return [packet.data for packet in packets if packet.code in COMMANDS]

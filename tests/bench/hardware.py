"""How the bottom room keeps time, stops, and sees a lost port.

Everything runs on real pseudo-terminals, paced by the virtual Arduino with our firmware;
`frames_per_s` by its machine code on a simulated chip. `stock_bytes_lost` is simulated on the model
of the published sketch, and the times until faults of servos are seen on that of the bus. A cycle
of the bus is a frame and the answers of all servos; it is late if it does not end within a period.
"""

import dataclasses
import logging
import math
import os
import pty
import random
import re
import statistics
import sys
import tempfile
import threading
import time
import tty
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, closing, contextmanager, nullcontext
from functools import partial
from pathlib import Path

import rustypot
import scservo_sdk

# This file is named like a room, and its folder comes first where it is run by itself.
sys.path = [folder for folder in sys.path if Path(folder) != Path(__file__).parent]

from executive.cli.support.process import make_punctual
from executive.recording.translate import arm_record
from hardware import (
    VIRTUAL,
    Arm,
    ArmEvent,
    BoardLink,
    Faulted,
    FrameSent,
    Measured,
    Playback,
    PlaybackState,
    RealClock,
    Robot,
    Schedule,
    SerialLink,
    SimulatedClock,
    compile_schedule,
    load_robot,
)
from hardware.clock import Signal
from hardware.description.guards import Guards
from hardware.drivers.arduino.firmware_profile import ARMTREE, FIRMWARES
from hardware.drivers.feetech import packets
from hardware.drivers.feetech.registers import STS
from hardware.drivers.feetech.virtual.bus import Bus, Fault
from hardware.drivers.virtual.board_process import BoardProcess
from logs import Recorder, Sent
from skills.motion import Pool, Query
from tests.avr import rig
from tests.bench.table import Row, arguments, show
from tests.support.arms.virtual_boards import virtual_board

HOME, PICK = (0.0, 0.0, 0.0, 0.0), (-1.4, -0.6, -0.07, -0.7)
# Where the arms of `busy` plan to [rad].
GOALS = {"arduinobot": PICK[:3], "so101": (0.8, -0.6, 0.5, 0.4, 0.3)}


PATIENCE = 30.0  # longer than anything here waits, however loaded the machine is [s]


def robot_with(firmware: str = "armtree") -> Robot:
    """The shipped robot with a firmware. Ours says when it has booted, however long that takes."""
    robot = load_robot()
    serial = dataclasses.replace(robot.serial, boot_wait=PATIENCE)
    return dataclasses.replace(robot, serial=serial, firmware=FIRMWARES[firmware])


def sweep(robot: Robot, start: Sequence[float], goal: Sequence[float], duration: float) -> Schedule:
    """A straight motion at constant speed."""

    def sample(times: Sequence[float]) -> list[list[float]]:
        shares = [min(1.0, time / duration) for time in times]
        return [[a + s * (b - a) for a, b in zip(start, goal, strict=True)] for s in shares]

    return compile_schedule(robot, start, sample, duration)


class Watch:
    """Notes what an arm does, and wakes who waits for it."""

    def __init__(self) -> None:
        self.events: list[ArmEvent] = []
        self.changed = threading.Condition()
        self.note: Callable[[ArmEvent], None] = lambda event: None  # also called; change it locked

    def __call__(self, event: ArmEvent) -> None:
        with self.changed:
            self.events.append(event)
            self.note(event)
            self.changed.notify_all()

    def wake(self) -> None:
        with self.changed:
            self.changed.notify_all()

    def until(self, so: Callable[[], bool], seconds: float = 0.0) -> None:
        with self.changed:
            assert self.changed.wait_for(so, timeout=seconds + PATIENCE)


Beside = Callable[[Robot, Watch], AbstractContextManager[None]]


@contextmanager
def active(robot: Robot, port: str) -> Iterator[tuple[Arm, Watch]]:
    """An active arm, watched."""
    watch = Watch()
    with Arm(robot, robot.link(port), RealClock(), watch) as arm:
        arm.configure()
        arm.activate()
        yield arm, watch


def play(arm: Arm, watch: Watch, goal: Sequence[float], seconds: float) -> Playback:
    """Begin a sweep from where the arm is."""
    schedule = sweep(arm.robot, arm.commanded, goal, seconds)
    return arm.play(schedule, watch.wake, "test", arm.generation)


def p99(samples: Sequence[float]) -> float:
    return statistics.quantiles(samples, n=100)[98]


def stop_times(count: int) -> list[float]:
    """From `stop()` to the hold frame written, streaming at full rate [ms]."""
    times, rng = [], random.Random(1)
    with active(robot_with(), VIRTUAL) as (arm, watch):
        for _ in range(count):
            far = PICK if arm.commanded[0] > -0.7 else HOME
            playback = play(arm, watch, far, 1.5)
            written = rng.randint(2, 6)
            watch.until(lambda p=playback, n=written: p.written >= n)  # type: ignore[misc]
            begun = time.monotonic()
            arm.stop()
            last = watch.events[-1]
            assert isinstance(last, FrameSent)
            assert last.scheduled is None
            times.append((time.monotonic() - begun) * 1000)
    return times


def unplug_times(count: int, streaming: bool) -> list[float]:
    """From the loss of the port to the report of the fault [ms]."""
    times = []
    robot = robot_with()
    serial = dataclasses.replace(robot.serial, boot_wait=0.0)
    silent = dataclasses.replace(ARMTREE, banner=b"")  # no board is at the other end
    robot = dataclasses.replace(robot, serial=serial, firmware=silent)
    for _ in range(count):
        master, slave = pty.openpty()
        tty.setraw(slave)
        with active(robot, os.ttyname(slave)) as (arm, watch):
            os.close(slave)
            if streaming:
                playback = play(arm, watch, PICK, 1.5)
                watch.until(lambda p=playback: p.written >= 3)  # type: ignore[misc]
            begun = time.monotonic()
            os.close(master)
            watch.until(lambda w=watch: any(isinstance(e, Faulted) for e in w.events))  # type: ignore[misc]
            (fault,) = (event for event in watch.events if isinstance(event, Faulted))
            times.append((fault.time - begun) * 1000)
    return times


def lateness(arm: Arm, watch: Watch) -> float:
    """Lateness of some 380 frames, there and back twice, p99 [ms]."""
    watch.events.clear()
    for goal in (PICK, HOME) * 2:
        playback = play(arm, watch, goal, 3.0)
        watch.until(lambda p=playback: p.state is not PlaybackState.PLAYING)  # type: ignore[misc]
        assert playback.state is PlaybackState.DONE, playback.error
    frames = [event for event in watch.events if isinstance(event, FrameSent)]
    return p99([(f.time - f.scheduled) * 1000 for f in frames if f.scheduled is not None])


@contextmanager
def busy(robot: Robot, watch: Watch) -> Iterator[None]:
    """A planner that plans all the time, and a recorder of a frame per plan and of the arm."""
    ended, clock = threading.Event(), RealClock()
    query = Query("arm", (0.0,) * len(robot.actuated), GOALS[robot.name])
    with (
        tempfile.TemporaryDirectory() as folder,
        closing(Pool(robot, 1, clock)) as pool,
        Recorder(Path(folder) / "x.mcap", clock.epoch_ns(), _failed) as recorder,
    ):
        pool.start()
        again = threading.Semaphore(1)

        def keep_on() -> None:
            while not ended.is_set():
                again.acquire()
                recorder.put(Sent(clock.now(), b"x" * 20, 0.0, False, ("a",), (0.0,)))
                pool.submit(query, lambda answer: again.release())

        def note(note: Callable[[ArmEvent], None]) -> None:
            with watch.changed:
                watch.note = note

        thread = threading.Thread(target=keep_on)
        thread.start()
        note(lambda event: recorder.put(arm_record(event, robot)))
        try:
            yield
        finally:
            note(lambda event: None)
            ended.set()
            thread.join()


def _failed(error: Exception) -> None:
    raise error


def lateness_ratios(runs: int) -> list[float]:
    """p99 while planner and recorder work, over p99 idle; alternating."""
    robot, ratios = robot_with(), []
    with active(robot, VIRTUAL) as (arm, watch):
        for _ in range(runs):
            idle = lateness(arm, watch)
            with busy(robot, watch):
                ratios.append(lateness(arm, watch) / idle)
    return ratios


def stock_bytes_lost(plans: int) -> int:
    """Bytes that the model of the published sketch lost, with a hold at a random instant."""
    rng, lost, stock = random.Random(1), 0, robot_with("stock")
    limits = [(joint.lower, joint.upper) for joint in stock.actuated]
    for _ in range(plans):
        rate = rng.choice((5.0, 10.0, 20.0, 50.0))
        robot = dataclasses.replace(stock, firmware=dataclasses.replace(stock.firmware, rate=rate))
        goal = [rng.uniform(*limit) for limit in limits]
        seconds = max(map(abs, goal)) / rng.uniform(0.5, 10.0)  # 0.5 to 10 rad/s
        schedule = sweep(robot, HOME, goal, seconds)
        lost += _lost(robot, schedule, rng.uniform(0.0, schedule.duration))
    return lost


def _lost(robot: Robot, schedule: Schedule, hold: float) -> int:
    board = virtual_board(robot)
    booted = robot.firmware.boot_time
    sent = [setpoint for setpoint in schedule.setpoints if setpoint.time <= hold]
    for setpoint in sent:
        board.receive(setpoint.frame.data, booted + setpoint.time)
    if sent:
        board.receive(sent[-1].frame.data, booted + hold)
    return board.state(booted + schedule.duration + 10.0).lost


def frames_per_s(seconds: float) -> float:
    """Frames that the machine code of our firmware takes, each acknowledged [1/s].

    The simulated chip keeps real time, and its line the speed of a real one.
    """
    with tempfile.TemporaryDirectory() as folder:
        built = rig.build(Path(folder))
        with closing(rig.AvrArduino(built, "armtree", 0.1)) as arduino:
            link = SerialLink(arduino.port, rig.BAUD)
            link.open()
            deadline = threading.Timer(seconds + PATIENCE, link.close)
            deadline.start()
            try:
                return _acknowledged(link, seconds)
            finally:
                deadline.cancel()
                link.close()


def _acknowledged(link: SerialLink, seconds: float) -> float:
    """Keeps two dozen frames under way, so that the line never rests."""
    clock, begun, sent, taken = RealClock(), math.inf, 0, 0
    for line in _lines(link):
        now = clock.now()
        if b"armtree" in line:
            link.write(b"bA01;")
        elif b"status" in line:
            begun = now
        elif match := re.fullmatch(rb"k([0-9a-f]{4}),00,00,[0-9a-f]{4}", line):
            assert int(match[1], 16) == taken + 1, f"a frame was lost after {taken}"
            taken += 1
        while begun < math.inf and sent - taken < 24:
            link.write(rig.frame([sent % 181] * 4))
            sent += 1
        if now - begun >= seconds:
            return taken / (now - begun)
    raise TimeoutError(f"the board fell silent after {taken} of {sent} frames")


def _lines(link: SerialLink) -> Iterator[bytes]:
    said = b""
    while data := link.read():
        *lines, said = (said + data).split(b"\n")
        yield from lines


def fault_times(kind: str, count: int, guards: Guards) -> list[float]:
    """From a fault of a servo of the SO-101, in the middle of a motion, until the arm stops [ms].

    Simulated, on the model of the bus. For `follow` the joint is blocked, and the time counts from
    the first measurement beyond the limit.
    """
    robot = dataclasses.replace(load_robot(Path("so101")), guards=guards)
    rng, times = random.Random(1), []
    for _ in range(count):
        model, clock, begin = robot.model(), SimulatedClock(), rng.uniform(0.7, 1.2)
        assert isinstance(model, Bus)
        fault = Fault("vanish" if kind == "vanish" else "block", 1, begin)
        bus, events = Bus(model.servos, robot.serial.baud, [fault]), list[ArmEvent]()
        woken = clock.signal()

        def wake(woken: Signal = woken) -> None:
            with woken:
                woken.notify()

        with clock.working(), Arm(robot, BoardLink(bus, clock), clock, events.append) as arm:
            arm.configure()
            arm.activate()
            start = arm.commanded
            goal = (1.5, *start[1:])
            schedule = sweep(robot, start, goal, 1.6)
            playback = arm.play(schedule, wake, "bench", arm.generation)
            with woken:
                while playback.state is PlaybackState.PLAYING:
                    woken.wait(None)
        seen = next(event.time for event in events if isinstance(event, Faulted))
        times.append((seen - (_beyond(events, guards) if kind == "follow" else begin)) * 1e3)
    return times


def _beyond(events: Sequence[ArmEvent], guards: Guards) -> float:
    """Return when the first joint was first measured beyond the limit of following [s]."""
    commanded = 0.0
    for event in events:
        match event:
            case FrameSent():
                commanded = event.positions[0]
            case Measured():
                error = abs(commanded - event.measurement.position[0])
                if error > math.radians(guards.following_deg):
                    return event.time
    raise AssertionError("the limit was not exceeded")


def bus_cycles(
    seconds: float, rate: float, beside: Beside = lambda robot, watch: nullcontext()
) -> tuple[list[float], list[float]]:
    """Cycles of the SO-101 on the virtual bus while its first joint moves to and fro.

    Args:
        seconds: Duration of the motion [s].
        rate: Rate of its frames [1/s].
        beside: Context of the motion, for the robot and what watches it.

    Returns:
        Durations of the cycles [ms], and how long after it was due each ended [ms].
    """
    so101 = load_robot(Path("so101"))
    robot = dataclasses.replace(so101, firmware=dataclasses.replace(so101.firmware, rate=rate))
    with active(robot, VIRTUAL) as (arm, watch), beside(robot, watch):
        start = arm.commanded

        def sample(times: Sequence[float]) -> list[list[float]]:
            return [[math.asin(math.sin(0.8 * time)), *start[1:]] for time in times]

        schedule = compile_schedule(robot, start, sample, seconds)
        playback = arm.play(schedule, watch.wake, "bench", arm.generation)
        watch.until(lambda: playback.state is not PlaybackState.PLAYING, seconds)
        assert playback.state is PlaybackState.DONE, playback.error
        # Two threads report them, so an answer may be reported before its frame.
        events = sorted(watch.events, key=lambda event: event.time)
    lasted, ended, frame = list[float](), list[float](), None
    for event in events:
        match event:
            case FrameSent(scheduled=float()):
                frame = event
            case Measured() if frame:
                lasted.append((event.time - frame.time) * 1e3)
                ended.append((event.time - (frame.scheduled or 0.0)) * 1e3)
                frame = None
    return lasted, ended


def bus_speed(seconds: float, rate: float) -> list[Row]:
    """How fast a cycle of the bus is, and whether its rate is held beside planner and recorder."""
    lasted, _ = bus_cycles(10.0, rate)
    _, ended = bus_cycles(seconds, rate, busy)
    late = sum(each > 1e3 / rate for each in ended) / len(ended)
    return [
        Row("bus_cycle_ms_p50", "ms", [statistics.median(lasted)]),
        Row("bus_cycle_ms_p99", "ms", [p99(lasted)]),
        Row("bus_rate_hz", "1/s", [len(ended) / seconds]),
        Row("bus_late_share", "1", [late]),
    ]


def sync_reads(count: int) -> Row:
    """Time to read the positions of six servos over that of the fastest of the other libraries."""
    ids, (first, size) = [1, 2, 3, 4, 5, 6], (STS.registers["position"].address, 2)
    model = load_robot(Path("so101")).model()
    assert model
    with closing(BoardProcess(model)) as bus:
        bus.state()  # it has started
        link = SerialLink(bus.port, 1_000_000)

        def ours() -> None:
            received, found = bytearray(), 0
            link.write(packets.sync_read(ids, first, size))
            while found < len(ids):
                received += link.read()
                found += len(packets.take_packets(received))

        times = dict[str, list[float]]()
        for _ in range(5):
            link.open()
            times.setdefault("armtree", []).extend(_spent(ours, count))
            link.close()
            port, handler = scservo_sdk.PortHandler(bus.port), scservo_sdk.PacketHandler(0)
            assert port.openPort()
            reader = scservo_sdk.GroupSyncRead(port, handler, first, size)
            for servo in ids:
                assert reader.addParam(servo)
            times.setdefault("feetech-servo-sdk", []).extend(_spent(reader.txRxPacket, count))
            port.closePort()
            read = rustypot.Sts3215PyController(
                bus.port, 1_000_000, 0.5
            ).sync_read_raw_present_position
            times.setdefault("rustypot", []).extend(_spent(partial(read, ids), count))
            del read  # it closes the port
    medians = {name: statistics.median(each) for name, each in times.items()}
    sys.stderr.write(f"sync read of six [ms]: {medians}\n")
    mine = medians.pop("armtree")
    return Row("sync_read_ratio", "1", [mine / min(medians.values())])


def _spent(call: Callable[[], object], count: int) -> list[float]:
    """Time of each call [ms]."""
    times = []
    for _ in range(count):
        begun = time.perf_counter()
        call()
        times.append((time.perf_counter() - begun) * 1e3)
    return times


def bus_faults() -> list[Row]:
    """How soon faults of bus servos are seen."""
    no_stall = Guards(stall_effort=2.0)
    return [
        Row("stall_seen_ms", "ms", fault_times("stall", 50, Guards())),
        Row("following_error_seen_ms", "ms", fault_times("follow", 50, no_stall)),
        Row("vanished_seen_ms", "ms", fault_times("vanish", 50, Guards())),
    ]


def throughput() -> list[Row]:
    """What is known of `frames_per_s`."""
    if missing := rig.missing():
        sys.stderr.write(f"frames_per_s is left out: {missing}\n")
        return []
    return [Row("frames_per_s", "1/s", [frames_per_s(5.0) for _ in range(3)])]


def main(runs: int, file: Path | None) -> None:
    """Measure and show."""
    logging.getLogger().addHandler(logging.NullHandler())  # the faults are meant
    make_punctual()  # as `armtree run` does
    stops = stop_times(100)
    unplugs = unplug_times(50, streaming=True) + unplug_times(50, streaming=False)
    rows = [
        Row("lateness_ratio_p99", "1", lateness_ratios(runs)),
        *throughput(),
        *bus_faults(),
        *bus_speed(60.0, 100.0),
        sync_reads(200),
        Row("stop_ms_p99", "ms", [p99(stops)]),
        Row("unplug_seen_ms_p99", "ms", [p99(unplugs)]),
        Row("stock_bytes_lost", "bytes", [stock_bytes_lost(1000)]),
    ]
    show(rows, file)


if __name__ == "__main__":
    given = arguments(__doc__ or "").parse_args()
    main(given.runs, given.json)

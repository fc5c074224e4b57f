"""Something happens to the servos of an SO-101 at a random time: in this process, simulated.

The arm, its planner and its recordings are real; the bus is the model behind a link of this
process. `rows/bus.py` does the same in real time, with the command and a port.
"""

import atexit
import logging
import random
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import NamedTuple

from mcap.records import Channel, Message
from mcap.stream_reader import StreamReader

from executive.api.outcome import Outcome
from executive.errors import GoalCanceled
from executive.executive import Executive
from executive.session import open_executive
from executive.setup import Setup
from executive.testing import SharedPool
from hardware import Arm, BoardLink, Robot, SimulatedClock, State, load_robot
from hardware.drivers.feetech.packets import HEADER, Instruction, take_packets
from hardware.drivers.feetech.virtual.bus import Bus, Fault
from hardware.drivers.feetech.virtual.servo import Servo
from logs import Transition
from tests.faults.row import Scene, frames_of, row

TASK = """task: 20
name: dance
description: Move all joints, rest, and move them back, without end.
tree:
  repeat:
    sequence:
      - subtree: reach
        with:
          arm: {shoulder_pan: 40 deg, shoulder_lift: -60 deg, elbow_flex: 40 deg,
                wrist_flex: 30 deg, wrist_roll: 40 deg}
          gripper: {gripper: 40 deg}
      - Wait: {duration: 300 ms}
      - subtree: reach
        with:
          arm: {shoulder_pan: -20 deg, shoulder_lift: -30 deg, elbow_flex: 10 deg,
                wrist_flex: 60 deg, wrist_roll: -20 deg}
          gripper: {gripper: 10 deg}
"""
LATEST = 2.5  # after the port is opened, of a fault [s]
PATIENCE = 10.0  # until a fault is reported [s]
AFTERWARDS = 1.0  # while nothing may be sent after a fault [s]
NEAR = 34  # 3 degrees, which a servo may be off where it is held [ticks]
REMEMBERED = 0.5  # an answer is not older [s]
MOST = 400  # of all servos in one frame [ticks]
WRITES, GOAL, TORQUE = Instruction.SYNC_WRITE, 42, 40  # the addresses of STS servos
NOT_BOOTED = {"hw.servo_missing", "hw.no_servos", "hw.board_silent", "hw.servo_fault"}
SILENT = {"hw.servo_silent"}
FEW, ALWAYS = 3, 1_000_000  # answers
CANCELED = GoalCanceled.code


@dataclass(frozen=True)
class Kind:
    """A kind of fault: the codes that it may end with, and what happens to a servo.

    Without a fault of the arm, the goal is canceled after a while: the code is then `CANCELED`.
    """

    codes: set[str]
    happen: "Callable[[Line, Servo], object]"

    @property
    def patience(self) -> float:
        """How long to wait for a fault of the arm [s]."""
        return 2.0 if CANCELED in self.codes else PATIENCE


class Written(NamedTuple):
    """Bytes on the line, their time [s], and where each servo was then, by its first id [ticks]."""

    time: float
    data: bytes
    positions: dict[int, float]


class Line(BoardLink[Bus]):
    """The link to a bus. It notes what is written, and when the arm reports a fault."""

    def __init__(self, bus: Bus, clock: SimulatedClock, dice: random.Random) -> None:
        super().__init__(bus, clock)
        self.servos, self.dice, self.noisy = list(bus.servos), dice, False
        self._ids = [servo.servo for servo in bus.servos]
        self.written: list[Written] = []
        self.faulted: int | None = None  # number of writes before it

    def write(self, data: bytes) -> None:
        super().write(data)
        places = (servo.position for servo in self.servos)
        now = self._clock.now()
        self.written.append(Written(now, data, dict(zip(self._ids, places, strict=True))))

    def read(self) -> bytes:
        data = super().read()
        if self.noisy and data:
            noise = HEADER * self.dice.randrange(2) + self.dice.randbytes(self.dice.randrange(9))
            return noise + (data[:-1] if self.dice.random() < 0.3 else data)
        return data

    def note(self, event: object) -> None:
        """Note the fault of the arm, which is published after its last command."""
        if isinstance(event, Transition) and event.label == "raise_error":
            self.faulted = len(self.written) if self.faulted is None else self.faulted

    def commands(self) -> list[tuple[int, int, dict[int, int]]]:
        """Each command to all servos: the number of its write, the address, and the values."""
        return list(self._commands())

    def _commands(self) -> Iterator[tuple[int, int, dict[int, int]]]:
        for number, each in enumerate(self.written):
            for packet in take_packets(bytearray(each.data)):
                if packet.code == WRITES:
                    address, size, *body = packet.parameters
                    parts = [body[k : k + size + 1] for k in range(0, len(body), size + 1)]
                    values = {part[0]: int.from_bytes(part[1:], "little") for part in parts}
                    yield number, address, values

    def happen(self, kind: Kind, servo: Servo) -> None:
        with self._changed:
            self.board.state(self._clock.now())  # until now all was well
            kind.happen(self, servo)
            self._changed.notify()

    def fail(self, kind: str, *servos: Servo, value: int = 1) -> None:
        now = self._clock.now()
        for servo in servos:
            self.board.fail(now, Fault(kind, servo.servo, now, value))

    def others(self, servo: Servo) -> list[Servo]:
        return [each for each in self.servos if each is not servo]


KINDS = {
    "a servo vanishes": Kind(SILENT, lambda line, servo: line.fail("vanish", servo)),
    "1 of 6 is left": Kind(SILENT, lambda line, servo: line.fail("vanish", *line.others(servo))),
    "none is left": Kind(SILENT, lambda line, _: line.fail("vanish", *line.servos)),
    "another id": Kind(SILENT, lambda line, servo: line.fail("renumber", servo, value=99)),
    "one id twice": Kind(
        SILENT, lambda line, servo: servo.put("id", line.dice.choice(line.others(servo)).servo)
    ),
    "answers for another": Kind(
        SILENT,
        lambda line, servo: line.fail(
            "impersonate", servo, value=line.dice.choice(line.others(servo)).servo
        ),
    ),
    "a few answers are lost": Kind(
        {CANCELED}, lambda line, servo: line.fail("lose", servo, value=FEW)
    ),
    "all answers are lost": Kind(
        SILENT, lambda line, servo: line.fail("lose", servo, value=ALWAYS)
    ),
    "damaged answers": Kind(SILENT, lambda line, servo: line.fail("damage", servo, value=ALWAYS)),
    "all answers are damaged": Kind(
        SILENT, lambda line, _: line.fail("damage", *line.servos, value=ALWAYS)
    ),
    "noise": Kind({CANCELED, *SILENT}, lambda line, _: setattr(line, "noisy", True)),
    "a joint is blocked": Kind(
        {"hw.stalled", "hw.not_following", "hw.servo_fault", "hw.not_arrived"},
        lambda line, servo: line.fail("block", servo),
    ),
    "low voltage": Kind(
        {"hw.servo_fault", "hw.voltage_low"}, lambda line, servo: line.fail("brown_out", servo)
    ),
    "a servo restarts": Kind(
        {"hw.torque_lost", "hw.not_following"}, lambda line, servo: line.fail("restart", servo)
    ),
    "all servos restart": Kind(
        {"hw.torque_lost", "hw.not_following"},
        lambda line, _: line.fail("restart", *line.servos),
    ),
    "torque is switched off": Kind(
        {"hw.torque_lost", "hw.not_following"}, lambda _, servo: servo.put("torque_enable", 0)
    ),
    "a servo gets hot": Kind(
        {"hw.servo_hot", "hw.servo_fault"}, lambda _, servo: setattr(servo, "ambient", 5000.0)
    ),
    "the adapter is unplugged": Kind({"hw.port_lost"}, lambda line, _: line.unplug()),
}


@cache
def shared() -> tuple[Robot, SimulatedClock, SharedPool]:
    """The robot, the clock and the planner of all injections."""
    logging.getLogger().addHandler(logging.NullHandler())  # the faults are meant
    robot, clock = load_robot(Path("so101")), SimulatedClock()
    pool = SharedPool(robot, 1, clock)
    atexit.register(close, pool, clock)
    return robot, clock, pool


def close(pool: SharedPool, clock: SimulatedClock) -> None:
    with clock.working():
        pool.close()


@row(
    "bus-fault",
    "at a random time of a run of the SO-101 on the simulated bus, to a random servo: "
    + ", ".join(KINDS),
    "the goal ends with the code of the cause and a way out; the servos that hold are held where"
    " they are, once, and nothing is sent afterwards; a few lost answers end nothing; the recording"
    " has the fault and every command",
    times=3,
    alone=True,  # it computes in this process, which measures other rows
)
def fault(scene: Scene) -> None:
    scene.injections = len(KINDS)
    for name, kind in KINDS.items():
        inject(scene, scene.folder / name.replace(" ", "-"), name, kind)


def inject(scene: Scene, folder: Path, name: str, kind: Kind) -> None:
    """Inject a fault, and check what the arm does."""
    robot, clock, pool = shared()
    model, dice = robot.model(), scene.random
    assert isinstance(model, Bus)
    line = Line(model, clock, dice)
    (folder / "trees").mkdir(parents=True)
    (folder / "trees" / "20_dance.yaml").write_text(TASK)
    setup = Setup(
        robot=replace(robot, needs_calibration=False),
        trees=folder / "trees",
        reload=False,
        recordings=folder,
        single_user=True,
        seed=dice.randrange(1000),
    )
    servo, after = dice.choice(line.servos), dice.uniform(0.0, LATEST)
    opened = open_executive(setup, clock=clock, link=line, pool=pool, subscriber=line.note)
    with clock.working(), opened as executive:
        executive.start()
        goal, begin = executive.send(20).identity, clock.now() + after
        outcome = result(executive, goal, begin)
        codes = kind.codes
        if "hw.torque_lost" in codes and not servo.get("torque_enable"):
            codes = {*codes, CANCELED}  # the arm switches the torque on later
        if name == "a joint is blocked" and servo is line.servos[-1]:
            codes = {*codes, CANCELED}  # a gripper counts as closed on an object
        line.happen(kind, servo)
        if outcome is None:
            outcome = result(executive, goal, clock.now() + kind.patience)
        if outcome is None:
            executive.cancel(goal)
            outcome = executive.result(goal)
        state = executive.status().arm
        result(executive, "", clock.now() + AFTERWARDS)
        problems = [*wrong(line, outcome, codes, state)]
    for problem in [*problems, *untold(line, outcome)]:
        when = f"{name}, servo {servo.servo}, after {after:.3f} s"
        scene.check(False, f"{when}: {problem} ({outcome.code}: {outcome.message})")


@row(
    "bus-activation",
    "the SO-101 is activated in a random pose, and its servos have the goals of another program",
    "the first goal of each servo is its own position, before its torque; none moves",
    worst=8,  # sum of six servos, each within a tick of its dead zone
    unit="ticks",
    times=100,
    alone=True,
)
def activation(scene: Scene) -> None:
    robot, clock, _ = shared()
    model, dice = robot.model(), scene.random
    assert isinstance(model, Bus)
    line, signal = Line(model, clock, dice), clock.signal()
    pose = [dice.uniform(joint.lower, joint.upper) for joint in robot.actuated]
    there = robot.wire_format.encode(pose).servos
    for servo, ticks in zip(line.servos, there, strict=True):
        servo.put("goal_position", dice.randrange(4096))
        servo.push(ticks)
    with clock.working(), Arm(robot, line, clock) as arm:
        arm.configure()
        arm.activate()
        until = clock.now() + AFTERWARDS
        with signal:
            while clock.now() < until:
                signal.wait(until)
        addresses = [address for _, address, _ in line.commands()]
        goals = [
            tuple(values.values()) for _, address, values in line.commands() if address == GOAL
        ]
        scene.check(goals == [there], f"at {there} the goals are {goals}")
        scene.check(GOAL in addresses[: addresses.index(TORQUE)], "the torque came first")
        moved = [abs(servo.position - q) for servo, q in zip(line.servos, there, strict=True)]
        scene.figure(sum(moved))


def result(executive: Executive, goal: str, until: float) -> Outcome | None:
    """Wait for the outcome of a goal, or for a time if there is no goal."""
    clock = executive.clock
    signal = clock.signal()
    while clock.now() < until:
        if goal and (outcome := executive.goal(goal).outcome):
            return outcome
        with signal:
            signal.wait(min(until, clock.now() + 0.01))
    return executive.goal(goal).outcome if goal else None


def wrong(line: Line, outcome: Outcome, codes: set[str], state: State) -> Iterator[str]:
    """What is wrong with the end of a goal and with the commands until then, and after it."""
    booted = any(address == TORQUE for _, address, _ in line.commands())
    if outcome.code not in codes | (set() if booted else NOT_BOOTED):
        yield "this is not its code"
    canceled = outcome.code == CANCELED
    if not (canceled or (outcome.cause and outcome.cause.hint)):
        yield "there is no way out"
    faulted = line.faulted is not None
    ends = {State.UNCONFIGURED if faulted else State.ACTIVE if booted else State.INACTIVE}
    if outcome.code == "hw.port_lost" and not booted:
        ends.add(State.UNCONFIGURED)  # it was lost while the arm was configured
    if state not in ends:
        yield f"the arm is {state.value}"
    if line.faulted is not None and len(line.written) > line.faulted:
        yield f"{len(line.written) - line.faulted} writes after the fault"
    goals = [(number, values) for number, address, values in line.commands() if address == GOAL]
    held = goals.pop() if faulted and outcome.code != "hw.port_lost" and goals else None
    last: Mapping[int, float] = line.written[0].positions if line.written else {}
    for _, values in goals:
        if (step := sum(abs(values[servo] - last[servo]) for servo in values)) > MOST:
            yield f"a step of {step:.0f} ticks"
        last = values
    torques = [values for _, address, values in line.commands() if address == TORQUE]
    if torques != [dict.fromkeys(last, 1)] * booted:
        yield f"the torque was switched {len(torques)} times"
    if held:
        yield from not_held(line, *held)


def not_held(line: Line, number: int, goals: Mapping[int, int]) -> Iterator[str]:
    """Which servos are held elsewhere than where they were just before."""
    now = line.written[number].time
    recent = [each.positions for each in line.written if now - REMEMBERED <= each.time <= now]
    for servo, goal in goals.items():
        places = [positions[servo] for positions in recent]
        if not min(places) - NEAR <= goal <= max(places) + NEAR:
            yield f"servo {servo} is held at {goal}, and was at {min(places)} to {max(places)}"


def untold(line: Line, outcome: Outcome) -> Iterator[str]:
    """What is missing from the recording."""
    path, told = Path(outcome.recording), dict[str, bytes]()
    with path.open("rb") as stream:
        names = dict[int, str]()
        for record in StreamReader(stream, record_size_limit=2**26).records:
            if isinstance(record, Channel):
                names[record.id] = record.topic
            elif isinstance(record, Message):
                name = names[record.channel_id]
                told[name] = told.get(name, b"") + record.data
    if outcome.code.encode() not in told["/result"]:
        yield "the recording has another outcome"
    if line.faulted is not None and outcome.message.encode() not in told["/rosout"]:
        yield "the recording does not have the fault"
    sent = bytearray(b"".join(each.data for each in frames_of(path)))
    recorded = [packet.data for packet in take_packets(sent) if packet.code == WRITES]
    written = bytearray(b"".join(each.data for each in line.written))
    commands = [packet.data for packet in take_packets(written) if packet.code == WRITES]
    if recorded != commands:
        yield f"{len(commands)} commands were sent, and {len(recorded)} are recorded"

"""An arm follows a leader, in simulated time on the model of the bus."""

import math
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from executive.api.move import LEADER, Move
from executive.api.outcome import Outcome
from executive.executive import Executive
from executive.replay.verification import verify
from executive.session import open_executive
from executive.setup import Setup
from executive.task_runner import TaskRunner
from executive.testing import SharedPool
from hardware import BoardLink, Robot, SimulatedClock, load_robot
from hardware.drivers.feetech.virtual.bus import Bus
from hardware.errors import PortLost
from logs import LeaderState, Recording, Sent, table
from logs.views.table import export
from logs.views.timeline import timeline
from skills import Blocked, NullLeader
from skills.motion.planner import Planner

ZERO = (0.0,) * 6
SECONDS = 4.0  # the leader ends then
FLOOR = (0.0, 1.6, 0.0, 0.9, 0.0, 0.0)  # the gripper is below the table

Path_ = Callable[[float], tuple[float, ...]]


@pytest.fixture(scope="module")
def robot() -> Robot:
    return load_robot(Path("so101"))


class Hand:
    """A leader that a hand moves."""

    def __init__(self, clock: SimulatedClock, path: Path_) -> None:
        self._clock, self._path, self._begun = clock, path, math.inf
        self.shown: list[Blocked | None] = []

    def positions(self) -> tuple[float, ...] | None:
        self._begun = min(self._begun, self._clock.now())
        passed = self._clock.now() - self._begun
        return self._path(passed) if passed < SECONDS else None

    def show(self, blocked: Blocked | None) -> None:
        self.shown.append(blocked)


@contextmanager
def followed(
    robot: Robot, folder: Path, path: Path_ | None, stop: float = -math.inf
) -> Iterator[tuple[Outcome, Any, Executive]]:
    clock = SimulatedClock()
    hand = Hand(clock, path) if path else NullLeader()
    setup = Setup(robot=robot, recordings=folder, single_user=True)
    bus = robot.model()
    assert isinstance(bus, Bus)
    bus.servos[5].stops = stop, math.inf
    link = BoardLink(bus, clock)
    with (
        closing(SharedPool(robot, 1, clock)) as pool,
        clock.working(),
        open_executive(setup, clock=clock, link=link, pool=pool, leader=hand) as executive,
    ):
        executive.start()
        yield TaskRunner(executive).run(Move((LEADER,))), hand, executive


def sent(outcome: Outcome) -> list[Sent]:
    records = Recording(Path(outcome.recording)).records(Sent)
    return [each for each in records if isinstance(each, Sent) and each.joints]


def test_it_follows_within_the_limits_and_the_recording_proves_it(
    robot: Robot, tmp_path: Path
) -> None:
    def path(time: float) -> tuple[float, ...]:
        return (0.4 * math.sin(time), -0.4 if time > 1 else 0.0, 0, 0, 0, 0)

    with followed(robot, tmp_path, path) as (outcome, hand, executive):
        assert outcome.success, outcome.text()
        commanded = executive.where().commanded
        assert commanded
        assert commanded["shoulder_pan"] == pytest.approx(path(SECONDS)[0], abs=0.05)
        assert commanded["shoulder_lift"] == pytest.approx(-0.4, abs=1e-3)
        assert hand.shown[-1:] == [None]
    frames = sent(outcome)
    assert len(frames) > 150
    for before, after in pairwise(frames):
        steps = zip(robot.actuated, before.positions, after.positions, strict=True)
        for joint, a, b in steps:
            assert abs(b - a) <= joint.velocity * 0.021
    checked = verify(Path(outcome.recording))
    assert checked.holds, checked.text()


@pytest.mark.slow
def test_the_recording_has_the_leader_at_every_step(robot: Robot, tmp_path: Path) -> None:
    def path(time: float) -> tuple[float, ...]:
        return (0.2 * time, 0, 0, 0, 0, 0)

    with followed(robot, tmp_path, path) as (outcome, _, executive):
        assert outcome.success, outcome.text()
        shown = executive.robot.actuated
    recording = Path(outcome.recording)
    leader = [each for each in Recording(recording).records() if isinstance(each, LeaderState)]
    assert leader[0].joints == tuple(joint.name for joint in shown)
    steps = [after.time - before.time for before, after in pairwise(leader)]
    assert steps == pytest.approx([1 / robot.firmware.rate] * len(steps), abs=1e-3)
    for each in leader:
        passed = each.time - leader[0].time
        assert each.positions == pytest.approx(path(passed), abs=1e-6)
    assert verify(recording).holds

    found = table(recording, "/leader/joint_states")
    assert found["shoulder_pan"].tolist() == [each.positions[0] for each in leader]
    trace = next(t for t in timeline(recording).traces if t.joint == "shoulder_pan")
    assert trace.leader == tuple(each.positions[0] for each in leader)

    joints, _, measured, led = export(recording, tmp_path)
    rows = led.read_text().splitlines()
    assert len(rows) == 1 + len(leader)
    assert rows[0].split(",")[:2] == ["time_s", "shoulder_pan_rad"]
    head = measured.read_text().splitlines()[0].split(",")
    suffixes = ("rad", "rad_s", "effort", "celsius", "volt", "ampere", "lost")
    columns = [f"{joint.name}_{each}" for each in suffixes for joint in shown]
    assert head[: 1 + len(columns)] == ["time_s", *columns]
    assert joints.name == f"{recording.stem}.joints.csv"


@pytest.mark.slow
def test_the_accelerations_together_stay_within_their_limit(robot: Robot, tmp_path: Path) -> None:
    """All joints speed up and slow down at once, on a supply that bears half of that."""
    weak = replace(robot, acceleration_sum=6.0)

    def path(time: float) -> tuple[float, ...]:
        return (0.3, -0.3, 0.3, 0.3, 0.3, 0.3) if time < 2.0 else ZERO

    with followed(weak, tmp_path, path) as (outcome, _, _):
        assert outcome.success, outcome.text()
    frames = [frame for frame in sent(outcome) if not frame.hold]
    assert len(frames) > 80
    assert max(map(largest_sum, frames, frames[1:], frames[2:])) <= 6.0 * 1.01
    assert max(frame.positions[5] for frame in frames) == pytest.approx(0.3, abs=0.03)


def largest_sum(a: Sent, b: Sent, c: Sent) -> float:
    """The sum of the accelerations of all joints in two periods of frames [rad/s2]."""
    assert a.scheduled is not None
    assert c.scheduled is not None
    if c.scheduled - a.scheduled > 0.041:
        return 0.0  # a joint turned by less than a tick in between
    rows = zip(a.positions, b.positions, c.positions, strict=True)
    return sum(abs(q - 2 * p + o) for o, p, q in rows) / 0.02**2


@pytest.mark.slow
def test_a_gripper_that_closes_on_an_object_holds_it(robot: Robot, tmp_path: Path) -> None:
    def path(time: float) -> tuple[float, ...]:
        return (*ZERO[:5], 1.0 if time < 2.0 else 0.0)

    there = robot.wire_format.encode([*ZERO[:5], 0.4]).servos[5]
    with followed(robot, tmp_path, path, stop=there) as (outcome, _, executive):
        assert outcome.success, outcome.text()
        commanded = executive.where().commanded
        assert commanded
        assert commanded["gripper"] == pytest.approx(0.4 - math.radians(1.5), abs=0.01)


@pytest.mark.slow
def test_a_gripper_that_moves_freely_follows_at_full_speed(robot: Robot, tmp_path: Path) -> None:
    """It may lag by more than the squeeze of a gripper that holds an object."""
    tight = replace(robot, guards=replace(robot.guards, squeeze_deg=0.5))

    def path(time: float) -> tuple[float, ...]:
        return (*ZERO[:5], 1.0)

    with followed(tight, tmp_path, path) as (outcome, _, _):
        assert outcome.success, outcome.text()
    due = {frame.scheduled: frame.positions[5] for frame in sent(outcome) if frame.scheduled}
    speeds = [(due[b] - due[a]) / (b - a) for a, b in pairwise(due)]
    assert max(speeds) > 0.9 * robot.joint("gripper").velocity


@pytest.mark.slow
def test_a_collision_stops_it_and_shows_where_it_is_free(robot: Robot, tmp_path: Path) -> None:
    def path(time: float) -> tuple[float, ...]:
        return FLOOR if time < 3.0 else ZERO

    with followed(robot, tmp_path, path) as (outcome, hand, executive):
        assert outcome.success, outcome.text()
        blocked = next(each for each in hand.shown if each)
        assert "floor" in blocked.contact
        assert blocked.free["shoulder_lift"] == (True, False)
        assert blocked.free["shoulder_pan"] == (True, True)
        commanded = executive.where().commanded
        assert commanded
        assert commanded["shoulder_lift"] < 1.0  # it follows again
    planner = Planner(robot)
    for frame in sent(outcome):
        nearest = planner.checker.nearest(np.array(frame.positions))
        assert nearest
        assert nearest[2] > 0.0
    assert verify(Path(outcome.recording)).holds


@pytest.mark.slow
def test_a_folded_arm_follows_out_of_its_contacts(robot: Robot, tmp_path: Path) -> None:
    """The forearm rests on the shoulder. It may stay and leave, but not press on."""
    folded = (0.0, *np.radians((-100.0, 91.0, 50.0, 0.0, 0.0)).tolist())
    pairs = zip(robot.joints, folded, strict=True)
    joints = tuple(replace(joint, boot=q) for joint, q in pairs)

    def path(time: float) -> tuple[float, ...]:
        elbow = folded[2] + 0.1 if time < 1.0 else folded[2] - 0.3
        return (0.2, folded[1], elbow, *folded[3:])

    with followed(replace(robot, joints=joints), tmp_path, path) as (outcome, hand, executive):
        assert outcome.success, outcome.text()
        blocked = next(each for each in hand.shown if each)
        assert "lower_arm_link" in blocked.contact
        assert blocked.free["elbow_flex"] == (True, False)
        commanded = executive.where().commanded
        assert commanded
        assert commanded["elbow_flex"] == pytest.approx(folded[2] - 0.3, abs=0.03)
    highest = max(frame.positions[2] for frame in sent(outcome))
    assert highest < folded[2] + 0.012  # 1 mm
    assert verify(Path(outcome.recording)).holds


def test_a_leader_that_is_lost_stops_it(robot: Robot, tmp_path: Path) -> None:
    def path(time: float) -> tuple[float, ...]:
        if time > 1.0:
            raise PortLost("/dev/ttyACM1", "unplugged")
        return (0.5, 0, 0, 0, 0, 0)

    with followed(robot, tmp_path, path) as (outcome, _, executive):
        assert outcome.code == "hw.port_lost"
        assert executive.status().arm.value == "active"
        commanded = executive.where().commanded
        assert commanded
        assert 0.3 < commanded["shoulder_pan"] <= 0.5


def test_without_a_leader_there_is_nothing_to_follow(robot: Robot, tmp_path: Path) -> None:
    with followed(robot, tmp_path, None) as (outcome, _, _):
        assert outcome.code == "task.no_leader"

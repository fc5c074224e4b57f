"""The contracts of drivers and links, as test classes. A subclass runs with pytest.

class TestMyBus(DriverContract):
    robot_file = Path("my_arm.toml")
    at_rest = Measurement(position=(0.0, 0.0), voltage=(12.0, 12.0))  # if it measures
"""

import math
import pickle
import random
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from functools import partial
from itertools import pairwise
from pathlib import Path
from threading import Thread

from .arm.arm import Arm
from .arm.events import ArmEvent, CommandSent, Faulted, Measured
from .arm.lifecycle import State
from .arm.schedule import compile_schedule
from .arm.streamer import Playback, PlaybackState
from .clock import RealClock, SimulatedClock
from .description.guards import HOLD
from .description.robot import Robot
from .description.robot_file import load_robot
from .drivers.board_protocol import Measurement
from .drivers.firmware_profile import Ability
from .drivers.virtual.in_process_link import BoardLink
from .drivers.virtual.model import BoardModel
from .errors import BadPosition, BoardError, HardwareError, PortLost
from .link.link import Link

_SAMPLES = 50
_RANGE = 10.0  # tests move a joint without limits from minus this to this [rad]
_SWITCHED = 0.01  # largest change of the pose when the torque is switched [rad]
_NEAR = 0.05  # largest error of a measured position at rest [rad]
# Largest error of any other measured value: a part of the right value, or `_LEAST` if that is more.
_SHARE = 0.2
_LEAST = 0.02  # in the unit of the value
_REST = 1.0  # time in which a moved joint comes to rest [s]
_CYCLE = 0.1  # longest time between two measurements of a moving arm [s]
_PATIENCE = 10.0  # longest wait for a thread [s]


class DriverContract:
    """Tests that every driver must pass. A subclass names a robot file with the driver.

    If the driver has a model of the board, the tests play motions on it in simulated time.

    Attributes:
        robot_file: The robot file.
        at_rest: Values that the model must measure while it holds its start pose. Required for a
            driver with `Ability.MEASURE`.
    """

    robot_file: Path
    at_rest: Measurement | None = None

    @property
    def robot(self) -> Robot:
        """The robot of the robot file."""
        return load_robot(self.robot_file)

    # Frames ----------------------------------------------------------------------------------

    def test_a_frame_decodes_to_positions_that_encode_to_it(self) -> None:
        """Tries positions at the limits and between them."""
        robot, wire = self.robot, self.robot.wire_format
        for positions in _poses(robot):
            frame = wire.encode(positions)
            decoded = wire.decode(frame)
            assert frame.data, f"the frame of {positions} is empty"
            assert len(frame.servos) == len(robot.actuated), f"{frame} has other joints"
            assert wire.frame(frame.servos) == frame, f"frame({frame.servos}) is not {frame}"
            assert wire.encode(decoded) == frame, f"{frame} decodes to {decoded}, another frame"
            for joint, q in zip(robot.actuated, decoded, strict=True):
                assert joint.lower <= q <= joint.upper, f"{frame} has {joint.name} at {q} rad"

    def test_bad_positions_are_refused(self) -> None:
        """Tries positions that are missing, not finite, or outside the limits."""
        robot = self.robot
        start = robot.boot_pose
        bad = [(), start + start[:1], (math.nan, *start[1:]), (math.inf, *start[1:])]
        bad += [(joint.upper + 1.0, *start[1:]) for joint in robot.actuated[:1]]
        for positions in bad:
            error = _raised(partial(robot.wire_format.encode, positions))
            assert isinstance(error, BadPosition), f"encode({positions}) raised {error!r}"

    def test_robots_of_one_file_have_equal_drivers(self) -> None:
        """Worker processes and recordings compare robots."""
        driver = self.robot.driver
        assert driver == self.robot.driver, f"two objects of {type(driver).__name__} differ"
        assert pickle.loads(pickle.dumps(self.robot)) == self.robot

    # The protocol ----------------------------------------------------------------------------

    def test_noise_is_ignored_or_a_board_error(self) -> None:
        """Sends random bytes in random pieces."""
        dice = random.Random(1)
        for _ in range(_SAMPLES):
            protocol = self.robot.protocol()
            noise = dice.randbytes(dice.randrange(300))
            error = _raised(partial(protocol.receive, noise, 0.0))
            assert error is None or isinstance(error, BoardError), f"{noise!r} raised {error!r}"

    # Motions on the model --------------------------------------------------------------------

    def test_the_model_can_be_pickled(self) -> None:
        """The process behind the port `virtual` receives the model."""
        pickle.loads(pickle.dumps(self.robot.model()))

    def test_motions_are_played_to_their_end(self) -> None:
        """Moves from the start pose and back, twice, with a new activation in between."""
        with self._rig() as rig:
            for _ in range(2):
                rig.activate()
                start = rig.arm.commanded
                measured = rig.arm.measured
                measures = self.robot.can(Ability.MEASURE)
                assert measures == (measured is not None), f"measures is {measures}: {measured}"
                for goal in (rig.goal(start), start):
                    playback = rig.play(goal)
                    assert playback.state is PlaybackState.DONE, f"it ended with {playback.error}"
                    assert math.dist(rig.arm.commanded, goal) < 1e-9
                rig.arm.deactivate()
            assert not rig.faults, f"the arm had the fault {rig.faults[0]}"

    def test_a_stop_ends_a_motion_and_the_next_one_plays(self) -> None:
        """The stop does not deactivate the arm."""
        with self._rig() as rig:
            rig.activate()
            start = rig.arm.commanded
            playback = rig.play(rig.goal(start), rig.arm.stop)
            assert playback.state is PlaybackState.STOPPED, f"it ended with {playback.error}"
            assert rig.play(start).state is PlaybackState.DONE
            assert not rig.faults, f"the arm had the fault {rig.faults[0]}"

    def test_a_board_that_vanishes_is_a_fault(self) -> None:
        """The board vanishes during a motion."""
        with self._rig() as rig:
            rig.activate()
            playback = rig.play(rig.goal(rig.arm.commanded), rig.link.unplug)
            assert isinstance(playback.error, PortLost), f"it ended with {playback.error!r}"

    def test_a_board_that_is_silent_is_refused_if_it_must_report_its_pose(self) -> None:
        """The first frame could make the arm jump from an unknown pose."""
        if self.robot.firmware.reports_pose:
            with self._rig(deaf=True) as rig:
                error = _raised(rig.activate)
                assert isinstance(error, BoardError), f"activate raised {error!r}"
                assert rig.arm.state is State.INACTIVE, f"the arm is {rig.arm.state.value}"

    # Measurements, only with `Ability.MEASURE` -----------------------------------------------

    def test_the_model_at_rest_measures_what_its_author_says(self) -> None:
        """Compares all values, with sign and scale, with `at_rest`."""
        if self.robot.can(Ability.MEASURE):
            assert self.at_rest, "at_rest is missing: what the model measures in its start pose"
            with self._rig() as rig:
                rig.activate()
                rig.wait(_REST)
            measured = asdict(rig.measured[-1].measurement)
            for quantity, right in asdict(self.at_rest).items():
                values = measured[quantity]
                assert _are_near(values, right), f"{quantity} is {values}; at_rest has {right}"

    def test_a_motion_is_measured(self) -> None:
        """Positions end at the goal. The velocities over time add up to the same motion."""
        if self.robot.can(Ability.MEASURE):
            with self._rig() as rig:
                rig.activate()
                goal = rig.goal(rig.arm.commanded)
                rig.play(goal)
                rig.wait(_REST)
            start, end = (rig.measured[k].measurement.position for k in (0, -1))
            assert math.dist(end, goal) < _NEAR, f"at the goal {goal}, {end} is measured"
            if rig.measured[-1].measurement.velocity:
                moved = [b - a for a, b in zip(start, end, strict=True)]
                sums = [0.0] * len(moved)
                for before, event in pairwise(rig.measured):
                    for k, velocity in enumerate(event.measurement.velocity):
                        sums[k] += velocity * (event.time - before.time)
                assert _are_near(sums, moved), f"it moved by {moved}; the velocities say {sums}"

    def test_a_silent_board_is_a_fault_and_the_joints_hold(self) -> None:
        """The fault must come within `silent_time`. The arm moves in one test, and rests in one."""
        if self.robot.can(Ability.MEASURE):
            for moves in (True, False):
                with self._rig() as rig:
                    self._check_silence(rig, moves)

    def _check_silence(self, rig: "_Rig", moves: bool) -> None:
        limit = self.robot.firmware.silent_time
        rig.activate()
        rig.wait(rig.start(rig.goal(rig.arm.commanded))[1] / 2 if moves else _REST)
        rig.link.deaf, since = True, rig.clock.now()
        rig.wait(limit + _CYCLE)
        silent = [isinstance(error, BoardError) for error in rig.faults]
        assert silent == [True], f"after {limit:g} s of silence, the arm has faults {rig.faults}"
        commands = [event for event in rig.events if isinstance(event, CommandSent)]
        sent = [each for each in commands if each.time >= since and not each.request]
        assert sent, "no command holds or releases the joints after the fault"
        if self.robot.firmware.reports_pose and self.robot.guards.on_fault == HOLD:
            held = rig.measured[-1].measurement.position
            rig.link.deaf = False
            rig.wait(_REST)
            rig.arm.configure()
            rig.activate()
            there = rig.measured[-1].measurement.position
            assert math.dist(there, held) < _NEAR, f"the arm moved from {held} to {there}"

    # Abilities -------------------------------------------------------------------------------

    def test_torque_is_switched_off_and_on(self) -> None:
        """Only with `Ability.TORQUE`. With torque again, the arm holds its pose and can move."""
        if self.robot.can(Ability.TORQUE):
            with self._rig() as rig:
                rig.activate()
                start = rig.arm.commanded
                for on in (False, True):
                    rig.arm.switch_torque(on)
                    assert rig.arm.torque is on, f"switch_torque({on}) left it {rig.arm.torque}"
                moved = math.dist(rig.arm.commanded, start)
                assert moved < _SWITCHED, f"the arm is commanded {moved:g} rad from its pose"
                assert rig.play(rig.goal(start)).state is PlaybackState.DONE
                assert not rig.faults, f"the arm had the fault {rig.faults[0]}"

    def test_servos_are_found_and_keep_what_is_written(self) -> None:
        """Only with `Ability.IDENTIFY` and `Ability.LIMITS`."""
        if self.robot.can(Ability.IDENTIFY):
            model = self.robot.model()
            assert model is not None, (
                "this driver has no model, so the search for servos is not tested"
            )
            clock, ids = SimulatedClock(), self.robot.servos.values()
            with clock.working(), self.robot.servos_on(BoardLink(model, clock), clock) as bus:
                found = bus.find(ids).servos
                assert [*found] == [*ids], f"found {[*found]} of {[*ids]}"
                assert bus.positions([*ids]) == {s: found[s].position for s in ids}
                if self.robot.can(Ability.LIMITS):
                    for servo, report in found.items():
                        values = {name: report.kept[name] for name in ("least", "most")}
                        values["least"] += 1
                        bus.keep(servo, values)
                    kept = {s: report.kept["least"] for s, report in bus.find(ids).servos.items()}
                    assert kept == {s: found[s].kept["least"] + 1 for s in ids}

    @contextmanager
    def _rig(self, deaf: bool = False) -> Iterator["_Rig"]:
        model = self.robot.model()
        assert model is not None, "this driver has no model, so its motions are not tested"
        rig = _Rig(self.robot, model, deaf)
        with rig.clock.working(), rig.arm:
            rig.arm.configure()
            yield rig


class _Line(BoardLink[BoardModel]):
    """A link to a model. A deaf link loses all bytes from the board."""

    deaf = False

    def read(self) -> bytes:
        while data := super().read():
            if not self.deaf:
                return data
        return b""


class _Rig:
    """An arm on a model of its board, in simulated time."""

    def __init__(self, robot: Robot, model: BoardModel, deaf: bool) -> None:
        self.clock = SimulatedClock()
        self.link = _Line(model, self.clock)
        self.link.deaf = deaf
        self.events: list[ArmEvent] = []
        self.arm = Arm(robot, self.link, self.clock, self.events.append)
        self.activate = self.arm.activate
        self._changed = self.clock.signal()

    @property
    def faults(self) -> list[HardwareError]:
        """Errors of all faults."""
        return [event.error for event in self.events if isinstance(event, Faulted)]

    @property
    def measured(self) -> list[Measured]:
        """Events of all measurements."""
        return [event for event in self.events if isinstance(event, Measured)]

    def goal(self, start: tuple[float, ...]) -> tuple[float, ...]:
        """Return a start pose with every joint moved by a fifth of its range, at most 0.5 rad."""
        joints = zip(self.arm.robot.actuated, start, strict=True)
        return tuple(_moved(*_limits(joint.lower, joint.upper), q) for joint, q in joints)

    def start(self, goal: tuple[float, ...]) -> tuple[Playback, float]:
        """Start a straight motion at half the velocity limits. Return playback and duration [s]."""
        start, robot = self.arm.commanded, self.arm.robot
        moves = zip(robot.actuated, start, goal, strict=True)
        duration = max(2 * abs(b - a) / joint.velocity for joint, a, b in moves)

        def sample(times: object) -> list[list[float]]:
            assert isinstance(times, list)
            parts = [time / duration for time in times]
            return [[a + (b - a) * s for a, b in zip(start, goal, strict=True)] for s in parts]

        schedule = compile_schedule(robot, start, sample, duration)
        generation = self.arm.generation
        return self.arm.play(schedule, self._notify, "contract", generation), duration

    def play(self, goal: tuple[float, ...], act: Callable[[], None] | None = None) -> Playback:
        """Play a motion to its end, and return the playback. Call `act` in the middle."""
        playback, duration = self.start(goal)
        if act:
            self.wait(duration / 2)
            act()
        with self._changed:
            while playback.playing:
                self._changed.wait(None)
        return playback

    def wait(self, seconds: float) -> None:
        """Wait for a time [s]."""
        until = self.clock.now() + seconds
        with self._changed:
            while self.clock.now() < until:
                self._changed.wait(until)

    def _notify(self) -> None:
        with self._changed:
            self._changed.notify()


class LinkContract:
    """Tests that every link must pass. A subclass makes the link and controls its other end.

    Each test calls `make_link` once. The other methods then act on the other end of that link.
    """

    def make_link(self) -> Link:
        """Return a link that is not open."""
        raise NotImplementedError

    def send(self, data: bytes) -> None:
        """Send bytes from the other end."""
        raise NotImplementedError

    def received(self, count: int) -> bytes:
        """Wait for this many bytes at the other end, and return them."""
        raise NotImplementedError

    def unplug(self) -> None:
        """Disconnect the other end."""
        raise NotImplementedError

    def close(self) -> None:
        """Release everything that `make_link` created besides the link."""

    def test_bytes_arrive_in_both_directions(self) -> None:
        """Sends all values of a byte, in order. Opens the link twice."""
        with self._link() as link:
            for _ in range(2):
                link.open()
                link.write(bytes(range(256)))
                link.write(b"end")
                assert self.received(259) == bytes(range(256)) + b"end"
                self.send(bytes(range(256)))
                heard = b""
                while len(heard) < 256:
                    heard += link.read()
                assert heard == bytes(range(256))
                assert not link.unread
                link.close()

    def test_a_closed_link_reads_nothing_and_refuses_bytes(self) -> None:
        """Tries a link before it is opened, and after it is closed."""
        with self._link() as link:
            for _ in range(2):
                assert link.read() == b""
                error = _raised(partial(link.write, b"lost"))
                assert isinstance(error, PortLost), f"write raised {error!r}"
                link.open()
                link.close()
                link.close()

    def test_closing_ends_a_read(self) -> None:
        """The read returns no bytes."""
        with self._link() as link:
            link.open()
            heard, reader = _reading(link)
            link.close()
            reader.join(_PATIENCE)
            assert heard == [b""], f"the read ended with {heard}"

    def test_a_link_that_is_unplugged_is_lost(self) -> None:
        """Reads and writes raise PortLost. Closing does not raise it."""
        with self._link() as link:
            link.open()
            heard, reader = _reading(link)
            self.unplug()
            reader.join(_PATIENCE)
            assert [type(each) for each in heard] == [PortLost], f"the read ended with {heard}"
            error = _raised(partial(link.write, b"lost"))
            assert isinstance(error, PortLost), f"write raised {error!r}"
            link.close()

    @contextmanager
    def _link(self) -> Iterator[Link]:
        link = self.make_link()
        try:
            yield link
        finally:
            link.close()
            self.close()


def _reading(link: Link) -> tuple[list[bytes | BaseException], Thread]:
    """Read once on another thread. Return the result or exception of the read, and the thread."""
    heard: list[bytes | BaseException] = []

    def read() -> None:
        try:
            heard.append(link.read())
        except Exception as error:  # the test checks it
            heard.append(error)

    return heard, RealClock().spawn(read, "reader")


def _poses(robot: Robot) -> Iterator[tuple[float, ...]]:
    dice, limits = random.Random(1), [_limits(j.lower, j.upper) for j in robot.actuated]
    yield robot.boot_pose
    yield tuple(lower for lower, _ in limits)
    yield tuple(upper for _, upper in limits)
    for _ in range(_SAMPLES):
        yield tuple(dice.uniform(*each) for each in limits)


def _limits(lower: float, upper: float) -> tuple[float, float]:
    return max(lower, -_RANGE), min(upper, _RANGE)


def _moved(lower: float, upper: float, start: float) -> float:
    """Return a position moved towards the farther limit: by a fifth of the range, up to 0.5 rad."""
    step = min((upper - lower) / 5, 0.5)
    return start + step if upper - start > start - lower else start - step


def _are_near(values: Sequence[float], right: Sequence[float]) -> bool:
    """Return True if each measured value is within a fifth of the right one, or within 0.02."""
    pairs = zip(values, right, strict=False)
    near = all(abs(a - b) <= max(_SHARE * abs(b), _LEAST) for a, b in pairs)
    return len(values) == len(right) and near


def _raised(call: Callable[[], object]) -> Exception | None:
    """Return the exception that a call raises, or None."""
    try:
        call()
    except Exception as error:  # the test checks its class
        return error
    return None

"""The write guard: the only code that writes to the board.

Trees, planners and servers may have bugs; the guard must not. Before every write it checks that the
arm is active, that the motion is the current one, that every position is finite and within its
limits, that no joint exceeds its velocity limit, and that the board can process the frame now.
"""

import math
import threading
from collections.abc import Callable, Sequence

from hardware.clock import Clock
from hardware.description.robot import Robot
from hardware.drivers.firmware_profile import Ability
from hardware.drivers.pacing import PacingModel
from hardware.drivers.wire_format import Frame
from hardware.errors import (
    ArmClaimed,
    DriverFailed,
    JointTooFast,
    LinkError,
    NotActive,
    StaleGeneration,
    TooFast,
    TorqueOff,
)
from hardware.joints import DISPLAY_UNITS, check_positions
from hardware.link.link import Link
from hardware.loading.dataclass import dataclass

from .board_session import BoardSession
from .events import OBSERVER_TIMEOUT, CommandSent, FrameSent, Observer, Outbox

# The guard allows a joint to be this many periods behind its command. One period is normal, because
# a position is commanded one period early. A busy host may add two periods: it may send a frame
# that late, and the next frames on time.
_PERIODS_BEHIND = 3
_READER_LATE = 0.05  # longest time that a request waits for the thread that reads [s]
_READER_WAIT = 0.001  # time between two checks whether that thread has read [s]
_VELOCITY_MARGIN = 1.01  # factor of a velocity limit, for rounding in planners


@dataclass(frozen=True, slots=True)
class Claim:
    """The right of one motion to command the arm. A release or a stop ends this right.

    Attributes:
        owner: Name of the owner.
        generation: Generation of the claim. The end of a claim begins the next generation, so no
            later claim equals this one.
    """

    owner: str
    generation: int


class WriteGuard:
    """Checks commanded positions and writes them to the board. Thread-safe.

    Args:
        robot: The robot, with its limits and firmware.
        link: Link to the board. The method `write` of the link must return within a deadline,
            because a stop waits for a write in progress.
        clock: Time source.
        is_active: Callback that returns True if the lifecycle is *active*.
        observe: Callback for every write, in order, without a lock.
        session: The protocol of the board.
        positions: Pose of the arm, one position per actuated joint [rad].

    Attributes:
        generation: Number of ended claims and stops. A motion planned before the last change of
            this number gets no claim.
        torque: True if the servos have torque. Without torque, no frame may be sent.
    """

    def __init__(
        self,
        robot: Robot,
        link: Link,
        clock: Clock,
        is_active: Callable[[], bool],
        observe: Observer,
        session: BoardSession,
        positions: tuple[float, ...],
    ) -> None:
        self._robot, self._link, self._clock = robot, link, clock
        self._is_active, self._outbox = is_active, Outbox(observe)
        self._session = session
        self._codec = robot.wire_format
        self._lock = threading.RLock()  # a signal handler may hold the arm
        self._claim: Claim | None = None
        self.generation = 0
        self._arrivals = [-math.inf] * len(positions)
        self._most_behind = _most_behind(robot)
        self._closed = self._hold_due = False
        self.torque = not robot.can(Ability.TORQUE)
        self.start_from(positions)

    def start_from(self, positions: tuple[float, ...]) -> None:
        """Set the pose of the arm before its first frame, one position per actuated joint [rad]."""
        robot = self._robot
        self._commanded = positions
        self._last_frame = self._codec.encode(positions)
        self._pacing = PacingModel(robot.firmware, robot.serial.baud, self._last_frame)

    @property
    def commanded(self) -> tuple[float, ...]:
        """Last commanded positions, one per actuated joint [rad]."""
        return self._commanded

    @property
    def earliest(self) -> float:
        """Earliest time at which the board can receive the next frame [s]."""
        return max(self._pacing.earliest, self._session.free_at)

    @property
    def done(self) -> float:
        """Time at which the board has executed all frames [s]."""
        return self._pacing.done

    def claim(self, owner: str, generation: int) -> Claim:
        """Claim the arm for a motion.

        Args:
            owner: Name of the owner.
            generation: Generation in which the motion was planned.

        Raises:
            ArmClaimed: Another motion has the arm.
            StaleGeneration: The arm was stopped, or another motion ended, after the planning.
        """
        with self._lock:
            if self._claim:
                raise ArmClaimed(self._claim.owner, owner)
            if generation != self.generation:
                raise StaleGeneration("the arm was stopped or moved since this motion was planned")
            self._claim = Claim(owner, generation)
            return self._claim

    def release(self, claim: Claim) -> None:
        """End a claim. Does nothing if it has ended."""
        with self._lock:
            if claim == self._claim:
                self._end_claim()

    def send_start_commands(self) -> None:
        """Send the start commands of the board.

        Raises:
            NotActive: The arm is not active.
            LinkError: The port failed.
        """
        with self._lock:
            self._check_active()
            self._send_command(self._session.start_commands())
        self._outbox.deliver()

    def release_torque(self) -> int:
        """End the claim and allow no frames, before the torque of the servos is switched.

        Returns:
            The new generation.

        Raises:
            NotActive: The arm is not active.
        """
        with self._lock:
            self._check_active()
            self._end_claim()
            self.torque = self._hold_due = False
            return self.generation

    def send_torque_command(self, data: bytes) -> bool:
        """Send a part of the commands that switch the torque of the servos.

        Returns:
            True if it was sent; False if the line must stay free for an answer now.

        Raises:
            NotActive: The arm is not active.
            LinkError: The port failed.
        """
        with self._lock:
            self._check_active()
            if self._clock.now() < self._session.free_at:
                return False
            self._send_command(data)
        self._outbox.deliver()
        return True

    def poll(self) -> float:
        """Send the request that is due, if any. A request moves no joint, so any state allows it.

        On a busy host, the reading thread may run late. Unread bytes may be the answer to the last
        request. The next request then waits until that thread has read them.

        Returns:
            Earliest useful time of the next call [s]; -inf for no limit.

        Raises:
            LinkError: The port failed.
            BoardError: The board does not answer in time.
        """
        now = self._clock.now()
        late = now - self._session.next_poll
        if late < 0:
            return -math.inf
        if late < _READER_LATE and self._link.unread:
            return now + _READER_WAIT
        with self._lock:
            if not self._closed:
                self._send_command(self._session.poll(self._clock.now()), request=True)
        self._outbox.deliver()
        return -math.inf

    def send_fault_commands(self, torque_off: bool) -> None:
        """Send the commands for a fault, also if the guard is closed.

        Args:
            torque_off: True to release the joints; False to hold their measured positions.

        Raises:
            LinkError: The port failed.
        """
        with self._lock:
            commands = self._session.torque_commands(False) if torque_off else []
            self._send_command(b"".join(commands) or self._session.hold_commands())
        self._outbox.deliver()

    def close(self) -> None:
        """Refuse all further writes. Wait until a write in progress is finished and reported."""
        self._closed = True
        with self._lock:
            pass
        self.flush_events()

    def flush_events(self) -> None:
        """Wait until all writes are reported, also those that another thread reports."""
        self._outbox.deliver(OBSERVER_TIMEOUT)

    def write(self, positions: Sequence[float], claim: Claim, scheduled: float) -> bool:
        """Command positions. A frame equal to the last one is not sent again.

        Args:
            positions: One position per actuated joint [rad].
            claim: Claim of the motion.
            scheduled: Planned time of the write [s].

        Returns:
            True if a frame was sent.

        Raises:
            WriteRefused: The arm is not active or has no torque, the claim has ended, a position is
                invalid, a joint would be too fast, or the board cannot process the frame now.
            PortLost: The port disappeared. The board may have received a part of the frame.
            PortStalled: The board accepts no more bytes. It may have received a part of the frame.
        """
        with self._lock:
            self._check_active()
            self._check_claim(claim)
            if not self.torque:
                raise TorqueOff
            target = check_positions(self._robot.actuated, tuple(positions))
            frame = self._codec.encode(target)
            changed = frame != self._last_frame
            if changed:
                self._check_pacing(frame)
            arrivals = self._check_velocity(target, frame)
            if changed:
                self._send(frame, target, scheduled)
            self._commanded, self._arrivals = target, arrivals
        self._outbox.deliver()
        return changed

    def hold(self, claim: Claim | None = None) -> None:
        """End the claim. Repeat the last frame once if a frame was written since the last hold.

        Args:
            claim: Claim of the motion to hold, or None to hold any motion.

        Raises:
            NotActive: The arm is not active.
            StaleGeneration: The claim has ended.
            PortLost: The port disappeared.
            PortStalled: The board accepts no more bytes.
        """
        with self._lock:
            if claim:
                self._check_claim(claim)
            self._end_claim()
            # One statement, because a signal handler may call this function in between.
            due, self._hold_due = self._hold_due, False
            if due:
                self._check_active()
                self._send(self._last_frame, self._commanded, None)
        self._outbox.deliver()

    def loosen(self, positions: Sequence[float], claim: Claim | None = None) -> bool:
        """Command positions nearer to the measured ones, for joints that push against an object.

        These joints stand still. Therefore their velocity is not checked.

        Args:
            positions: One position per actuated joint [rad].
            claim: Claim of the motion, or None if no motion is played. A frame that is sent without
                a claim ends the generation, so motions planned before are refused.

        Returns:
            True if a frame was sent. False if the frame equals the last one, or if the board has no
            room for it now. Also False without a claim if a motion has begun or the torque is off.

        Raises:
            NotActive: The arm is not active.
            TorqueOff: A claim is given, and the arm has no torque.
            StaleGeneration: The claim has ended.
            BadPosition: A position is invalid.
            LinkError: The port failed.
            DriverFailed: The link raised another exception.
        """
        with self._lock:
            self._check_active()
            if claim:
                self._check_claim(claim)
                if not self.torque:
                    raise TorqueOff
            elif self._claim or not self.torque:
                return False
            target = check_positions(self._robot.actuated, tuple(positions))
            frame = self._codec.encode(target)
            changed = frame != self._last_frame and self.earliest <= self._clock.now()
            if changed:
                if claim is None:
                    self._end_claim()
                self._send(frame, target, None)
                self._commanded = target
        self._outbox.deliver()
        return changed

    def _check_active(self) -> None:
        if self._closed or not self._is_active():
            raise NotActive("the arm is not active; configure and activate it first")

    def _check_claim(self, claim: Claim) -> None:
        if claim != self._claim:
            raise StaleGeneration("this motion was stopped; nothing more is sent for it")

    def _end_claim(self) -> None:
        self._claim = None
        self.generation += 1

    def _check_velocity(self, target: tuple[float, ...], frame: Frame) -> list[float]:
        """Return the time at which each joint reaches its target at its velocity limit [s].

        A step that is too small to turn its servo is accepted, and added to the next step.
        """
        now, arrivals = self._clock.now(), []
        turns = zip(self._last_frame.servos, frame.servos, strict=True)
        moves = zip(self._commanded, target, self._arrivals, self._most_behind, turns, strict=True)
        for joint, move in zip(self._robot.actuated, moves, strict=True):
            before, after, busy_until, most, (servo, servo_after) = move
            limit = joint.velocity * _VELOCITY_MARGIN
            behind = max(busy_until - now, 0.0) + abs(after - before) / limit
            if behind > most and servo_after != servo:
                period = 1 / self._robot.firmware.rate
                needed = max(abs(after - before) / period, limit * behind / most)
                scale, unit = DISPLAY_UNITS[joint.unit]
                raise JointTooFast(joint.name, needed, joint.velocity, scale, unit)
            arrivals.append(now + behind)
        return arrivals

    def _check_pacing(self, frame: Frame) -> None:
        step, most = self._pacing.step(frame), self._robot.firmware.max_step
        if step > most:
            raise TooFast(
                f"{frame} turns the servos by {step} {self._robot.firmware.words.unit} in total; "
                f"the limit is {most}"
            )
        early = self.earliest - self._clock.now()
        if early > 0:
            raise TooFast(f"{frame} comes {early * 1000:.1f} ms before the board has room for it")

    def _send(self, frame: Frame, positions: tuple[float, ...], scheduled: float | None) -> None:
        began = self._clock.now()
        self._hold_due = scheduled is not None
        before = self._session.next_poll
        self._session.note_sent(frame, began)
        due = self._session.next_poll <= began < before  # the frame made a request due
        request = self._session.poll(began) if due else b""
        self._put(frame.data + request)
        # The time after the write, which may have waited.
        self._pacing.note_sent(frame, self._clock.now())
        self._last_frame = frame
        self._outbox.put(FrameSent(began, frame.data, positions, scheduled))
        if request:
            self._outbox.put(CommandSent(began, request, request=True))

    def _send_command(self, data: bytes, request: bool = False) -> None:
        if data:
            self._put(data)
            self._outbox.put(CommandSent(self._clock.now(), data, request))

    def _put(self, data: bytes) -> None:
        try:
            self._link.write(data)
        except BaseException as error:
            self._closed = True  # the board may have a part of the bytes, so nothing may follow
            if isinstance(error, LinkError) or not isinstance(error, Exception):
                raise
            raise DriverFailed(error) from error  # even a WriteRefused: only the guard may raise it


def _most_behind(robot: Robot) -> list[float]:
    """Return the largest delay of each joint behind its command [s].

    A servo turns by whole units, and a slow joint may need many periods for one unit.
    """
    ends = [
        (0.0, 1.0) if joint.continuous else (joint.lower, joint.upper) for joint in robot.actuated
    ]
    low, high = (robot.wire_format.encode(each).servos for each in zip(*ends, strict=True))
    late = _PERIODS_BEHIND / robot.firmware.rate
    return [
        late + (upper - lower) / max(1, abs(b - a)) / (joint.velocity * _VELOCITY_MARGIN)
        for joint, (lower, upper), a, b in zip(robot.actuated, ends, low, high, strict=True)
    ]

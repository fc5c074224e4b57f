"""A leaf that follows a hand-guided arm."""

import logging
import math
from collections.abc import Iterator, Sequence

from py_trees.common import Status

from hardware import Playback, PlaybackState, Schedule, Setpoint
from skills.base import Skill
from skills.context import LeaderRead, Scheduled
from skills.errors import Interrupted
from skills.leader import Blocked
from skills.motion.errors import MotionCollides, MotionError
from skills.motion.query import MIN_SPEED, Verify
from skills.planning_skill import PlannerJob
from skills.ports import Port

logger = logging.getLogger(__name__)

_PROBE = {"rad": math.radians(3), "m": 0.003}  # a joint that can move this far is shown as free
_QUIET = 1.0  # shortest time between two lines in the log [s]


class FollowLeader(Skill):
    """Follow the joints of a leader until a person ends this. The arm stops before a collision.

    In each period of frames, the arm makes a step towards the leader, within the limits of velocity
    and acceleration. Each step is checked for collision before it is sent.
    """

    moves = True
    phase = "following"

    INPUT_PORTS = {
        "speed": Port(
            float,
            default_value=1.0,
            description="share of the robot's speed",
            least=MIN_SPEED,
            most=1.0,
        ),
    }

    _playback: Playback | None = None
    _checks: tuple[PlannerJob, ...] = ()  # check of the next step, or one check per probe
    _contact = ""  # cause of a blocked step, while `_checks` are those of probes
    _blocked = False
    _origin: tuple[float, ...] | None  # start of following: contacts there may not become deeper
    _start: tuple[float, ...]
    _schedule: Schedule
    _generation: int
    _period: float
    _due: float
    _velocity: list[float]

    @property
    def busy(self) -> bool:
        """True while a planner checks a step or the arm moves."""
        return self._playing or any(not check.done for check in self._checks)

    def on_start(self) -> Status:
        """Start to follow, from standstill."""
        robot = self.context.robot
        self._period, self._due = 1 / robot.firmware.rate, self.context.now()
        self._quiet_until = -math.inf  # time of the next allowed line in the log [s]
        self._rest()
        return self.on_running()

    def on_running(self) -> Status:
        """Start the next step when the previous step is done and the next period begins."""
        if self.busy:
            return Status.RUNNING
        if self._playback:
            self._finish(self._playback)
        if self._checks:
            self._process_checks()
            return self.on_running()
        now = self.context.now()
        if now >= self._due:
            self._due = max(self._due + self._period, now)
            target = self.context.leader.positions()
            if target is None:
                self.context.leader.show(None)
                return Status.SUCCESS
            self.context.publish(LeaderRead(target))
            self._step(target)
        self.context.wake_at(self._due)
        return Status.RUNNING

    def on_pause(self) -> None:
        """Stop the arm."""
        self.on_halt()
        self._rest()

    def on_halt(self) -> None:
        """Stop the arm, and cancel pending checks."""
        for check in self._checks:
            check.cancel()
        if self._playing:
            self.context.arm.stop()
        self.context.leader.show(None)

    def _rest(self) -> None:
        """Reset everything about the current step, because the arm stands still."""
        self._origin, self._playback, self._checks = None, None, ()
        self._contact, self._blocked = "", False
        self._velocity = [0.0] * len(self.context.robot.actuated)  # last velocity [rad/s]
        self._gripping = set[int]()  # columns of grippers that push against an object

    def _step(self, target: Sequence[float]) -> None:
        """Request a check of the next step towards the leader.

        Args:
            target: Positions of the leader, one per actuated joint [rad].
        """
        arm, wire = self.context.arm, self.context.robot.wire_format
        start, self._generation = arm.commanded, arm.generation
        self._origin = self._origin or start
        positions = self._ahead(start, target)
        if positions == start:
            return
        frame = wire.encode(positions)
        moved = frame != wire.encode(start)
        setpoints = (Setpoint(0.0, 0.0, positions, frame),) if moved else ()
        self._schedule = Schedule(setpoints, positions, 0.0, 0.0, continues=True)
        self._start = start
        self._checks = (self._check(start, positions),)

    def _ahead(self, start: Sequence[float], target: Sequence[float]) -> tuple[float, ...]:
        """Return the commanded positions after the next period: a step towards the leader.

        Each joint stays so slow that it can stop at the leader's position. The sum of the
        accelerations stays within `acceleration_sum`, because each joint uses only its share. If a
        gripper pushes against an object, its target is at most `squeeze_deg` from its measured
        position, so that its servo is not overloaded. This ends when the leader is nearer than
        `squeeze_deg`.
        """
        speed, period, positions = self.get_input("speed"), self._period, []
        robot, measured = self.context.robot, self.context.arm.measured
        total = speed**2 * sum(joint.acceleration for joint in robot.actuated)
        share = min(1.0, robot.acceleration_sum / total)
        guards, squeeze = robot.guards, math.radians(robot.guards.squeeze_deg)
        for column, joint in enumerate(robot.actuated):
            most, at, goal = share * speed**2 * joint.acceleration, start[column], target[column]
            if measured and joint.name in robot.groups["gripper"] and joint.unit == "rad":
                there = measured.position[column]
                if not measured.effort or abs(measured.effort[column]) >= guards.grip_effort:
                    self._gripping.add(column)
                elif abs(goal - there) <= squeeze:
                    self._gripping.discard(column)
                if column in self._gripping:
                    goal = _clip(goal, there - squeeze, there + squeeze)
            left = _clip(goal, joint.lower, joint.upper) - at
            change = most * period
            stoppable = math.sqrt(change**2 + 2 * most * abs(left)) - change
            wanted = min(stoppable, abs(left) / period, speed * joint.velocity)
            before = self._velocity[column]
            velocity = _clip(math.copysign(wanted, left), before - change, before + change)
            self._velocity[column] = velocity
            positions.append(_clip(at + velocity * period, joint.lower, joint.upper))
        return tuple(positions)

    def _check(self, start: tuple[float, ...], end: tuple[float, ...]) -> PlannerJob:
        """Request a collision check of a straight motion, with the margin that plans guarantee."""
        context = self.context
        margin = 0.5 * context.robot.collision.margin
        world = context.scene.world
        verify = Verify((start, end), margin, None, context.timeout, world, self._origin)
        return PlannerJob(context, verify)

    def _process_checks(self) -> None:
        """Send the step if it is free of collisions. Else request the checks of all probes."""
        answers, self._checks = [check.answer for check in self._checks], ()
        collides = [isinstance(answer, MotionCollides) for answer in answers]
        for answer, known in zip(answers, collides, strict=True):
            if isinstance(answer, MotionError) and not known:
                raise answer
        if self._contact:
            self._show(self._contact, [not each for each in collides])
            self._contact = ""
        elif isinstance(answer := answers[0], MotionCollides):
            self._velocity = [0.0] * len(self._velocity)
            if not self._blocked:
                self._blocked, self._contact = True, answer.contact
                self._checks = tuple(self._check(self._start, end) for end in self._probes())
        else:
            self._play()

    def _probes(self) -> Iterator[tuple[float, ...]]:
        """Yield the probes: configurations with only one joint moved, a little down or up."""
        for column, joint in enumerate(self.context.robot.actuated):
            for way in (-1, 1):
                end = list(self._start)
                end[column] += way * _PROBE[joint.unit]
                yield tuple(end)

    def _show(self, contact: str, free: Sequence[bool]) -> None:
        """Show and log why the arm does not follow, and the free directions.

        Args:
            contact: The two bodies that would come too close, in words.
            free: True for each probe without collision.
        """
        joints = self.context.robot.actuated
        ways = {
            joint.name: (
                down and q - _PROBE[joint.unit] >= joint.lower,
                up and q + _PROBE[joint.unit] <= joint.upper,
            )
            for joint, q, down, up in zip(joints, self._start, free[::2], free[1::2], strict=True)
        }
        self.context.leader.show(Blocked(contact, ways))
        if self.context.now() >= self._quiet_until:
            self._quiet_until = self.context.now() + _QUIET
            logger.warning("The arm stopped following: %s", contact)

    def _play(self) -> None:
        """Send the step."""
        if self._blocked:
            self._blocked = False
            self.context.leader.show(None)
        context = self.context
        context.publish(Scheduled(self._schedule, self._start, None))
        self._playback = context.arm.play(self._schedule, context.wake, self.name, self._generation)

    def _finish(self, playback: Playback) -> None:
        """End the step. Raise an error if the step was not sent completely."""
        self._playback = None
        if playback.error:
            raise playback.error
        if playback.state is PlaybackState.STOPPED:
            raise Interrupted("the motion was stopped while the arm followed its leader")

    @property
    def _playing(self) -> bool:
        return bool(self._playback and self._playback.playing)


def _clip(value: float, least: float, most: float) -> float:
    return min(max(value, least), most)

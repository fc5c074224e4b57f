"""The base class of skills that move the arm. It checks frames, streams them, and can pause."""

import math
from dataclasses import replace

from py_trees.common import Status

from hardware import Playback, PlaybackState, Robot, Schedule

from .base import Skill
from .context import Scheduled
from .errors import Interrupted, StartMoved
from .merged_motion import MergedMotion, differs, moved_gripper, verify_query
from .motion.errors import MotionError
from .motion.query import Rest
from .motion.trajectory.plan import Plan
from .planning_skill import PlannerJob


class StreamedMotion(Skill, register=False):
    """A skill that checks the frames of a motion for collisions, and then streams them.

    A subclass implements `compile_motion`.
    """

    moves = True

    _job: PlannerJob | None = None
    _playback: Playback | None = None
    _schedule: Schedule | None = None
    _motion: MergedMotion | None = None
    _start: tuple[float, ...] = ()
    _generation = 0
    _frames_before = 0  # frames of this motion that were sent before the last pause
    _progress_before: float | None = None  # progress at the last pause
    _paused = False
    _remaining: list[Plan | PlannerJob] | None = None  # plans for the rest of a paused motion
    _holds = False  # True if the gripper closed on an object before the last pause
    _resumed = 0.0  # time in the motion from which it is resumed [s]

    @property
    def busy(self) -> bool:
        """True while a planner works for this skill or the arm moves."""
        jobs = [self._job, *(self._remaining or [])]
        return self._playing or any(isinstance(j, PlannerJob) and not j.done for j in jobs)

    @property
    def progress(self) -> float | None:
        """Fraction of the frames that the board has received; None before the motion starts."""
        if self._playback is None:
            return self._progress_before
        total = self._frames_before + len(self._playback.schedule.setpoints)
        return (self._frames_before + self._playback.arrived) / total if total else 1.0

    @property
    def time_left(self) -> float:
        """Planned time from the last received frame to the end of the motion [s].

        It is 0 before the motion starts.
        """
        if self._playback is None:
            return 0.0
        schedule, arrived = self._playback.schedule, self._playback.arrived
        return schedule.duration - (schedule.setpoints[arrived - 1].time if arrived else 0.0)

    def on_start(self) -> Status:
        """Compile the motion into frames, and request a check of the frames."""
        arm = self.context.arm
        self._playback, self._remaining, self._paused, self._holds = None, None, False, False
        self._frames_before, self._progress_before = 0, None
        schedule, motion = self.compile_motion(arm.commanded)
        return self._check(schedule, motion, None)

    def on_running(self) -> Status:
        """Start the motion when the check of its frames has passed, and monitor it to its end."""
        if self._paused:
            return self._resume()
        if self._remaining is not None:
            return self._play_remaining(self._remaining)
        assert self._job
        assert self._schedule
        if not self._job.done:
            return Status.RUNNING
        if isinstance(self._job.answer, MotionError):
            raise self._job.answer
        if self._playback is None:
            arm, wake = self.context.arm, self.context.wake
            self._playback = arm.play(self._schedule, wake, self.name, self._generation)
        return self._follow(self._playback)

    def compile_motion(self, start: tuple[float, ...]) -> tuple[Schedule, MergedMotion | None]:
        """Return the schedule of frames to execute, and the motion that was compiled.

        The motion is None if the frames were not planned.

        Args:
            start: Position of every actuated joint before the first frame [rad].
        """
        raise NotImplementedError

    def merge(
        self, start: tuple[float, ...], plans: list[Plan], together: bool
    ) -> tuple[Schedule, MergedMotion]:
        """Return the schedule of frames for several plans, and the motion that was compiled.

        Args:
            start: Position of every actuated joint before the first frame [rad].
            plans: Plans of the groups.
            together: True if the groups move at the same time, False if one after the other.

        Raises:
            StartMoved: The plans do not begin at the start position.
        """
        merged = MergedMotion(self.context.robot, start, plans, together)
        if not merged.begins_at(start):
            raise StartMoved("the arm was moved after its motion was planned; plan again")
        return merged.compile(), merged

    def _check(
        self, schedule: Schedule, motion: MergedMotion | None, resumed: float | None
    ) -> Status:
        context = self.context
        self._generation, self._start = context.arm.generation, context.arm.commanded
        start = self._start
        self._schedule, self._motion, self._playback = schedule, motion, None
        context.publish(Scheduled(schedule, start, motion, resumed))
        world = context.scene.world
        request = verify_query(context.robot, start, schedule, context.timeout, world)
        self._job = PlannerJob(context, request)
        return Status.RUNNING

    def on_pause(self) -> None:
        """Stop the arm."""
        if self._playing:
            self._paused = True
            self.context.arm.stop()

    def _resume(self) -> Status:
        """Request that the rest of the motion is timed, from the position of the paused arm."""
        playback = self._playback
        assert playback
        if playback.playing:  # the arm still decelerates
            return Status.RUNNING
        self._paused = False
        if playback.gripped or playback.state is not PlaybackState.STOPPED:
            return self._follow(playback)
        position = self.context.arm.commanded
        loosened = position in playback.loosened
        if not (loosened or _stopped_at(playback, self._start, position)):
            raise StartMoved("the arm was moved while the motion was paused; plan again")
        self._holds |= loosened
        self._progress_before = self.progress
        self._frames_before += playback.written
        if self._motion is None:
            joints = self.context.robot.actuated
            ramp = max(joint.velocity / joint.acceleration for joint in joints)
            rest, last = _remaining_frames(playback, ramp), self._start
            if playback.written:
                last = playback.schedule.setpoints[playback.written - 1].positions
            return self._check(begun_at(self.context.robot, rest, last, position), None, None)
        self._resumed, self._playback = _time_at(playback, self._motion, position), None
        self._remaining = [
            PlannerJob(self.context, rest) if isinstance(rest, Rest) else rest
            for rest in self._motion.rest(self._resumed, position)
        ]
        return self._play_remaining(self._remaining)

    def _play_remaining(self, remaining: list[Plan | PlannerJob]) -> Status:
        """Compile the rest of the motion into frames, when all plans of this rest are timed."""
        assert self._motion
        plans = [part.answer if isinstance(part, PlannerJob) else part for part in remaining]
        if any(isinstance(part, PlannerJob) and not part.done for part in remaining):
            return Status.RUNNING
        self._remaining = None
        for plan in plans:
            if isinstance(plan, MotionError):
                raise plan
        start = self.context.arm.commanded
        schedule, motion = self.merge(
            start, [plan for plan in plans if isinstance(plan, Plan)], self._motion.together
        )
        return self._check(schedule, motion, self._resumed)

    def _follow(self, playback: Playback) -> Status:
        before, frames = self._frames_before, len(playback.schedule.setpoints)
        self.feedback_message = f"{before + playback.arrived} of {before + frames} frames"
        if playback.playing:
            return Status.RUNNING
        if playback.error:
            raise playback.error
        # If the gripper has closed on an object, the stop only holds the object.
        if playback.state is PlaybackState.STOPPED and not playback.gripped:
            raise Interrupted(f"the motion was stopped after {self.feedback_message}")
        if playback.gripped or self._holds:
            self.feedback_message += "; the gripper holds an object"
        return Status.SUCCESS

    def on_halt(self) -> None:
        """Stop the arm, and cancel pending requests to planners."""
        for job in (self._job, *(self._remaining or ())):
            if isinstance(job, PlannerJob):
                job.cancel()
        if self._playing:
            self.context.arm.stop()

    @property
    def _playing(self) -> bool:
        return bool(self._playback and self._playback.playing)


def begun_at(
    robot: Robot, schedule: Schedule, before: tuple[float, ...], start: tuple[float, ...]
) -> Schedule:
    """Return a schedule for an arm whose gripper holds an object, so that its start differs.

    The gripper stays at its actual position until its command in the schedule changes. It then
    moves towards its command, at most with its velocity limit.

    Args:
        robot: Description of the robot.
        schedule: The original frames.
        before: Positions from which the original frames start, one per actuated joint [rad].
        start: Actual positions of the arm, one per actuated joint [rad].

    Raises:
        StartMoved: A joint that is not of the gripper is not at its position in `before`.
    """
    elsewhere = moved_gripper(robot, before, start)
    if not elsewhere:
        return schedule
    moves, now, setpoints = set[int](), start, []
    last = robot.wire_format.encode(start)
    for setpoint in schedule.setpoints:
        goal = [*setpoint.positions]
        for k in elsewhere:
            moves |= {k} if differs(goal[k], before[k]) else set()
            step = robot.actuated[k].velocity / robot.firmware.rate if k in moves else 0.0
            goal[k] = min(max(goal[k], now[k] - step), now[k] + step)
        now, frame = tuple(goal), robot.wire_format.encode(goal)
        if frame != last:
            setpoints.append(replace(setpoint, positions=now, frame=frame))
        last = frame
    return replace(schedule, setpoints=tuple(setpoints), end=now)


def _time_at(playback: Playback, motion: MergedMotion, position: tuple[float, ...]) -> float:
    """Return the time in a motion at which it reaches the position of the stopped arm [s].

    If the gripper was loosened, its position is taken from the last frame.
    """
    if not playback.written:
        return 0.0
    last = playback.schedule.setpoints[playback.written - 1]
    expected = last.time - last.delay
    position = last.positions if position in playback.loosened else position
    times = [time for time, row in motion.sampled.items() if tuple(row) == position]
    return min(times, key=lambda time: abs(time - expected))


def _stopped_at(playback: Playback, start: tuple[float, ...], position: tuple[float, ...]) -> bool:
    """Return True if the arm is still at the position at which a playback stopped.

    Args:
        playback: The stopped playback.
        start: Positions before the first frame, one per actuated joint [rad].
        position: Current positions, one per actuated joint [rad].
    """
    schedule, written = playback.schedule, playback.written
    last = schedule.setpoints[written - 1].positions if written else start
    return position == last or (written == len(schedule.setpoints) and position == schedule.end)


def _remaining_frames(playback: Playback, ramp: float) -> Schedule:
    """Return a schedule of the frames that were not sent, for frames that were not planned.

    The new schedule starts from standstill. Its rate grows linearly to the original rate.

    Args:
        playback: The stopped playback.
        ramp: Time until the original rate is reached [s].
    """
    schedule, written = playback.schedule, playback.written
    if not written:
        return schedule
    remaining, passed = schedule.setpoints[written:], schedule.setpoints[written - 1].time

    def later(time: float) -> float:
        ahead = time - passed
        return math.sqrt(2 * ramp * ahead) if ahead < ramp / 2 else ahead + ramp / 2

    setpoints = tuple(replace(setpoint, time=later(setpoint.time)) for setpoint in remaining)
    return replace(schedule, setpoints=setpoints, duration=later(schedule.duration))

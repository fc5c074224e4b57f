"""Moving: the plans become frames, the frames go out."""

import math
from dataclasses import replace

from py_trees.common import Status
from py_trees.ports import PortInformation

from hardware import Playback, PlaybackState, Schedule, compile_schedule
from skills.base import Skill
from skills.context import Scheduled
from skills.errors import Interrupted, StartMoved
from skills.merged_motion import MergedMotion, verify_query
from skills.motion.errors import MotionError
from skills.motion.plan import Plan
from skills.motion.query import Rest
from skills.planning_skill import PlannerJob


class Execute(Skill):
    """Check the merged motion as its frames will play it, then stream them.

    Success is told when the board is done with the last frame.
    """

    moves = True

    INPUT_PORTS = {
        "arm_plan": PortInformation(Plan, description="the arm's motion"),
        "gripper_plan": PortInformation(Plan, description="the gripper's motion"),
        "together": PortInformation(
            bool,
            default_value=False,
            description="whether the gripper moves with the arm, not after it",
        ),
    }
    OUTPUT_PORTS: dict[str, PortInformation] = {}

    _pending: PlannerJob | None = None
    _playback: Playback | None = None
    _schedule: Schedule | None = None
    _motion: MergedMotion | None = None
    _start: tuple[float, ...] = ()
    _generation = 0
    _frames_before = 0  # that were sent of this motion before it was paused,
    _share: float | None = None  # and how far it was then
    _held = False
    _rest: list[Plan | PlannerJob] | None = None
    _resumed = 0.0

    @property
    def busy(self) -> bool:
        """Whether a planner still works for it, or the motion goes on."""
        pending = [self._pending, *(self._rest or [])]
        return self._playing or any(isinstance(p, PlannerJob) and not p.done for p in pending)

    @property
    def progress(self) -> float | None:
        """Frames the board has over frames scheduled; None until the motion begins."""
        if self._playback is None:
            return self._share
        total = self._frames_before + len(self._playback.schedule.setpoints)
        return (self._frames_before + self._playback.arrived) / total if total else 1.0

    def on_start(self) -> Status:
        """Turn the plans into frames and have them checked."""
        arm = self.context.arm
        self._playback, self._rest, self._held = None, None, False
        self._frames_before, self._share = 0, None
        schedule, motion = self._compile(arm.commanded)
        return self._check(schedule, motion, None)

    def on_running(self) -> Status:
        """Begin to move once the check is passed; follow the motion to its end."""
        if self._held:
            return self._take_up()
        if self._rest is not None:
            return self._go_on(self._rest)
        assert self._pending
        assert self._schedule
        if not self._pending.done:
            return Status.RUNNING
        if isinstance(self._pending.answer, MotionError):
            raise self._pending.answer
        if self._playback is None:
            arm, wake = self.context.arm, self.context.wake
            self._playback = arm.play(self._schedule, wake, self.name, self._generation)
        return self._follow(self._playback)

    def _compile(self, start: tuple[float, ...]) -> tuple[Schedule, MergedMotion | None]:
        """The frames to play from where the arm stands [rad], and the motion they came from."""
        plans: list[Plan] = [self.get_input("arm_plan"), self.get_input("gripper_plan")]
        return self._merge(start, plans, self.get_input("together"))

    def _merge(
        self, start: tuple[float, ...], plans: list[Plan], together: bool
    ) -> tuple[Schedule, MergedMotion]:
        robot = self.context.robot
        merged = MergedMotion(robot, start, plans, together)
        if not merged.begins_at(start):
            raise StartMoved("the arm was moved after it was planned; plan again")
        return compile_schedule(robot, start, merged.sample, merged.duration), merged

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
        self._pending = PlannerJob(context, request)
        return Status.RUNNING

    def on_pause(self) -> None:
        """Stop the arm on its way."""
        if self._playing:
            self._held = True
            self.context.arm.stop()

    def _take_up(self) -> Status:
        """See where the pause has left the arm, and have the rest timed from there."""
        playback = self._playback
        assert playback
        if playback.state is PlaybackState.PLAYING:  # it still slows down
            return Status.RUNNING
        self._held = False
        if playback.state is not PlaybackState.STOPPED:
            return self._follow(playback)
        stands = self.context.arm.commanded
        if not _left_at(playback, self._start, stands):
            raise StartMoved("the arm was moved while the motion was paused; plan again")
        self._share = self.progress
        self._frames_before += playback.written
        if self._motion is None:
            joints = self.context.robot.actuated
            ramp = max(joint.velocity / joint.acceleration for joint in joints)
            return self._check(_frames_left(playback, ramp), None, None)
        self._resumed, self._playback = _reached(playback, self._motion, stands), None
        left = self._motion.rest(self._resumed, stands)
        self._rest = [PlannerJob(self.context, r) if isinstance(r, Rest) else r for r in left]
        return self._go_on(self._rest)

    def _go_on(self, rest: list[Plan | PlannerJob]) -> Status:
        """Turn the rest of the motion into frames, once it is timed."""
        assert self._motion
        plans = [part.answer if isinstance(part, PlannerJob) else part for part in rest]
        if any(isinstance(part, PlannerJob) and not part.done for part in rest):
            return Status.RUNNING
        self._rest = None
        for plan in plans:
            if isinstance(plan, MotionError):
                raise plan
        start = self.context.arm.commanded
        schedule, motion = self._merge(
            start, [plan for plan in plans if isinstance(plan, Plan)], self._motion.together
        )
        return self._check(schedule, motion, self._resumed)

    def _follow(self, playback: Playback) -> Status:
        before, frames = self._frames_before, len(playback.schedule.setpoints)
        self.feedback_message = f"{before + playback.arrived} of {before + frames} frames"
        if playback.state is PlaybackState.PLAYING:
            return Status.RUNNING
        if playback.error:
            raise playback.error
        if playback.state is PlaybackState.STOPPED:
            raise Interrupted(f"the motion was stopped after {self.feedback_message}")
        return Status.SUCCESS

    def on_halt(self) -> None:
        """Stop the arm, or what is done before it moves."""
        for pending in (self._pending, *(self._rest or ())):
            if isinstance(pending, PlannerJob):
                pending.cancel()
        if self._playing:
            self.context.arm.stop()

    @property
    def _playing(self) -> bool:
        return self._playback is not None and self._playback.state is PlaybackState.PLAYING


def _reached(playback: Playback, motion: MergedMotion, stands: tuple[float, ...]) -> float:
    """When, by the motion's own time [s], it is where a stopped playback has left the arm [rad]."""
    if not playback.written:
        return 0.0
    last = playback.schedule.setpoints[playback.written - 1]
    about = last.time - last.delay
    there = [time for time, row in motion.sampled.items() if tuple(row) == stands]
    return min(there, key=lambda time: abs(time - about))


def _left_at(playback: Playback, start: tuple[float, ...], stands: tuple[float, ...]) -> bool:
    """Whether the arm stands where a stopped playback has left it [rad]."""
    schedule, written = playback.schedule, playback.written
    last = schedule.setpoints[written - 1].positions if written else start
    return stands == last or (written == len(schedule.setpoints) and stands == schedule.end)


def _frames_left(playback: Playback, ramp: float) -> Schedule:
    """What was not sent, for frames that no motion is known of: at their pace, from standstill.

    Within the ramp [s] the pace grows evenly up to that of the frames' own times.
    """
    schedule, written = playback.schedule, playback.written
    if not written:
        return schedule
    left, passed = schedule.setpoints[written:], schedule.setpoints[written - 1].time

    def later(time: float) -> float:
        ahead = time - passed
        return math.sqrt(2 * ramp * ahead) if ahead < ramp / 2 else ahead + ramp / 2

    setpoints = tuple(replace(setpoint, time=later(setpoint.time)) for setpoint in left)
    return replace(schedule, setpoints=setpoints, duration=later(schedule.duration))

"""Moving: the plans become frames, the frames go out."""

from py_trees.common import Status
from py_trees.ports import PortInformation

from hardware import Playback, PlaybackState, Schedule, compile_schedule, played

from .base import Scheduled, Skill
from .errors import Interrupted, StartMoved
from .merged import Merged
from .motion import MotionError, Plan, Verify
from .pending import Pending

# The frames are checked as they will be played. Decoded whole degrees, turned one servo after the
# other, stray up to 15 mm from the plan at the fingertip (measured), so that this margin is smaller
# than planning's and yet proves half a millimetre everywhere [m].
PLAYED_MARGIN = 0.001


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

    _pending: Pending | None = None
    _playback: Playback | None = None
    _schedule: Schedule | None = None
    _generation = 0

    @property
    def busy(self) -> bool:
        """Whether the check or the motion still goes on."""
        checking = self._pending is not None and not self._pending.done
        return checking or self._playing

    @property
    def progress(self) -> float | None:
        """Frames the board has over frames scheduled; None until the motion begins."""
        if self._playback is None:
            return None
        total = len(self._playback.schedule.setpoints)
        return self._playback.arrived / total if total else 1.0

    def on_start(self) -> Status:
        """Turn the plans into frames and have them checked."""
        context, self._playback = self.context, None
        self._generation, start = context.arm.generation, context.arm.commanded
        self._schedule, motion = self._compile(start)
        context.tell(Scheduled(self._schedule, start, motion))
        times, rows = played(context.robot, start, self._schedule)
        request = Verify(rows, PLAYED_MARGIN, times, context.timeout, context.scene.world)
        self._pending = Pending(context, request)
        return Status.RUNNING

    def on_running(self) -> Status:
        """Begin to move once the check is passed; follow the motion to its end."""
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

    def _compile(self, start: tuple[float, ...]) -> tuple[Schedule, Merged | None]:
        """The frames to play from where the arm stands [rad], and the motion they came from."""
        robot, together = self.context.robot, self.get_input("together")
        plans: list[Plan] = [self.get_input("arm_plan"), self.get_input("gripper_plan")]
        merged = Merged(robot, start, plans, together)
        if not merged.begins_at(start):
            raise StartMoved("the arm was moved after it was planned; plan again")
        return compile_schedule(robot, start, merged.sample, merged.duration), merged

    def _follow(self, playback: Playback) -> Status:
        frames = len(playback.schedule.setpoints)
        self.feedback_message = f"{playback.arrived} of {frames} frames"
        if playback.state is PlaybackState.PLAYING:
            return Status.RUNNING
        if playback.error:
            raise playback.error
        if playback.state is PlaybackState.STOPPED:
            raise Interrupted(f"the motion was stopped after {self.feedback_message}")
        return Status.SUCCESS

    def on_halt(self) -> None:
        """Stop the arm, or the check before it moves."""
        if self._pending:
            self._pending.cancel()
        if self._playing:
            self.context.arm.stop()

    @property
    def _playing(self) -> bool:
        return self._playback is not None and self._playback.state is PlaybackState.PLAYING

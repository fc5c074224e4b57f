"""What is told of a run: into its recording, and to whoever watches."""

import errno
import logging
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor, wait
from functools import cached_property, partial
from pathlib import Path

import logs
from executive.goals.goal import Goal
from executive.goals.outcome import GoalState, GoalStatus
from hardware import ArmEvent, Clock, Robot, State
from logs.writing.compactor import Compactor, compactor
from skills import Planned, SkillEvent
from trees.build import Tree

from .archive import archive_world, robot_note
from .translate import arm_record, skill_record
from .versions import versions

logger = logging.getLogger(__name__)

_BETWEEN = "server"  # in the name of the recording of what happens between goals

# So many goals' recordings may be unfinished, each with its descriptors; then the next goal waits.
_UNFINISHED = 64
_AT_ONCE = 4  # are being finished; most of its time each waits for the disk

_EARLY = 1000  # lines of the log that are kept for a recording that is still to be opened


def is_server_recording(recording: Path) -> bool:
    """Whether a recording is one of what happens between goals, by its name."""
    return recording.stem.endswith(f"-{_BETWEEN}")


class Recordings:
    """One recording per goal; everything told goes into the one that is open, and to the watcher.

    A server keeps one more, which is open whenever no goal's is. Lines of the log for which none is
    open yet head the next one.

    Args:
        folder: Where recordings are made.
        robot: Whose arm.
        clock: Whose time.
        watch: Told of everything that is recorded; must be quick, from any thread.
        failed: Called when something could not be recorded, from another thread.
        configuration: What else decides about a run, as words by name; noted in every recording.

    Attributes:
        path: Of the recording that is open; empty while none is.
        frames: How many frames were sent since it was opened.
    """

    def __init__(
        self,
        folder: Path,
        robot: Robot,
        clock: Clock,
        watch: Callable[[logs.Record], None],
        failed: Callable[[logs.LogError], None],
        configuration: Mapping[str, str],
    ) -> None:
        self._folder, self._robot, self._clock = folder, robot, clock
        self._watch, self._failed = watch, failed
        self._configuration = configuration
        self._recorder: logs.Recorder | None = None
        self._between: logs.Recorder | None = None
        self._compactor: Compactor | None = None
        self._finishers = ThreadPoolExecutor(_AT_ONCE, "recording")
        self._unfinished: deque[Future[None]] = deque()
        self._wrong: list[logs.LogError] = []
        self._meshes: set[str] = set()  # that are in it already
        self._early = deque[logs.LogLine](maxlen=_EARLY)
        self._state = State.UNCONFIGURED.value  # of the arm
        self.path = ""
        self.frames = 0

    def open_server_recording(self) -> None:
        """Open the recording of what happens between goals.

        Raises:
            LogError: It cannot be made.
        """
        self._compactor = compactor()
        self._recorder = self._between = recorder = self._create(_BETWEEN)
        recorder.put(*self._evidence(None), *self._told_early(), self._standing(self._clock.now()))

    def open(self, goal: Goal, name: str, seed: int, tree: Tree | None) -> None:
        """Open the recording of a goal and tell of it.

        Args:
            goal: Which.
            name: Of its task.
            seed: For whatever draws at random.
            tree: What is to run, where it could be built; its files are attached.

        Raises:
            LogError: It cannot be made.
        """
        self._recorder = recorder = self._create(goal.task)
        self.path, self.frames = str(recorder.path), 0
        self._meshes.clear()
        told = logs.Goal(self._clock.now(), goal.identity, goal.task, name, seed)
        recorder.put(*self._evidence(tree), *self._told_early(), told, self._standing(told.time))
        self._watch(told)

    def goal_changed(self, status: GoalStatus) -> None:
        """Note in a server's recording that there is a goal, and its end, whatever it came to."""
        if self._between is None:
            return
        if status.state is GoalState.ACCEPTED:
            accepted = (status.stamp_ns - self._clock.epoch_ns()) / 1e9
            self._between.put(logs.Goal(accepted, status.identity, status.task, "", 0))
        elif status.outcome:
            now = self._clock.now()
            self._between.put(status.outcome.to_record(status.identity, now))

    def wait(self) -> None:
        """Wait until what was told of goals so far, and between them, is on its way to the disk."""
        if self._between:
            self._between.wait()

    def check_space(self) -> None:
        """See that a run's recording has room.

        Raises:
            LogError: It has not.
        """
        logs.check_space(self._folder)

    def settle(self) -> None:
        """Wait until what was told of a goal so far is on its way to the disk.

        Raises:
            LogError: It cannot be recorded.
        """
        if self._recorder:
            self._recorder.settle()

    def goal_ended(self) -> None:
        """Finish the recording of a goal in the background; what follows is between goals."""
        recorder, self._recorder, self.path = self._recorder, self._between, ""
        self.frames = 0
        if recorder and recorder is not self._between:
            self._unfinished.append(self._finishers.submit(self._finish, recorder))
        while self._unfinished and self._unfinished[0].done():
            self._unfinished.popleft()
        if len(self._unfinished) > _UNFINISHED:
            wait([self._unfinished.popleft()])

    def close(self) -> None:
        """Finish the recordings that are open.

        Raises:
            LogError: Something is missing from one of them.
        """
        recorders = [self._recorder, self._between]
        self._recorder, self._between, self.path, self.frames = None, None, "", 0
        for recorder in filter(None, recorders):
            self._finish(recorder)
        self._finishers.shutdown()
        if self._wrong:
            raise self._wrong.pop(0)

    def _finish(self, recorder: logs.Recorder) -> None:
        try:
            recorder.close(self._compactor)
        except logs.LogError as error:
            logger.error("%s", error)
            self._wrong.append(error)
        except Exception:  # the outermost place of this thread
            logger.exception("a bug of ours")

    def record(self, record: logs.Record) -> None:
        """Record something and show it to the watcher."""
        if isinstance(record, logs.Sent) and record.joints:
            self.frames += 1
        if self._recorder:
            self._recorder.put(record)
        elif isinstance(record, logs.LogLine):
            self._early.append(record)
        self._watch(record)

    def caught_up(self, timeout: float) -> bool:
        """Whether every frame that was told is on its way to the disk; waits for it [s]."""
        recorder = self._recorder
        return recorder is None or recorder.caught_up(timeout)

    def on_arm_event(self, event: ArmEvent) -> None:
        """Tell of something the arm did."""
        record = arm_record(event, self._robot)
        if isinstance(record, logs.Transition):
            self._state = record.goal
        self.record(record)

    def on_skill_event(self, event: SkillEvent) -> None:
        """Tell of something a skill did."""
        if isinstance(event, Planned):
            self._attach_new(archive_world(event.query.world)[1])
        self.record(skill_record(event, self._robot, self._clock.now()))

    def _standing(self, time: float) -> logs.Transition:
        """The state in which a recording begins: what led to it is in an earlier one."""
        return logs.Transition(time, "", self._state, self._state)

    def _told_early(self) -> Iterator[logs.LogLine]:
        while self._early:
            yield self._early.popleft()

    def _evidence(self, tree: Tree | None) -> list[logs.Item]:
        """All that it takes to see, and to prove, the run from its file alone."""
        urdf, files, notes = self._machine
        task = tree.files if tree else {}
        return [
            *files,
            logs.Description(self._clock.now(), urdf),
            *notes,
            *(
                logs.Attachment(file, "application/yaml", text.encode())
                for file, text in task.items()
            ),
        ]

    @cached_property
    def _machine(self) -> tuple[str, list[logs.Attachment], list[logs.Note]]:
        """The URDF, the robot's files and the notes, as they are at the first goal."""
        robot = self._robot
        files = [
            logs.Attachment(path.name, "text/plain", path.read_bytes())
            for path in (robot.path, robot.urdf)
        ]
        notes = [
            logs.Note("robot", robot_note(robot)),
            logs.Note("configuration", dict(self._configuration)),
            logs.Note("versions", versions()),
        ]
        return robot.urdf.read_text(), files, notes

    def _attach_new(self, meshes: Mapping[str, bytes]) -> None:
        if self._recorder:
            for name in sorted(meshes.keys() - self._meshes):
                file = logs.Attachment(name, "application/octet-stream", meshes[name])
                self._recorder.put(file)
                self._meshes.add(name)

    def _create(self, task: int | str) -> logs.Recorder:
        utc_ns = self._clock.epoch_ns() + round(self._clock.now() * 1e9)
        while True:
            path = logs.recording_path(self._folder, utc_ns, task)
            try:
                return logs.Recorder(path, self._clock.epoch_ns(), partial(self._give_up, path))
            except logs.RecordingExists:
                utc_ns += 1_000_000

    def _give_up(self, path: Path, cause: Exception) -> None:
        full = isinstance(cause, OSError) and cause.errno == errno.ENOSPC
        self._failed(logs.DiskFull(path) if full else logs.RecordingIncomplete(path, None, cause))

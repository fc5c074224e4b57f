"""Recordings of goals: opens and finishes them, and writes records to the open one."""

import errno
import logging
import threading
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor, wait
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING

import logs
from executive.api.outcome import GoalState, GoalStatus, Outcome
from hardware import Ability, ArmEvent, Clock, Robot, State, utc_ns
from logs.writing.compaction_process import CompactionProcess, shared_process
from skills import Planned, SkillEvent

from .exchanges import Exchanges
from .translate import arm_record, skill_record

if TYPE_CHECKING:
    from .archive import RobotMeshes

logger = logging.getLogger(__name__)

_SERVER = "server"  # word in the name of a server's own recording

# Largest number of unfinished recordings, because each has open files. Beyond it, goals wait.
_UNFINISHED = 64
_AT_ONCE = 4  # number of recordings finished in parallel; each mostly waits for the disk

_EARLY = 1000  # largest number of log lines kept until a recording is opened


def is_server_recording(recording: Path) -> bool:
    """Return True if the file name is that of a server's own recording."""
    return recording.stem.endswith(f"-{_SERVER}")


class Recordings:
    """Makes one recording per goal. Each record goes to the open recording and the subscriber.

    A server has one more recording, its own, for events between goals, and for the acceptance and
    end of every goal. Log lines from before the first recording are written at its start.

    Args:
        folder: Folder for recordings.
        robot: The robot.
        clock: Time source.
        watch: Callback for every record, from any thread. It must be fast.
        failed: Callback for a recording error, from another thread.
        configuration: Settings that affect a run, by name. Every recording contains them.

    Attributes:
        path: Path of the open recording of a goal; empty if there is none.
        frames: Number of frames sent since this recording was opened.
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
        # Read now: a file that is edited before the first run differs from the loaded robot.
        self._robot_files = {path.name: path.read_bytes() for path in robot.files}
        self._watch, self._failed = watch, failed
        self._configuration = configuration
        self._recorder: logs.Recorder | None = None
        self._server: logs.Recorder | None = None
        self._compaction: CompactionProcess | None = None
        self._finishers = ThreadPoolExecutor(_AT_ONCE, "recording")
        self._unfinished: deque[Future[None]] = deque()
        # Only the first error, because its traceback keeps the recorder in memory.
        self._error: logs.LogError | None = None
        self._accepted: set[str] = set()  # goals without an end in the server's own recording
        self._meshes: set[str] = set()  # names of the meshes in the open recording
        self._exchanges = Exchanges(self._record_arm_event)
        self._early = deque[logs.LogLine](maxlen=_EARLY)
        # Lock for the count of frames and changes of the recorder.
        self._counting = threading.RLock()
        self._replacing = threading.Lock()
        self._state = State.UNCONFIGURED.value  # state of the arm's lifecycle
        self.path = ""
        self.frames = 0

    def open_server_recording(self) -> None:
        """Open the server's own recording.

        Raises:
            LogError: The recording cannot be created.
        """
        self._compaction = shared_process()
        recorder = self._create(_SERVER)
        self._begin(recorder, {}, self._arm_state(self._clock.now()))
        self._accepted.clear()
        with self._counting:
            failed, self._server = self._server, recorder
            if self._recorder is failed:
                self._recorder = recorder
        if failed:
            self._finish_later(failed)

    def open(
        self,
        goal: GoalStatus,
        name: str,
        seed: int,
        files: Mapping[str, str],
        start: Mapping[str, float],
    ) -> None:
        """Open the recording of a goal, and record the goal.

        Args:
            goal: Status of the goal.
            name: Name of its task, or words of a move.
            seed: Seed of the planners.
            files: Texts of the files of its task, by name; empty if they could not be read.
            start: Commanded positions [rad], by joint; empty if unknown.

        Raises:
            LogError: The recording cannot be created.
        """
        recorder = self._create("move" if goal.task == logs.MOVE else goal.task)
        record = logs.Goal(self._clock.now(), goal.identity, goal.task, name, seed, start)
        with self._counting:  # no frame comes before the beginning
            self._begin(recorder, files, record, self._arm_state(record.time))
            self._recorder, self.path, self.frames = recorder, str(recorder.path), 0
        self._meshes.clear()
        self._exchanges.restart()
        self._watch(record)

    def goal_changed(self, status: GoalStatus) -> None:
        """Record the acceptance and the end of a goal in the server's own recording."""
        if self._server is None:
            return
        if status.state is GoalState.ACCEPTED:
            self._accepted.add(status.identity)
            accepted = (status.stamp_ns - self._clock.epoch_ns()) / 1e9
            self._server.put(logs.Goal(accepted, status.identity, status.task, "", 0))
        elif status.outcome and status.identity in self._accepted:
            self._accepted.remove(status.identity)
            now = self._clock.now()
            self._server.put(status.outcome.to_record(status.identity, now))

    def wait(self) -> None:
        """Wait until the server's own recording was written to the operating system."""
        if self._server:
            self._server.wait()

    def check_space(self) -> None:
        """Check that the disk has space for the recording of a run.

        Raises:
            LogError: The disk is too full.
        """
        logs.check_space(self._folder)

    def flush(self) -> None:
        """Wait until all records of the open recording were written to the operating system.

        Raises:
            LogError: A record cannot be written.
        """
        if self._recorder:
            self._recorder.flush()

    def goal_ended(self) -> None:
        """Finish the recording of a goal in the background. Records then go to the server's own."""
        with self._counting:
            recorder, self._recorder, self.path = self._recorder, self._server, ""
            self.frames = 0
        if recorder and recorder is not self._server:
            self._finish_later(recorder)
        self._replace_failed()
        while self._unfinished and self._unfinished[0].done():
            self._unfinished.popleft()
        if len(self._unfinished) > _UNFINISHED:
            wait([self._unfinished.popleft()])

    def close(self) -> None:
        """Finish the open recordings.

        Raises:
            LogError: A recording is incomplete.
        """
        recorders = [self._recorder, self._server]
        self._recorder, self._server, self.path, self.frames = None, None, "", 0
        for recorder in filter(None, recorders):
            self._finish(recorder)
        self._finishers.shutdown()
        if error := self._error:
            self._error = None
            raise error

    def _replace_failed(self) -> None:
        """Open another recording for the server if its own has failed, and the disk has space.

        Without it, stops and activations after a full disk would not be recorded.
        """
        with self._replacing:
            if self._server and self._server.failed:
                try:
                    self.check_space()
                    self.open_server_recording()
                except logs.LogError as error:
                    logger.error("%s", error)

    def _finish_later(self, recorder: logs.Recorder) -> None:
        """Finish a recording in the background."""
        self._unfinished.append(self._finishers.submit(self._finish, recorder))

    def _finish(self, recorder: logs.Recorder) -> None:
        try:
            recorder.close(self._compaction)
        except logs.LogError as error:
            logger.error("%s", error)
            self._error = self._error or error
        except Exception:  # catches every error of this thread
            logger.exception("a bug in armtree")

    def record(self, record: logs.Record) -> None:
        """Write a record to the open recording, and pass it to the subscriber."""
        with self._counting:
            if isinstance(record, logs.Sent) and record.joints:
                self.frames += 1
            if self._recorder:
                self._recorder.put(record)
            elif isinstance(record, logs.LogLine):
                self._early.append(record)
        self._watch(record)

    def record_result(self, identity: str, make: Callable[[int, str], Outcome]) -> Outcome:
        """Record the outcome of a goal, and return it.

        Args:
            identity: Identity of the goal.
            make: Callback that returns the outcome, from the number of frames before it and the
                path of the recording.
        """
        with self._counting:  # else a stop could send one more frame between count and record
            outcome = make(self.frames, self.path)
            record = outcome.to_record(identity, self._clock.now())
            if self._recorder:
                self._recorder.put(record)
        self._watch(record)
        return outcome

    @property
    def begun(self) -> bool:
        """True unless the file of the open recording is still being created."""
        recorder = self._recorder
        return recorder is None or recorder.begun

    def caught_up(self, timeout: float) -> bool:
        """Return True if every recorded frame was written to the operating system.

        Args:
            timeout: Longest time to wait for this [s].
        """
        recorder = self._recorder
        return recorder is None or recorder.caught_up(timeout)

    def write_time(self) -> float:
        """Return the duration of writes since the last call [s], including an unfinished write."""
        recorders = {self._recorder, self._server} - {None}
        return max((each.write_time() for each in recorders if each), default=0.0)

    def on_arm_event(self, event: ArmEvent) -> None:
        """Record an event of the arm. Exchanges with a measuring board may be recorded later."""
        if self._robot.can(Ability.MEASURE):
            self._exchanges.take(event)
        else:
            self._record_arm_event(event)

    def _record_arm_event(self, event: ArmEvent) -> None:
        record = arm_record(event, self._robot)
        if isinstance(record, logs.Transition):
            self._state = record.goal
            self._replace_failed()
        self.record(record)

    def on_skill_event(self, event: SkillEvent) -> None:
        """Record an event of a skill."""
        if isinstance(event, Planned):
            from .archive import archive_world

            self._attach_meshes({**self._robot_meshes.files, **archive_world(event.query.world)[1]})
        self.record(skill_record(event, self._robot, self._clock.now()))

    def _arm_state(self, time: float) -> logs.Transition:
        """Return the state of the arm's lifecycle in which a recording begins."""
        return logs.Transition(time, "", self._state, self._state)

    def _early_lines(self) -> Iterator[logs.LogLine]:
        while self._early:
            yield self._early.popleft()

    def _begin(
        self, recorder: logs.Recorder, task: Mapping[str, str], *records: logs.Record
    ) -> None:
        """Write the beginning of a recording. The writing thread makes it, which takes long."""
        now, early = self._clock.now(), [*self._early_lines()]
        recorder.put_made(lambda: [*self._setup(now, task), *early, *records])

    def _setup(self, time: float, task: Mapping[str, str]) -> list[logs.Item]:
        """Return all items that a recording needs for viewing and verification."""
        urdf, files, notes = self._robot_items
        return [
            *files,
            logs.Description(time, urdf),
            *notes,
            *(
                logs.Attachment(file, "application/yaml", text.encode())
                for file, text in task.items()
            ),
        ]

    @cached_property
    def _robot_meshes(self) -> "RobotMeshes":
        """The meshes of the robot. They are read once."""
        from .archive import archive_meshes  # slow to import

        meshes = archive_meshes(self._robot)
        if meshes.left_out:
            logger.warning("%s", meshes.left_out)
        return meshes

    @cached_property
    def _robot_items(self) -> tuple[str, list[logs.Attachment], list[logs.Note]]:
        """Return the URDF, the robot's files and the notes. They are made once."""
        from .archive import robot_note  # slow to import
        from .versions import versions

        files = self._robot_files
        attached = [logs.Attachment(name, "text/plain", data) for name, data in files.items()]
        notes = [
            logs.Note("robot", robot_note(self._robot, files, self._robot_meshes)),
            logs.Note("configuration", dict(self._configuration)),
            logs.Note("versions", versions()),
        ]
        return files[self._robot.urdf.name].decode(), attached, notes

    def _attach_meshes(self, meshes: Mapping[str, logs.Attachment]) -> None:
        if self._recorder:
            for name in sorted(meshes.keys() - self._meshes):
                self._recorder.put(meshes[name])
                self._meshes.add(name)

    def _create(self, task: int | str) -> logs.Recorder:
        stamp = utc_ns(self._clock)
        while True:
            path = logs.recording_path(self._folder, stamp, task)
            try:
                return logs.Recorder(path, self._clock.epoch_ns(), partial(self._give_up, path))
            except logs.RecordingExists:
                stamp += 1_000_000

    def _give_up(self, path: Path, cause: Exception) -> None:
        full = isinstance(cause, OSError) and cause.errno == errno.ENOSPC
        self._failed(logs.DiskFull(path) if full else logs.RecordingIncomplete(path, None, cause))

"""The executor thread: the only thread that builds, ticks, stops and discards trees."""

import dataclasses
import logging
import uuid
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from threading import Lock, Thread

import logs
from executive.errors import GoalError
from executive.recording.recordings import Recordings
from hardware import ActivationStopped, HardwareError, NotActive, State
from skills import Context, SkillError
from skills.motion import MotionError
from trees import FileError, Located, TaskFile, TaskLibrary, TreeError, UnknownTask
from trees.build import Tree, build
from trees.compile.arguments import located
from trees.errors import BadArguments

from .breakpoints import Breakpoints
from .goal import Goal
from .mailbox import Mailbox
from .queue import GoalQueue
from .run_loop import Run, decide_outcome
from .start_pose import StartPose
from .stop import GoalStopper

logger = logging.getLogger(__name__)

_KNOWN = (HardwareError, SkillError, MotionError, TreeError, GoalError, logs.LogError)


@dataclass
class _Attempt:
    """The execution of a goal.

    Attributes:
        goal: The goal.
        task: Its task file; None if it cannot be read.
        tree: Its tree; None if it could not be built.
        error: First error outside the tree, or None.
        node: Path of the skill that moved the arm when the arm failed; else empty.
        warning: Warning about the task files; empty for none.
    """

    goal: Goal
    task: TaskFile | None = None
    tree: Tree | None = None
    error: Exception | None = None
    node: str = ""
    warning: str = ""


class GoalExecutor:
    """Executes goals, one after the other, on its own thread.

    Args:
        queue: Queue of goals.
        stopper: Ends goals.
        library: The tasks.
        recordings: Receives every record.
        context: Context of skills, without the parts that depend on the run.
        breakpoints: Paths of the nodes with a breakpoint; may change at any time.
        start_pose: Finds the start pose of an activation.
        single_user: True if goals activate the arm.
    """

    def __init__(
        self,
        queue: GoalQueue,
        stopper: GoalStopper,
        library: TaskLibrary,
        recordings: Recordings,
        context: Context,
        breakpoints: set[str],
        start_pose: StartPose,
        single_user: bool,
    ) -> None:
        self._queue, self._stopper = queue, stopper
        self._library, self._recordings, self._context = library, recordings, context
        self._arm, self._pool, self._clock = context.arm, context.pool, context.clock
        self._breakpoints, self._start_pose = breakpoints, start_pose
        self._single_user = single_user
        self._blackboard = Lock()  # py_trees has one blackboard for all trees, without a lock
        self._thread: Thread | None = None
        self._ended = False

    def start(self) -> None:
        """Start the thread."""
        if not self._single_user:
            self._pool.start()
        self._thread = self._clock.spawn(self._execute_all, "executor")

    def join(self) -> None:
        """Wait until the last goal has ended. Call this after the queue is closed."""
        if self._thread is None:
            return
        with self._queue.signal:
            while not (self._ended or self._queue.blocked):
                self._queue.signal.wait(None)
        if self._ended:
            self._thread.join()

    def validate(self, task: int, arguments: Mapping[str, str | Located]) -> Exception | None:
        """Validate a goal, without the checks that need the arm. Thread-safe.

        Returns:
            The error, or None.
        """
        identity = uuid.uuid4().hex  # so that this tree shares no keys with the tree of a goal
        attempt = _Attempt(Goal(identity, task, arguments, 0.0, 0, Mailbox(self._clock)))
        self._try(attempt, self._build)
        self._discard(attempt)
        return attempt.error

    def validate_request(
        self, task: int, arguments: Mapping[str, str | Located]
    ) -> Exception | None:
        """Validate the task number, its files and the arguments of a goal. Any thread may call.

        Returns:
            The error, or None. Other errors become the recorded outcome of the goal.
        """
        if self._queue.blocked:
            return None  # the queue refuses the goal, and validation might also block
        error = self.validate(task, arguments)
        return error if isinstance(error, (UnknownTask, BadArguments, FileError)) else None

    def _execute_all(self) -> None:
        try:
            while goal := self._queue.take():
                self._execute(_Attempt(goal))
        except BaseException:
            logger.critical("a bug in armtree: no goal is executed any more", exc_info=True)
            self._queue.close()
            self._arm.stop()
        with self._queue.signal:
            self._ended = True
            self._queue.signal.notify()

    def _execute(self, attempt: _Attempt) -> None:
        goal = attempt.goal
        with self._stopper.skill_code(goal):
            self._try(attempt, self._build)
        if goal.outcome is None:  # else the build took too long, and the goal was aborted
            self._try(attempt, self._open)
            if attempt.error is None:
                self._try(attempt, self._run)
        end = decide_outcome(attempt.tree, attempt.error, goal.mailbox.canceled, attempt.node)
        self._stopper.end(goal, *end)
        if not self._single_user:
            self._recordings.goal_ended()
        self._discard(attempt)

    def _try(self, attempt: _Attempt, step: Callable[[_Attempt], None]) -> None:
        """Run a step, and keep the first error."""
        try:
            step(attempt)
        except _KNOWN as error:
            if attempt.error:
                logger.error("%s", error)
            # The goal and the arm keep the error. Its traceback would keep the tree in memory.
            attempt.error = attempt.error or error.with_traceback(None)
        except Exception as error:  # also a bug must end the goal
            logger.exception("a bug in armtree")
            attempt.error = attempt.error or error.with_traceback(None)

    def _build(self, attempt: _Attempt) -> None:
        """Validate a goal and build its tree, without the arm."""
        goal = attempt.goal
        if goal.text:
            from .moves.move_task import draft_move  # tasks do not need it

            library, draft = self._library.latest, draft_move(goal.text)
        else:
            library, attempt.warning = self._library.for_task(goal.task)
            draft = library.draft(goal.task)
        attempt.task = draft[0]
        mailbox, breakpoints = goal.mailbox, Breakpoints(self._breakpoints, goal.mailbox)
        context = dataclasses.replace(
            self._context,
            wake=mailbox.wake,
            wake_at=mailbox.wake_at,
            paused_time=lambda: mailbox.paused_time,
            at_breakpoint=breakpoints.hold,
        )
        namespace = f"run_{goal.identity}"
        arguments = located(goal.arguments)
        with self._blackboard:
            attempt.tree = build(
                draft, library, context, namespace, arguments, in_file=not goal.text
            )
        breakpoints.use(attempt.tree)

    def _open(self, attempt: _Attempt) -> None:
        """Open the recording of a goal, if the disk has space for it."""
        self._recordings.check_space()
        goal, name = attempt.goal, ""
        if attempt.task:
            name = attempt.task.description if goal.text else attempt.task.name
        start: dict[str, float] = {}
        with suppress(NotActive):
            start = self._context.robot.by_joint(self._arm.commanded)
        # The error of a refused tree also has its files.
        files = attempt.tree.files if attempt.tree else getattr(attempt.error, "files", {})
        self._recordings.open(goal.status, name, self._context.seed, files, start)
        # Log when the recording is open, so that these lines follow its first event.
        sender = f" from {goal.client}" if goal.client else ""
        logger.info("Executing the goal for %s (%s)%s", *goal.name, sender)
        if attempt.warning:
            logger.warning("%s", attempt.warning)

    def _run(self, attempt: _Attempt) -> None:
        assert attempt.tree
        self._prepare_arm(attempt.goal)
        record = self._recordings.record
        run = Run(attempt.goal, attempt.tree, self._arm, self._stopper, self._clock, record)
        try:
            run.execute()
        except HardwareError:
            attempt.node = run.moving
            raise
        except _KNOWN:
            raise
        except Exception:
            self._arm.stop()
            raise

    def _prepare_arm(self, goal: Goal) -> None:
        """Check that the arm is active. For a single user, activate it."""
        if goal.mailbox.canceled:
            raise ActivationStopped("canceled before the arm moved")
        if self._single_user:
            self._activate()
        self._arm.check_active()  # before the next check: it finds a fault that is being reported
        if goal.mailbox.fault:
            raise goal.mailbox.fault

    def _activate(self) -> None:
        if self._arm.failure:  # only a person can leave the error state
            raise self._arm.failure.with_traceback(None)
        if self._arm.state is State.UNCONFIGURED:
            self._arm.configure()
        if self._arm.state is State.INACTIVE:
            lost = list[logs.LogError]()

            def prepare() -> None:
                """Load the planners, and wait for the recording, while the board boots."""
                self._pool.start()
                try:
                    self._recordings.flush()
                except logs.LogError as error:
                    lost.append(error)
                    self._arm.stop()  # without a recording, no command is sent

            try:
                self._start_pose.activate(self._arm, prepare)
            except ActivationStopped:
                if lost:
                    raise lost[0] from None
                raise

    def _discard(self, attempt: _Attempt) -> None:
        if attempt.tree:
            with self._blackboard:
                attempt.tree.discard()

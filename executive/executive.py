"""The task executive: goals in, outcomes out."""

import dataclasses
import logging
import uuid
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType

import logs
from hardware import (
    ActivationStopped,
    Arm,
    ArmEvent,
    Clock,
    Faulted,
    HardwareError,
    Link,
    Robot,
    State,
)
from skills import Context, NoOperator, Operator, SkillError
from skills.motion import MotionError, Pool
from trees import Library, Located, TaskFile, TreeError

from .building.builder import Tree, build
from .goal import Goal, GoalState, Outcome
from .recording.recorded_link import RecordedLink
from .recording.recordings import Recordings
from .run import Mailbox, Run
from .verdict import judge

logger = logging.getLogger(__name__)

_OURS = (HardwareError, SkillError, MotionError, TreeError, logs.LogError)


@dataclasses.dataclass
class _Attempt:
    """A goal on its way.

    Attributes:
        goal: Which.
        task: Its file; None where there is none that can be read.
        tree: What to run; None where it could not be built.
        error: What failed outside the tree.
    """

    goal: Goal
    task: TaskFile | None = None
    tree: Tree | None = None
    error: Exception | None = None


class Executive:
    """Runs tasks on an arm, one after the other.

    Args:
        robot: The robot.
        link: The line to its board; None where nobody said which port.
        library: The tasks there are.
        pool: The planners.
        recordings: Folder for recordings.
        clock: Whose time.
        seed: For whatever draws at random.
        timeout: How long a planner may take [s].
        watch: Told of everything that is recorded; must be quick, from any thread.
        operator: Who answers what tasks ask.
    """

    def __init__(
        self,
        robot: Robot,
        link: Link | None,
        library: Library,
        pool: Pool,
        recordings: Path,
        clock: Clock,
        seed: int,
        timeout: float,
        watch: Callable[[logs.Record], None],
        operator: Operator | None = None,
    ) -> None:
        self._library, self._pool, self._clock = library, pool, clock
        self._mailbox = mailbox = Mailbox(clock)
        self._recordings = Recordings(recordings, robot, clock, watch, mailbox.fail)
        recorded = RecordedLink(link, self._recordings, clock) if link else None
        self._arm = Arm(robot, recorded, clock, self._arm_did)
        self._context = Context(
            robot,
            self._arm,
            pool,
            seed,
            timeout,
            mailbox.wake,
            self._recordings.skill_did,
            clock,
            mailbox.wake_at,
            operator=operator or NoOperator(),
        )

    def cancel(self) -> None:
        """Cancel what runs and what still waits; the arm stops. May be called from any thread."""
        self._mailbox.cancel()
        self._arm.stop()

    def tell(self, record: logs.Record) -> None:
        """Record something from outside, such as a line of the log."""
        self._recordings.tell(record)

    def run(
        self,
        tasks: Sequence[int],
        report: Callable[[Outcome], None],
        arguments: Mapping[str, Located] = MappingProxyType({}),
    ) -> list[Outcome]:
        """Run tasks in turn, up to the first that is not done.

        What can be judged without the arm is judged for all of them before it is activated.

        Args:
            tasks: Their numbers.
            report: Told of every outcome as soon as its recording is closed.
            arguments: Values of the tasks' parameters, by name.

        Returns:
            The outcomes of those that were begun or refused.
        """
        attempts = [_Attempt(self._goal(number)) for number in tasks]
        try:
            for attempt in attempts:
                if not self._build(attempt, arguments):
                    return [self._refuse(attempt, report)]
            self._pool.start()
            with self._arm:
                return self._run_all(attempts, report)
        finally:
            for attempt in attempts:
                if attempt.tree:
                    attempt.tree.discard()

    def _goal(self, number: int) -> Goal:
        return Goal(number, uuid.uuid4().hex, self._clock.now())

    def _build(self, attempt: _Attempt, arguments: Mapping[str, Located]) -> bool:
        """Judge a goal as far as that goes without the arm."""
        goal = attempt.goal
        try:
            draft = self._library.draft(goal.task)
            attempt.task = draft[0]
            namespace = f"run_{goal.identity}"
            attempt.tree = build(draft, self._library, self._context, namespace, arguments)
        except _OURS as error:
            attempt.error = error
        return attempt.error is None

    def _refuse(self, attempt: _Attempt, report: Callable[[Outcome], None]) -> Outcome:
        try:
            self._open(attempt)
        except logs.LogError as error:
            logger.error("%s", error)
        return self._end(attempt, report)

    def _run_all(
        self, attempts: list[_Attempt], report: Callable[[Outcome], None]
    ) -> list[Outcome]:
        outcomes: list[Outcome] = []
        for attempt in attempts:
            done = self._run(attempt)
            if not done or attempt is attempts[-1]:
                self._arm.shutdown()  # before its recording closes, so that it is in it
            outcomes.append(self._end(attempt, report))
            if not outcomes[-1].success:
                break
        return outcomes

    def _run(self, attempt: _Attempt) -> bool:
        """Run a goal; false when it was not done."""
        assert attempt.tree
        attempt.goal.accepted = self._clock.now()
        run = Run(
            attempt.goal, attempt.tree, self._arm, self._clock, self._mailbox, self._recordings.tell
        )
        try:
            self._open(attempt)
            self._activate()
            return run.execute()
        except _OURS as error:
            attempt.error = error
        except Exception as error:
            # The outermost place of this thread: a bug, too, must stop the arm and end the goal.
            logger.exception("a bug of ours")
            self._arm.stop()
            attempt.error = error
        return False

    def _open(self, attempt: _Attempt) -> None:
        name = attempt.task.name if attempt.task else ""
        self._recordings.open(attempt.goal, name, self._context.seed, attempt.tree)

    def _activate(self) -> None:
        if self._mailbox.fault:  # coming back from a fault is a person's act
            raise self._mailbox.fault
        if self._mailbox.canceled:
            raise ActivationStopped("canceled before the arm was activated")
        self._recordings.check_space()
        if self._arm.state is State.UNCONFIGURED:
            self._arm.configure()
        if self._arm.state is State.INACTIVE:
            self._arm.activate()

    def _end(self, attempt: _Attempt, report: Callable[[Outcome], None]) -> Outcome:
        """Judge a goal, record its outcome and close its recording."""
        goal, recordings, now = attempt.goal, self._recordings, self._clock.now()
        state, code, message = judge(attempt.tree, attempt.error, self._mailbox.canceled)
        if goal.state is GoalState.ACCEPTED:
            goal.enter(GoalState.CANCELING if state is GoalState.CANCELED else GoalState.EXECUTING)
        goal.enter(state)
        outcome = Outcome(
            task=goal.task,
            state=state,
            code=code,
            message=message,
            frames=recordings.frames,
            duration=now - goal.accepted,
            recording=recordings.path,
        )
        recordings.tell(_result(goal, outcome, now))
        try:
            recordings.close()
        except logs.LogError as error:
            if outcome.success:
                outcome = dataclasses.replace(outcome, code=error.code, message=str(error))
        report(outcome)
        return outcome

    def _arm_did(self, event: ArmEvent) -> None:
        self._recordings.arm_did(event)
        if isinstance(event, Faulted):
            self._mailbox.fail(event.error)


def _result(goal: Goal, outcome: Outcome, now: float) -> logs.Result:
    return logs.Result(
        time=now,
        goal_id=goal.identity,
        task=goal.task,
        state=outcome.state.name,
        success=outcome.success,
        code=outcome.code,
        message=outcome.message,
        frames=outcome.frames,
        duration=outcome.duration,
    )

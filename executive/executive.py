"""The task executive: goals in, outcomes out. Whoever sends goals, by whatever way, uses this."""

import logging
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType

import logs
from hardware import (
    TRANSITIONS,
    Arm,
    ArmEvent,
    Clock,
    Faulted,
    FrameSent,
    Link,
    NotActive,
    Robot,
    State,
    StateChanged,
    TransitionRefused,
)
from skills import Context, NoOperator, Operator
from skills.motion import Pool
from trees import Library, Located
from trees.live_library import LiveLibrary

from .errors import NotExecuting, NotPaused, TooManyBreakpoints
from .goals.events import Event, EventSubscribers, Status
from .goals.executor import GoalExecutor
from .goals.goal import Goal
from .goals.history import load_goal_history
from .goals.mailbox import Mailbox
from .goals.outcome import Acceptance, CancelResult, GoalState, GoalStatus, Outcome, cause_of
from .goals.queue import GoalQueue, Policy
from .goals.start_pose import StartPose
from .recording.archive import configuration_note
from .recording.recorded_link import RecordedLink
from .recording.recordings import Recordings
from .setup import Setup

logger = logging.getLogger(__name__)

BREAKPOINTS = 100  # so many may be marked


class Executive:
    """Runs tasks on an arm. Any thread may call; one thread of its own executes.

    Args:
        setup: What it was started with.
        robot: The robot.
        link: Link to the board, or None if no port is configured.
        library: The tasks.
        pool: The planners.
        clock: Time source.
        operator: Answers the questions of tasks; default: none does.
        subscriber: First callback for every event, as by `subscribe`.

    Attributes:
        setup, robot, library, clock: The same.
        port: Name of the port; empty for none.
    """

    def __init__(
        self,
        setup: Setup,
        robot: Robot,
        link: Link | None,
        library: Library | LiveLibrary,
        pool: Pool,
        clock: Clock,
        operator: Operator | None = None,
        subscriber: Callable[[Event], None] | None = None,
    ) -> None:
        self.setup, self.robot, self.library, self.clock = setup, robot, library, clock
        self.port, self._began = link.port if link else "", clock.now()
        self._subscribers = EventSubscribers()
        if subscriber:
            self._subscribers.add(subscriber)
        self._progress: logs.Feedback | None = None
        self._start_pose = StartPose(robot, self.port, setup.recordings, setup.pose)
        self._marked = set[str]()
        noted = configuration_note(self.port, setup)
        self._recordings = Recordings(
            setup.recordings, robot, clock, self._publish, self._fail, noted
        )
        recorded = RecordedLink(link, self._recordings, clock) if link else None
        self._arm = arm = Arm(robot, recorded, clock, self._arm_did)
        self._queue = GoalQueue(clock, setup.policy, setup.result_timeout, self._goal_changed)
        context = Context(
            robot,
            arm,
            pool,
            setup.seed,
            setup.planning_timeout,
            wake=_nobody,
            publish=self._recordings.on_skill_event,
            clock=clock,
            wake_at=_nobody,
            operator=operator or NoOperator(),
        )
        self._executor = GoalExecutor(
            self._queue,
            arm,
            library,
            pool,
            self._recordings,
            context,
            clock,
            self._marked,
            self._start_pose,
            setup.single_user,
        )

    def start(self) -> None:
        """Begin to execute goals. A server knows those of another one before it.

        Raises:
            LogError: A server's recording cannot be made.
        """
        if not self.setup.single_user:
            utc = self.clock.epoch_ns() / 1e9 + self.clock.now()
            for goal in load_goal_history(self.setup.recordings, utc - self._queue.keep):
                self._queue.add_ended(*goal)
            self._recordings.open_server_recording()
        self._executor.start()

    def refused(self, tasks: Sequence[int], arguments: Mapping[str, str | Located]) -> int | None:
        """The first task of which it can be said without the arm that it will not be done.

        Only before `start`.
        """
        return next((task for task in tasks if self._executor.judge(task, arguments)), None)

    def close(self) -> None:
        """Take no more goals, cancel those there are, wait for them, and shut the arm down.

        Raises:
            LogError: A recording could not be finished.
        """
        self._queue.close()
        *_, running = self._queue.cancel("", 0)
        self._stop_for(running)
        self._executor.join()
        try:
            if self._arm.state is not State.UNCONFIGURED:
                self._arm.shutdown()
        finally:
            self._recordings.close()

    def send(
        self,
        task: int,
        arguments: Mapping[str, str | Located] = MappingProxyType({}),
        identity: str = "",
        strict: bool = False,
    ) -> Acceptance:
        """Send a goal. Returns at once.

        Args:
            task: Number of the task.
            arguments: Values of its parameters, by name; a text is read as it would be in a file.
            identity: 32 hexadecimal digits, made here where there are none.
            strict: Whether it is refused, not aborted, where it is asked for wrongly.
        """
        preempts = self._queue.policy is Policy.PREEMPT
        judge = self._executor.judge if preempts else self._executor.judge_request
        wrong = judge(task, arguments) if preempts or strict else None
        acceptance, preempted = self._queue.send(task, arguments, identity, wrong)
        self._stop_for(preempted)
        did = "accepted" if acceptance.accepted else f"refused: {acceptance.message}"
        logger.info("Received a goal for task %d (%s): %s", task, acceptance.identity, did)
        return acceptance

    def send_and_record(
        self, task: int, arguments: Mapping[str, str | Located], identity: str
    ) -> Acceptance:
        """Send a goal, strictly; return once a server started after this one would know of it."""
        acceptance = self.send(task, arguments, identity, strict=True)
        self._recordings.wait()
        return acceptance

    def cancel(self, identity: str = "", stamp_ns: int = 0) -> CancelResult:
        """Cancel goals, and stop the arm if it moves for one of them. Returns at once.

        Args:
            identity: Which; empty to name none.
            stamp_ns: All that were accepted up to then, UTC [ns since 1970]; 0 to name none. All
                there are where neither is named; then the arm is stopped in any case.
        """
        answer, canceled, running = self._queue.cancel(identity, stamp_ns)
        if not (identity or stamp_ns or running):
            self._arm.stop()
        self._stop_for(running, canceled)
        return answer

    def result(self, identity: str, timeout: float | None = None) -> Outcome:
        """Wait for the outcome of a goal; any number may wait, also after its end.

        Args:
            identity: Which.
            timeout: How long at most [s]; None for as long as it takes.

        Raises:
            UnknownGoal: There is none, or it is forgotten.
            ResultTimeout: It has not ended in that time.
        """
        return self._queue.result(identity, timeout)

    def on_result(self, identity: str, callback: Callable[[Outcome], None]) -> None:
        """Have the outcome of a goal told once, from any thread; at once if it has ended.

        Raises:
            UnknownGoal: There is none, or it is forgotten.
        """
        self._queue.on_result(identity, callback)

    def goal(self, identity: str) -> GoalStatus:
        """What a goal is at.

        Raises:
            UnknownGoal: There is none, or it is forgotten.
        """
        return self._queue.find(identity).status

    def goals(self, newest: int | None = None) -> tuple[GoalStatus, ...]:
        """All goals that are known, or the newest of them; ended ones until they are forgotten."""
        return self._queue.all(newest)

    def pause(self, identity: str) -> None:
        """Stop the arm where a goal has brought it, and keep the goal. Time-outs stand still too.

        Raises:
            UnknownGoal: There is none, or it is forgotten.
            NotExecuting: It is not executing.
        """
        self._executing(identity).pause()

    def resume(self, identity: str) -> None:
        """Go on with a paused goal: what is left of its motion is timed anew from standstill.

        Raises:
            UnknownGoal: There is none, or it is forgotten.
            NotExecuting: It is not executing.
            NotPaused: It is not paused.
        """
        if not self._executing(identity).resume():
            raise NotPaused(identity)

    def step(self, identity: str) -> None:
        """Go on with a paused goal up to the next skill that begins, and pause before it.

        Raises:
            UnknownGoal: There is none, or it is forgotten.
            NotExecuting: It is not executing.
            NotPaused: It is not paused.
        """
        if not self._executing(identity).resume(step=True):
            raise NotPaused(identity)

    def break_at(self, path: str, on: bool = True) -> None:
        """Have every goal pause before a node begins; a condition is never waited for.

        Args:
            path: Of the node in its tree, such as `pick/Execute`.
            on: False to have it no longer.

        Raises:
            TooManyBreakpoints: There are as many as there may be.
        """
        if not on:
            self._marked.discard(path)
        elif len(self._marked | {path}) > BREAKPOINTS:
            raise TooManyBreakpoints(BREAKPOINTS)
        else:
            self._marked.add(path)

    def arm_to(self, transition: str, pose: str | None = None) -> State:
        """Take the arm through a transition, to its end; gives where it stands then.

        Args:
            transition: configure, activate, deactivate, cleanup or shutdown.
            pose: Confirmed start pose of an activation, `boot` or `last`; see `find_start_pose`.

        Raises:
            HardwareError: It did not succeed, or is not legal now.
            LogError: There is no room for a recording, so the arm is not activated.
        """
        if transition not in TRANSITIONS:
            known = ", ".join(TRANSITIONS)
            raise TransitionRefused(f"there is no transition {transition}; there are {known}")
        if transition == "activate":
            self._recordings.check_space()
            self._recordings.wait()  # the board boots next, and may move the arm
        if transition in ("deactivate", "shutdown") and self._arm.state is State.ACTIVE:
            self._executor.arm_leaves()  # first: the stop that comes with it is not the cause
        if transition == "activate":
            self._start_pose.activate(self._arm, pose)
        else:
            getattr(self._arm, transition)()
        return self._arm.state

    def subscribe(self, callback: Callable[[Event], None]) -> Callable[[], None]:
        """Have everything told that is recorded, and every change of a goal.

        Args:
            callback: Must be quick, and wait for no other thread; called from any. One that raises
                something is told nothing more.

        Returns:
            What ends it.
        """
        return self._subscribers.add(callback)

    def status(self) -> Status:
        """Status of the arm and the goals at this moment."""
        running, failure, progress = self._queue.running, self._arm.failure, self._progress
        if progress and not (running and progress.goal_id == running.identity):
            progress = None
        return Status(
            arm=self._arm.state,
            fault=cause_of(failure) if failure else None,
            port=self.port,
            commanded=self._commanded(),
            goal=running.status if running else None,
            percentage=progress.percentage if progress else None,
            phase=progress.phase if progress else "",
            node=progress.node if progress else "",
            attempt=progress.attempt if progress else 1,
            waiting=self._queue.waiting,
            policy=self._queue.policy,
            paused=running is not None and running.mailbox.paused,
            breakpoints=tuple(sorted(self._marked)),
            uptime=self.clock.now() - self._began,
        )

    def tell(self, record: logs.Record) -> None:
        """Record something from outside, such as a line of the log."""
        self._recordings.record(record)

    def finish_recording(self) -> None:
        """Finish the recording of the last goal.

        Raises:
            LogError: Something is missing from it.
        """
        self._recordings.close()

    def _stop_for(self, running: Goal | None, canceled: Sequence[Goal] = ()) -> None:
        """Stop the arm for a goal that is under way, if there is one; then say what is canceled."""
        try:
            if running:
                self._arm.stop()
            for goal in canceled:
                did = f"a cancel of the goal for task {goal.task} ({goal.identity})"
                logger.info("Received %s", did)
        finally:
            if running:
                self._queue.stopped(running)
                self._executor.stop_in_time(running)

    def _executing(self, identity: str) -> Mailbox:
        goal = self._queue.find(identity)
        if goal.state is not GoalState.EXECUTING:
            raise NotExecuting(identity, goal.state.name)
        return goal.mailbox

    def _commanded(self) -> Mapping[str, float] | None:
        try:
            positions = self._arm.commanded
        except NotActive:
            return None
        return {joint.name: q for joint, q in zip(self.robot.actuated, positions, strict=True)}

    def _arm_did(self, event: ArmEvent) -> None:
        self._recordings.on_arm_event(event)
        match event:
            case FrameSent():
                self._start_pose.note(event.positions)
            case Faulted():
                self._fail(event.error)
            case StateChanged(start=State.ACTIVE, goal=State.DEACTIVATING | State.SHUTTINGDOWN):
                self._executor.arm_leaves()

    def _fail(self, error: Exception) -> None:
        self._executor.interrupt(error)

    def _goal_changed(self, status: GoalStatus) -> None:
        self._recordings.goal_changed(status)
        self._publish(status)

    def _publish(self, event: Event) -> None:
        if isinstance(event, logs.Feedback):
            self._progress = event
        self._subscribers.publish(event)


def _nobody(*_: float) -> None:
    """Wakes nobody."""

"""The task executive: it accepts goals, executes them, and reports their outcomes.

The command line, the server and the Python interface all use this class.
"""

import logging
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from types import MappingProxyType
from typing import TYPE_CHECKING

import logs
from hardware import (
    TRANSITIONS,
    VIRTUAL,
    Ability,
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
    utc_ns,
)
from logs import MOVE, goal_title, unpack
from skills import (
    BadTarget,
    Context,
    Leader,
    NoOperator,
    NullLeader,
    Operator,
    Positions,
    SkillError,
    query_tool_target,
)
from skills.motion import EMPTY, Pool, Unreachable, World
from skills.motion.world import Vector
from trees import Located, TaskLibrary, TreeError
from trees.compile.arguments import located

from .api import Policy
from .api.events import Event, Status, Where
from .api.move import Move
from .api.outcome import Acceptance, CancelResult, GoalState, GoalStatus, Outcome, cause_of
from .errors import (
    GoalUnderWay,
    NotExecuting,
    NotPaused,
    PoseUnconfirmed,
    SentBeforeStop,
    TooManyBreakpoints,
)
from .goals.event_subscribers import EventSubscribers
from .goals.executor import GoalExecutor
from .goals.mailbox import Mailbox
from .goals.queue import GoalQueue
from .goals.start_pose import StartPose
from .goals.stop import GoalStopper
from .recording.recorded_link import RecordedLink
from .recording.recordings import Recordings
from .setup import Setup

if TYPE_CHECKING:
    from .preview.dry_run import DryRun

logger = logging.getLogger(__name__)

BREAKPOINTS = 100  # largest number of breakpoints

_LEAVES = "the arm left *active* before the goal had ended"


class Executive:
    """Executes tasks on an arm. Any thread may call; one executor thread runs the trees.

    Args:
        setup: Settings.
        robot: Description of the robot.
        link: Link to the board, or None if no port is configured.
        library: The tasks.
        pool: The planners.
        clock: Time source.
        operator: Answers the questions of tasks. Default: no operator.
        leader: Hand-guided arm, for tasks that follow it. Default: none.
        world: Bodies around the arm before the first goal.

    Attributes:
        setup, robot, library, clock: The arguments of these names.
        start_pose: Finds the start pose of an activation.
        port: Name of the port; empty if there is no port.
    """

    def __init__(
        self,
        setup: Setup,
        robot: Robot,
        link: Link | None,
        library: TaskLibrary,
        pool: Pool,
        clock: Clock,
        operator: Operator | None = None,
        leader: Leader | None = None,
        world: World = EMPTY,
    ) -> None:
        self.setup, self.robot, self.library, self.clock = setup, robot, library, clock
        self.port, self._started = link.port if link else "", clock.now()
        self._pool, self._subscribers = pool, EventSubscribers()
        self._progress: logs.Feedback | None = None
        self._breakpoints = set[str]()
        self._planned_worlds: tuple[World, ...] = ()  # worlds of the last dry run
        self._recordings = Recordings(
            setup.recordings,
            robot,
            clock,
            self._publish,
            self._interrupt,
            {
                "port": self.port,
                "seed": str(setup.seed),
                "planning_timeout_s": str(setup.planning_timeout),
                "policy": setup.policy.value,
                "solo": str(setup.single_user),
            },
        )
        self.start_pose = StartPose(robot, self.port, setup.recordings, setup.pose)
        if link:
            recorded = RecordedLink(link, self._recordings, clock, setup.recording_timeout)
            self._arm = Arm(robot, recorded, clock, self._arm_changed, recorded.ready)
        else:
            self._arm = Arm(robot, None, clock, self._arm_changed)
        self._queue = GoalQueue(clock, setup.policy, setup.result_timeout, self._goal_changed)
        self._stopper = GoalStopper(self._queue, self._arm, self._recordings, clock)
        self._context = context = Context(
            robot,
            self._arm,
            pool,
            setup.seed,
            setup.planning_timeout,
            wake=_no_run,
            publish=self._recordings.on_skill_event,
            clock=clock,
            wake_at=_no_run,
            operator=operator or NoOperator(),
            leader=leader or NullLeader(),
        )
        context.scene.world = world
        self._executor = GoalExecutor(
            self._queue,
            self._stopper,
            library,
            self._recordings,
            context,
            self._breakpoints,
            self.start_pose,
            setup.single_user,
        )

    def start(self) -> None:
        """Start to execute goals. A server first loads the goals of earlier servers.

        Raises:
            LogError: The recording of the server cannot be created.
        """
        if not self.setup.single_user:
            from .goals.history import load_goal_history  # only a server needs it

            utc = utc_ns(self.clock) / 1e9
            for goal in load_goal_history(self.setup.recordings, utc - self._queue.keep):
                self._queue.add_ended(*goal)
            self._recordings.open_server_recording()
        self._executor.start()

    def find_invalid(
        self, tasks: Sequence[int | Move], arguments: Mapping[str, str | Located]
    ) -> int | None:
        """Return the number of the first task that is not valid as a goal with these arguments.

        Returns None if all are valid. Moves, and checks that need the arm, are skipped. Call this
        only before `start`.
        """
        numbers = (task for task in tasks if not isinstance(task, Move))
        return next((task for task in numbers if self._executor.validate(task, arguments)), None)

    def close(self) -> None:
        """Accept no more goals, cancel all goals, wait for their ends, and shut the arm down.

        Raises:
            LogError: A recording could not be finished.
        """
        self._stopper.close()
        self._executor.join()
        try:
            if self._arm.state is not State.UNCONFIGURED:
                self._arm.shutdown()
        finally:
            self._recordings.close()

    def send(
        self,
        task: int | Move,
        arguments: Mapping[str, str | Located] = MappingProxyType({}),
        identity: str = "",
        strict: bool = False,
        client: str = "",
        stops: int | None = None,
    ) -> Acceptance:
        """Send a goal. Return at once whether it is accepted or refused.

        Args:
            task: Task number, or a move.
            arguments: Values of the task's parameters, by name. Text is read as in a task file.
            identity: 32 hexadecimal digits; empty for a new identity.
            strict: True to refuse a goal for an unknown task, for a task with mistakes in its
                files, or with wrong arguments. If False, such a goal is accepted and aborted. An
                invalid move is always refused.
            client: Name of the sending program, for the recording; empty if unknown.
            stops: Number of stops in the last status that the sender has read. The goal is refused
                if the arm was stopped after that status. None for no such check.
        """
        invalid, text = None, ""
        if isinstance(task, Move):
            invalid, text = self._read_move(task)
            task, arguments = MOVE, {}
        elif self.setup.policy is Policy.PREEMPT:
            invalid = self._executor.validate(task, arguments)
        elif strict:
            invalid = self._executor.validate_request(task, arguments)
        acceptance, preempted = self._queue.send(
            task, arguments, identity, invalid, text, client, stops
        )
        self._stopper.stop(preempted)
        answer = "accepted" if acceptance.accepted else f"refused: {acceptance.message}"
        title = goal_title(task)
        logger.info("Received a goal for %s (%s): %s", title, acceptance.identity, answer)
        return acceptance

    def send_and_record(
        self,
        task: int | Move,
        arguments: Mapping[str, str | Located],
        identity: str,
        client: str = "",
        stops: int | None = None,
    ) -> Acceptance:
        """Call `send` with `strict`, and wait until the accepted goal is recorded.

        A later server then knows the goal.
        """
        acceptance = self.send(task, arguments, identity, True, client, stops)
        self._recordings.wait()
        return acceptance

    def cancel(self, identity: str = "", stamp_ns: int = 0) -> CancelResult:
        """Cancel goals. Stop the arm if the current goal is one of them. Returns at once.

        Without arguments, it cancels all goals and always stops the arm.

        Args:
            identity: Identity of a goal to cancel; empty for none.
            stamp_ns: Cancel all goals accepted up to this time, UTC [ns since 1970]; 0 for none.
        """
        return self._stopper.cancel(identity, stamp_ns)

    def result(self, identity: str, timeout: float | None = None) -> Outcome:
        """Wait for the outcome of a goal and return it. Any number of threads may wait.

        Args:
            identity: Identity of the goal.
            timeout: Longest time to wait [s]; None for no limit.

        Raises:
            UnknownGoal: No goal has that identity, or it is forgotten.
            ResultTimeout: The goal has not ended in time.
        """
        return self._queue.result(identity, timeout)

    def goal(self, identity: str) -> GoalStatus:
        """Return the state of a goal.

        Raises:
            UnknownGoal: No goal has that identity, or it is forgotten.
        """
        return self._queue.find(identity).status

    def goals(self, newest: int | None = None) -> tuple[GoalStatus, ...]:
        """Return all known goals, or only the newest ones, in the order of acceptance."""
        return self._queue.all(newest)

    def pause(self, identity: str) -> None:
        """Stop the arm and keep the goal. The timeouts of its task also pause.

        Raises:
            UnknownGoal: No goal has that identity, or it is forgotten.
            NotExecuting: The goal is not executing.
        """
        self._executing(identity).pause()

    def resume(self, identity: str, step: bool = False) -> None:
        """Resume a paused goal. The rest of its motion is timed again, from standstill.

        Args:
            identity: Identity of the goal.
            step: True to pause again before the next skill starts.

        Raises:
            UnknownGoal: No goal has that identity, or it is forgotten.
            NotExecuting: The goal is not executing.
            NotPaused: The goal is not paused.
        """
        if not self._executing(identity).resume(step):
            raise NotPaused(identity)

    def step(self, identity: str) -> None:
        """Resume a paused goal, and pause it again before the next skill starts.

        Raises the errors of `resume`.
        """
        self.resume(identity, step=True)

    def break_at(self, path: str, on: bool = True) -> None:
        """Set a breakpoint: every goal pauses before the node starts. Conditions do not pause.

        Args:
            path: Path of the node in its tree, as in its events.
            on: False to remove the breakpoint.

        Raises:
            TooManyBreakpoints: The limit is reached.
        """
        if not on:
            self._breakpoints.discard(path)
        elif len(self._breakpoints | {path}) > BREAKPOINTS:
            raise TooManyBreakpoints(BREAKPOINTS)
        else:
            self._breakpoints.add(path)

    def arm_to(self, transition: str, pose: str | None = None, stops: int | None = None) -> State:
        """Request a transition of the arm's lifecycle, and wait for its end.

        Args:
            transition: configure, activate, deactivate, cleanup or shutdown.
            pose: Confirmed start pose of an activation, `boot` or `last`; see `StartPose`.
            stops: Number of stops in the last status that the sender has read. An activation is
                refused if the arm was stopped after that status. None for the current number.

        Returns:
            State of the arm after the transition.

        Raises:
            HardwareError: The transition failed, or is not allowed now.
            LogError: The disk has no room for a recording, so the arm is not activated.
            SentBeforeStop: The arm was stopped after that status, before the activation began.
        """
        if transition not in TRANSITIONS:
            known = ", ".join(TRANSITIONS)
            raise TransitionRefused(f"there is no transition {transition}; give one of {known}")
        if transition == "activate":
            stops = self._queue.stops if stops is None else stops
            self._recordings.check_space()
            self._recordings.wait()  # the board boots next and may move the arm
            if self._queue.stopped_since(stops):
                raise SentBeforeStop
            self.start_pose.activate(self._arm, self._pool.start, pose)
            return self._arm.state
        if transition in ("deactivate", "shutdown") and self._arm.state is State.ACTIVE:
            # Interrupt the goal first; else it would report the stop of the arm as its cause.
            self._interrupt(NotActive(_LEAVES))
        getattr(self._arm, transition)()
        return self._arm.state

    def dry_run(self, task: int, arguments: Mapping[str, str | Located]) -> "DryRun":
        """Check a task and plan its motions from the position of the arm. Nothing moves.

        Args:
            task: Task number.
            arguments: Values of the task's parameters, by name. Text is read as in a task file.

        Raises:
            GoalUnderWay: A goal is under way, so the start pose of the task is unknown.
            TreeError: There is no such task, or its files have mistakes.
        """
        # Imported here, because a run without a dry run then starts sooner.
        from .preview.dry_run import dry_run

        if goal := self._queue.current:
            raise GoalUnderWay(goal.identity)
        library, _ = self.library.for_task(task)
        commanded = self._commanded()
        start = tuple(commanded.values()) if commanded else self.robot.boot_pose
        found = dry_run(self._context, library, task, located(arguments), start)
        self._planned_worlds = found.worlds
        return found

    def world_mesh(self, name: str) -> bytes | None:
        """Return the file of an obstacle's mesh, also from the last dry run; None if unknown.

        Args:
            name: Name of the mesh in the record of a plan.
        """
        from .recording.archive import archive_world  # slow to import

        for world in (self._context.scene.world, *self._planned_worlds):
            if attached := archive_world(world)[1].get(name):
                return unpack(attached)[1]
        return None

    def switch_torque(self, on: bool) -> None:
        """Switch the torque of the servos on or off. Without it, a person can move the arm by hand.

        The arm of a single user is activated first.

        Raises:
            HardwareError: The board cannot switch the torque, the arm is not active, or a joint is
                outside its limits. The torque then stays off.
            LogError: The disk has no room for a recording, so the arm is not activated.
        """
        self.robot.require(Ability.TORQUE)
        if self.setup.single_user:
            if self._arm.state is State.UNCONFIGURED:
                self.arm_to("configure")
            if self._arm.state is State.INACTIVE:
                self.arm_to("activate")
        self._arm.switch_torque(on)

    def subscribe(self, callback: Callable[[Event], None]) -> Callable[[], None]:
        """Subscribe to all events: records, and changes of goals.

        Args:
            callback: Callback for every event, from any thread. It must be quick and must not wait
                for other threads. It is removed if it raises an exception.

        Returns:
            Function that removes the callback.
        """
        return self._subscribers.add(callback)

    def status(self) -> Status:
        """Return the status of the arm and the goals at this moment."""
        goal, failure, progress = self._queue.current, self._arm.failure, self._progress
        if progress and not (goal and progress.goal_id == goal.identity):
            progress = None
        now = self.clock.now()
        return Status(
            arm=self._arm.state,
            fault=cause_of(failure) if failure else None,
            port=self.port,
            commanded=self._commanded(),
            measured=self.where().measured,
            goal=goal.status if goal else None,
            percentage=progress.percentage if progress else None,
            phase=progress.phase if progress else "",
            node=progress.node if progress else "",
            attempt=progress.attempt if progress else 1,
            waiting=self._queue.waiting,
            policy=self.setup.policy,
            paused=goal is not None and goal.mailbox.paused,
            breakpoints=tuple(sorted(self._breakpoints)),
            stops=self._queue.stops,
            uptime=now - self._started,
            time=now,
        )

    def where(self) -> Where:
        """Return the position of the arm."""
        commanded = self._commanded()
        measured = self._arm.measured if commanded else None
        return Where.of(self.robot, self._arm.state, commanded, measured)

    def record(self, record: logs.Record) -> None:
        """Write a record of another component, such as a line of the log, to the recording."""
        self._recordings.record(record)

    def finish_recording(self) -> None:
        """Finish the recording of the last goal.

        Raises:
            LogError: Records are missing from the recording.
        """
        self._recordings.close()

    def _read_move(self, move: Move) -> tuple[Exception | None, str]:
        """Return the error of a move, or None; and the text of the move, empty for an error."""
        from .goals.moves.move_task import move_text, poses_with_home, read_move

        try:
            library = self.library.latest
            poses, words = library.poses()[0], " ".join(move.words)
            if words in library.names() and words not in poses_with_home(self.robot, poses):
                raise BadTarget(f"{words} is a task, not a target; `armtree run {words}` runs it")
            read = read_move(move, self.robot, poses)
            if read.point and (start := self._known_start(move.relative)):
                self._check_reach(read.point, start, move.relative)
            return None, move_text(move, read)
        except (SkillError, TreeError, Unreachable) as error:
            vars(error).update(heading="", hint="")  # the message is complete alone
            return error, ""

    def _known_start(self, relative: bool) -> Mapping[str, float] | None:
        """Return the pose from which a point is checked; None if only the skill can check it.

        A relative point depends on the pose when its motion begins, and an active arm may move
        until then.
        """
        robot, commanded = self.robot, self._commanded()
        if not relative:
            return commanded or robot.by_joint(robot.boot_pose)
        reported = robot.firmware.reports_pose and self.port != VIRTUAL
        if not self.setup.single_user or commanded or reported:
            return None
        with suppress(PoseUnconfirmed):
            return robot.by_joint(self.start_pose.find())
        return None

    def _check_reach(self, point: Vector, start: Mapping[str, float], relative: bool) -> None:
        """Check that the tool can reach a point in an empty world.

        Raises:
            Unreachable: The tool cannot reach the point.
        """
        given = {"point": point, "relative": relative, "start": Positions(start)}
        query = query_tool_target(self.robot, given)
        self._pool.start()  # the planners of a single user may not be started yet
        answer = self._pool.ask(replace(query, timeout=self.setup.planning_timeout))
        if isinstance(answer, Unreachable):
            raise answer

    def _executing(self, identity: str) -> Mailbox:
        goal = self._queue.find(identity)
        if goal.state is not GoalState.EXECUTING:
            raise NotExecuting(identity, goal.state.name)
        return goal.mailbox

    def _commanded(self) -> Mapping[str, float] | None:
        try:
            return self.robot.by_joint(self._arm.commanded)
        except NotActive:
            return None

    def _arm_changed(self, event: ArmEvent) -> None:
        self._recordings.on_arm_event(event)
        match event:
            case FrameSent():
                self.start_pose.note(event.positions)
            case Faulted():
                self._interrupt(event.error)
            case StateChanged(start=State.ACTIVE, goal=State.DEACTIVATING | State.SHUTTINGDOWN):
                self._interrupt(NotActive(_LEAVES))

    def _interrupt(self, error: Exception) -> None:
        self._stopper.interrupt(error)

    def _goal_changed(self, status: GoalStatus) -> None:
        self._recordings.goal_changed(status)
        self._publish(status)

    def _publish(self, event: Event) -> None:
        if isinstance(event, logs.Feedback):
            self._progress = event
        self._subscribers.publish(event)


def _no_run(*_: float) -> None:
    """Do nothing. Each run replaces this function in its own context."""

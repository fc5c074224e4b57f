"""The client for ordinary programs.

`python -m tests.support.generated.sync_client` makes this file from `asynchronous.py`.
"""

import uuid
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, nullcontext, suppress
from functools import partial
from typing import TYPE_CHECKING, Any, Self, TypeVar

from executive.api.events import Event, Status, Where
from executive.api.move import HOME, Move
from executive.api.operations import OPERATIONS
from executive.api.outcome import CancelResult, GoalStatus, Outcome, cause_of
from executive.errors import GoalFailed, Refused, ResultTimeout, ServerUnreachable
from hardware import Clock, RealClock

from . import transport
from .responses import EventReader, ResponseBody
from .values import OpenQuestion, PlannedTask, Task

if TYPE_CHECKING:
    import httpcore

T = TypeVar("T")


class Client:
    """A client of a server. Use it as a context; any thread may call.

    Args:
        url: URL; default ARMTREE_SERVER, then the server on this machine (ARMTREE_TCP_PORT).
        token: Token; default ARMTREE_TOKEN, then the file that the server wrote for this user.
        clock: Time source for the deadlines of answers; default: real time.
        name: Name of the client, in ASCII. Recordings of its goals contain it.

    Every method raises ServerUnreachable if no server answers, WrongAnswer if another program
    answers, and Refused if the server refuses the request.
    """

    def __init__(
        self,
        url: str | None = None,
        token: str | None = None,
        clock: Clock | None = None,
        name: str = "",
    ) -> None:
        from httpcore import ConnectionPool  # slow to import; `--help` does not need it

        from .deadlines import Backend

        self._address = transport.Address.find(url, token, name)
        self.url: str = self._address.url
        backend = Backend((clock or RealClock()).now)
        self._http = ConnectionPool(network_backend=backend, **transport.POOL)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *raised: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the connections. Goals continue."""
        self._http.close()

    def run(self, task: int | str, deadman: bool = False, **arguments: Any) -> Outcome:
        """Run a task and wait for its end.

        Args:
            task: Number or name of the task.
            deadman: True to cancel the goal if this program dies or stops answering.
            arguments: Values of the task's parameters, by name.

        Returns:
            The outcome of a goal that succeeded.

        Raises:
            GoalFailed: The goal did not succeed. `outcome` has the cause.
        """
        return self._run(partial(self.send, task, arguments), deadman)

    def move(
        self,
        *to: str | float,
        relative: bool = False,
        speed: float = 1.0,
        deadman: bool = False,
        **joints: str | float,
    ) -> Outcome:
        """Move, and wait for the end.

        Args:
            to: The target: names of poses, `joint_1=70deg`, `width=20mm` (gripper), or x, y, z
                of the tool [m].
            relative: True if the target is a change: of joints, of x, y, z of the tool, or of its
                orientation, such as `pitch=5deg`.
            speed: Share of the robot's speed, 0.01 to 1.
            deadman: True to cancel the goal if this program dies or stops answering.
            joints: Targets of joints, such as `joint_1="70 deg"`, or a number [rad].

        Returns:
            The outcome of a goal that succeeded.

        Raises:
            GoalFailed: The goal did not succeed. `outcome` has the cause.
        """
        move = Move.of(to, joints, relative, speed)
        return self._run(partial(self.send_move, move), deadman)

    def home(self, speed: float = 1.0) -> Outcome:
        """Move to the home of the robot: the pose `home`, or the home in the robot file."""
        return self.move(HOME, speed=speed)

    def send_move(self, move: Move, goal_id: str = "", deadman: bool = False) -> str:
        """Send a move, without waiting for its end.

        Args:
            move: The move.
            goal_id: 32 hexadecimal digits; empty to let the server choose.
            deadman: True to cancel the goal when its hold ends; see `hold`.

        Returns:
            The id of the goal.
        """
        return self._call(
            "move",
            lambda answer: str(answer["goal_id"]),
            to=move.words,
            relative=move.relative,
            speed=move.speed,
            goal_id=goal_id or None,
            deadman=deadman,
        )

    def send(
        self,
        task: int | str,
        arguments: Mapping[str, Any] | None = None,
        goal_id: str = "",
        deadman: bool = False,
    ) -> str:
        """Send a goal, without waiting for its end.

        Args:
            task: Number or name of the task.
            arguments: Values of the task's parameters, by name.
            goal_id: 32 hexadecimal digits; empty to let the server choose.
            deadman: True to cancel the goal when its hold ends; see `hold`.

        Returns:
            The id of the goal.
        """
        return self._call(
            "send",
            lambda answer: str(answer["goal_id"]),
            task=task,
            arguments=dict(arguments or {}),
            goal_id=goal_id or None,
            deadman=deadman,
        )

    def plan(
        self, task: int | str, arguments: Mapping[str, Any] | None = None, timeout: float = 60.0
    ) -> PlannedTask:
        """Check a task and plan its motions from the position of the arm. Nothing moves.

        Args:
            task: Number or name of the task.
            arguments: Values of the task's parameters, by name.
            timeout: Longest time for planning [s].
        """
        return self._call(
            "plan",
            PlannedTask.from_json,
            extra_time=timeout,
            task=task,
            arguments=dict(arguments or {}),
        )

    def result(self, goal_id: str, timeout: float | None = None) -> Outcome:
        """Wait for the outcome of a goal.

        Args:
            goal_id: Id of the goal.
            timeout: Longest time to wait [s]; None for no limit. Refused is raised afterwards.
        """
        for seconds in transport.poll_times(timeout):
            try:
                return self._call(
                    "result",
                    Outcome.from_json,
                    extra_time=seconds,
                    goal_id=goal_id,
                    timeout=seconds,
                )
            except Refused as error:
                if error.code != ResultTimeout.code:
                    raise
        raise Refused(cause_of(ResultTimeout(goal_id, timeout or 0.0)))

    def goal(self, goal_id: str) -> GoalStatus:
        """Return the state of a goal."""
        return self._call("goal", GoalStatus.from_json, goal_id=goal_id)

    def goals(self) -> tuple[GoalStatus, ...]:
        """Return all known goals. The server forgets ended goals after some time."""

        def to_page(answer: Any) -> tuple[GoalStatus, ...]:
            return tuple(map(GoalStatus.from_json, answer["goals"]))

        found: tuple[GoalStatus, ...] = ()
        while page := self._call("goals", to_page, before=found[0].stamp_ns if found else None):
            found = page + found
        return found

    def cancel(self, goal_id: str = "", stamp_ns: int = 0) -> CancelResult:
        """Cancel one goal, all goals accepted until a time, both, or all goals if neither is given.

        Args:
            goal_id: Id of the goal.
            stamp_ns: Time of acceptance [ns since 1970].
        """
        return self._call(
            "cancel", CancelResult.from_json, goal_id=goal_id or None, stamp_ns=stamp_ns or None
        )

    def stop(self) -> CancelResult:
        """Stop the arm and cancel all goals. This is not an emergency stop."""
        return self._call("stop", CancelResult.from_json)

    def pause(self, goal_id: str) -> GoalStatus:
        """Stop the arm and keep the goal."""
        return self._call("pause", GoalStatus.from_json, goal_id=goal_id)

    def resume(self, goal_id: str) -> GoalStatus:
        """Resume a paused goal."""
        return self._call("resume", GoalStatus.from_json, goal_id=goal_id)

    def step(self, goal_id: str) -> GoalStatus:
        """Resume a paused goal until the next node starts."""
        return self._call("step", GoalStatus.from_json, goal_id=goal_id)

    def break_at(self, node: str, on: bool = True) -> tuple[str, ...]:
        """Set or clear a breakpoint: every goal pauses before that node starts.

        Args:
            node: Path of the node, as in its events.
            on: False to clear the breakpoint.

        Returns:
            The paths of all breakpoints.
        """
        return self._call("break_at", lambda answer: tuple(answer["breakpoints"]), node=node, on=on)

    def questions(self) -> tuple[OpenQuestion, ...]:
        """Return the open questions of tasks."""
        return self._call(
            "questions", lambda answer: tuple(map(OpenQuestion.from_json, answer["questions"]))
        )

    def answer(self, question_id: str, words: str) -> str:
        """Answer a question.

        Args:
            question_id: Id of the question.
            words: One of the choices, or an unambiguous abbreviation.

        Returns:
            The first answer, which counts.
        """
        return self._call(
            "answer", lambda answer: str(answer["answer"]), question_id=question_id, answer=words
        )

    def arm(self, transition: str, pose: str | None = None, stops: int | None = None) -> str:
        """Request a transition of the arm's lifecycle, and wait for its end.

        Activating opens the port, which may reset the board and move the arm.

        Args:
            transition: configure, activate, deactivate, cleanup or shutdown.
            pose: Pose of an arm whose board does not reset: `boot`, or `last` for the last
                commanded pose.
            stops: `Status.stops`, to refuse an activation if the arm was stopped after that status.

        Returns:
            The new state.
        """
        return self._call(
            "arm",
            lambda answer: str(answer["arm"]),
            extra_time=30.0,
            transition=transition,
            pose=pose,
            stops=stops,
        )

    def status(self) -> Status:
        """Return the state of the arm and of the goals."""
        return self._call("status", Status.from_json)

    def page_link(self) -> str:
        """Return a link that opens the page, and signs one browser in."""
        return self._call("link", lambda answer: str(answer["url"]))

    def where(self) -> Where:
        """Return the position of the arm."""
        return self._call("where", Where.from_json)

    def robot(self) -> Mapping[str, Any]:
        """Return the description of the robot, in the form of `GET /api/robot`."""
        return self._call("robot", dict)

    def tasks(self) -> tuple[Task, ...]:
        """Return the tasks of the server."""
        return self._call("tasks", lambda answer: tuple(map(Task.from_json, answer["tasks"])))

    def recordings(
        self, search: str = "", task: int | None = None, state: str = "", limit: int | None = None
    ) -> tuple[Mapping[str, Any], ...]:
        """Return recordings, newest first, in the form of `GET /api/recordings`.

        Args:
            search: Text to find; empty for all recordings.
            task: Number of a task; None for all.
            state: SUCCEEDED, CANCELED, ABORTED or UNFINISHED; empty for all.
            limit: Largest number of recordings; None for the limit of the server.
        """
        return self._call(
            "recordings",
            lambda answer: tuple(answer["recordings"]),
            search=search or None,
            task=task,
            state=state or None,
            limit=limit,
        )

    def recorded_events(self, name: str, at: float = 0.0) -> Mapping[str, Any]:
        """Return the events of a recording around a moment, with the state before them.

        Args:
            name: Name of the recording.
            at: The moment, from the beginning of the goal [s].
        """
        return self._call("recorded_events", dict, extra_time=20.0, name=name, at=at)

    @contextmanager
    def events(self, *kinds: str) -> Iterator[Iterator[Event]]:
        """Watch events. The first events describe the current state.

        Args:
            kinds: Kinds of events, such as `goal`, `node`, `status`; default all.
        """
        operation = OPERATIONS["events"]
        path, query, _ = operation.split({"events": ",".join(kinds) or None})
        timeout = transport.ANSWER_TIMEOUT
        with transport.transport_errors(self.url, timeout):
            request = self._address.request("GET", path, query, timeout=timeout)
            with self._http.stream(**request) as response:
                pieces = response.iter_stream()
                if response.status != operation.status:
                    self._read(response, "events")
                first = next(pieces, b"")  # the server confirms the subscription
                transport.lift_deadline(response)
                yield self._read_events(first, pieces)

    @contextmanager
    def hold(self, goal_id: str) -> Iterator[None]:
        """Hold a goal: the end of this context cancels it. Send the goal within a second.

        The goal is also canceled if this program dies, or if the server cannot reach this machine
        for a second.
        """
        path, _, _ = OPERATIONS["hold"].split({"goal_id": goal_id})

        def post(body: Iterator[bytes]) -> None:
            timeout = transport.ANSWER_TIMEOUT
            with suppress(ServerUnreachable), transport.transport_errors(self.url, timeout):
                request = self._address.request("POST", path) | {"content": body}
                with self._http.stream(**request):
                    return  # the goal has ended, or the server refuses the hold

        with transport.posted(post):
            yield

    def _run(self, send: Callable[..., Any], deadman: bool) -> Outcome:
        """Send a goal, and wait for its end.

        Args:
            send: Sends the goal. It gets the arguments `goal_id` and `deadman`.
            deadman: True to cancel the goal if this program dies or stops answering.

        Raises:
            GoalFailed: The goal did not succeed. `outcome` has the cause.
        """
        goal_id = uuid.uuid4().hex
        with self.hold(goal_id) if deadman else nullcontext():
            send(goal_id=goal_id, deadman=deadman)
            outcome = self.result(goal_id)
        if not outcome.success:
            raise GoalFailed(outcome)
        return outcome

    def _read_events(self, piece: bytes, more: Iterator[bytes]) -> Iterator[Event]:
        events = EventReader(self.url)
        with transport.transport_errors(self.url, transport.SILENCE_TIMEOUT):
            while piece:
                yield from events.read(piece)
                piece = next(more, b"")

    def _call(
        self, name: str, read: Callable[[Any], T], /, extra_time: float = 0.0, **arguments: Any
    ) -> T:
        """Call an operation.

        Args:
            name: Name of its row in `operations`.
            read: Converts the JSON of the answer.
            extra_time: Time that the answer may take beyond `ANSWER_TIMEOUT` [s].
            arguments: Parameters, and keys of the body. Those that are None are left out.
        """
        operation = OPERATIONS[name]
        path, query, body = operation.split(arguments)
        timeout = transport.ANSWER_TIMEOUT + extra_time
        with transport.transport_errors(self.url, timeout, operation.method == "GET"):
            request = self._address.request(operation.method, path, query, body, timeout)
            with self._http.stream(**request) as response:
                return read(self._read(response, name))

    def _read(self, response: "httpcore.Response", name: str) -> Any:
        """Return the JSON of an answer.

        Args:
            response: The answer.
            name: Name of the operation.
        """
        body = ResponseBody(self.url, response.status)
        for piece in response.iter_stream():
            body.add(piece)
        return body.value(name)

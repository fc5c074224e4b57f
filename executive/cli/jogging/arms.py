"""Arms that a jog moves: an arm of this command, and the arm of a server."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

from executive.api.events import EVENTS, STATUS, Event, Where
from executive.api.move import Move
from executive.api.outcome import Cause, GoalState, GoalStatus, Outcome
from executive.cli.support.run_tasks import without_server
from executive.client.synchronous import Client
from executive.errors import Refused, ServerUnreachable
from executive.executive import Executive
from executive.task_runner import TaskRunner
from hardware import NotActive
from logs import MOVE, Measured, Sent, Transition

# Events after which the arm has moved or changed its state. A GoalStatus is one of them: the last
# setpoints of a motion may move the arm without a new frame.
_CHANGES = (Sent, Transition, GoalStatus)
_KINDS = (STATUS, EVENTS[Sent], EVENTS[Transition])


class OwnArm:
    """An arm that this command drives itself, without a server.

    Attributes:
        by_hand: True while the servos of the arm have no torque.
    """

    def __init__(self, executive: Executive) -> None:
        self._executive, self._runner, self.by_hand = executive, TaskRunner(executive), False
        self._path: list[Mapping[str, float]] | None = None

    def move(self, move: Move, accepted: Callable[[], None]) -> Outcome:
        """Execute a move, and return its outcome when it has ended or is refused.

        Args:
            move: The move.
            accepted: Callback that is called when the move is accepted. `stop` then stops the move.
        """
        return without_server(self._runner.run(move, accepted=accepted), "move again")

    def stop(self) -> None:
        """Stop the arm at once."""
        self._executive.cancel()

    def where(self) -> Where:
        """Return the position of the arm. While a person moves the arm, it is the measured one.

        Raises:
            NotActive: The arm failed while a person moved it. Only the first call raises this.
        """
        where = self._executive.where()
        if not self.by_hand:
            return where
        if not where.measured:
            self.by_hand, fault = False, self.fault()
            raise NotActive(f"The arm has no torque: hold it. {fault.message if fault else ''}")
        there = Where.of(self._executive.robot, where.arm, where.measured)
        return replace(there, measured=where.measured)

    def fault(self) -> Cause | None:
        """Return the fault that took the arm out of *active*; None after the next activation."""
        return self._executive.status().fault

    def watch(self, changed: Callable[[], None]) -> None:
        """Call a function after each change of position or state. Returns at once."""

        def note(event: Event) -> None:
            by_hand = self.by_hand and isinstance(event, Measured)
            if by_hand and isinstance(event, Measured) and self._path is not None:
                self._path.append(dict(zip(event.joints, event.position, strict=True)))
            if by_hand or isinstance(event, _CHANGES):
                changed()

        self._executive.subscribe(note)

    def switch_torque(self, on: bool) -> None:
        """Switch the torque of the servos, so that a person may move the arm."""
        self._executive.switch_torque(on)
        self.by_hand, self._path = not on, None

    def start_path(self) -> None:
        """Start a path: store the measured positions from now on."""
        self._path = [self.where().measured or {}]

    def end_path(self) -> Sequence[Mapping[str, float]]:
        """End the path. Return its measured positions by joint [rad or m]; empty without a path."""
        path, self._path = self._path, None
        return path or ()


class ServerArm:
    """The arm of a server. A person cannot move it by hand."""

    by_hand = False

    def __init__(self, client: Client) -> None:
        self._client = client

    def move(self, move: Move, accepted: Callable[[], None]) -> Outcome:
        """Execute a move, and return its outcome, as `OwnArm.move` does."""
        try:
            goal_id = self._client.send_move(move)
        except Refused as error:
            return Outcome.of(MOVE, GoalState.ABORTED, error.cause)
        accepted()
        return self._client.result(goal_id)

    def stop(self) -> None:
        """Stop the arm at once."""
        self._client.stop()

    def where(self) -> Where:
        """Return the position of the arm."""
        return self._client.where()

    def watch(self, changed: Callable[[], None]) -> None:
        """Call a function after each change of position or state.

        Raises:
            ServerUnreachable: The server has ended.
        """
        with self._client.events(*_KINDS) as events:
            for _ in events:
                changed()
        raise ServerUnreachable(self._client.url, "it has ended")


# Any thread may call the methods of both classes.
JogArm = OwnArm | ServerArm

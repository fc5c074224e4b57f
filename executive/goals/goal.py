"""A goal, and the state machine of ROS 2 actions as a table."""

from collections.abc import Mapping
from dataclasses import dataclass

from executive.api.outcome import GoalState, GoalStatus, Outcome
from logs import goal_title
from trees import Located

from .mailbox import Mailbox

_S = GoalState

NEXT = {
    _S.ACCEPTED: (_S.EXECUTING, _S.CANCELING),
    _S.EXECUTING: (_S.CANCELING, _S.SUCCEEDED, _S.ABORTED),
    _S.CANCELING: (_S.SUCCEEDED, _S.CANCELED, _S.ABORTED),
    _S.SUCCEEDED: (),
    _S.CANCELED: (),
    _S.ABORTED: (),
}


@dataclass(eq=False)
class Goal:
    """One goal for one task.

    Attributes:
        identity: 32 hexadecimal digits.
        task: Task number; `MOVE` for a move.
        arguments: Values of the task's parameters, by name.
        accepted: Time of acceptance [s].
        stamp_ns: The same time, UTC [ns since 1970].
        mailbox: Mailbox of the run.
        state: State of the goal.
        outcome: The outcome; None before the end.
        ended: Time of the end [s].
        text: Text of a move; empty for a task.
        client: Name of the program that sent the goal; empty if unknown.
        stops: Number of pending stops of the arm. The goal ends after all of them.
    """

    identity: str
    task: int
    arguments: Mapping[str, str | Located]
    accepted: float
    stamp_ns: int
    mailbox: Mailbox
    text: str = ""
    client: str = ""
    state: GoalState = GoalState.ACCEPTED
    outcome: Outcome | None = None
    ended: float = 0.0
    stops: int = 0

    @property
    def name(self) -> tuple[str, str]:
        """Title and identity, for the log."""
        return goal_title(self.task), self.identity

    @property
    def cancelable(self) -> bool:
        """True if the goal can be canceled. A goal can be canceled only once."""
        return GoalState.CANCELING in NEXT[self.state]

    @property
    def status(self) -> GoalStatus:
        """State of the goal now."""
        return GoalStatus(self.identity, self.task, self.state, self.stamp_ns, self.outcome)

    def enter(self, state: GoalState) -> None:
        """Change the state.

        Raises:
            ValueError: `NEXT` has no such transition.
        """
        if state not in NEXT[self.state]:
            raise ValueError(f"a goal that is {self.state.name} cannot become {state.name}")
        self.state = state

"""Goals and their states: those of ROS 2 actions, as a table."""

from dataclasses import dataclass
from enum import Enum


class GoalState(Enum):
    """States of a goal; the values are ROS 2's numbers."""

    ACCEPTED = 1
    EXECUTING = 2
    CANCELING = 3
    SUCCEEDED = 4
    CANCELED = 5
    ABORTED = 6


_S = GoalState

NEXT = {
    _S.ACCEPTED: (_S.EXECUTING, _S.CANCELING),
    _S.EXECUTING: (_S.CANCELING, _S.SUCCEEDED, _S.ABORTED),
    _S.CANCELING: (_S.SUCCEEDED, _S.CANCELED, _S.ABORTED),
    _S.SUCCEEDED: (),
    _S.CANCELED: (),
    _S.ABORTED: (),
}


@dataclass(frozen=True, slots=True)
class Outcome:
    """How a goal ended.

    Attributes:
        task: Task number.
        state: SUCCEEDED, ABORTED or CANCELED.
        code: Stable name of the cause, `ok` for success.
        message: In words.
        frames: Frames that were sent.
        duration: From acceptance to the end [s].
        recording: The file; empty where none could be made.
    """

    task: int
    state: GoalState
    code: str
    message: str
    frames: int
    duration: float
    recording: str

    @property
    def success(self) -> bool:
        """Whether the task was done."""
        return self.state is GoalState.SUCCEEDED


class Goal:
    """One goal for one task.

    Args:
        task: Task number.
        identity: 32 hexadecimal digits.
        accepted: When it was accepted [s].
    """

    def __init__(self, task: int, identity: str, accepted: float) -> None:
        self.task, self.identity, self.accepted = task, identity, accepted
        self.state = GoalState.ACCEPTED

    def enter(self, state: GoalState) -> None:
        """Take a step in the table.

        Raises:
            ValueError: The table has no such step.
        """
        if state not in NEXT[self.state]:
            raise ValueError(f"a goal that is {self.state.name} cannot become {state.name}")
        self.state = state

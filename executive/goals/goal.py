"""Goals and their states: those of ROS 2 actions, as a table."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import Enum

from trees import Located

from .mailbox import Mailbox


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
class Cause:
    """Why a goal was not done.

    Attributes:
        code: Stable name.
        message: In words.
        node: Path of the node in the tree that it came from; empty where it came from outside.
        joint: Which it concerns; empty where none is known.
        value: What was wrong: a position [rad], a distance [m], or a time [s].
        limit: What it is held against, in the same unit.
        hint: What to do next.
    """

    code: str
    message: str
    node: str = ""
    joint: str = ""
    value: float | None = None
    limit: float | None = None
    hint: str = ""

    def __str__(self) -> str:
        """In words, with the code and the node."""
        return f"{self.message} [{self.code}{f' at {self.node}' if self.node else ''}]"


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
        cause: Why it was not done; None where it was.
    """

    task: int
    state: GoalState
    code: str
    message: str
    frames: int
    duration: float
    recording: str
    cause: Cause | None = None

    @property
    def success(self) -> bool:
        """Whether the task was done."""
        return self.state is GoalState.SUCCEEDED


@dataclass(frozen=True, slots=True)
class GoalStatus:
    """What is known of a goal.

    Attributes:
        identity: 32 hexadecimal digits.
        task: Task number.
        state: Where it stands.
        stamp_ns: When it was accepted, UTC [ns since 1970].
        outcome: How it ended; None until then.
    """

    identity: str
    task: int
    state: GoalState
    stamp_ns: int
    outcome: Outcome | None


@dataclass(frozen=True, slots=True)
class QuestionStatus:
    """What is known of a question that a task puts.

    Attributes:
        time: When this was so [s].
        question_id: 8 hexadecimal digits.
        text: What is asked.
        choices: The answers there are; empty where any words do.
        open: Whether it waits for its answer.
    """

    time: float
    question_id: str
    text: str
    choices: tuple[str, ...]
    open: bool


class Goal:
    """One goal for one task.

    Args:
        identity: 32 hexadecimal digits.
        task: Task number.
        arguments: Values of the task's parameters, by name.
        accepted: When it was accepted [s].
        stamp_ns: The same, UTC [ns since 1970].
        mailbox: Of its run.

    Attributes:
        state: Where it stands.
        outcome: How it ended; None until then.
        ended: When it did [s].
        waiters: To be called with the outcome.
        stops: How many stops of the arm are under way for it, in other threads.
    """

    def __init__(
        self,
        identity: str,
        task: int,
        arguments: Mapping[str, str | Located],
        accepted: float,
        stamp_ns: int,
        mailbox: Mailbox,
    ) -> None:
        self.identity, self.task, self.arguments = identity, task, arguments
        self.accepted, self.stamp_ns, self.mailbox = accepted, stamp_ns, mailbox
        self.state = GoalState.ACCEPTED
        self.outcome: Outcome | None = None
        self.ended = 0.0
        self.waiters: list[Callable[[Outcome], None]] = []
        self.stops = 0

    @property
    def over(self) -> bool:
        """Whether it has reached its last state."""
        return not NEXT[self.state]

    @property
    def cancelable(self) -> bool:
        """Whether it can still be asked to cancel; not twice."""
        return GoalState.CANCELING in NEXT[self.state]

    @property
    def status(self) -> GoalStatus:
        """What is known of it."""
        return GoalStatus(self.identity, self.task, self.state, self.stamp_ns, self.outcome)

    def enter(self, state: GoalState) -> None:
        """Take a step in the table.

        Raises:
            ValueError: The table has no such step.
        """
        if state not in NEXT[self.state]:
            raise ValueError(f"a goal that is {self.state.name} cannot become {state.name}")
        self.state = state

"""What can go wrong with goals.

GoalError
├── UnknownGoal         there is no goal of that name, or it is forgotten
├── ResultTimeout       TimeoutError: the goal has not ended yet
├── NotExecuting        only a goal that is executing can be paused and gone on with
├── NotPaused           only a paused goal can be gone on with
├── TooManyBreakpoints  there are as many as there may be
├── NoSuchNode          no task has a node of that path
├── GoalPreempted       another goal took its place
├── ExecutorBlocked           the code of a skill holds the thread that would execute it
└── ServerRestarted     its server ended before it did

Every error carries a stable `code`, and its message says what to do next.
"""


class GoalError(Exception):
    """Root of everything that is said of goals as such."""

    code = "goal.error"


class UnknownGoal(GoalError):
    """There is no goal of that name, or its result was kept long enough."""

    code = "goal.unknown"

    def __init__(self, identity: str) -> None:
        super().__init__(f"no goal {identity} is known; results are kept for a while only")


class ResultTimeout(GoalError, TimeoutError):
    """The goal has not ended yet."""

    code = "goal.result_timeout"

    def __init__(self, identity: str, timeout: float) -> None:
        super().__init__(f"goal {identity} has not ended within {timeout:g} s; ask again")


class NotExecuting(GoalError):
    """Only a goal that is executing can be paused and gone on with."""

    code = "goal.not_executing"

    def __init__(self, identity: str, state: str) -> None:
        super().__init__(f"goal {identity} is {state}; only one that is EXECUTING can be paused")


class NotPaused(GoalError):
    """Only a paused goal can be gone on with."""

    code = "goal.not_paused"

    def __init__(self, identity: str) -> None:
        super().__init__(f"goal {identity} is not paused; pause it first")


class TooManyBreakpoints(GoalError):
    """There are as many as there may be."""

    code = "goal.too_many_breakpoints"

    def __init__(self, most: int) -> None:
        super().__init__(f"there are {most} breakpoints already; take one away first")


class NoSuchNode(GoalError):
    """No task has a node of that path."""

    code = "goal.no_such_node"


class GoalPreempted(GoalError):
    """Another goal took its place."""

    code = "goal.preempted"

    def __init__(self, identity: str) -> None:
        super().__init__(f"goal {identity} took its place; send it again if it is still wanted")


class ExecutorBlocked(GoalError):
    """The code of a skill does not return, and holds the thread that would execute it.

    Args:
        identity: Of the goal that has ended, but for that.
        task: Which it was for.
        node: Path in its tree; empty where it is not known.
    """

    code = "server.held"

    def __init__(self, identity: str, task: int, node: str) -> None:
        super().__init__(
            f"the code of {node or 'a skill'} of goal {identity} for task {task} does not return, "
            "so no other goal can be executed; start the server again"
        )


class ServerRestarted(GoalError):
    """Its server ended before it did."""

    code = "server.restarted"

    def __init__(self) -> None:
        super().__init__(
            "the server ended before this goal did, and never goes on with one; see where the arm "
            "stands, then send the goal again"
        )


class UnknownQuestion(GoalError):
    """There is no question of that name, or it is answered."""

    code = "goal.unknown_question"

    def __init__(self, identity: str) -> None:
        super().__init__(f"question {identity} is not known, or answered already")


class BadAnswer(GoalError):
    """An answer is none of the choices."""

    code = "goal.bad_answer"

    def __init__(self, words: str, question: str) -> None:
        super().__init__(f"{words.strip() or 'nothing'} is no answer to: {question}")

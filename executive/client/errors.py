"""What the clients raise.

ClientError
├── ServerUnreachable   no server answers
├── Refused             the server refuses a request
└── GoalFailed          a goal was canceled or aborted

Every error carries a stable `code`.
"""

from collections.abc import Mapping
from typing import Any

from executive.goals.outcome import Cause, Outcome


class ClientError(Exception):
    """Root of the errors of a client."""

    code = "server.error"
    exit_status = 13
    meaning = "The server failed"
    hint = "see its log"
    heading = ""


class ServerUnreachable(ClientError, ConnectionError):
    """No server answers, or it stopped answering."""

    code = "server.unreachable"
    meaning = "No server answers"
    hint = "`armtree serve` starts one; --server URL or ARMTREE_SERVER says where it is"

    def __init__(self, url: str, why: str) -> None:
        super().__init__(
            f"no server answers at {url}: {why.rstrip('.')}. Start one with armtree serve, or "
            "set its URL with --server URL or ARMTREE_SERVER"
        )


class Refused(ClientError):
    """The server refuses a request.

    Args:
        fields: The error as JSON.

    Attributes:
        code: Stable name of the cause.
        node: Path of the node that it concerns, or None.
        joint: Name of the joint that it concerns, or None.
        value: The wrong value [rad], [m] or [s].
        limit: Limit of the value, in the same unit.
        hint: What to do about it.
        cause: All of these as one value, as in an outcome.
    """

    def __init__(self, fields: Mapping[str, Any]) -> None:
        self.code = str(fields.get("code") or ClientError.code)
        self.node, self.joint = fields.get("node"), fields.get("joint")
        self.value, self.limit = fields.get("value"), fields.get("limit")
        self.hint = str(fields.get("hint") or "")
        words = str(fields.get("message") or "the server refused, and gave no reason")
        named = str(self.node or ""), str(self.joint or "")
        self.cause = Cause(self.code, words, *named, self.value, self.limit, self.hint)
        adds = self.hint and self.code.startswith("request.")  # other messages contain the hint
        super().__init__(f"{words}; {self.hint}" if adds else words)


class GoalFailed(ClientError):
    """A goal was canceled or aborted.

    Args:
        outcome: Outcome of the goal.
    """

    def __init__(self, outcome: Outcome) -> None:
        self.code, self.outcome = outcome.code, outcome
        super().__init__(f"task {outcome.task} {outcome.state.name}: {outcome.message}")

"""What goes wrong when a server is asked.

ClientError
├── ServerUnreachable   nobody answers, or no longer
├── Refused             the server says no, and why
└── GoalFailed          a goal ended, but was not done

Every error carries a stable `code`.
"""

from collections.abc import Mapping
from typing import Any

from executive.goals.outcome import Cause, Outcome


class ClientError(Exception):
    """Root of all that a client may raise."""

    code = "server.error"
    exit_status = 13
    meaning = "The server failed"
    hint = "see its log"
    heading = ""


class ServerUnreachable(ClientError, ConnectionError):
    """Nobody answers, or no longer."""

    code = "server.unreachable"
    meaning = "No server answers"
    hint = "`armtree serve` starts one; --server URL or ARMTREE_SERVER says where it is"

    def __init__(self, url: str, why: str) -> None:
        super().__init__(
            f"no server answers at {url}: {why.rstrip('.')}. Start one with armtree serve, or say "
            "where it is with --server URL or ARMTREE_SERVER"
        )


class Refused(ClientError):
    """The server says no.

    Args:
        told: The error as it was sent.

    Attributes:
        code: Stable name of the cause.
        node: Of the tree, if one is to blame.
        joint: If one is to blame.
        value: What was asked for.
        limit: What is allowed.
        hint: What to do about it.
        cause: All of that in one, as outcomes have it.
    """

    def __init__(self, told: Mapping[str, Any]) -> None:
        self.code = str(told.get("code") or ClientError.code)
        self.node, self.joint = told.get("node"), told.get("joint")
        self.value, self.limit = told.get("value"), told.get("limit")
        self.hint = str(told.get("hint") or "")
        words = str(told.get("message") or "the server refused, and did not say why")
        named = str(self.node or ""), str(self.joint or "")
        self.cause = Cause(self.code, words, *named, self.value, self.limit, self.hint)
        adds = self.hint and self.code.startswith("request.")  # elsewhere the words say it all
        super().__init__(f"{words}; {self.hint}" if adds else words)


class GoalFailed(ClientError):
    """A goal ended, but was not done.

    Args:
        outcome: How it ended.
    """

    def __init__(self, outcome: Outcome) -> None:
        self.code, self.outcome = outcome.code, outcome
        super().__init__(f"task {outcome.task} {outcome.state.name}: {outcome.message}")

"""What goes wrong between a client and the executive, as one shape.

RequestError               the request itself is at fault
├── BadRequest             400, 422  not understood
├── Forbidden              403       wrong Host or Origin
├── Unauthorized           401       no token, or a wrong one
└── TooMuch                408, 413, 429, 503
"""

import dataclasses
from typing import Any

from executive.goals.causes import cause_of

_LONGEST = 300  # characters of what was wrong, in an answer: a client's own words may be in it


class RequestError(Exception):
    """A request that is refused before the executive hears of it.

    Args:
        message: What is wrong.
        hint: What to do about it.
        status: Of the answer.
        code: Stable name; None for the class's.
    """

    status = 400
    code = "request"

    def __init__(
        self, message: str, hint: str = "", status: int | None = None, code: str | None = None
    ) -> None:
        cut = message if len(message) <= _LONGEST else f"{message[:_LONGEST]} …"
        super().__init__(cut)
        self.hint = hint
        self.status = status or self.status
        self.code = code or self.code


class BadRequest(RequestError):
    """A request that cannot be understood."""

    code = "request.malformed"


class Forbidden(RequestError):
    """A request that came by way of a page or a name that is not ours."""

    status = 403
    code = "request.forbidden"


class Unauthorized(RequestError):
    """A request without the token."""

    status = 401
    code = "request.token"


class TooMuch(RequestError):
    """A request that is too large, too slow, or one too many."""

    status = 429
    code = "request.too_many"


# A code is looked up whole, then by what stands before its dot.
STATUS = {
    "goal": 422,
    "goal.unknown": 404,
    "goal.unknown_task": 404,
    "goal.bad_arguments": 409,  # of the right form, but not what the task takes as it is now
    "goal.unknown_question": 404,
    "goal.duplicate": 409,
    "goal.busy": 409,
    "goal.queue_full": 429,
    "goal.result_timeout": 409,
    "goal.not_executing": 409,
    "goal.not_paused": 409,
    "goal.too_many_breakpoints": 409,
    "goal.no_such_node": 404,
    "goal.not_held": 409,
    "file": 422,
    "hw": 409,
    "log": 409,
    "server": 409,
}


def status_of(code: str) -> int:
    """The HTTP status that goes with a code of the executive."""
    return STATUS.get(code) or STATUS.get(code.partition(".")[0]) or 500


def as_json(error: Exception) -> dict[str, Any]:
    """Any error in the one shape: that of a cause."""
    cause = dataclasses.asdict(cause_of(error))
    hint = getattr(error, "hint", "")
    return cause | {"hint": hint} if hint else cause

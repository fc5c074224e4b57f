"""The HTTP status of each code, and the answer after an error."""

import logging

from starlette.responses import JSONResponse

from executive.api.codes import INTERNAL
from executive.api.outcome import cause_of

logger = logging.getLogger(__name__)

# The whole code is looked up first, then its family: the part before the dot.
HTTP_STATUS = {
    "goal": 422,
    "goal.unknown": 404,
    "goal.unknown_task": 404,
    "goal.bad_arguments": 409,  # well-formed, but not what the task accepts now
    "goal.unknown_question": 404,
    "goal.duplicate": 409,
    "goal.busy": 409,
    "goal.queue_full": 429,
    "goal.result_timeout": 409,
    "goal.not_executing": 409,
    "goal.not_paused": 409,
    "goal.under_way": 409,
    "goal.too_many_breakpoints": 409,
    "goal.no_such_node": 404,
    "goal.not_held": 409,
    "file": 422,
    "file.no_pose": 404,
    "hw": 409,
    "log": 409,
    "server": 409,
}


def http_status(code: str) -> int:
    """Return the HTTP status for a code of the executive."""
    return HTTP_STATUS.get(code) or HTTP_STATUS.get(code.partition(".")[0]) or 500


def failure(error: Exception, path: str) -> JSONResponse:
    """Return the answer to a request for a path that failed, and log a bug."""
    cause = cause_of(error)
    if cause.code == INTERNAL:
        logger.error("Bug in armtree while answering %s", path, exc_info=error)
    return JSONResponse(cause.to_json(), http_status(cause.code))

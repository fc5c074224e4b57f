"""The answer after an error, with the HTTP status of its class."""

import logging

from starlette.responses import JSONResponse

from executive.api.outcome import Cause, cause_of
from executive.code_table import look_up
from hardware import InternalError

logger = logging.getLogger(__name__)


def refusal(cause: Cause) -> JSONResponse:
    """Return the answer to a refused request."""
    return JSONResponse(cause.to_json(), look_up(cause.code).http_status)


def failure(error: Exception, path: str) -> JSONResponse:
    """Return the answer to a request that failed. Log a bug."""
    cause = cause_of(error)
    if cause.code == InternalError.code:
        logger.error("Bug in armtree while answering %s", path, exc_info=error)
    return refusal(cause)

"""A job for the planners, from a skill's side."""

from .base import Context
from .motion import Request, Result


class Pending:
    """A job on its way. A new job is a new object, so a late answer reaches nobody.

    Args:
        context: Whose planners, and whom to wake.
        request: What is asked.

    Attributes:
        answer: What came back, once it is done.
    """

    def __init__(self, context: Context, request: Request) -> None:
        self.done = False
        self.answer: Result = None
        self._wake = context.wake
        self._job = context.pool.submit(request, self._finish)

    def cancel(self) -> None:
        """Ask the worker to give up."""
        self._job.cancel()

    def _finish(self, answer: Result) -> None:
        self.answer, self.done = answer, True
        self._wake()

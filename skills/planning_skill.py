"""A job for the planners, from a skill's side."""

from py_trees.common import Status

from .base import Skill
from .context import Context
from .motion.query import Request, Result


class PlannerJob:
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


class PlanningSkill(Skill, register=False):
    """A skill that asks the planners one thing; subclasses call `ask` and implement `on_answer`."""

    _pending: PlannerJob | None = None

    @property
    def busy(self) -> bool:
        """Whether the planner still works."""
        return self._pending is not None and not self._pending.done

    def ask(self, request: Request) -> Status:
        """Hand a request to a worker."""
        self._pending = PlannerJob(self.context, request)
        return Status.RUNNING

    def on_answer(self, answer: Result) -> Status:
        """Take the answer, or raise it."""
        raise NotImplementedError

    def on_running(self) -> Status:
        """Take the answer when it is there."""
        assert self._pending
        return self.on_answer(self._pending.answer) if self._pending.done else Status.RUNNING

    def on_halt(self) -> None:
        """Cancel the planner."""
        if self._pending:
            self._pending.cancel()

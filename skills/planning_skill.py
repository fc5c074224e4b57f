"""The base class of skills that wait for a planner."""

from py_trees.common import Status

from .base import Skill
from .context import Context
from .motion.query import Request, Result


class PlannerJob:
    """A request that was sent to the planners.

    Args:
        context: Context of the skill.
        request: The request.

    Attributes:
        done: True if the planner has answered.
        answer: The answer, once `done`.
    """

    def __init__(self, context: Context, request: Request) -> None:
        self.done = False
        self.answer: Result = None
        self._wake = context.wake
        self._job = context.pool.submit(request, self._finish)

    def cancel(self) -> None:
        """Cancel the request."""
        self._job.cancel()

    def _finish(self, answer: Result) -> None:
        self.answer, self.done = answer, True
        self._wake()


class PlanningSkill(Skill, register=False):
    """A skill that sends a request to the planners. Subclasses implement `on_answer`."""

    _job: PlannerJob | None = None

    @property
    def busy(self) -> bool:
        """True until the planner has answered."""
        return self._job is not None and not self._job.done

    def request(self, request: Request) -> Status:
        """Send a request to the planners."""
        self._job = PlannerJob(self.context, request)
        return Status.RUNNING

    def on_answer(self, answer: Result) -> Status:
        """Process the answer of the planner. Raise it if it is an error."""
        raise NotImplementedError

    def on_running(self) -> Status:
        """Process the answer when it has arrived."""
        assert self._job
        return self.on_answer(self._job.answer) if self._job.done else Status.RUNNING

    def on_halt(self) -> None:
        """Cancel the request."""
        if self._job:
            self._job.cancel()

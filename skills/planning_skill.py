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
        answer: Answer of the planner; None until `done` is True.
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
    """A skill that sends a request to the planners. A subclass implements `on_answer`."""

    _job: PlannerJob | None = None

    @property
    def busy(self) -> bool:
        """True until the planner has answered."""
        return self._job is not None and not self._job.done

    def request(self, request: Request) -> Status:
        """Send a request to the planners. Return RUNNING."""
        self._job = PlannerJob(self.context, request)
        return Status.RUNNING

    def on_answer(self, answer: Result) -> Status:
        """Process the answer of the planner, and return the new status.

        Args:
            answer: The answer. If it is an error, the method raises it.
        """
        raise NotImplementedError

    def on_running(self) -> Status:
        """Process the answer of the planner when it has arrived."""
        assert self._job
        return self.on_answer(self._job.answer) if self._job.done else Status.RUNNING

    def on_halt(self) -> None:
        """Cancel the request to the planners."""
        if self._job:
            self._job.cancel()

"""Parallels: one that lets all its children end before it judges them, one that takes the first."""

from collections.abc import Iterator

from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.composites import Composite


class Join(Composite):
    """Ticks its children until every one has ended; fails if any of them did.

    py_trees' own Parallel fails with its first child and cuts the others off, so that what they
    would have said is lost.
    """

    def tick(self) -> Iterator[Behaviour]:
        """Tick the children that still run."""
        if self.status is not Status.RUNNING:
            for child in self.children:
                if child.status is not Status.INVALID:
                    child.stop(Status.INVALID)
            self.initialise()
            unfinished = list(self.children)
        else:
            unfinished = [child for child in self.children if child.status is Status.RUNNING]
        for child in unfinished:
            yield from child.tick()
        self.current_child = self.children[-1] if self.children else None
        self.judge({child.status for child in self.children})
        yield self

    def judge(self, statuses: set[Status]) -> None:
        """Take the status that those of the children make."""
        if Status.RUNNING in statuses:
            self.status = Status.RUNNING
        else:
            self.stop(Status.SUCCESS if statuses <= {Status.SUCCESS} else Status.FAILURE)


class Race(Join):
    """Succeeds with the first child that does, and halts the others; fails if all do."""

    def judge(self, statuses: set[Status]) -> None:
        """Take the status that those of the children make."""
        if Status.SUCCESS in statuses:
            for child in self.children:
                if child.status is Status.RUNNING:
                    child.stop(Status.INVALID)
            self.stop(Status.SUCCESS)
        elif Status.RUNNING in statuses:
            self.status = Status.RUNNING
        else:
            self.stop(Status.FAILURE)

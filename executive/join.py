"""A parallel that lets all its children end before it judges them."""

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
        statuses = {child.status for child in self.children}
        if Status.RUNNING in statuses:
            self.status = Status.RUNNING
        else:
            self.stop(Status.SUCCESS if statuses <= {Status.SUCCESS} else Status.FAILURE)
        yield self

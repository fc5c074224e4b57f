"""How far a run is: frames that arrived over frames scheduled."""

from typing import NamedTuple

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from skills import Skill
from trees.compile.builder import Tree
from trees.nodes.control import Repeat, Retry


class Reached(NamedTuple):
    """How far a run is, as it is told.

    Attributes:
        percentage: Of the frames; None while none are scheduled.
        phase: planning, executing, asking, waiting, paused or succeeded.
        node: Name of the skill at work.
        attempt: From 1; a retry begins another one.
    """

    percentage: int | None
    phase: str
    node: str
    attempt: int


class Progress:
    """Follows one tree.

    Args:
        tree: Which.
    """

    def __init__(self, tree: Tree) -> None:
        self._tree = tree
        # Those that measure how far they are, whether or not they have begun.
        self._moving = [s for s in tree.skills if type(s).progress is not Skill.progress]
        retries = (node for node in tree.root.iterate() if isinstance(node, Retry))
        self._failed = dict.fromkeys(retries, 0)  # attempts of each, when it was looked at last
        self._told = Reached(None, "", "", 1)

    def step(self, paused: bool = False) -> Reached | None:
        """How far the tree is now; None where nothing has changed."""
        skills = reversed(self._tree.skills)
        running = next((skill for skill in skills if skill.status is Status.RUNNING), None)
        if running is None and not paused:
            return None
        attempt = self._attempt()
        before = self._told.percentage if attempt == self._told.attempt else None
        percentage = self._percentage(before)
        name = running.name if running else self._tree.root.name
        doing = "paused" if paused else running.doing if running else ""
        phase = doing or ("planning" if percentage is None else "executing")
        return self._tell(Reached(percentage, phase, name, attempt))

    def done(self) -> Reached:
        """What is told of success."""
        return Reached(100, "succeeded", self._tree.root.name, self._told.attempt)

    def _attempt(self) -> int:
        """The number of the attempt; it only grows, also where a loop begins its retries anew."""
        more = 0
        for retry, failed in self._failed.items():
            more += max(0, retry.rounds - failed)
            self._failed[retry] = retry.rounds
        return self._told.attempt + more

    def _tell(self, reached: Reached) -> Reached | None:
        told, self._told = self._told, reached
        return reached if reached != told else None

    def _percentage(self, before: int | None) -> int | None:
        shares = [_share(skill) for skill in self._moving]
        if before is None and all(share is None for share in shares):
            return None
        done = sum(share or 0.0 for share in shares) / len(shares) if shares else 0.0
        # 100 belongs to success alone, and what was reached is not taken back within an attempt.
        return max(before or 0, min(99, int(100 * done)))


def _share(skill: Skill) -> float | None:
    """How much of all that a skill has to do is done, rounds of loops included."""
    share = None if skill.status is Status.INVALID else skill.call_hook("progress")
    node: Behaviour | None = skill.parent
    while node is not None:
        if isinstance(node, (Repeat, Retry)) and node.between_rounds:
            share = None  # what it says is of the round before
        if isinstance(node, Repeat) and node.times and (node.rounds or share is not None):
            share = (node.rounds + (share or 0.0)) / node.times
        node = node.parent
    return share

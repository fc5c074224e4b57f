"""Planned times: durations of the motions of a task, planned as in a run."""

from collections.abc import Callable
from dataclasses import replace

from py_trees.behaviour import Behaviour

from hardware import HardwareError, Robot
from skills.merged_motion import MergedMotion
from skills.motion import Plan, Query, Result
from trees.compile.compiler import CompiledTree
from trees.compile.leaf import Leaf

from .predicted_motion import Motion

_MOST_PLANS = 100  # largest number of plans for one task
_MOST_TIME = 2.0  # longest time for planning of one task [s]


class PlannedTimes:
    """Plans the motions inside the timeouts of a task, up to a number of plans and a time.

    Args:
        tree: The compiled task.
        robot: The robot.
        plan: Callback that plans a motion. It returns a Plan or an error.
    """

    def __init__(self, tree: CompiledTree, robot: Robot, plan: Callable[[Query], Result]) -> None:
        self._robot, self._plan = robot, plan
        self._plans, self._left = _MOST_PLANS, _MOST_TIME
        self._limited = _moving_below_timeouts(tree)

    def __bool__(self) -> bool:
        """Return True if a timeout contains motions."""
        return bool(self._limited)

    def duration(self, leaf: Leaf, motion: Motion) -> float:
        """Return the time until the board has executed a motion [s].

        The result is the least time if no timeout contains the skill, or if the motion cannot be
        planned within the limits of this class.
        """
        least, plans = motion.least_time(self._robot), list[Plan]()
        if leaf.skill not in self._limited or motion.start is None:
            return least
        for query in motion.queries(self._robot, motion.start):
            if not self._plans or self._left <= 0.0:
                return least
            answer = self._plan(replace(query, timeout=self._left))
            if not isinstance(answer, Plan):
                self._left = 0.0  # stop planning, because the next search could take as long
                return least
            self._plans -= 1
            self._left -= sum(answer.milliseconds.values()) / 1000.0
            plans.append(answer)
        together = leaf.known.get("together") is True
        merged = MergedMotion(self._robot, motion.start, plans, together)
        try:
            return max(least, merged.compile().duration)
        except HardwareError:
            return least


def _moving_below_timeouts(tree: CompiledTree) -> set[Behaviour]:
    """Return the skills that move the arm within a timeout."""
    return {
        below
        for node, control in tree.controls.items()
        if control.kind.timed
        for below in node.iterate()
        if (leaf := tree.leaves.get(below)) and leaf.skill.moves
    }

"""RRTConnect: a way round, when the straight line is not free.

James J. Kuffner and Steven M. LaValle, "RRT-Connect: an efficient approach to single-query path
planning", ICRA 2000; here OMPL's, whose objects leak when they refer to each other in a cycle, so
that one space serves all searches of a group.
"""

from itertools import chain, combinations, islice

import numpy as np
from numpy.typing import NDArray
from ompl import base as ob
from ompl import geometric as og
from ompl import util as ou

from skills.motion.arrays import norms
from skills.motion.errors import NoPath

from .space import Space

Array = NDArray[np.float64]

ou.setLogLevel(ou.LogLevel.LOG_NONE)

_ITERATIONS = 5_000  # a count, not a time: the same query must give the same path
_RANGE = 0.7  # longest new branch [rad]
_GOALS = 64  # ways round to one goal: all of up to six joints


class Search:
    """Searches in the joint space of one group.

    Args:
        lower: Of its joints (J,) [rad].
        upper: Of its joints (J,) [rad]; where infinite, half a turn beyond the ends is searched.
        turning: Which of them stand the same a whole turn on (J,).
    """

    def __init__(self, lower: Array, upper: Array, turning: NDArray[np.bool_]) -> None:
        self.lower, self.upper, self.turning = lower, upper, turning
        self._bounds: tuple[float, ...] = ()
        self._space = ob.RealVectorStateSpace(len(lower))
        self._information = ob.SpaceInformation(self._space)
        self._edges = _Edges(self._information)
        self._information.setMotionValidator(self._edges)
        self._information.setStateValidityChecker(_any)

    def other_ways(self, start: Array, goal: Array) -> Array:
        """A goal, and the same where joints without an end turn the other way (G, J) [rad].

        The nearest first, as the search tries them in turn.
        """
        back = np.where(self.turning, 2.0 * np.pi * np.sign(goal - start), 0.0)
        joints = np.flatnonzero(back)
        some = chain.from_iterable(combinations(joints, n) for n in range(len(joints) + 1))
        chosen = [np.isin(np.arange(len(goal)), those) for those in islice(some, _GOALS)]
        goals = goal - np.array(chosen) * back
        return goals[np.argsort(norms(goals - start), kind="stable")]

    def find(self, space: Space, start: Array, goals: Array, seed: int) -> Array:
        """A path of free edges from start to one of the goals (N, J) [rad].

        Args:
            space: Where the group may move.
            start: A free point (J,) [rad].
            goals: Others (G, J) [rad].
            seed: Equal seeds give equal paths; at least 1.

        Raises:
            NoPath: The budget is spent.
            PlanTimeout: The time is up.
        """
        self._edges.space = space
        self._bound(np.vstack([start, goals]))
        problem = self._problem(start, goals)
        ou.RNG.setSeed(seed)
        planner = og.RRTConnect(self._information)
        planner.setRange(_RANGE)
        planner.setProblemDefinition(problem)
        planner.setup()
        budget = _Budget(space)
        planner.solve(ob.PlannerTerminationCondition(budget.spent))
        space.deadline.check()
        if not problem.hasExactSolution():
            raise NoPath(_ITERATIONS)
        states = problem.getSolutionPath().getStates()
        return np.array([s[0 : len(start)] for s in states])

    def _bound(self, ends: Array) -> None:
        lower = np.where(np.isfinite(self.lower), self.lower, ends.min(axis=0) - np.pi)
        upper = np.where(np.isfinite(self.upper), self.upper, ends.max(axis=0) + np.pi)
        if self._bounds == (known := (*lower.tolist(), *upper.tolist())):
            return
        self._bounds, bounds = known, ob.RealVectorBounds(len(lower))
        for i in range(len(lower)):
            bounds.setLow(i, float(lower[i]))
            bounds.setHigh(i, float(upper[i]))
        self._space.setBounds(bounds)
        self._information.setup()

    def _problem(self, start: Array, goals: Array) -> ob.ProblemDefinition:
        problem, ends = ob.ProblemDefinition(self._information), ob.GoalStates(self._information)
        problem.addStartState(self._state(start))
        for goal in goals:
            ends.addState(self._state(goal))
        problem.setGoal(ends)
        return problem

    def _state(self, values: Array) -> ob.State:
        state = self._information.allocState()
        for i, value in enumerate(values.tolist()):
            state[i] = value
        return state


class _Edges(ob.MotionValidator):  # type: ignore[misc]
    """Asks the space of the query at hand, a whole edge at a time."""

    space: Space

    def __init__(self, information: ob.SpaceInformation) -> None:
        super().__init__(information)
        self._size = information.getStateDimension()

    def checkMotion(self, a: ob.State, b: ob.State) -> bool:  # noqa: N802, named by OMPL
        size = self._size
        return self.space.edge(np.array(a[0:size]), np.array(b[0:size]))


def _any(_: ob.State) -> bool:
    """The edge to a point is looked at, so the point by itself need not be."""
    return True


class _Budget:
    """Counts the steps of a search."""

    def __init__(self, space: Space) -> None:
        self._deadline, self._left = space.deadline, _ITERATIONS

    def spent(self) -> bool:
        self._left -= 1
        return self._left < 0 or self._deadline.over

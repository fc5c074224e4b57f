"""RRT-Connect: searches a path if neither a line nor a single bend is free.

James J. Kuffner and Steven M. LaValle, "RRT-Connect: an efficient approach to single-query path
planning", ICRA 2000, as implemented by OMPL. OMPL objects that refer to each other in a cycle are
never freed, so all searches of a group share one state space.
"""

import numpy as np
from ompl import base as ob, geometric as og, util as ou

from skills.motion.arrays import Array
from skills.motion.errors import NoPath
from skills.motion.kinematics.joint_group import JointGroup

from .motion_validator import MotionValidator

ou.setLogLevel(ou.LogLevel.LOG_NONE)

_MAX_ITERATIONS = 5_000  # a count, not a time: equal queries give equal paths
_RANGE = 0.7  # longest extension of a tree [rad]


class RRTConnect:
    """Searches in the joint space of one group.

    A joint without limits is searched up to half a turn beyond start and goal.

    Args:
        group: The group.
    """

    def __init__(self, group: JointGroup) -> None:
        self._group = group
        self._bounds: tuple[float, ...] = ()
        self._space = ob.RealVectorStateSpace(len(group.lower))
        self._information = ob.SpaceInformation(self._space)
        self._edges = _EdgeValidator(self._information)
        self._information.setMotionValidator(self._edges)
        self._information.setStateValidityChecker(_always_valid)

    def find(self, validator: MotionValidator, start: Array, goals: Array, seed: int) -> Array:
        """Return a path of free edges from start to one of the goals (N, J) [rad].

        Args:
            validator: Checks motions of the group.
            start: A free point (J,) [rad].
            goals: Free points, tried in turn (G, J) [rad].
            seed: Random seed, at least 1. Equal seeds give equal paths.

        Raises:
            NoPath: No path was found within the limit of iterations.
            PlanTimeout: The deadline passed.
        """
        self._edges.validator = validator
        self._set_bounds(np.vstack([start, goals]))
        problem = self._problem(start, goals)
        ou.RNG.setSeed(seed)
        planner = og.RRTConnect(self._information)
        planner.setRange(_RANGE)
        planner.setProblemDefinition(problem)
        planner.setup()
        budget = _Budget(validator)
        planner.solve(ob.PlannerTerminationCondition(budget.spent))
        validator.deadline.check()
        if not problem.hasExactSolution():
            raise NoPath(_MAX_ITERATIONS)
        states = problem.getSolutionPath().getStates()
        return np.array([s[0 : len(start)] for s in states])

    def _set_bounds(self, ends: Array) -> None:
        group = self._group
        lower = np.where(np.isfinite(group.lower), group.lower, ends.min(axis=0) - np.pi)
        upper = np.where(np.isfinite(group.upper), group.upper, ends.max(axis=0) + np.pi)
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


class _EdgeValidator(ob.MotionValidator):  # type: ignore[misc]
    """Checks whole edges with the validator of the current query."""

    validator: MotionValidator

    def __init__(self, information: ob.SpaceInformation) -> None:
        super().__init__(information)
        self._size = information.getStateDimension()

    def checkMotion(self, a: ob.State, b: ob.State) -> bool:  # noqa: N802, named by OMPL
        size = self._size
        return self.validator.line_is_free(np.array(a[0:size]), np.array(b[0:size]))


def _always_valid(_: ob.State) -> bool:
    """Single states need no check: the edge to each state is checked."""
    return True


class _Budget:
    """Counts the iterations of a search."""

    def __init__(self, validator: MotionValidator) -> None:
        self._deadline, self._left = validator.deadline, _MAX_ITERATIONS

    def spent(self) -> bool:
        self._left -= 1
        return self._left < 0 or self._deadline.over

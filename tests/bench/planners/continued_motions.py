"""Motions that only our planner offers: via points, and the rest of a stopped motion."""

import dataclasses
from collections.abc import Iterable, Iterator
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from skills.motion import EndInCollision, Plan, Query, Rest
from skills.motion.planner import Planner
from tests.bench.planners.problems import Problem
from tests.bench.planners.reference.padded import padded
from tests.bench.planners.reference.reference_checker import ReferenceChecker, excess, ticks

Array = NDArray[np.float64]


@dataclasses.dataclass
class ContinuedScore:
    """Quality of these motions.

    Attributes:
        count: Number of motions.
        colliding: Number of motions in collision.
        over: Largest excess over a limit of each, as a share of the limit.
    """

    count: int = 0
    colliding: int = 0
    over: list[float] = dataclasses.field(default_factory=list)


def score_continued(problems: Iterable[Problem]) -> ContinuedScore:
    """Score motions via each goal to the next start, with legs as given and with equal legs."""
    score = ContinuedScore()
    for problem in problems:
        reference = ReferenceChecker(padded(problem.robot, problem.world, 0.0))
        for plan in _plans(problem):
            rows = ticks(plan)
            score.count += 1
            score.colliding += reference.collides(rows)
            score.over.append(excess(rows, plan.velocity, plan.acceleration))
    return score


def _plans(problem: Problem) -> Iterator[Plan]:
    planner, random = Planner(problem.robot), np.random.default_rng(1)
    for query, following in pairwise(problem.queries()):
        there = _arm(problem, following.start)
        cut = 10.0 ** random.uniform(-3.0, 0.0)
        for changed in (_by_way(query, there), _equal(problem, query, there, cut)):
            try:
                plan = planner.plan(changed)
            except EndInCollision:
                continue  # the end of a shortened leg may be in collision
            yield plan
            time = float(random.uniform(0.0, plan.duration))
            stands = _whole(problem, query.start, plan.sample([time])[0])
            yield planner.rest(Rest(plan, time, stands))


def _by_way(query: Query, goal: Array) -> Query:
    return dataclasses.replace(query, via=(query.goal,), goal=tuple(goal.tolist()))


def _equal(problem: Problem, query: Query, goal: Array, cut: float) -> Query:
    """Shorten both legs to a share of the shorter one, so that very short paths are one blend."""
    middle = np.array(query.goal)
    legs = [_arm(problem, query.start) - middle, goal - middle]
    length = cut * min(np.linalg.norm(leg) for leg in legs)
    start, end = (middle + length / np.linalg.norm(leg) * leg for leg in legs)
    whole = _whole(problem, query.start, start)
    return _by_way(dataclasses.replace(query, start=whole), end)


def _columns(problem: Problem) -> list[int]:
    return [problem.robot.actuated.index(joint) for joint in problem.robot.actuated_in("arm")]


def _arm(problem: Problem, whole: tuple[float, ...]) -> Array:
    return np.array(whole)[_columns(problem)]


def _whole(problem: Problem, start: tuple[float, ...], arm: Array) -> tuple[float, ...]:
    whole = np.array(start)
    whole[_columns(problem)] = arm
    return tuple(whole.tolist())

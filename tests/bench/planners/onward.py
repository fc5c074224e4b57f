"""Motions that no peer is asked for: by way of a point, and what is left of a stopped motion."""

import dataclasses
from collections.abc import Iterable, Iterator
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from skills.motion import EndInCollision, Plan, Query, Rest
from skills.motion.planner import Planner
from tests.bench.planners.judge import Judge, excess, ticks
from tests.bench.planners.padded import padded
from tests.bench.planners.problems import Problem

Array = NDArray[np.float64]


@dataclasses.dataclass
class Onward:
    """How these motions did.

    Attributes:
        asked: How many there were.
        colliding: How many touch something.
        over: Largest speed or acceleration over its limit, less 1, of each.
    """

    asked: int = 0
    colliding: int = 0
    over: list[float] = dataclasses.field(default_factory=list)


def onward(problems: Iterable[Problem]) -> Onward:
    """By way of each goal to the next start, with legs as they come and with equal ones."""
    score = Onward()
    for problem in problems:
        judge = Judge(padded(problem.robot, problem.world, 0.0))
        for plan in _plans(problem):
            rows = ticks(plan)
            score.asked += 1
            score.colliding += judge.collides(rows)
            score.over.append(excess(rows, plan.velocity, plan.acceleration))
    return score


def _plans(problem: Problem) -> Iterator[Plan]:
    planner, random = Planner(problem.robot), np.random.default_rng(1)
    for query, following in pairwise(problem.queries()):
        there = _arm(problem, following.start)
        cut = 10.0 ** random.uniform(-3.0, 0.0)
        for asked in (_by_way(query, there), _equal(problem, query, there, cut)):
            try:
                plan = planner.plan(asked)
            except EndInCollision:
                continue  # where a leg was cut short
            yield plan
            time = float(random.uniform(0.0, plan.duration))
            stands = _whole(problem, query.start, plan.state(time))
            yield planner.rest(Rest(plan, time, stands))


def _by_way(query: Query, goal: Array) -> Query:
    return dataclasses.replace(query, via=(query.goal,), goal=tuple(goal.tolist()))


def _equal(problem: Problem, query: Query, goal: Array, cut: float) -> Query:
    """Both legs cut to a share of the shorter, so that a path of short ones is all one bend."""
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

"""Arms with meshes: time to plan, time to reject a goal in collision, and delay of deadlines."""

import dataclasses
import time
from collections.abc import Iterator
from contextlib import closing
from itertools import cycle, permutations
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hardware import RealClock, Robot
from skills.motion import GoalInCollision, Plan, PlanTimeout, Pool, Query
from skills.motion.collision.checker import CollisionChecker
from skills.motion.collision.planning_scene import PlanningScene
from skills.motion.planner import Planner
from tests.bench.planners.problems import POSTS
from tests.bench.planners.worker_pool import ask
from tests.support.arms.real_arms import FILES, real
from tests.support.arms.robots import free_poses

_TIMEOUTS = (0.005, 0.01, 0.02, 0.05, 0.1, 0.2)  # [s]


def arms(folder: Path) -> list[Robot]:
    """Return arms with their makers' URDFs. Their robot files are written into a folder."""
    return [real(name, folder) for name in FILES]


def spent(robot: Robot, count: int) -> Iterator[float]:
    """Time for each plan between two random free configurations [ms]."""
    planner, size = Planner(robot), len(robot.actuated_in("arm"))
    poses = free_poses(robot, 2 * count, 1, planner.checker)
    for seed, (start, goal) in enumerate(zip(poses[::2], poses[1::2], strict=True), 1):
        begun = time.perf_counter()
        planner.plan(Query("arm", tuple(start), tuple(goal[:size]), seed))
        yield 1e3 * (time.perf_counter() - begun)


def poison(robot: Robot, count: int) -> Iterator[float]:
    """Time until the error for each goal in collision [ms]."""
    checker, random = CollisionChecker(PlanningScene(robot, POSTS)), np.random.default_rng(1)
    start, leaders = free_poses(robot, 1, 1, checker)[0], robot.actuated_in("arm")
    lower = [max(joint.lower, -np.pi) for joint in leaders]
    upper = [min(joint.upper, np.pi) for joint in leaders]
    goals = random.uniform(lower, upper, (100 * count, len(leaders)))
    rows = np.hstack([goals, np.tile(start[len(leaders) :], (len(goals), 1))])
    touching = (i for i in range(len(goals)) if checker.first_collision(rows[i : i + 1], 0.0) == 0)
    with closing(_pool(robot, start)) as pool:
        for _, i in zip(range(count), touching, strict=False):
            query = Query("arm", tuple(start), tuple(goals[i]), world=POSTS)
            begun = time.perf_counter()
            answer = ask(pool, query)
            yield 1e3 * (time.perf_counter() - begun)
            assert isinstance(answer, GoalInCollision), answer


def late(robot: Robot, count: int) -> Iterator[float]:
    """Delay of the answer after the deadline, for each plan that missed it [ms]."""
    poses = free_poses(robot, 20, 1, CollisionChecker(PlanningScene(robot, POSTS)))
    size = len(robot.actuated_in("arm"))
    ends, timeouts = cycle(permutations(poses, 2)), cycle(_TIMEOUTS)
    with closing(_pool(robot, poses[0])) as pool:
        for seed, (start, goal), timeout in zip(range(count), ends, timeouts, strict=False):
            query = Query("arm", tuple(start), tuple(goal[:size]), seed, world=POSTS)
            begun = time.perf_counter()
            answer = ask(pool, dataclasses.replace(query, timeout=timeout))
            if isinstance(answer, PlanTimeout):
                yield 1e3 * (time.perf_counter() - begun - timeout)


def _pool(robot: Robot, start: NDArray[np.float64]) -> Pool:
    """A pool with one warm worker: it planned a bend among the posts, so everything is loaded."""
    pool, size = Pool(robot, 1, RealClock()), len(robot.actuated_in("arm"))
    pool.start()
    aside, goal = start[:size].copy(), start[:size].copy()
    aside[0] += 0.01
    goal[1] += 0.01
    query = Query("arm", tuple(start), tuple(goal), via=(tuple(aside),), world=POSTS)
    assert isinstance(ask(pool, query), Plan)
    return pool

"""How soon a plan is found, how long it takes, and whether it keeps what it promises.

300 random pairs on the bare arm and 300 round a post, drawn with a fixed seed; every plan is judged
anew each millisecond, on primitives, by pinocchio alone. The seven-axis arm, that of
`tests/data`, stands between two posts. Peers are not in this table yet.
"""

import dataclasses
import statistics
import sys
import threading
import time
from collections.abc import Sequence
from contextlib import closing
from itertools import combinations
from pathlib import Path

# This file's folder comes first where it is run by itself, and holds files named like rooms.
sys.path = [folder for folder in sys.path if Path(folder) != Path(__file__).parent]
sys.path.insert(0, str(Path(__file__).parents[2]))

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from hardware import RealClock, Robot, load_robot
from skills.motion import (
    EMPTY,
    Body,
    Box,
    MotionError,
    Plan,
    Pool,
    Query,
    Request,
    Result,
    World,
)
from skills.motion.bodies import objects
from skills.motion.contacts import Contacts
from skills.motion.explain import straight_duration
from skills.motion.model import Model
from skills.motion.planner import Planner
from tests.arms import foreign, free_poses
from tests.bench.table import Row, arguments, show

Array = NDArray[np.float64]

POST = World((Body("post", Box((0.03, 0.03, 0.3)), (0.115, 0.115, 0.15)),))
POSTS = World(
    (
        Body("left", Box((0.1, 0.1, 1.2)), (0.4, 0.3, 0.4)),
        Body("right", Box((0.1, 0.1, 1.2)), (0.4, -0.3, 0.4)),
    )
)
PAIRS = 300


def queries(robot: Robot, world: World, count: int) -> list[Query]:
    """Random free pairs for the arm; the other joints stay at the start."""
    own = [i for i, joint in enumerate(robot.actuated) if joint in robot.leaders("arm")]
    contacts = Contacts(Model(robot, world))
    found: list[Query] = []
    seed = 0
    while len(found) < count:
        seed += 1
        start, end = free_poses(robot, 2, seed, contacts)
        goal = start.copy()
        goal[own] = end[own]
        if contacts.first_hit(goal[None, :], robot.collision.margin) is None:
            found.append(Query("arm", tuple(start), tuple(end[own]), 1, 1.0, world=world))
    return found


def timed(planner: Planner, asked: Sequence[Query]) -> tuple[list[Plan], list[float]]:
    """The plans found, and how long each took [ms]."""
    plans, spent = [], []
    for query in asked:
        begun = time.perf_counter()
        try:
            plans.append(planner.plan(query))
        except MotionError as error:
            sys.stderr.write(f"{error}\n")
        else:
            spent.append(1e3 * (time.perf_counter() - begun))
    return plans, spent


def percentile(samples: Sequence[float], share: float) -> float:
    return float(np.percentile(samples, share))


class Judge:
    """Looks for contacts of primitives, with nothing of the planner's but the world's shapes."""

    def __init__(self, robot: Robot, world: World) -> None:
        self._robot = robot
        self._model = pin.buildModelFromUrdf(str(robot.urdf), True)
        geometry = pin.buildGeomFromUrdf(
            self._model, str(robot.urdf), pin.GeometryType.COLLISION, None, []
        )
        links = [self._model.frames[s.parentFrame].name for s in geometry.geometryObjects]
        for body, shape, _ in objects(self._model, world):
            geometry.addGeometryObject(shape)
            links.append(body.name)
        for i, j in combinations(range(len(links)), 2):
            one, other = geometry.geometryObjects[i], geometry.geometryObjects[j]
            pair = frozenset((links[i], links[j]))
            if one.parentJoint != other.parentJoint and pair not in robot.collision.allowed:
                geometry.addCollisionPair(pin.CollisionPair(i, j))
        self._pool = pin.GeometryPool(self._model, geometry, 1)

    def collides(self, plan: Plan) -> bool:
        """Whether the motion touches anything, each millisecond."""
        names = [joint.name for joint in self._robot.actuated]
        times = np.append(np.arange(0.0, plan.duration, 0.001), plan.duration)
        rows = np.tile(plan.start, (len(times), 1))
        rows[:, [names.index(name) for name in plan.joints]] = plan.sample(times)
        q = np.asfortranarray(rows.T)
        return bool(np.any(pin.computeCollisionsInParallel(1, self._pool, q, True, True)))


def excess(plan: Plan) -> float:
    """Largest speed or acceleration over its limit each millisecond, less 1."""
    times = np.arange(0.0, plan.duration, 0.001)
    if not times.size:
        return 0.0
    speed = np.max(abs(plan.velocities(times)) / plan.velocity)
    return float(max(speed, np.max(abs(plan.accelerations(times)) / plan.acceleration))) - 1.0


def overheads(robot: Robot, count: int) -> list[float]:
    """A straight plan as the caller of a worker sees it, less the solve itself [ms]."""
    query, spent = Query("arm", (0.0,) * 4, (-1.4, -0.6, -0.07)), list[float]()
    with closing(Pool(robot, 1, RealClock())) as pool:
        pool.start()
        ask(pool, query)
        for _ in range(count):
            begun = time.perf_counter()
            plan = ask(pool, query)
            waited = 1e3 * (time.perf_counter() - begun)
            assert isinstance(plan, Plan)
            spent.append(waited - sum(plan.milliseconds.values()))
    return spent


def ask(pool: Pool, request: Request) -> Result:
    there, found = threading.Event(), list[Result]()

    def done(result: Result) -> None:
        found.append(result)
        there.set()

    pool.submit(request, done)
    there.wait()
    return found[0]


def main(runs: int, file: Path | None) -> None:
    """Measure and show."""
    robot, seven_axes = load_robot(), foreign("seven_axes")
    planner, seven = Planner(robot), Planner(seven_axes)
    bare, post = queries(robot, EMPTY, PAIRS), queries(robot, POST, PAIRS)
    straights, detours, plans = list[list[float]](), list[list[float]](), list[Plan]()
    for _ in range(runs):
        found, spent = timed(planner, bare)
        straights.append([t for p, t in zip(found, spent, strict=True) if len(p.waypoints) == 2])
        around, spent = timed(planner, post)
        detours.append([t for p, t in zip(around, spent, strict=True) if len(p.waypoints) > 2])
        plans = found + around
    ratios = [p.duration / line for p in around if (line := straight_duration(p))]
    judges = {EMPTY: Judge(robot, EMPTY), POST: Judge(robot, POST)}
    colliding = sum(judges[EMPTY].collides(p) for p in found)
    colliding += sum(judges[POST].collides(p) for p in around)
    poses = [dataclasses.replace(query, timeout=1.0) for query in queries(seven_axes, POSTS, PAIRS)]
    solved, seconds = timed(seven, poses)
    seven_hits = sum(map(Judge(seven_axes, POSTS).collides, solved))
    rows = [
        Row("straight_p50_ms", "ms", [percentile(each, 50) for each in straights]),
        Row("straight_p95_ms", "ms", [percentile(each, 95) for each in straights]),
        Row("detour_p50_ms", "ms", [percentile(each, 50) for each in detours]),
        Row("detour_p95_ms", "ms", [percentile(each, 95) for each in detours]),
        Row("detours", "of 300", [len(detours[0])]),
        Row("obstacle_duration_ratio", "1", [statistics.fmean(ratios)]),
        Row("solved", "of 600", [len(plans)]),
        Row("colliding", "of 600", [colliding]),
        Row("limit_excess", "1", [max(map(excess, plans + solved))]),
        Row("seven_axis_success", "1", [len(solved) / len(poses)]),
        Row("seven_axis_p50_ms", "ms", [percentile(seconds, 50)]),
        Row("seven_axis_p95_ms", "ms", [percentile(seconds, 95)]),
        Row("seven_axis_colliding", "of 300", [seven_hits]),
        Row("worker_overhead_ms", "ms", [percentile(overheads(robot, 300), 50)]),
    ]
    show(rows, file)


if __name__ == "__main__":
    given = arguments(__doc__ or "").parse_args()
    main(given.runs, given.json)

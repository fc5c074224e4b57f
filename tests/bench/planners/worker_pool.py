"""The worker pool: overhead, cancellation, invalid requests, and growth of memory."""

import dataclasses
import threading
import time
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import numpy as np

from hardware import RealClock, Robot
from skills.motion import (
    EMPTY,
    MotionError,
    Plan,
    PlanCanceled,
    PlanTimeout,
    Pool,
    Query,
    Request,
    Result,
    World,
)
from skills.motion.planner import Planner
from tests.bench.planners.problems import POST

EASY = Query("arm", (0.0, 0.0, 0.0, 0.0), (-1.4, -0.6, -0.07))
_NAN, _INF = float("nan"), float("inf")
POISON = (
    dataclasses.replace(EASY, start=(_NAN, 0.0, 0.0, 0.0)),
    dataclasses.replace(EASY, goal=(0.0, _INF, 0.0)),
    dataclasses.replace(EASY, goal=(0.0, -_INF, 0.0)),
    dataclasses.replace(EASY, start=(2.0, 0.0, 0.0, 0.0)),
    dataclasses.replace(EASY, goal=(0.0, 0.0, -1.6)),
    dataclasses.replace(EASY, start=(0.0, -1.5, -0.5, 0.0)),
    dataclasses.replace(EASY, goal=(0.0, -1.5, -0.5)),
    dataclasses.replace(EASY, goal=(0.0, 0.0)),
    dataclasses.replace(EASY, group="legs"),
    dataclasses.replace(EASY, seed=-1),
    dataclasses.replace(EASY, timeout=_NAN),
    dataclasses.replace(EASY, timeout=-1.0),
)

WALL = """
<link name="wall"><collision>
  <origin xyz="0.354 0.421 0.35" rpy="0 0 0.8708"/><geometry><box size="0.9 0.01 0.7"/></geometry>
</collision></link>
<joint name="wall_joint" type="fixed"><parent link="world"/><child link="wall"/></joint>
</robot>"""


class _Call:
    """A request and its result."""

    def __init__(self, pool: Pool, request: Request) -> None:
        self.there, self._found = threading.Event(), list[Result]()
        self.job = pool.submit(request, self._done)

    def _done(self, result: Result) -> None:
        self._found.append(result)
        self.there.set()

    def answer(self) -> Result:
        """Wait for the result and return it."""
        self.there.wait()
        return self._found[0]


def ask(pool: Pool, request: Request) -> Result:
    """Return the pool's answer to a request."""
    return _Call(pool, request).answer()


def overheads(robot: Robot, count: int) -> list[float]:
    """Return the time of a straight plan in a worker minus that in this process [ms].

    The two alternate, so that both run under the same load.
    """
    planner, spent = Planner(robot), list[float]()
    with closing(warm_pool(robot)) as pool:
        for _ in range(count):
            begun = time.perf_counter()
            assert isinstance(ask(pool, EASY), Plan)
            answered = time.perf_counter()
            planner.plan(EASY)
            spent.append(1e3 * (2.0 * answered - begun - time.perf_counter()))
    return spent


def deadlines(
    robot: Robot, count: int, folder: Path
) -> tuple[list[float], list[float], list[float]]:
    """Return delays of deadlines, times to cancel, and times from there to the next plan [ms].

    The goal is behind a wall. The URDF with the wall is written into the folder.
    """
    late, canceled, again = list[float](), list[float](), list[float]()
    with closing(warm_pool(cut_off(robot, folder))) as pool:
        for seed in range(count):
            begun = time.perf_counter()
            answer = ask(pool, dataclasses.replace(EASY, seed=seed, timeout=0.1))
            late.append(1e3 * (time.perf_counter() - begun - 0.1))
            assert isinstance(answer, PlanTimeout)
        for seed in range(count // 5):
            times = next_after_cancel(pool, seed, EMPTY)
            canceled.append(times[0])
            again.append(times[1])
    return late, canceled, again


def next_after_cancel(pool: Pool, seed: int, world: World) -> tuple[float, float]:
    """Return the time to cancel a search, and from there to the next plan [ms].

    The robot is that of `cut_off`, so the search does not end by itself.
    """
    call = _Call(pool, dataclasses.replace(EASY, seed=seed, timeout=30.0, world=world))
    call.there.wait(0.1)
    begun = time.perf_counter()
    call.job.cancel()
    assert isinstance(call.answer(), PlanCanceled)
    ended = time.perf_counter()
    near = dataclasses.replace(EASY, goal=(0.1, 0.0, 0.0), world=world)
    assert isinstance(ask(pool, near), Plan)
    return 1e3 * (ended - begun), 1e3 * (time.perf_counter() - ended)


def poison(robot: Robot) -> Iterator[float]:
    """Yield the time until the error of each invalid query, and of each invalid robot [ms]."""
    with closing(warm_pool(robot)) as pool:
        for query in POISON:
            yield _refused(pool, query)
            assert isinstance(ask(pool, EASY), Plan)  # the next request is not affected
    first, *rest = robot.joints
    for wrong in (
        dataclasses.replace(first, lower=first.upper, upper=first.lower),
        dataclasses.replace(first, velocity=0.0),
        dataclasses.replace(first, acceleration=0.0),
        dataclasses.replace(first, lower=_NAN),
        dataclasses.replace(first, upper=_NAN),
        dataclasses.replace(first, acceleration=_INF),
    ):
        with closing(warm_pool(dataclasses.replace(robot, joints=(wrong, *rest)))) as pool:
            yield _refused(pool, EASY)


def _refused(pool: Pool, query: Query) -> float:
    """Time until the error [ms]."""
    begun = time.perf_counter()
    answer = ask(pool, query)
    spent = 1e3 * (time.perf_counter() - begun)
    assert isinstance(answer, MotionError), query
    return spent


def growth_mb(robot: Robot, count: int) -> float:
    """Return the growth of a worker's memory over `count` different plans [MB]."""
    random = np.random.default_rng(1)
    with closing(warm_pool(robot)) as pool:
        _plans(pool, robot, random, count // 10)
        worker = pool._slots[0].process
        assert worker
        assert worker.pid
        before = _resident(worker.pid)
        _plans(pool, robot, random, count)
        assert pool._slots[0].process is worker
        return _resident(worker.pid) - before


def _plans(pool: Pool, robot: Robot, random: np.random.Generator, count: int) -> None:
    """Plan between random configurations; every tenth plan is in a new world."""
    arm, world, plans = robot.actuated_in("arm"), POST, 0
    lower, upper = np.array([(joint.lower, joint.upper) for joint in arm]).T
    while plans < count:
        start, goal = random.uniform(lower, upper, (2, len(arm))).tolist()
        whole = (*start, *robot.boot_pose[len(arm) :])
        query = Query("arm", whole, tuple(goal), plans, 10.0, world=world)
        plans += isinstance(ask(pool, query), Plan)
        if not plans % 10:
            x, y = (0.12 + 0.02 * random.uniform(size=2)).tolist()
            world = World((dataclasses.replace(POST.bodies[0], position=(x, y, 0.15)),))


def _resident(pid: int) -> float:
    pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    return 4096 * pages / 2**20


def warm_pool(robot: Robot) -> Pool:
    """A pool with one warm worker."""
    pool = Pool(robot, 1, RealClock())
    pool.start()
    ask(pool, dataclasses.replace(EASY, goal=(0.1, 0.0, 0.0)))
    return pool


def cut_off(robot: Robot, folder: Path) -> Robot:
    """The arm behind a wall, with limits too narrow to pass it."""
    urdf = folder / "cut_off.urdf"
    urdf.write_text(robot.urdf.read_text().replace("</robot>", WALL))
    base, *rest = robot.joints
    stiff = (
        dataclasses.replace(j, lower=max(j.lower, -0.7), upper=min(j.upper, 0.1)) for j in rest
    )
    ignores = robot.collision.floor_ignores | {"wall"}
    rules = dataclasses.replace(robot.collision, floor_ignores=ignores)
    return dataclasses.replace(robot, urdf=urdf, collision=rules, joints=(base, *stiff))

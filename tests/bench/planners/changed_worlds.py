"""Large worlds that change a little: 400 boxes, and a mesh of 400,000 triangles."""

import dataclasses
import threading
import time
from collections.abc import Iterable, Iterator
from contextlib import closing
from pathlib import Path

import numpy as np

from hardware import Robot
from skills.motion import Body, Box, Mesh, Plan, Query, World
from skills.motion.planner import Planner
from tests.bench.planners.worker_pool import EASY, ask, cut_off, next_after_cancel, warm_pool

_BOX = Box((0.03, 0.03, 0.03))
_LOAD = 1.0  # the fork server ends to load a mesh up to 0.4 s after the first answer [s]
_SIDE = 447  # squares on each side of the mesh, of two triangles each


def one_box_moved(robot: Robot, count: int) -> Iterator[float]:
    """Yield the time to plan after one of 400 boxes moved [ms]."""
    planner, bodies = Planner(robot), list(_boxes(400 + count))
    bodies, others = bodies[:400], bodies[400:]
    planner.plan(_query(robot, World(tuple(bodies))))
    for i, other in enumerate(others):
        bodies[i] = dataclasses.replace(bodies[i], position=other.position)
        yield _spent(planner, _query(robot, World(tuple(bodies))))


def box_beside_mesh(robot: Robot, count: int, folder: Path) -> Iterator[float]:
    """Yield the time to plan after a box beside a large mesh moved [ms]."""
    planner, mesh = Planner(robot), _mesh(folder)
    planner.plan(_query(robot, World((mesh,))))
    for box in _boxes(count):
        yield _spent(planner, _query(robot, World((mesh, box))))


def next_after_kill_of_400(robot: Robot, count: int, folder: Path) -> Iterator[float]:
    """Yield the time from a cancel to the next plan among 400 boxes; one moves each time [ms]."""
    first, *others = _boxes(400 + count)
    bodies = others[:399]
    worlds = (World((box, *bodies)) for box in (first, *others[399:]))
    yield from _next_after_kill(robot, folder, worlds)


def next_after_kill_beside_mesh(robot: Robot, count: int, folder: Path) -> Iterator[float]:
    """Yield the time from a cancel to the next plan beside a large mesh [ms]."""
    yield from _next_after_kill(robot, folder, (count + 1) * [World((_mesh(folder),))])


def _next_after_kill(robot: Robot, folder: Path, worlds: Iterable[World]) -> Iterator[float]:
    with closing(warm_pool(cut_off(robot, folder))) as pool:
        for seed, world in enumerate(worlds):
            if seed:
                yield next_after_cancel(pool, seed, world)[1]
            else:  # the first world is known, as in a long run
                near = dataclasses.replace(EASY, goal=(0.1, 0.0, 0.0), world=world)
                assert isinstance(ask(pool, near), Plan)
                threading.Event().wait(_LOAD)


def _mesh(folder: Path) -> Body:
    return Body("mesh", _waves(folder / "waves.stl"), (1.5, 0.0, 0.3))


def _query(robot: Robot, world: World) -> Query:
    size = len(robot.actuated_in("arm"))
    goal = tuple(position + 0.1 for position in robot.boot_pose[:size])
    return Query("arm", robot.boot_pose, goal, world=world, timeout=30.0)


def _spent(planner: Planner, query: Query) -> float:
    begun = time.perf_counter()
    planner.plan(query)
    return 1e3 * (time.perf_counter() - begun)


def _boxes(count: int) -> Iterator[Body]:
    """Yield boxes around the arm, out of its reach."""
    random = np.random.default_rng(1)
    for i in range(count):
        angle, radius = random.uniform(0.0, 2.0 * np.pi), random.uniform(1.0, 2.0)
        height = 0.1 + random.uniform(0.0, 0.3)
        place = (float(radius * np.cos(angle)), float(radius * np.sin(angle)), float(height))
        yield Body(f"box_{i}", _BOX, place)


def _waves(file: Path) -> Mesh:
    """Return a surface of 399,618 triangles, written to a file."""
    ends = np.linspace(-0.2, 0.2, _SIDE + 1)
    x, y = np.meshgrid(ends, ends)
    points = np.stack((x, y, 0.02 * np.sin(20.0 * x) * np.cos(20.0 * y)), axis=-1)
    a, b, c, d = points[:-1, :-1], points[1:, :-1], points[1:, 1:], points[:-1, 1:]
    halves = [np.stack(half, axis=2).reshape(-1, 9) for half in ((a, b, c), (a, c, d))]
    corners = np.concatenate(halves)
    record = [("normal", "<3f4"), ("corners", "<9f4"), ("attributes", "<u2")]
    triangles = np.zeros(len(corners), dtype=record)
    triangles["corners"] = corners
    file.write_bytes(bytes(80) + np.uint32(len(triangles)).tobytes() + triangles.tobytes())
    return Mesh(str(file))

"""Arms in a room that is one mesh, beside the same room of six boxes.

The convex hull of the mesh contains the arm, so only its triangles prove that a motion is free.
"""

import dataclasses
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from skills.motion import Body, Box, World
from skills.motion.planner import Planner
from tests.bench.planners.problems import random
from tests.support.arms.cube_mesh import cube

_INNER, _OUTER = 1.5, 1.6  # half the edges of the room [m]


def ratios(count: int, folder: Path) -> Iterator[float]:
    """Yield the planning time in the mesh, divided by that in boxes, for each arm of `random`."""
    rooms = ((Body("room", cube(folder, (_OUTER, -_INNER))),), tuple(_walls()))
    for problem in random(count):
        planner = Planner(problem.robot)
        mesh, boxes = (World((*problem.world.bodies, *room)) for room in rooms)
        spent = dict.fromkeys((mesh, boxes), 0.0)
        for query in problem.queries():
            for world in spent:
                begun = time.perf_counter()
                planner.plan(dataclasses.replace(query, world=world))
                spent[world] += time.perf_counter() - begun
        yield spent[mesh] / spent[boxes]


def _walls() -> Iterator[Body]:
    for axis, side in np.ndindex(3, 2):
        size, place = [2.0 * _OUTER] * 3, [0.0] * 3
        size[axis], place[axis] = _OUTER - _INNER, (side - 0.5) * (_OUTER + _INNER)
        (a, b, c), (x, y, z) = size, place
        yield Body(f"wall_{axis}_{side}", Box((a, b, c)), (x, y, z))

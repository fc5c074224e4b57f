"""A world that is padded for planners without a margin is as wide as ours with it."""

import numpy as np
import pytest

from skills.motion import Body, Box, World
from tests.bench.planners.reference.padded import padded
from tests.bench.planners.reference.reference_checker import ReferenceChecker
from tests.support.arms.robots import foreign

_SIDE = 0.04  # of the beam, from the axis of the upright arm [m]


@pytest.mark.parametrize("boxes", [False, True])
@pytest.mark.parametrize(("share", "refused"), [(0.6, True), (0.95, True), (1.05, False)])
def test_a_mesh_beside_a_board(share: float, refused: bool, boxes: bool) -> None:
    """The beam is a mesh. The gap beside it is a share of the margin."""
    robot = foreign("six_axes")
    at = _SIDE + share * robot.collision.margin + 0.01
    world = World((Body("board", Box((0.02, 0.1, 0.1)), (at, 0.0, 0.4)),))
    upright = np.zeros((1, 6))
    assert ReferenceChecker(padded(robot, world, boxes=boxes)).collides(upright) == refused
    assert not ReferenceChecker(padded(robot, world, 0.0, boxes)).collides(upright)

"""Penetration depth of meshes: how far one must move to be free."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from hardware import load_robot
from skills.motion import Body, Box, Mesh, Query, Shape, Sphere, StartInCollision, World
from skills.motion.collision.checker import CollisionChecker
from skills.motion.collision.planning_scene import PlanningScene
from skills.motion.planner import Planner
from tests.skills.motion.collision.test_containment import AWAY, STAND
from tests.support.arms.cube_mesh import cube

pytestmark = pytest.mark.slow

ROBOT = load_robot()
EDGE = 0.1
HIGH = (0.0, 0.0, 0.8)  # where the arm is not

places = st.tuples(*[st.floats(-0.08, 0.08)] * 3)
turns = st.tuples(*[st.floats(-1.0, 1.0)] * 4).filter(lambda turn: np.linalg.norm(turn) > 0.1)


@pytest.fixture(scope="module")
def mesh(tmp_path_factory: pytest.TempPathFactory) -> Mesh:
    return cube(tmp_path_factory.mktemp("mesh"), (0.5 * EDGE,))


def depth(held: Shape, there: Shape, shift: tuple[float, ...], turn: tuple[float, ...]) -> float:
    """Depth of a body on the arm's base in a fixed one; negative if they are apart."""
    x, y, z = np.add(HIGH, shift).tolist()
    a, b, c, d = (np.array(turn) / np.linalg.norm(turn)).tolist()
    moving = Body("moving", held, HIGH, link="base_plate")
    standing = Body("standing", there, (x, y, z), (a, b, c, d))
    nearest = CollisionChecker(PlanningScene(ROBOT, World((moving, standing)))).nearest(
        ROBOT.boot_pose
    )
    assert nearest
    return -nearest.distance


def test_the_error_has_the_depth_of_two_meshes(mesh: Mesh) -> None:
    held = Body("held", mesh, HIGH, link="base_plate")
    there = Body("there", mesh, (0.09, 0.003, 0.802))
    with pytest.raises(
        StartInCollision, match=r"held would be up to 10\.0 mm deep in there"
    ) as caught:
        Planner(ROBOT).plan(Query("arm", STAND, AWAY, world=World((held, there))))
    assert caught.value.distance == pytest.approx(-0.01, abs=1e-6)


@settings(max_examples=40)
@given(places, turns)
def test_convex_meshes_have_the_depth_of_the_same_primitives(
    mesh: Mesh, shift: tuple[float, ...], turn: tuple[float, ...]
) -> None:
    box = Box((EDGE,) * 3)
    solids = depth(box, box, shift, turn)
    for held, there in ((mesh, mesh), (mesh, box), (box, mesh)):
        found = depth(held, there, shift, turn)
        if solids > 1e-6:
            assert solids - 1e-5 <= found <= solids + 1e-5
        elif solids < -1e-6:
            assert found == pytest.approx(solids, abs=1e-5)


def test_the_depth_in_the_wall_of_a_tray_is_less_than_in_its_hull(tmp_path: Path) -> None:
    tray = cube(tmp_path, (0.5 * EDGE,), open_top=True)
    pea, flat = Sphere(0.01), (0.0, 0.0, 0.0, 1.0)
    aside = (0.042, 0.0, 0.0)
    assert depth(pea, tray, aside, flat) == pytest.approx(0.002, rel=0.05)
    assert depth(tray, pea, aside, flat) == pytest.approx(0.002, rel=0.05)


def test_bodies_are_apart_if_only_their_hulls_overlap(tmp_path: Path) -> None:
    tray = cube(tmp_path, (0.5 * EDGE,), open_top=True)
    assert depth(Sphere(0.01), tray, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)) < 0.0


def test_moving_further_inside_is_no_separation(mesh: Mesh, tmp_path: Path) -> None:
    """9 mm further inside it would not touch the surface."""
    small, aside = cube(tmp_path, (0.01,)), (0.049, 0.0, 0.0)
    for held, there in ((small, mesh), (mesh, small)):
        assert depth(held, there, aside, (0.0, 0.0, 0.0, 1.0)) == pytest.approx(0.011, abs=1e-5)


@settings(max_examples=40)
@given(st.floats(-0.12, 0.12), turns)
def test_the_depth_in_the_floor_is_that_of_the_same_primitive(
    mesh: Mesh, height: float, turn: tuple[float, ...]
) -> None:
    """For a mesh and the floor, coal returns the depth of any triangle."""
    a, b, c, d = (np.array(turn) / np.linalg.norm(turn)).tolist()
    found = []
    for shape in (mesh, Box((EDGE,) * 3)):
        held = Body("held", shape, (1.5, 0.0, height), (a, b, c, d), link="base_plate")
        checker = CollisionChecker(PlanningScene(ROBOT, World((held,))))
        nearest = checker.nearest(ROBOT.boot_pose)
        assert nearest
        found.append((nearest.distance, checker.first_collision([ROBOT.boot_pose], 0.005)))
    assert found[0][0] == pytest.approx(found[1][0], abs=1e-6)
    assert found[0][1] == found[1][1]

"""A shape completely inside a mesh is in collision. This is checked at the ends of a motion."""

from collections.abc import Sequence
from itertools import product
from pathlib import Path

import coal
import numpy as np
import pytest
from hypothesis import given, strategies as st

from hardware import RealClock, load_robot
from skills.motion import (
    Body,
    Box,
    GoalInCollision,
    Mesh,
    MotionCollides,
    PlanTimeout,
    Query,
    Shape,
    Sphere,
    StartInCollision,
    ToolQuery,
    Verify,
    World,
)
from skills.motion.arrays import Array
from skills.motion.collision.checker import CollisionChecker
from skills.motion.collision.planning_scene import PlanningScene
from skills.motion.deadline import Deadline
from skills.motion.planner import Planner
from skills.motion.robot_model.geometry import EnclosedVolume
from tests.support.arms.cube_mesh import CORNERS, TRIANGLES, cube
from tests.support.arms.robots import foreign

pytestmark = pytest.mark.slow

ROBOT = load_robot()
PLANNER = Planner(ROBOT)
STAND, AWAY = (0.0,) * 4, (0.5, 0.0, 0.0)


def test_a_body_inside_a_mesh_link_and_its_depth() -> None:
    """In the middle of a beam 80 mm wide, plus its own radius; see beam.stl."""
    robot = foreign("six_axes")
    planner, stand = Planner(robot), (0.0,) * 6
    pea = World((Body("pea", Sphere(0.003), (0.0, 0.0, 0.3)),))
    with pytest.raises(StartInCollision, match=r"upper_arm .* pea") as caught:
        planner.plan(Query("arm", stand, (0.0, 1.0, 0.0, 0.0, 0.0, 0.0), world=pea))
    assert caught.value.distance == pytest.approx(-0.043, abs=1e-5)
    with pytest.raises(GoalInCollision, match=r"upper_arm .* pea"):
        planner.plan(Query("arm", (0.0, 1.0, 0.0, 0.0, 0.0, 0.0), stand, world=pea))


def test_a_deadline_is_read_before_each_check_of_a_point() -> None:
    """Such a check takes 30 ms in a mesh of 400,000 triangles."""
    pea = World((Body("pea", Sphere(0.003), (0.0, 0.0, 0.3)),))
    checker = CollisionChecker(PlanningScene(foreign("six_axes"), pea))
    stand = checker._coordinates(np.zeros((1, 6)))[0]
    assert checker._containment.pairs(stand)
    over = Deadline(RealClock(), -1.0)
    with checker.within(over), pytest.raises(PlanTimeout):
        checker._containment.pairs(stand)


def test_a_deadline_is_read_before_close_pairs_are_searched(tmp_path: Path) -> None:
    """In four nested rooms, a search of one row takes 30 ms."""
    room = World((Body("room", cube(tmp_path, (1.0, -0.99))),))
    checker = CollisionChecker(PlanningScene(ROBOT, room))
    row = np.zeros((1, len(ROBOT.actuated)))
    assert checker.close_pairs(row, 0.2)
    with checker.within(Deadline(RealClock(), -1.0)), pytest.raises(PlanTimeout):
        checker.close_pairs(row, 0.2)


def test_bodies_inside_a_link_are_found_without_a_margin() -> None:
    """coal misses overlaps of shapes with parallel axes at a margin of 0."""
    robot, missed = foreign("six_axes"), []
    for x, y, z in product((0.0, 0.01), (0.0, 0.01), np.linspace(0.25, 0.44, 20).round(3).tolist()):
        pea = World((Body("pea", Sphere(0.003), (x, y, z)),))
        checker = CollisionChecker(PlanningScene(robot, pea))
        if checker.first_invalid(np.zeros((1, 6)), 0.0) is None:
            missed.append((x, y, z))
    assert missed == []


@pytest.mark.parametrize(
    ("sizes", "open_top", "free"),
    [
        ((1.0,), False, False),
        ((-1.0,), False, False),
        ((1.0, 1.1), False, False),
        ((1.0,), True, True),
        ((1.1, -1.0), False, True),
    ],
    ids=["solid", "inside out", "of two parts", "tray", "room with thick walls"],
)
def test_an_arm_in_a_mesh_of_the_world(
    tmp_path: Path, sizes: tuple[float, ...], open_top: bool, free: bool
) -> None:
    there = World((Body("thing", cube(tmp_path, sizes, open_top), (0.0, 0.0, 0.5)),))
    query, rows = Query("arm", STAND, AWAY, world=there), [STAND, (*AWAY, 0.0)]
    reach = ToolQuery("arm", STAND, (0.1, 0.05, 0.08), world=there)
    if free:
        assert PLANNER.plan(query).duration
        assert PLANNER.reach(reach).found
        PLANNER.verify(Verify(rows, 0.005, world=there))
    else:
        with pytest.raises(StartInCollision, match="thing"):
            PLANNER.plan(query)
        with pytest.raises(GoalInCollision, match="thing"):
            PLANNER.reach(reach)
        with pytest.raises(MotionCollides, match="thing"):
            PLANNER.verify(Verify(rows, 0.005, world=there))


def test_an_arm_in_the_thick_wall_of_a_room(tmp_path: Path) -> None:
    """The wall is 1 m thick, so the arm is far from all triangles."""
    room = World((Body("room", cube(tmp_path, (4.0, -3.0)), (3.5, 0.0, 0.0)),))
    with pytest.raises(StartInCollision, match="room"):
        PLANNER.plan(Query("arm", STAND, AWAY, world=room))


@pytest.mark.parametrize("shape", [Box((0.01, 0.01, 0.01)), Mesh("small")])
def test_a_held_body_in_a_mesh(tmp_path: Path, shape: Shape) -> None:
    """Two bodies of the world, no link."""
    (tmp_path / "small").mkdir()
    if isinstance(shape, Mesh):
        shape = cube(tmp_path / "small", (0.005,))
    held = Body("held", shape, (0.0, 0.0, 0.8), link="base_plate")
    around = Body("around", cube(tmp_path, (0.1,)), (0.0, 0.0, 0.9))
    with pytest.raises(StartInCollision, match=r"held .* around"):
        PLANNER.plan(Query("arm", STAND, AWAY, world=World((held, around))))


def volume(triangles: Sequence[tuple[int, int, int]], corners: Array = CORNERS) -> EnclosedVolume:
    mesh = coal.BVHModelOBBRSS()
    mesh.beginModel(len(triangles), len(corners))
    mesh.addVertices(corners)
    mesh.addTriangles(np.array(triangles))
    mesh.endModel()
    return EnclosedVolume(mesh)


POINTS = st.lists(st.tuples(*[st.floats(-1.5, 1.5)] * 3), max_size=5)


@given(POINTS)
def test_inside_and_outside(points: list[tuple[float, float, float]]) -> None:
    solid = volume(TRIANGLES)
    assert solid.closed
    for point in points:
        if not np.isclose(np.abs(point), 1.0).any():
            assert solid.contains(np.array(point)) == (max(map(abs, point)) < 1.0)


@given(POINTS)
def test_a_point_is_never_inside_an_open_mesh(points: list[tuple[float, float, float]]) -> None:
    tray = volume(TRIANGLES[:-2])
    assert not tray.closed
    assert not any(tray.contains(np.array(point)) for point in points)


def test_rounding_of_vertices_opens_no_mesh() -> None:
    """As in a sphere whose last vertices are at sin(pi): a computer gives 1e-16, not 0."""
    corners = CORNERS[np.ravel(TRIANGLES)]
    corners *= 1.0 + np.random.default_rng(1).uniform(-1e-9, 1e-9, corners.shape)
    apart = [(i, i + 1, i + 2) for i in range(0, len(corners), 3)]
    assert volume(apart, corners).contains(np.zeros(3))
    assert not volume(apart[:-1], corners).closed


@given(POINTS)
def test_with_a_triangle_that_faces_inward_no_answer_depends_on_the_points_before(
    points: list[tuple[float, float, float]],
) -> None:
    """Below such a triangle the winding number is another one than in the middle."""
    a, b, c = TRIANGLES[0]
    triangles = [(a, c, b), *TRIANGLES[1:]]
    used = volume(triangles)
    assert used.closed
    below, middle = CORNERS[[a, b, c]].mean(axis=0) * 0.95, np.zeros(3)
    assert volume(triangles).contains(below) != volume(triangles).contains(middle)
    for point in (below, middle, below, *map(np.array, points)):
        assert used.contains(point) == volume(triangles).contains(point)


def test_an_arm_is_far_from_the_walls_of_a_room(tmp_path: Path) -> None:
    """The hull of the room contains the arm, so hulls do not show it."""
    room = World((Body("room", cube(tmp_path, (1.0, -0.99))),))
    checker = CollisionChecker(PlanningScene(ROBOT, room))
    links = checker.scene.linked_pairs(checker.scene.hulls)
    walls = frozenset(k for k, pair in enumerate(links) if "room" in pair)
    rows = np.zeros((4, len(ROBOT.actuated)))
    for margin, near in ((0.04, False), (0.9, True)):
        found = checker.proximity(rows, np.full(len(links), margin), 0.005, walls)
        assert found.collision is None
        assert found.near.tolist() == [near] * len(rows)

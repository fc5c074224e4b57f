"""Boxes, in a tree or not, find the same collisions as checking one pair after another."""

from collections.abc import Callable
from itertools import count
from pathlib import Path

import coal
import numpy as np
import pinocchio as pin
import pytest

from hardware import Robot, load_robot
from skills.motion import Body, Box, Cylinder, Shape, Sphere, World
from skills.motion.arrays import Array, Mask
from skills.motion.collision import (
    body_meshes,
    broad_phase,
    checker as collision_checker,
    narrow_phase,
)
from skills.motion.collision.broad_phase import BroadPhase
from skills.motion.collision.checker import CollisionChecker
from skills.motion.collision.planning_scene import PlanningScene
from skills.motion.robot_model.robot_model import RobotModel
from tests.support.arms.cube_mesh import cube
from tests.support.arms.robots import foreign

ROBOTS: dict[str, Callable[[], Robot]] = {
    "primitives and a floor": load_robot,
    "meshes": lambda: load_robot(Path("so101")),
    "seven axes": lambda: foreign("seven_axes"),
}
SHAPES: tuple[Shape, ...] = (
    Box((0.05, 0.03, 0.02)),
    Cylinder(0.02, 0.08),
    Sphere(0.03),
    Box((1e-6, 1e-6, 1e-6)),
)


def world(random: np.random.Generator, reach: float, *meshes: Shape) -> World:
    """Bodies of every kind in any pose; the smallest one is as small as a body may be."""
    bodies = []
    for i, shape in enumerate(3 * SHAPES + meshes):
        turn = random.normal(size=4)
        rotation = tuple((turn / np.linalg.norm(turn)).tolist())
        place = tuple(random.uniform(-reach, reach, 3).tolist())
        bodies.append(Body(f"body_{i}", shape, place, rotation))
    return World(tuple(bodies))


def configurations(robot: Robot, random: np.random.Generator, number: int) -> Array:
    lower = [max(joint.lower, -np.pi) for joint in robot.actuated]
    upper = [min(joint.upper, np.pi) for joint in robot.actuated]
    return random.uniform(lower, upper, (number, len(lower)))


@pytest.mark.slow
@pytest.mark.parametrize("name", ROBOTS)
@pytest.mark.parametrize("trays", [0, 2])
def test_boxes_miss_nothing(
    name: str, trays: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    robot, random = ROBOTS[name](), np.random.default_rng(1)
    meshes = trays * [cube(tmp_path, (0.1,), open_top=True)]
    around = world(random, 0.8 if name == "seven axes" else 0.3, *meshes)
    scene = PlanningScene(robot, around)
    assert bool(scene.triangle_pairs) == bool(trays)
    q = scene.robot_model.coordinates(configurations(robot, random, 300)).T
    every = frozenset(range(len(scene.hulls.collisionPairs)))
    some = frozenset(k for k in every if k % 3)

    def answers(boxes: bool) -> list[tuple[Mask, frozenset[int], int]]:
        checker, margins, found = (
            BroadPhase(scene, boxes, lambda: None),
            draws,
            [],
        )
        for pairs, margin in ((every, 0.0), (every, 0.005), (some, 0.03), (every, None)):
            if margin is None:
                checker.set_margins(pairs, margins)
            else:
                checker.set_margin(pairs, margin)
            hits = checker.collisions(q, stop=False)
            first = checker.collisions(q, stop=True).argmax()
            found.append((hits, checker.close_pairs(q), int(first)))
        return found

    draws = random.uniform(0.0, 0.1, len(every))
    one_by_one, all_boxes = answers(False), answers(True)
    monkeypatch.setattr(broad_phase, "FEW_SHAPES", 0)
    for found in (all_boxes, answers(True)):
        for (hits, pairs, first), (hits_, pairs_, first_) in zip(found, one_by_one, strict=True):
            assert hits.any()
            assert (hits == hits_).all()
            assert (pairs, first) == (pairs_, first_)


@pytest.mark.parametrize("boxes", [False, True])
def test_other_pairs_with_the_same_margin(boxes: bool, tmp_path: Path) -> None:
    robot, random = load_robot(), np.random.default_rng(5)
    around = world(random, 0.4, *2 * [cube(tmp_path, (0.15,), open_top=True)])
    scene = PlanningScene(robot, around)
    q = scene.robot_model.coordinates(configurations(robot, random, 300)).T
    every = frozenset(range(len(scene.hulls.collisionPairs)))
    used, found = BroadPhase(scene, boxes, lambda: None), []
    for pairs in every, frozenset(k for k in every if k % 2), every:
        fresh = BroadPhase(scene, boxes, lambda: None)
        for checker in used, fresh:
            checker.set_margin(pairs, 0.005)
        found.append(used.collisions(q, stop=False).sum())
        assert (used.collisions(q, stop=False) == fresh.collisions(q, stop=False)).all()
        assert used.close_pairs(q) == fresh.close_pairs(q)
    assert found[0] > found[1]


@pytest.mark.parametrize("boxes", [False, True])
def test_after_an_interrupted_search_for_close_pairs_all_pairs_are_checked(boxes: bool) -> None:
    robot, random = load_robot(), np.random.default_rng(3)
    scene, calls = PlanningScene(robot, world(random, 0.3)), count()
    q = scene.robot_model.coordinates(configurations(robot, random, 300)).T

    def check() -> None:
        if next(calls) == 1:
            raise TimeoutError

    def checker(check: Callable[[], None]) -> BroadPhase:
        made = BroadPhase(scene, boxes, check)
        made.set_margin(frozenset(range(len(scene.hulls.collisionPairs))), 0.01)
        return made

    interrupted = checker(check)
    with pytest.raises(TimeoutError):
        interrupted.close_pairs(q)
    assert interrupted.close_pairs(q) == checker(lambda: None).close_pairs(q)


def test_as_few_pools_of_exact_shapes_as_one_find_the_same_collisions(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    robot, random = load_robot(), np.random.default_rng(2)
    scene, rows = PlanningScene(robot, world(random, 0.6)), configurations(robot, random, 400)

    def found() -> list[int | None]:
        checker = CollisionChecker(scene)
        return [checker.first_collision(part, 0.02) for part in np.split(rows, 40)]

    many = found()
    monkeypatch.setattr(narrow_phase, "_MAX_POOLS", 1)
    assert found() == many
    assert len({*many}) > 2


@pytest.mark.parametrize("name", ROBOTS)
@pytest.mark.parametrize("few", [True, False], ids=["small world", "large world"])
def test_the_triangles_of_a_hollow_mesh_give_the_verdicts_of_its_hull(
    name: str, few: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What hulls do not decide, exact shapes decide."""
    robot, random = ROBOTS[name](), np.random.default_rng(4)
    tray = cube(tmp_path, (0.15,), open_top=True)
    held = Body("held", tray, (0.3, 0.2, 0.2), link=robot.links[-1])
    around = world(random, 1.2 if name == "seven axes" else 0.5, tray, tray)
    around = World((*around.bodies, held))
    rows = configurations(robot, random, 300)
    if not few:
        monkeypatch.setattr(broad_phase, "FEW_SHAPES", 0)
        monkeypatch.setattr(collision_checker, "FEW_SHAPES", 0)

    def verdicts(hollow: bool) -> tuple[list[bool], list[int | None], list[int | None]]:
        scene = PlanningScene(robot, around)
        assert bool(scene.triangle_pairs) == hollow
        checker = CollisionChecker(scene)
        each = [rows[i : i + 1] for i in range(len(rows))]
        return (
            checker.collisions(rows, 0.005).tolist(),
            [checker.first_collision(rows[i:], 0.005) for i in range(0, len(rows), 5)],
            [checker.first_invalid(row, 0.005) for row in each],
        )

    found = verdicts(hollow=True)
    monkeypatch.setattr(body_meshes, "_HOLLOW", 10.0)
    assert verdicts(hollow=False) == found
    assert len({*found[0]}) == 2


def points_of(shape: pin.GeometryObject, random: np.random.Generator, number: int) -> Array:
    """Random points of a shape, most of them on its surface, in the frame of its joint (N, 3)."""
    form = shape.geometry
    if isinstance(form, coal.BVHModelBase):
        faces = [form.tri_indices(k) for k in random.integers(form.num_tris, size=number).tolist()]
        corners = form.vertices()[np.array([[face[i] for i in range(3)] for face in faces])]
        points = (random.dirichlet(np.ones(3), number)[..., None] * corners).sum(axis=1)
    elif isinstance(form, coal.Box):
        points = np.clip(random.uniform(-2.0, 2.0, (number, 3)), -1.0, 1.0) * form.halfSide
    else:
        points = random.normal(size=(number, 3))
        if isinstance(form, coal.Cylinder):
            points[:, :2] /= np.linalg.norm(points[:, :2], axis=1, keepdims=True)
            points = np.clip(points, -1.0, 1.0) * (form.radius, form.radius, form.halfLength)
        else:
            assert isinstance(form, coal.Sphere)
            points *= form.radius / np.linalg.norm(points, axis=1, keepdims=True)
    return np.array([shape.placement.act(point) for point in points])


@pytest.mark.parametrize("name", ROBOTS)
def test_each_hull_covers_the_shapes_of_its_link(name: str) -> None:
    """So what keeps a distance to the hulls, keeps it to the links."""
    random, model = np.random.default_rng(17), RobotModel(ROBOTS[name]())
    hulls = dict(zip(model.hull_links, model.hulls, strict=True))
    for link, shape in zip(model.exact_links, model.exact, strict=True):
        hull = hulls[link].geometry
        assert isinstance(hull, coal.ConvexBase)
        assert hulls[link].parentJoint == shape.parentJoint
        vertices, points = hull.points(), points_of(shape, random, 2000)
        faces = [hull.polygons(k) for k in range(hull.num_polygons)]
        first, second, third = (vertices[[face[i] for face in faces]] for i in range(3))
        normals = np.cross(second - first, third - first)
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        normals *= -np.sign(((vertices.mean(axis=0) - first) * normals).sum(axis=1))[:, None]
        assert (points @ normals.T - (first * normals).sum(axis=1)).max() < 1e-9

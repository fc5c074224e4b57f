"""Hulls around the content of mesh files."""

import dataclasses
from collections.abc import Sequence
from pathlib import Path

import coal
import numpy as np
import pinocchio as pin
import pytest

from hardware import load_robot
from skills.motion import (
    BadWorld,
    Body,
    Box,
    Mesh,
    MotionCollides,
    Query,
    StartInCollision,
    Verify,
    World,
)
from skills.motion.collision import body_meshes
from skills.motion.collision.planning_scene import PlanningScene
from skills.motion.planner import Planner
from skills.motion.robot_model.geometry import convex_hull, corners
from skills.motion.world import quaternion
from tests.support.arms.cube_mesh import CORNERS, TRIANGLES

ROBOT = load_robot()
SHEET = ([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], [(0, 1, 2), (0, 2, 3)])
TRIANGLE = (SHEET[0][:3], SHEET[1][:1])


def rod(sides: int) -> tuple[list[object], list[object]]:
    """A cylinder as CAD programs write it: fans around the centres of both ends."""
    turns = 2.0 * np.pi / sides * np.arange(sides)
    ring = [(np.cos(a), np.sin(a)) for a in turns]
    points: list[object] = [(*xy, z) for z in (-1.0, 1.0) for xy in ring]
    points += [(0.0, 0.0, -1.0), (0.0, 0.0, 1.0)]
    faces = list[object]()
    for i in range(sides):
        j = (i + 1) % sides
        faces += [(i, j, sides + i), (sides + j, sides + i, j)]
        faces += [(j, i, 2 * sides), (sides + i, sides + j, 2 * sides + 1)]
    return points, faces


def mesh(folder: Path, points: object, faces: object, size: float = 0.1) -> Mesh:
    file = folder / "mesh.obj"
    lines = [f"v {x} {y} {z}" for x, y, z in np.asarray(points, float)]
    lines += ["f {} {} {}".format(*row) for row in np.asarray(faces) + 1]
    file.write_text("\n".join(lines) + "\n")
    return Mesh(str(file), (size, size, size))


CUBE = [tuple(corner) for corner in CORNERS.tolist()]
INNER = [tuple(i + len(CUBE) for i in reversed(triangle)) for triangle in TRIANGLES]
ROOM = ([*CUBE, *(0.8 * CORNERS)], [*TRIANGLES, *INNER])
FRAME = [(x, y, 0) for size in (1, 2) for x in (-size, size) for y in (-size, size)]
AROUND = [(0, 1, 4), (1, 5, 4), (1, 3, 5), (3, 7, 5), (3, 2, 7), (2, 6, 7), (2, 0, 6), (0, 4, 6)]


@pytest.mark.parametrize(
    ("points", "faces", "hollow"),
    [
        (CUBE, TRIANGLES, False),
        (CUBE, [(a, c, b) for a, b, c in TRIANGLES], False),
        (CUBE, TRIANGLES[:-1], True),
        ([(x, y, z - 1) for x, y, z in CUBE], TRIANGLES[:-2], True),
        ([(x, y, z + 9) for x, y, z in CUBE], TRIANGLES[:-2], True),
        (*SHEET, False),
        (FRAME, AROUND, True),
        (*ROOM, True),
        (*rod(64), False),
    ],
    ids=[
        "solid", "inside out", "with a door", "tray below the origin", "tray above the origin",
        "sheet", "frame", "room", "rod",
    ],
)  # fmt: skip
def test_which_meshes_are_hollow(
    tmp_path: Path, points: object, faces: object, hollow: bool
) -> None:
    there = World((Body("thing", mesh(tmp_path, points, faces), (0.0, 0.0, 0.6)),))
    assert bool(PlanningScene(ROBOT, there).triangle_pairs) == hollow


@pytest.mark.slow
@pytest.mark.parametrize("form", [SHEET, TRIANGLE, rod(64), rod(300), rod(1000)])
@pytest.mark.parametrize("height", [0.6, 0.15])
def test_thin_and_round_bodies_are_checked_exactly(
    tmp_path: Path, form: tuple[object, object], height: float
) -> None:
    """Above the arm the body is free, through the arm it is in collision."""
    there = World((Body("thing", mesh(tmp_path, *form), (0.0, 0.0, height)),))
    planner, stand = Planner(ROBOT), (0.0,) * 4
    if height > 0.5:
        assert planner.plan(Query("arm", stand, (0.5, 0.0, 0.0), world=there)).duration
    else:
        with pytest.raises(MotionCollides, match="thing"):
            planner.verify(Verify([stand, (0.5, 0.0, 0.0, 0.0)], 0.005, world=there))


@pytest.mark.parametrize(("x", "free"), [(0.0, True), (0.15, False)])
def test_an_arm_in_a_flat_frame(tmp_path: Path, x: float, free: bool) -> None:
    """The arm stands in its opening, or where the frame is."""
    there = World((Body("frame", mesh(tmp_path, FRAME, AROUND), (x, 0.0, 0.15)),))
    planner = Planner(ROBOT)
    request = Verify([(0.0,) * 4, (0.5, 0.0, 0.0, 0.0)], 0.005, world=there)
    if free:
        planner.verify(request)
    else:
        with pytest.raises(MotionCollides, match="frame"):
            planner.verify(request)


def test_a_mesh_without_numbers_is_rejected(tmp_path: Path) -> None:
    points = [(float("nan"), 0.0, 0.0), *SHEET[0][1:]]
    there = World((Body("thing", mesh(tmp_path, points, SHEET[1]), (0.0, 0.0, 0.6)),))
    with pytest.raises(BadWorld, match=r"mesh\.obj"):
        Planner(ROBOT).plan(Query("arm", (0.0,) * 4, (0.5, 0.0, 0.0), world=there))


def test_a_mesh_is_read_once_while_its_world_changes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A large mesh takes a second to read. It is in another place in each world."""
    hulls = list[object]()

    def noted(shapes: Sequence[pin.GeometryObject]) -> coal.ConvexBase:
        hulls.append(convex_hull(shapes))
        return hulls[-1]

    monkeypatch.setattr(body_meshes, "convex_hull", noted)
    form = mesh(tmp_path, *rod(16))
    planner, query = Planner(ROBOT), Query("arm", (0.0,) * 4, (0.5, 0.0, 0.0))
    box = Body("box", Box((0.1, 0.1, 0.1)), (1.0, 0.0, 0.5))
    for world in (
        World((Body("thing", form, (0.0, 0.0, 0.7)),)),
        World((Body("thing", form, (0.0, 0.0, 0.7)), box)),
        World((Body("thing", form, (0.0, 0.0, 0.8), quaternion(0.5, 0.0, 0.0)), box)),
    ):
        assert planner.plan(dataclasses.replace(query, world=world)).duration
    there = World((Body("thing", form, (0.0, 0.0, 0.2)),))
    with pytest.raises(StartInCollision, match="thing"):
        planner.plan(dataclasses.replace(query, world=there))
    assert len(hulls) == 1


def test_a_placed_hull_contains_its_mesh(tmp_path: Path) -> None:
    turn = quaternion(0.3, -0.8, 1.2)
    body = Body("thing", mesh(tmp_path, *rod(16)), (0.1, 0.2, 0.3), turn, link="claw_support")
    scene = PlanningScene(ROBOT, World((body,)))
    bounds = []
    for geometry in (scene.exact, scene.hulls):
        points = corners(geometry.geometryObjects[geometry.getGeometryId("thing")])
        bounds.append((points.min(axis=0), points.max(axis=0)))
    assert np.array(bounds[0]) == pytest.approx(np.array(bounds[1]), abs=1e-9)


def test_a_changed_mesh_file_is_read_again(tmp_path: Path) -> None:
    """The path and the world stay equal, the content changes."""
    points, faces = rod(16)
    there = World((Body("thing", mesh(tmp_path, points, faces), (0.0, 0.0, 0.7)),))
    planner, query = Planner(ROBOT), Query("arm", (0.0,) * 4, (0.5, 0.0, 0.0), world=there)
    assert planner.plan(query).duration
    mesh(tmp_path, 10.0 * np.asarray(points), faces)
    with pytest.raises(StartInCollision, match="thing"):
        planner.plan(query)
    Path(tmp_path / "mesh.obj").unlink()
    with pytest.raises(BadWorld, match=r"mesh\.obj"):
        planner.plan(query)

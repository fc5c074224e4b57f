"""Meshes of the world's bodies, each read from its file once for all scenes that contain it."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from weakref import WeakValueDictionary

import coal
import numpy as np
import pinocchio as pin

from hardware.description.meshes import MAX_MESH_BYTES
from skills.motion.arrays import Array
from skills.motion.errors import BadWorld
from skills.motion.robot_model.geometry import EnclosedVolume, convex_hull
from skills.motion.world import Mesh, Stamp, World, mesh_stamp

_HOLLOW = 0.03  # radius of a ball that fits into a hollow mesh; about that of a small link [m]
_PLACES = 256  # places of the ball that are tried
_MAX_FREE = 8  # free places that are checked for solid material, 30 ms each for 400,000 triangles


@dataclass(frozen=True, eq=False)
class BodyMesh:
    """A mesh in its own frame.

    Attributes:
        shape: The triangles.
        hull: Their convex hull.
        volume: The volume inside them.
        hollow: True if a small ball was found to fit into the hull beside the triangles, as in a
            room, a tray or under a table.
    """

    shape: coal.BVHModelBase
    hull: coal.ConvexBase
    volume: EnclosedVolume
    hollow: bool


class BodyMeshes:
    """Meshes that some scene contains. A mesh is dropped with the last scene that contains it.

    A mesh of 400,000 triangles takes 3 s to read, and a scene with it 3 ms to build.
    """

    def __init__(self) -> None:
        self._loaded = WeakValueDictionary[tuple[Mesh, Stamp | None], BodyMesh]()

    def load_all(self, world: World) -> list[BodyMesh]:
        """Return the meshes of a world. They stay in memory as long as the list or a scene does.

        Raises:
            BadWorld: `load` failed.
        """
        found = list[BodyMesh]()
        for number, body in enumerate(world.bodies):
            if isinstance(body.shape, Mesh):
                with located(number, "mesh"):
                    found.append(self.load(body.shape))
        return found

    def load(self, mesh: Mesh) -> BodyMesh:
        """Return a mesh as its file is now.

        Raises:
            BadWorld: The file cannot be read or is too large, or a vertex is out of range.
        """
        key = mesh, mesh_stamp(mesh)
        loaded = self._loaded.get(key)
        if loaded is None:
            self._loaded[key] = loaded = _read(*key)
        return loaded


@contextmanager
def located(*steps: int | str) -> Iterator[None]:
    """Put steps before the location of an error."""
    try:
        yield
    except BadWorld as error:
        error.location = (*steps, *error.location)
        raise


def _read(mesh: Mesh, stamp: Stamp | None) -> BodyMesh:
    path, file = mesh.path, Path(mesh.path)
    if not file.is_file():
        what = "it is not an ordinary file" if file.exists() else f"there is no {file.absolute()}"
        raise BadWorld(f"The mesh {path} cannot be read: {what}")
    if stamp and stamp[1] > MAX_MESH_BYTES:
        raise BadWorld(f"The mesh {path} has {stamp[1]} bytes; {MAX_MESH_BYTES} are allowed")
    try:
        shape = coal.MeshLoader().load(path, np.array(mesh.scale))
    except (RuntimeError, ValueError) as error:
        why = str(error).partition("message: ")[2].splitlines() or [str(error)]
        raise BadWorld(
            f"The mesh {path} cannot be read: {why[0]}; give an STL, DAE or OBJ file"
        ) from error
    try:
        hull = convex_hull([pin.GeometryObject(path, 0, 0, pin.SE3.Identity(), shape)])
    except ValueError as error:
        raise BadWorld(f"The mesh {path} is unusable: {error}") from error
    for geometry in shape, hull:
        geometry.computeLocalAABB()  # coal needs the boxes for its first guess
    volume = EnclosedVolume(shape)
    return BodyMesh(shape, hull, volume, _is_hollow(shape, hull, volume))


def _is_hollow(shape: coal.BVHModelBase, hull: coal.ConvexBase, volume: EnclosedVolume) -> bool:
    """Return True if a ball is found to fit into the hull of a mesh without touching the mesh.

    The places are random points of the hull. The inside of a closed mesh is solid. A hollow mesh
    that is not found takes more time in later checks.
    """
    random, corners = np.random.default_rng(1), np.asarray(hull.points())
    chosen = corners[random.integers(len(corners), size=(_PLACES, 4))]
    places = np.einsum("pi,pij->pj", random.dirichlet(np.ones(4), _PLACES), chosen)
    ball, identity = coal.Sphere(_HOLLOW), coal.Transform3s.Identity()

    def is_free(place: Array) -> bool:
        result, placed = coal.CollisionResult(), coal.Transform3s(np.eye(3), place)
        coal.collide(shape, identity, ball, placed, coal.CollisionRequest(), result)
        return not result.isCollision()

    free = islice(filter(is_free, places), _MAX_FREE)
    return not all(volume.contains(place) for place in free)

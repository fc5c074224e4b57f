"""What a mesh encloses."""

from functools import cached_property

import coal
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Solid:
    """What a mesh encloses, prepared so that points are soon placed.

    Args:
        points: Its corners (V, 3) [m].
        triangles: Three of them each (F, 3).

    Attributes:
        size: How many triangles there are.
    """

    def __init__(self, points: Array, triangles: NDArray[np.intp]) -> None:
        self._points, self._triangles, self.size = points, triangles, len(triangles)
        a, b, c = points[triangles.T]
        self._normals = np.cross(b - a, c - a)
        self._heights = _dots(a, self._normals)
        self._sides = np.array([0.5 * _dots(side, side) for side in (b - a, c - b, a - c)])

    @cached_property
    def closed(self) -> bool:
        """Whether every edge is shared by two triangles, or four, and so on."""
        _, same = np.unique(self._points, axis=0, return_inverse=True)
        corners = same.reshape(-1)[self._triangles]
        edges = np.sort(corners[:, [[0, 1], [1, 2], [2, 0]]], axis=2).reshape(-1, 2)
        edges = edges[edges[:, 0] != edges[:, 1]]
        _, counts = np.unique(edges, axis=0, return_counts=True)
        return not (counts % 2).any()

    def contains(self, point: Array) -> bool:
        """Whether the surface goes round a point (3,) [m].

        How often it does is the sum of the solid angles under which the triangles are seen (A. Van
        Oosterom and J. Strackee, "The solid angle of a plane triangle", 1983): once inside, twice
        where two parts of a link overlap, not at all in a hollow.
        """
        apart = self._points - point
        squares = _dots(apart, apart)
        la, lb, lc = np.sqrt(squares)[self._triangles.T]
        a, b, c = 0.5 * squares[self._triangles.T]
        ab, bc, ca = (
            np.array([a + b, b + c, c + a]) - self._sides
        )  # products of the ways to corners
        volume = self._heights - self._normals @ point
        rest = la * lb * lc + ab * lc + bc * la + ca * lb
        return bool(abs(np.arctan2(volume, rest).sum()) > np.pi)  # halves of solid angles


def _dots(a: Array, b: Array) -> Array:
    return np.asarray(np.einsum("fi,fi->f", a, b))


def solid_of(geometry: coal.CollisionGeometry) -> Solid | None:
    """What a mesh encloses; None for a primitive."""
    if not isinstance(geometry, coal.BVHModelBase):
        return None
    rows = map(geometry.tri_indices, range(geometry.num_tris))  # coal gives them one by one
    corners = (row[i] for row in rows for i in range(3))
    triangles = np.fromiter(corners, np.intp, 3 * geometry.num_tris).reshape(-1, 3)
    return Solid(np.array(geometry.vertices()), triangles)

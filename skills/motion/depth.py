"""How deep two shapes are in each other, where one of them is a mesh.

Of a mesh coal knows how deep single triangles are, which says nothing of the whole. What is meant
is how far one of the two has to be moved until it is free of the other. As far as their hulls are
deep is always enough, and for convex shapes it is just that; for others shorter ways are looked
for. So it is never said to be less than it is.
"""

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from .inside import Insides
from .model import Model

Array = NDArray[np.float64]

_SHARE = 0.05  # to which a depth is told, but no finer than that [m]:
_FINEST = 1e-4
_CONTACTS = 200  # enough to show how two surfaces cut each other


class Depths:
    """Measures how deep shapes of a model are in each other; for one thread.

    Args:
        model: Whose.
        data: Working memory of its joints.
        placed: And of its exact shapes; whoever asks brings both up to date before.
        insides: Looks into the same meshes.
    """

    def __init__(
        self, model: Model, data: pin.Data, placed: pin.GeometryData, insides: Insides
    ) -> None:
        self._model, self._data, self._placed, self._insides = model, data, placed, insides
        self._outer = model.outer.createData()
        hulls = {model.link(model.outer, i): i for i in range(len(model.outer.geometryObjects))}
        shapes = range(len(model.exact.geometryObjects))
        self._hulls = [hulls[model.link(model.exact, i)] for i in shapes]

    def deepest(self, distances: Array, inside: list[int]) -> int:
        """The pair of `Model.exact` that is nearest or deepest; its distance is set right.

        Args:
            distances: What coal says of each pair (P,), corrected here [m].
            inside: Pairs of which one is wholly inside the other.
        """
        cut, model = {k for k in self._insides.meshed if distances[k] <= 0.0}, self._model
        if cut or inside:
            pin.updateGeometryPlacements(model.kinematics, self._data, model.outer, self._outer)
        for k in cut.union(inside):
            distances[k] = -self._of_hulls(k)[0]
        while (deepest := int(np.argmin(distances))) in cut:
            cut.remove(deepest)
            distances[deepest] = -self._depth(deepest)
        return deepest

    def _of_hulls(self, pair: int) -> tuple[float, Array]:
        """How deep the hulls of two are in each other [m], and which way the second one is out."""
        ends, result = self._model.exact.collisionPairs[pair], coal.DistanceResult()
        first, second = self._hulls[ends.first], self._hulls[ends.second]
        shapes, places = self._model.outer.geometryObjects, self._outer.oMg
        distance = coal.distance(
            shapes[first].geometry,
            _transform(places[first], np.zeros(3)),
            shapes[second].geometry,
            _transform(places[second], np.zeros(3)),
            coal.DistanceRequest(),
            result,
        )
        return max(0.0, -distance), np.array(result.normal)

    def _depth(self, pair: int) -> float:
        """The shortest way out that is found [m]."""
        depth, out = self._of_hulls(pair)
        for way in (out, *self._across(pair)):
            depth = self._out(pair, way, depth)
        return depth

    def _across(self, pair: int) -> Array:
        """Both ways across the plane, as far as it is one, that two surfaces cut each other in.

        Shapes that only graze each other are soonest apart there.
        """
        request = coal.CollisionRequest()
        request.enable_contact, request.num_max_contacts = True, _CONTACTS
        contacts = self._collide(pair, np.zeros(3), request).getContacts()
        points = np.array([contact.pos for contact in contacts]).reshape(-1, 3)
        if not len(points):
            return points
        middled = points - points.mean(axis=0)
        across = np.linalg.eigh(middled.T @ middled)[1][:, 0]
        return np.array([across, -across])

    def _out(self, pair: int, way: Array, depth: float) -> float:
        """How far along a way the second one is out; `depth` where that is not sooner [m]."""
        near, far = 0.0, _FINEST
        while far < depth and self._touch(pair, far * way):
            near, far = far, 2.0 * far
        far = min(far, depth)
        while far - near > max(_SHARE * far, _FINEST):
            middle = 0.5 * (near + far)
            near, far = (middle, far) if self._touch(pair, middle * way) else (near, middle)
        return far

    def _touch(self, pair: int, shift: Array) -> bool:
        """Whether they would touch if the second one were moved by a shift (3,) [m]."""
        result = self._collide(pair, shift, coal.CollisionRequest())
        return result.isCollision() or self._insides.shifted(pair, shift)

    def _collide(
        self, pair: int, shift: Array, request: coal.CollisionRequest
    ) -> coal.CollisionResult:
        ends, result = self._model.exact.collisionPairs[pair], coal.CollisionResult()
        shapes, places = self._model.exact.geometryObjects, self._placed.oMg
        coal.collide(
            shapes[ends.first].geometry,
            _transform(places[ends.first], np.zeros(3)),
            shapes[ends.second].geometry,
            _transform(places[ends.second], shift),
            request,
            result,
        )
        return result


def _transform(place: pin.SE3, shift: Array) -> coal.Transform3s:
    return coal.Transform3s(place.rotation, place.translation + shift)

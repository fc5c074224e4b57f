"""How near two shapes are, or how deep in each other.

Of a mesh coal knows how deep single triangles are, which says nothing of the whole. What is meant
is how far one of the two has to be moved until it is free of the other. As far as their hulls are
deep is always enough, and for convex shapes it is just that; for others, unless they are very fine,
shorter ways are looked for. So it is never said to be less than it is.
"""

import math
from collections.abc import Iterator

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from skills.motion.collision.scene import PlanningScene

from .inside import Insides

Array = NDArray[np.float64]

_SHARE = 0.05  # to which a depth is told, but no finer than that [m]:
_FINEST = 1e-4
_CONTACTS = 50  # enough to show how two surfaces cut each other
_LARGE = 20_000  # triangles of two; of more each look takes milliseconds, and there is but one
_STILL = np.zeros(3)
_FAR, _ANY, _ALL = coal.DistanceRequest(), coal.CollisionRequest(), coal.CollisionRequest()
_ALL.enable_contact, _ALL.num_max_contacts = True, _CONTACTS


class Depths:
    """Measures the shapes of a model; for one thread.

    Args:
        model: Whose.
        data: Working memory of its joints.
        placed: And of its exact shapes.
        insides: Looks into the same meshes.
    """

    def __init__(
        self, model: PlanningScene, data: pin.Data, placed: pin.GeometryData, insides: Insides
    ) -> None:
        self._model, self._data, self._placed, self._insides = model, data, placed, insides
        self._outer = model.outer.createData()
        hulls = {ends: k for k, ends in enumerate(_ends(model, model.outer))}
        self._hulls = [hulls[ends] for ends in _ends(model, model.exact)]

    def nearest(self, q: Array) -> tuple[int, float]:
        """The pair of `PlanningScene.exact` that is deepest, or else nearest, and its distance [m].

        No two are nearer, or deeper, than their hulls. So they are asked in the order of these, and
        most are never asked. Whether they touch is asked first: of meshes that costs a hundredth of
        how far apart they are.

        Args:
            q: Where the joints are, as pinocchio wants them (nq,).
        """
        model = self._model
        pin.computeDistances(model.kinematics, self._data, model.outer, self._outer, q)
        pin.updateGeometryPlacements(model.kinematics, self._data, model.exact, self._placed)
        hulls = np.array([result.min_distance for result in self._outer.distanceResults])
        least = hulls[self._hulls]
        order = np.argsort(least, kind="stable").tolist()
        for ask in (self._overlap, self._gap):
            found, nearest = -1, math.inf
            for k in order:
                if least[k] >= nearest or (ask == self._overlap and least[k] > 0.0):
                    break
                distance = ask(k, nearest)
                if distance < nearest:
                    found, nearest = k, distance
            if found >= 0:
                return found, nearest
        raise AssertionError("shapes are some distance apart")

    def _overlap(self, pair: int, nearest: float) -> float:
        """How far two are from touching, 0 or less; infinite if they are apart [m].

        It is not looked for once it is no less than `nearest`.
        """
        if pair not in self._insides.meshed:
            distance = self._gap(pair, nearest)
            return distance if distance <= 0.0 else math.inf
        if not self._touch(pair, _STILL):
            return math.inf
        return -self._depth(pair, max(0.0, -nearest))

    def _gap(self, pair: int, nearest: float) -> float:
        """How far two are apart [m]; it is not looked for once it is no less than `nearest`."""
        ends, result = self._model.exact.collisionPairs[pair], coal.DistanceResult()
        if ends.first in self._model.solids and pair not in self._insides.meshed:
            return self._height(ends.first, ends.second)
        if 0.0 < nearest < math.inf:  # coal takes one below 0 for its own answer
            result.min_distance = nearest
        coal.distance(*self._shape(ends.first), *self._shape(ends.second), _FAR, result)
        return float(result.min_distance)

    def _height(self, mesh: int, floor: int) -> float:
        """How far a mesh is above the floor [m]; coal would tell that of a single triangle."""
        shapes, place = self._model.exact.geometryObjects, self._placed.oMg[mesh]
        half, points = shapes[floor].geometry, np.asarray(shapes[mesh].geometry.vertices())
        heights = points @ (place.rotation.T @ half.n)
        return float(heights.min() + half.n @ place.translation - half.d)

    def _depth(self, pair: int, enough: float) -> float:
        """The shortest way out that is found, or one no longer than `enough` [m]."""
        hulls = self._outer.distanceResults[self._hulls[pair]]
        depth: float = max(0.0, -hulls.min_distance)
        ways = () if self._large(pair) else self._ways(pair, np.array(hulls.normal))
        for way in ways:
            depth = self._out(pair, way, depth, enough)
            if depth <= enough:
                break
        return depth

    def _large(self, pair: int) -> bool:
        ends, solids = self._model.exact.collisionPairs[pair], self._model.solids
        return sum(solids[i].size for i in (ends.first, ends.second) if i in solids) > _LARGE

    def _ways(self, pair: int, out: Array) -> Iterator[Array]:
        """Which ways the second one may be soonest out: unit vectors (3,).

        That of the hulls, and both across the plane, as far as it is one, that two surfaces cut
        each other in. Shapes that only graze each other are soonest apart there.
        """
        yield out
        contacts = self._collide(pair, _STILL, _ALL).getContacts()
        points = np.array([contact.pos for contact in contacts]).reshape(-1, 3)
        if len(points):
            middled = points - points.mean(axis=0)
            across = np.linalg.eigh(middled.T @ middled)[1][:, 0]
            yield across
            yield -across

    def _out(self, pair: int, way: Array, depth: float, enough: float) -> float:
        """How far along a way the second one is out; `depth` where that is not sooner [m]."""
        if enough > 0.0 and not self._touch(pair, enough * way):
            return enough
        near, far, middle = max(enough, _FINEST), depth, (1.0 - _SHARE) * depth
        while far - near > max(_SHARE * far, _FINEST):
            if self._touch(pair, middle * way):
                near = middle
            else:
                far = middle
            middle = math.sqrt(near * far)
        return far

    def _touch(self, pair: int, shift: Array) -> bool:
        """Whether they would touch if the second one were moved by a shift (3,) [m]."""
        hit = self._collide(pair, shift, _ANY).isCollision()
        return hit or self._insides.shifted(pair, shift)

    def _collide(
        self, pair: int, shift: Array, request: coal.CollisionRequest
    ) -> coal.CollisionResult:
        ends, result = self._model.exact.collisionPairs[pair], coal.CollisionResult()
        coal.collide(*self._shape(ends.first), *self._shape(ends.second, shift), request, result)
        return result

    def _shape(
        self, index: int, shift: Array = _STILL
    ) -> tuple[coal.CollisionGeometry, coal.Transform3s]:
        place = self._placed.oMg[index]
        where = coal.Transform3s(place.rotation, place.translation + shift)
        return self._model.exact.geometryObjects[index].geometry, where


def _ends(model: PlanningScene, geometry: pin.GeometryModel) -> list[tuple[str, str]]:
    """The two links of each pair."""
    links = [model.link(geometry, index) for index in range(len(geometry.geometryObjects))]
    return [(links[pair.first], links[pair.second]) for pair in geometry.collisionPairs]

"""The geometric path: straight lines with parabolic corners, exact at every point.

The parameter s is the length of the polyline through the waypoints, in joint space. A corner of
radius r replaces the last r before a waypoint and the first r after it by the parabola that is
tangent to both, traversed at the same rate of s: with unit directions d and e before and after,

    q(u) = q_corner - r d + u d + u^2 (e - d) / (4 r),      0 <= u <= 2 r

so dq/ds runs linearly from d to e and is continuous, and |dq/ds| <= 1.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skills.motion.arrays import norms, readonly

Array = NDArray[np.float64]

_SAME = 1e-9  # a break nearer ahead than this is passed: no piece is too short to be timed


@dataclass(frozen=True, eq=False)
class Curve:
    """Pieces of `base + u * slope + u**2 * bend`, with u = s less the break where they begin.

    Attributes:
        breaks: Where the pieces begin, and the end of the last (M + 1,), in units of s.
        base: Where each piece begins (M, J) [rad].
        slope: dq/ds at the beginning of each piece (M, J).
        bend: Half of d2q/ds2 of each piece (M, J).
        stops: Values of s between the ends where the direction jumps, so the motion must stop.
    """

    breaks: Array
    base: Array
    slope: Array
    bend: Array
    stops: Array

    def __post_init__(self) -> None:
        for name in ("breaks", "base", "slope", "bend", "stops"):
            object.__setattr__(self, name, readonly(getattr(self, name)))

    @classmethod
    def through(cls, waypoints: Array, radii: Array) -> "Curve":
        """The curve along a polyline.

        Args:
            waypoints: At least two, each different from the one before (N, J) [rad].
            radii: Of the corners, 0 where the motion stops (N - 2,), in units of s; those of
                neighbouring corners fit between them.
        """
        steps = np.diff(waypoints, axis=0)
        lengths = norms(steps)
        directions = steps / lengths[:, None]
        reach = np.concatenate(([0.0], np.cumsum(lengths)))
        ends = np.concatenate(([0.0], radii, [0.0]))
        pieces = []
        for i, direction in enumerate(directions):
            if i and radii[i - 1] > 0.0:
                r, before = radii[i - 1], directions[i - 1]
                start = waypoints[i] - r * before
                pieces.append((reach[i] - r, start, before, (direction - before) / (4.0 * r)))
            if lengths[i] - ends[i] - ends[i + 1] > 1e-12 * reach[-1]:
                start = waypoints[i] + ends[i] * direction
                pieces.append((reach[i] + ends[i], start, direction, 0.0 * direction))
        breaks, base, slope, bend = zip(*pieces, strict=True)
        stops = reach[1:-1][radii == 0.0]
        return cls(
            np.array([*breaks, reach[-1]]), np.array(base), np.array(slope), np.array(bend), stops
        )

    @classmethod
    def line(cls, begin: Array, end: Array) -> "Curve":
        """The line from one point to another (J,) [rad]."""
        step = (end - begin)[None, :]
        length = norms(step)
        slope = step / length[:, None]
        breaks = np.array([0.0, length[0]])
        return cls(breaks, begin[None, :], slope, np.zeros_like(slope), np.empty(0))

    @classmethod
    def point(cls, position: Array) -> "Curve":
        """The curve of length 0 at a position (J,) [rad]."""
        still = np.zeros((1, len(position)))
        return cls(np.zeros(2), position[None, :], still, still, np.empty(0))

    def after(self, s: float) -> "Curve":
        """What is left of it from s on; its own parameter begins at 0 there."""
        beyond = s + _SAME
        first = int(np.searchsorted(self.breaks[1:-1], beyond, side="right"))
        base, slope = self.base[first:].copy(), self.slope[first:].copy()
        u = max(0.0, s - self.breaks[first])
        base[0] += u * (slope[0] + u * self.bend[first])
        slope[0] += 2.0 * u * self.bend[first]
        breaks = np.concatenate(([0.0], self.breaks[first + 1 :] - s))
        return Curve(breaks, base, slope, self.bend[first:], self.stops[self.stops > beyond] - s)

    @property
    def length(self) -> float:
        """Largest s."""
        return float(self.breaks[-1])

    @property
    def straight(self) -> bool:
        """Whether it is one line."""
        return len(self.base) == 1 and not self.bend.any()

    def positions(self, s: Array) -> Array:
        """Positions at s (K,) -> (K, J) [rad]."""
        i, u = self._place(s)
        return self.base[i] + u * (self.slope[i] + u * self.bend[i])

    def slopes(self, s: Array) -> Array:
        """First derivative dq/ds at s (K,) -> (K, J)."""
        i, u = self._place(s)
        return self.slope[i] + 2.0 * u * self.bend[i]

    def bends(self, s: Array) -> Array:
        """Second derivative at s, of the piece that begins there (K,) -> (K, J) [1/rad]."""
        i, _ = self._place(s)
        return 2.0 * self.bend[i]

    def intervals(self, grid: Array) -> tuple[Array, Array, Array]:
        """Of intervals that lie each in one piece, as seen from within.

        Args:
            grid: Their ends (K + 1,).

        Returns:
            dq/ds at the lower ends, at the upper ends, and d2q/ds2, each (K, J).
        """
        i, _ = self._place(0.5 * (grid[:-1] + grid[1:]))
        bends = 2.0 * self.bend[i]
        lower, upper = ((s - self.breaks[i])[:, None] for s in (grid[:-1], grid[1:]))
        return self.slope[i] + lower * bends, self.slope[i] + upper * bends, bends

    def _place(self, s: Array) -> tuple[NDArray[np.intp], Array]:
        i = np.searchsorted(self.breaks[1:-1], s, side="right")
        return i, (s - self.breaks[i])[:, None]

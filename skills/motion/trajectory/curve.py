"""The path of a motion as a curve: straight lines and parabolic blends, exact at every point.

The parameter s is the length along the lines between the waypoints, in joint space [rad]. A blend
of radius r replaces a length r before and after a waypoint by the parabola that is tangent to both
lines. With the unit direction d before the waypoint and the unit direction e after it,

    q(u) = q_corner - r d + u d + u^2 (e - d) / (4 r),      0 <= u <= 2 r

so dq/ds changes linearly from d to e and is continuous, and |dq/ds| <= 1.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skills.motion.arrays import Array, norms, readonly

_SAME = 1e-9  # a break at most this far ahead counts as passed: a very short piece cannot be timed


class Slopes(NamedTuple):
    """Derivatives of a curve in intervals of s. Each interval is within one piece of the curve.

    Attributes:
        lower: dq/ds at the lower ends (K, J).
        upper: dq/ds at the upper ends (K, J).
        second: d2q/ds2 (K, J) [1/rad].
    """

    lower: Array
    upper: Array
    second: Array


@dataclass(frozen=True, eq=False)
class Curve:
    """A piecewise quadratic curve: `constant + u * linear + u**2 * quadratic` on each piece.

    The parameter u is s minus the first break of the piece.

    Attributes:
        breaks: Values of s at which pieces begin, and s at the end of the last piece (M + 1,).
        constant: Position at the start of each piece (M, J) [rad].
        linear: dq/ds at the start of each piece (M, J).
        quadratic: Half of d2q/ds2 of each piece (M, J) [1/rad].
        stops: Values of s, without both ends, at which the direction jumps. The motion must stop
            there.
    """

    breaks: Array
    constant: Array
    linear: Array
    quadratic: Array
    stops: Array

    def __post_init__(self) -> None:
        for name in ("breaks", "constant", "linear", "quadratic", "stops"):
            object.__setattr__(self, name, readonly(getattr(self, name)))

    @classmethod
    def through(cls, waypoints: Array, radii: Array) -> "Curve":
        """Return the curve along the lines between waypoints.

        Args:
            waypoints: Two or more waypoints (N, J) [rad]. Each differs from the previous waypoint.
            radii: Blend radii of the corners (N - 2,) [rad]. If a radius is 0, the motion stops at
                the corner. The line between two corners must be as long as the sum of their radii.
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
        breaks, constant, linear, quadratic = zip(*pieces, strict=True)
        stops = reach[1:-1][radii == 0.0]
        return cls(
            np.array([*breaks, reach[-1]]),
            np.array(constant),
            np.array(linear),
            np.array(quadratic),
            stops,
        )

    @classmethod
    def line(cls, begin: Array, end: Array) -> "Curve":
        """Return the straight curve from one point to another point (J,) [rad]."""
        step = (end - begin)[None, :]
        length = norms(step)
        linear = step / length[:, None]
        breaks = np.array([0.0, length[0]])
        return cls(breaks, begin[None, :], linear, np.zeros_like(linear), np.empty(0))

    @classmethod
    def point(cls, position: Array) -> "Curve":
        """Return the curve of length 0 at a position (J,) [rad]."""
        zero = np.zeros((1, len(position)))
        return cls(np.zeros(2), position[None, :], zero, zero, np.empty(0))

    def after(self, s: float) -> "Curve":
        """Return the rest of the curve after `s`. The parameter of the result begins at 0."""
        passed = s + _SAME
        first = int(np.searchsorted(self.breaks[1:-1], passed, side="right"))
        constant, linear = self.constant[first:].copy(), self.linear[first:].copy()
        u = max(0.0, s - self.breaks[first])
        constant[0] += u * (linear[0] + u * self.quadratic[first])
        linear[0] += 2.0 * u * self.quadratic[first]
        breaks = np.concatenate(([0.0], self.breaks[first + 1 :] - s))
        stops = self.stops[self.stops > passed] - s
        return Curve(breaks, constant, linear, self.quadratic[first:], stops)

    @property
    def length(self) -> float:
        """Largest s [rad]."""
        return float(self.breaks[-1])

    @property
    def straight(self) -> bool:
        """True if the curve is a single line."""
        return len(self.constant) == 1 and not self.quadratic.any()

    def positions(self, s: Array) -> Array:
        """Return positions at s (K,) -> (K, J) [rad]."""
        i, u = self._piece(s)
        return self.constant[i] + u * (self.linear[i] + u * self.quadratic[i])

    def first_derivatives(self, s: Array) -> Array:
        """Return dq/ds at s (K,) -> (K, J)."""
        i, u = self._piece(s)
        return self.linear[i] + 2.0 * u * self.quadratic[i]

    def second_derivatives(self, s: Array) -> Array:
        """Return d2q/ds2 at s (K,) -> (K, J) [1/rad]; at a break, the value of the next piece."""
        i, _ = self._piece(s)
        return 2.0 * self.quadratic[i]

    def intervals(self, grid: Array) -> Slopes:
        """Return the derivatives of the curve in intervals of s.

        Args:
            grid: Values of s at the ends of the intervals (K + 1,).
        """
        i, _ = self._piece(0.5 * (grid[:-1] + grid[1:]))
        second = 2.0 * self.quadratic[i]
        lower, upper = ((s - self.breaks[i])[:, None] for s in (grid[:-1], grid[1:]))
        return Slopes(self.linear[i] + lower * second, self.linear[i] + upper * second, second)

    def _piece(self, s: Array) -> tuple[NDArray[np.intp], Array]:
        i = np.searchsorted(self.breaks[1:-1], s, side="right")
        return i, (s - self.breaks[i])[:, None]

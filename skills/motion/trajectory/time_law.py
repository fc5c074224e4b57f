"""The time law s(t) of a motion: the position s along the curve, as a function of the time t."""

import math
import sys
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from skills.motion.arrays import Array, readonly

from .curve import Curve, Slopes


@dataclass(frozen=True, eq=False)
class TimeLaw:
    """A time law s(t), given by its knots. Between two knots, the acceleration is constant.

    Attributes:
        times: Times of the knots, from 0 (K,) [s].
        positions: s at the knots (K,).
        speeds: ds/dt at the knots (K,) [1/s].
        accelerations: d2s/dt2 from each knot to the next knot; 0 for the last knot (K,) [1/s2].
    """

    times: Array
    positions: Array
    speeds: Array
    accelerations: Array

    def __post_init__(self) -> None:
        for name in ("times", "positions", "speeds", "accelerations"):
            object.__setattr__(self, name, readonly(getattr(self, name)))

    @classmethod
    def standstill(cls) -> "TimeLaw":
        """Return the time law of a motion with duration 0."""
        return cls(np.zeros(1), np.zeros(1), np.zeros(1), np.zeros(1))

    @classmethod
    def along_line(
        cls, begin: float, end: float, slope: Array, velocity: Array, acceleration: Array
    ) -> "TimeLaw":
        """Return the fastest time law along a line that starts and ends at standstill.

        Along a line, q' is constant and q'' is zero. The limits of all joints then become a limit
        of ds/dt and a limit of d2s/dt2, so a trapezoidal profile is optimal.

        Args:
            begin: s at the start.
            end: s at the end, more than `begin`.
            slope: dq/ds on the line (J,).
            velocity: Velocity limits (J,) [rad/s].
            acceleration: Acceleration limits (J,) [rad/s2].
        """
        moving = [(i, part) for i, part in enumerate(abs(slope).tolist()) if part]
        speed, push = (
            min(limits[i] / part for i, part in moving)
            for limits in (velocity.tolist(), acceleration.tolist())
        )
        return cls.trapezoidal(begin, end, speed, push)

    @classmethod
    def trapezoidal(cls, begin: float, end: float, speed: float, acceleration: float) -> "TimeLaw":
        """Return a time law with a trapezoidal velocity profile, from standstill to standstill.

        The profile is a triangle if the distance is too short to reach the largest speed.

        Args:
            begin: s at the start.
            end: s at the end, more than `begin`.
            speed: Limit of ds/dt [1/s].
            acceleration: Limit of d2s/dt2 [1/s2].
        """
        length = end - begin
        top = min(speed, _sqrt_of_product(length, acceleration))
        rising, distance = top / acceleration, 0.5 * top * top / acceleration
        cruise = max(0.0, (length - 2.0 * distance) / top)
        return cls(
            np.array([0.0, rising, rising + cruise, 2.0 * rising + cruise]),
            np.array([begin, begin + distance, end - distance, end]),
            np.array([0.0, top, top, 0.0]),
            np.array([acceleration, 0.0, -acceleration, 0.0]),
        )

    @property
    def duration(self) -> float:
        """Duration of the motion [s]."""
        return float(self.times[-1])

    def at(self, times: ArrayLike) -> tuple[Array, Array, Array]:
        """Return s, ds/dt [1/s] and d2s/dt2 [1/s2] at times (K,) [s].

        Times outside of [0, duration] are replaced by the nearest time inside.
        """
        inside = np.clip(np.asarray(times, dtype=np.float64), 0.0, self.duration)
        k = np.searchsorted(self.times, inside, side="right") - 1
        dt, acceleration = inside - self.times[k], self.accelerations[k]
        speed = self.speeds[k] + acceleration * dt
        position = self.positions[k] + dt * (self.speeds[k] + 0.5 * acceleration * dt)
        return np.clip(position, 0.0, self.positions[-1]), speed, acceleration

    def acceleration_ratios(self, slopes: Slopes, acceleration: Array) -> Array:
        """Return the largest acceleration of each joint between two knots, as a share of its limit.

        Between two knots, the acceleration is linear in s, so it is largest at one of these knots.

        Args:
            slopes: Derivatives of the path between the knots.
            acceleration: Acceleration limits (J,) [rad/s2].

        Returns:
            Ratios (K - 1, J).
        """
        ratios: Array = np.maximum(*self._accelerations_at_knots(slopes)) / acceleration
        return ratios

    def within_sum(self, curve: Curve, most: float) -> "TimeLaw":
        """Return this time law, slowed down if the sum of all accelerations exceeds a limit.

        Args:
            curve: The path.
            most: Largest sum of the absolute accelerations of all joints [rad/s2].
        """
        if most == math.inf:
            return self
        ends = self._accelerations_at_knots(curve.intervals(self.positions))
        sums = [np.max(each.sum(axis=1), initial=0.0) for each in ends]
        factor = math.sqrt(float(max(sums)) / most)
        return self.slowed(factor) if factor > 1.0 else self

    def _accelerations_at_knots(self, slopes: Slopes) -> tuple[Array, Array]:
        """Return the absolute accelerations at both ends of each interval, (K - 1, J) each."""
        lower, upper, second = slopes
        push, squares = self.accelerations[:-1, None], np.square(self.speeds)[:, None]
        first, last = lower * push + second * squares[:-1], upper * push + second * squares[1:]
        return abs(first), abs(last)

    def slowed(self, factor: float) -> "TimeLaw":
        """Return this time law with its duration multiplied by a factor."""
        times, speeds = self.times * factor, self.speeds / factor
        return TimeLaw(times, self.positions, speeds, self.accelerations / factor**2)

    def then(self, other: "TimeLaw") -> "TimeLaw":
        """Return a time law that consists of this one and another one, which starts at its end."""
        return TimeLaw(
            np.concatenate((self.times[:-1], other.times + self.times[-1])),
            np.concatenate((self.positions[:-1], other.positions)),
            np.concatenate((self.speeds[:-1], other.speeds)),
            np.concatenate((self.accelerations[:-1], other.accelerations)),
        )


def _sqrt_of_product(a: float, b: float) -> float:
    """Return the square root of a * b. Also exact if the product would underflow."""
    product = a * b
    if product < sys.float_info.min:
        return math.sqrt(a) * math.sqrt(b)
    return math.sqrt(product)

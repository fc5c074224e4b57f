"""How far along the curve, when: s(t) of piecewise constant acceleration."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skills.motion.arrays import readonly

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Profile:
    """Knots of s(t); between two of them the acceleration is constant.

    Attributes:
        times: Of the knots, from 0 (K,) [s].
        places: s at the knots (K,).
        speeds: ds/dt at the knots (K,) [1/s].
        pushes: d2s/dt2 from each knot to the next; the last is 0 (K,) [1/s2].
    """

    times: Array
    places: Array
    speeds: Array
    pushes: Array

    def __post_init__(self) -> None:
        for name in ("times", "places", "speeds", "pushes"):
            object.__setattr__(self, name, readonly(getattr(self, name)))

    @classmethod
    def still(cls) -> "Profile":
        """Of a motion that goes nowhere."""
        return cls(np.zeros(1), np.zeros(1), np.zeros(1), np.zeros(1))

    @property
    def duration(self) -> float:
        """[s]."""
        return float(self.times[-1])

    def at(self, times: Array) -> tuple[Array, Array, Array]:
        """s, ds/dt [1/s] and d2s/dt2 [1/s2] at times in [0, duration] (K,) [s]."""
        k = np.searchsorted(self.times, times, side="right") - 1
        dt, push = times - self.times[k], self.pushes[k]
        speed = self.speeds[k] + push * dt
        place = self.places[k] + dt * (self.speeds[k] + 0.5 * push * dt)
        return np.clip(place, 0.0, self.places[-1]), speed, push

    def stretched(self, factor: float) -> "Profile":
        """The same, slower by a factor."""
        return Profile(
            self.times * factor, self.places, self.speeds / factor, self.pushes / factor**2
        )

    def then(self, other: "Profile") -> "Profile":
        """This one, and the other from where it ends; between them the motion stands."""
        return Profile(
            np.concatenate((self.times[:-1], other.times + self.times[-1])),
            np.concatenate((self.places[:-1], other.places)),
            np.concatenate((self.speeds[:-1], other.speeds)),
            np.concatenate((self.pushes[:-1], other.pushes)),
        )

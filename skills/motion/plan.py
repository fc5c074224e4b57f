"""A motion that was found, checked and timed."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .arrays import Rebuilt, readonly
from .curve import Curve
from .profile import Profile

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Plan(Rebuilt):
    """A motion of one group, exact at every time.

    Attributes:
        group: Name of the group that moves.
        joints: Names of the joints that move of their own, the columns of every array (J).
        start: All actuated joints at the start (A,) [rad].
        origin: The group's joints at the start (J,) [rad].
        goal: The group's joints at the end (J,) [rad].
        seed: Of everything random.
        velocity: Limits kept (J,) [rad/s].
        acceleration: Limits kept (J,) [rad/s2].
        waypoints: Of the polyline whose corners are blended (N, J) [rad].
        curve: The path.
        profile: The time law along it.
        milliseconds: What each rung of the ladder took [ms]; differs from run to run.
    """

    group: str
    joints: tuple[str, ...]
    start: Array
    origin: Array
    goal: Array
    seed: int
    velocity: Array
    acceleration: Array
    waypoints: Array
    curve: Curve
    profile: Profile
    milliseconds: Mapping[str, float]

    def __post_init__(self) -> None:
        for name in ("start", "origin", "goal", "velocity", "acceleration", "waypoints"):
            object.__setattr__(self, name, readonly(getattr(self, name)))

    @property
    def duration(self) -> float:
        """[s]; 0 where the group already is at the goal."""
        return self.profile.duration

    def sample(self, times: ArrayLike) -> Array:
        """The group's joints at times (K,) [s] -> (K, J) [rad].

        Before 0 it is exactly the start, from the duration on exactly the goal.
        """
        given = np.asarray(times, dtype=np.float64)
        s, _, _ = self.profile.at(self._clamped(given))
        positions = self.curve.positions(s)
        positions[given <= 0.0] = self.origin
        positions[given >= self.duration] = self.goal
        return positions

    def state(self, time: float) -> Array:
        """The group's joints at one time [s] -> (J,) [rad]."""
        joints: Array = self.sample((time,))[0]
        return joints

    def velocities(self, times: ArrayLike) -> Array:
        """Joint speeds at times (K,) [s] -> (K, J) [rad/s]."""
        s, speed, _ = self.profile.at(self._clamped(times))
        return self.curve.slopes(s) * speed[:, None]

    def accelerations(self, times: ArrayLike) -> Array:
        """Joint accelerations at times (K,) [s] -> (K, J) [rad/s2], by the chain rule.

        Where the acceleration jumps, that of what follows.
        """
        s, speed, push = self.profile.at(self._clamped(times))
        turn = self.curve.bends(s) * (speed * speed)[:, None]
        return self.curve.slopes(s) * push[:, None] + turn

    def _clamped(self, times: Any) -> Array:
        return np.clip(np.asarray(times, dtype=np.float64), 0.0, self.duration)

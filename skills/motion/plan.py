"""A motion that was found, checked and timed."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .arrays import Joined, joined, parted, readonly
from .path.curve import Curve
from .timing.profile import Profile

Array = NDArray[np.float64]

# What is an array, in a plan and in its parts.
_OWN = ("start", "origin", "goal", "velocity", "acceleration", "waypoints")
_CURVE = ("breaks", "base", "slope", "bend", "stops")
_PROFILE = ("times", "places", "speeds", "pushes")
# Group, joints, seed, milliseconds, and all arrays.
_State = tuple[str, tuple[str, ...], int, dict[str, float], Joined]


@dataclass(frozen=True, eq=False)
class Plan:
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
        for name in _OWN:
            object.__setattr__(self, name, readonly(getattr(self, name)))

    def __getstate__(self) -> _State:
        """As little as there is, its arrays in one piece of memory."""
        curve, profile = self.curve, self.profile
        arrays = [getattr(self, name) for name in _OWN]
        arrays += [getattr(curve, name) for name in _CURVE]
        arrays += [getattr(profile, name) for name in _PROFILE]
        return self.group, self.joints, self.seed, dict(self.milliseconds), joined(arrays)

    def __setstate__(self, state: _State) -> None:
        group, joints, seed, milliseconds, together = state
        curve, profile = Curve.__new__(Curve), Profile.__new__(Profile)
        arrays = parted(together)
        own, rest = arrays[: len(_OWN)], arrays[len(_OWN) :]
        self.__dict__.update(zip(_OWN, own, strict=True))
        curve.__dict__.update(zip(_CURVE, rest[: len(_CURVE)], strict=True))
        profile.__dict__.update(zip(_PROFILE, rest[len(_CURVE) :], strict=True))
        self.__dict__.update(
            group=group,
            joints=joints,
            seed=seed,
            milliseconds=milliseconds,
            curve=curve,
            profile=profile,
        )

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

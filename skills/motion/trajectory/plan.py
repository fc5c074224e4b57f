"""A motion that was found, checked and timed."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from skills.motion.arrays import Array, readonly

from .curve import Curve
from .time_law import TimeLaw

# Names of the arrays in a plan, its curve and its time law.
_PLAN = ("start", "origin", "goal", "velocity", "acceleration", "waypoints")
_CURVE = ("breaks", "constant", "linear", "quadratic", "stops")
_TIME_LAW = ("times", "positions", "speeds", "accelerations")

# Shape and first byte of each array, and the bytes of all of them.
_Packed = tuple[list[tuple[tuple[int, ...], int]], bytes]
# Group, joints, seed, milliseconds, and all arrays.
_State = tuple[str, tuple[str, ...], int, dict[str, float], _Packed]


@dataclass(frozen=True, eq=False)
class Plan:
    """A motion of one group, exact at every time.

    Attributes:
        group: Name of the group that moves.
        joints: Names of the group's actuated joints, the columns of every array (J).
        start: All actuated joints at the start (A,) [rad].
        origin: The group's joints at the start (J,) [rad].
        goal: The group's joints at the end (J,) [rad].
        seed: Seed of the search.
        velocity: Velocity limits that the motion keeps (J,) [rad/s].
        acceleration: Acceleration limits that the motion keeps (J,) [rad/s2].
        waypoints: Corners of the path before they were rounded, and its ends (N, J) [rad].
        curve: The path.
        profile: The time law along the path.
        milliseconds: Duration of each stage of planning [ms]. It differs from run to run.
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
    profile: TimeLaw
    milliseconds: Mapping[str, float]

    def __post_init__(self) -> None:
        for name in _PLAN:
            object.__setattr__(self, name, readonly(getattr(self, name)))

    def __getstate__(self) -> _State:
        """Return all arrays as one piece of memory: pickle takes 3 us for each array."""
        curve, profile = self.curve, self.profile
        arrays = [getattr(self, name) for name in _PLAN]
        arrays += [getattr(curve, name) for name in _CURVE]
        arrays += [getattr(profile, name) for name in _TIME_LAW]
        return self.group, self.joints, self.seed, dict(self.milliseconds), _pack(arrays)

    def __setstate__(self, state: _State) -> None:
        group, joints, seed, milliseconds, packed = state
        curve, profile = Curve.__new__(Curve), TimeLaw.__new__(TimeLaw)
        arrays = _unpack(packed)
        own, rest = arrays[: len(_PLAN)], arrays[len(_PLAN) :]
        self.__dict__.update(zip(_PLAN, own, strict=True))
        curve.__dict__.update(zip(_CURVE, rest[: len(_CURVE)], strict=True))
        profile.__dict__.update(zip(_TIME_LAW, rest[len(_CURVE) :], strict=True))
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
        """Duration [s]; 0 if the group already is at the goal."""
        return self.profile.duration

    def sample(self, times: ArrayLike) -> Array:
        """Return the group's joints at times (K,) [s] -> (K, J) [rad].

        It is exactly the start before 0, and exactly the goal from the duration on.
        """
        given = np.asarray(times, dtype=np.float64)
        s, _, _ = self.profile.at(self._clamped(given))
        positions = self.curve.positions(s)
        positions[given <= 0.0] = self.origin
        positions[given >= self.duration] = self.goal
        return positions

    def velocities(self, times: ArrayLike) -> Array:
        """Return joint velocities at times (K,) [s] -> (K, J) [rad/s]."""
        s, speed, _ = self.profile.at(self._clamped(times))
        return self.curve.first_derivatives(s) * speed[:, None]

    def accelerations(self, times: ArrayLike) -> Array:
        """Return joint accelerations at times (K,) [s] -> (K, J) [rad/s2], by the chain rule.

        At a time at which an acceleration jumps, it is the one after the jump.
        """
        s, speed, push = self.profile.at(self._clamped(times))
        turn = self.curve.second_derivatives(s) * (speed * speed)[:, None]
        return self.curve.first_derivatives(s) * push[:, None] + turn

    def _clamped(self, times: Any) -> Array:
        return np.clip(np.asarray(times, dtype=np.float64), 0.0, self.duration)


def _pack(arrays: Iterable[Array]) -> _Packed:
    places, memory, begin = list[tuple[tuple[int, ...], int]](), list[bytes](), 0
    for array in arrays:
        places.append((array.shape, begin))
        memory.append(array.tobytes())
        begin += len(memory[-1])
    return places, b"".join(memory)


def _unpack(packed: _Packed) -> list[Array]:
    """Return the arrays that were packed, read-only.

    Raises:
        ValueError: A value is not finite, or bytes are missing.
    """
    places, memory = packed
    if not all(map(math.isfinite, memoryview(memory).cast("d"))):
        raise ValueError("a value is not finite")
    dtype = np.dtype(np.float64)
    return [np.ndarray(shape, dtype, memory, begin) for shape, begin in places]

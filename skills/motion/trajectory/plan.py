"""The plan of a motion, which was found, checked and timed.

Skills use this type before the board boots, and NumPy is loaded during the boot. Therefore only
functions in this module import NumPy.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from skills.motion.arrays import Array, Packed

    from .curve import Curve
    from .time_law import TimeLaw

# Names of the arrays of a plan, of its curve and of its time law.
_PLAN = ("start", "origin", "goal", "velocity", "acceleration", "waypoints")
_CURVE = ("breaks", "constant", "linear", "quadratic", "stops")
_TIME_LAW = ("times", "positions", "speeds", "accelerations")

# Group, joints, seed, milliseconds, and all arrays.
_State = tuple[str, tuple[str, ...], int, dict[str, float], "Packed"]


@dataclass(frozen=True, eq=False)
class Plan:
    """A planned motion of one group: a path and a time law, both as formulas.

    Attributes:
        group: Name of the group that moves.
        joints: Names of the group's actuated joints, in the order of every dimension J.
        start: All actuated joints at the start (A,) [rad].
        origin: The group's joints at the start (J,) [rad].
        goal: The group's joints at the end (J,) [rad].
        seed: Seed of the search.
        velocity: Velocity limits that the motion keeps (J,) [rad/s].
        acceleration: Acceleration limits that the motion keeps (J,) [rad/s2].
        waypoints: Start, goal, and the corners of the path before they were rounded (N, J) [rad].
        curve: The path.
        profile: The time law along the path.
        milliseconds: Duration of each stage of planning [ms]. It differs from run to run.
    """

    group: str
    joints: tuple[str, ...]
    start: "Array"
    origin: "Array"
    goal: "Array"
    seed: int
    velocity: "Array"
    acceleration: "Array"
    waypoints: "Array"
    curve: "Curve"
    profile: "TimeLaw"
    milliseconds: Mapping[str, float]

    def __post_init__(self) -> None:
        from skills.motion.arrays import readonly

        for name in _PLAN:
            object.__setattr__(self, name, readonly(getattr(self, name)))

    def __getstate__(self) -> _State:
        from skills.motion.arrays import pack

        curve, profile = self.curve, self.profile
        arrays = [getattr(self, name) for name in _PLAN]
        arrays += [getattr(curve, name) for name in _CURVE]
        arrays += [getattr(profile, name) for name in _TIME_LAW]
        return self.group, self.joints, self.seed, dict(self.milliseconds), pack(arrays)

    def __setstate__(self, state: _State) -> None:
        from skills.motion.arrays import unpack

        from .curve import Curve
        from .time_law import TimeLaw

        group, joints, seed, milliseconds, packed = state
        curve, profile = Curve.__new__(Curve), TimeLaw.__new__(TimeLaw)
        arrays = unpack(packed)
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
        """Duration of the motion [s]; 0 if the group is already at the goal."""
        return self.profile.duration

    def sample(self, times: "ArrayLike") -> "Array":
        """Return the group's joints at times (K,) [s] -> (K, J) [rad].

        The result is exactly the start before time 0, and exactly the goal after the duration.
        """
        from skills.motion.arrays import readonly

        given = readonly(times)
        s, _, _ = self.profile.at(given)
        positions = self.curve.positions(s)
        positions[given <= 0.0] = self.origin
        positions[given >= self.duration] = self.goal
        return positions

    def velocities(self, times: "ArrayLike") -> "Array":
        """Return joint velocities at times (K,) [s] -> (K, J) [rad/s]."""
        s, speed, _ = self.profile.at(times)
        return self.curve.first_derivatives(s) * speed[:, None]

    def accelerations(self, times: "ArrayLike") -> "Array":
        """Return joint accelerations at times (K,) [s] -> (K, J) [rad/s2], by the chain rule.

        At a jump of the acceleration, the result is the value after the jump.
        """
        s, speed, push = self.profile.at(times)
        turn = self.curve.second_derivatives(s) * (speed * speed)[:, None]
        return self.curve.first_derivatives(s) * push[:, None] + turn

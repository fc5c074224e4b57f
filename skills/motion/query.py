"""What may be asked of the planner."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .arrays import Rebuilt, readonly


@dataclass(frozen=True, slots=True)
class Query:
    """Move a group from where the arm stands to a goal.

    Attributes:
        group: Name of the group that moves; all other joints stay at the start.
        start: All actuated joints, in the order of `robot.actuated` [rad].
        goal: The group's own joints, in the order of `robot.leaders(group)` [rad].
        seed: Of everything random; equal queries give equal plans.
        timeout: Time there is [s]; it can only fail a plan, never change one.
    """

    group: str
    start: tuple[float, ...]
    goal: tuple[float, ...]
    seed: int = 1
    timeout: float = 5.0


@dataclass(frozen=True, eq=False)
class Verify(Rebuilt):
    """Check a motion as it will be played.

    Attributes:
        configurations: All actuated joints, in the order of `robot.actuated` (N, A) [rad]; from
            one row to the next the arm moves straight.
        margin: Distance to be kept [m].
        times: When each row is reached (N,) [s]; None where it does not matter.
        timeout: Time there is [s].
    """

    configurations: NDArray[np.float64] | Sequence[Sequence[float]]
    margin: float
    times: NDArray[np.float64] | Sequence[float] | None = None
    timeout: float = 5.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "configurations", readonly(self.configurations))
        if self.times is not None:
            object.__setattr__(self, "times", readonly(self.times))

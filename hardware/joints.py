"""Joints as data: limits, whom they follow, how they travel.

Positions are in rad, and in m for a joint that slides; wherever these files say rad, this is meant.
"""

import math
from dataclasses import dataclass
from numbers import Real

from .errors import BadPosition


@dataclass(frozen=True, slots=True)
class Mimic:
    """A joint that follows another: `multiplier * leader + offset`.

    Attributes:
        leader: Name of the joint it follows.
        multiplier: Unitless.
        offset: [rad].
    """

    leader: str
    multiplier: float
    offset: float

    def value(self, leader: float) -> float:
        """The follower's value [rad] for the leader's [rad]."""
        return self.multiplier * leader + self.offset


@dataclass(frozen=True, slots=True)
class Joint:
    """One moving joint.

    Attributes:
        name: As in the URDF.
        lower: Smallest position [rad].
        upper: Largest position [rad].
        velocity: Limit [rad/s].
        acceleration: Limit [rad/s2].
        boot: Where a reset of the board puts it [rad].
        mimic: Whom it follows; None for a joint of its own.
        wire: How it travels in a frame, as its driver read it; None for a joint that has no servo
            of its own, or whose robot file names no driver.
        unit: Of its position: `rad`, or `m` where it slides.
    """

    name: str
    lower: float
    upper: float
    velocity: float
    acceleration: float
    boot: float
    mimic: Mimic | None
    wire: object | None
    unit: str = "rad"

    @property
    def continuous(self) -> bool:
        """Whether it turns without end, so that it stands the same a whole turn on."""
        return self.unit == "rad" and self.lower == -math.inf and self.upper == math.inf


def check_position(joint: Joint, q: object) -> float:
    """Refuse a joint value that must never travel.

    Returns:
        The value as a float [rad], whatever kind of number it was.

    Raises:
        BadPosition: Not a number, not finite, or outside the limits.
    """
    try:
        value = float(q) if isinstance(q, Real) and not isinstance(q, bool) else math.nan
    except OverflowError:  # an integer beyond all floats
        value = math.inf
    if not math.isfinite(value):
        raise BadPosition(f"{joint.name} = {q!r} is not a finite number", joint.name, q)
    if not joint.lower <= value <= joint.upper:
        limits = f"[{joint.lower!r}, {joint.upper!r}] {joint.unit}"
        limit = min(max(value, joint.lower), joint.upper)
        words = f"{joint.name} = {q} {joint.unit} is outside its limits {limits}"
        raise BadPosition(words, joint.name, q, limit)
    return value

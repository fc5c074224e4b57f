"""Joints as data, and the check of joint positions.

The position of a prismatic joint is in metres: for such a joint, read [m] for the unit [rad] in the
documentation of this package.
"""

import math
from collections.abc import Mapping, Sequence
from numbers import Real

from .errors import BadPosition
from .loading.dataclass import dataclass

# Units in messages for people: factor and name, by the unit of a joint's position.
DISPLAY_UNITS = {"rad": (math.degrees(1.0), "deg"), "m": (1e3, "mm")}


@dataclass(frozen=True, slots=True)
class Mimic:
    """The relation of a follower joint to its leader: `multiplier * leader + offset`.

    Attributes:
        leader: Name of the leader.
        multiplier: Factor of the leader's position.
        offset: Position of the follower when the leader is at 0 [rad].
    """

    leader: str
    multiplier: float
    offset: float

    def value(self, leader: float) -> float:
        """Return the follower's position [rad] for a position of its leader [rad]."""
        return self.multiplier * leader + self.offset


@dataclass(frozen=True, slots=True)
class Joint:
    """A joint that moves.

    Attributes:
        name: Name in the URDF.
        lower: Smallest position [rad].
        upper: Largest position [rad].
        velocity: Velocity limit [rad/s].
        acceleration: Acceleration limit [rad/s2].
        boot: Position in the start pose: at the start of a plan, and after a reset of the board
            [rad].
        mimic: Relation to the joint that it follows; None if it moves independently.
        wire: Encoding of the joint in a frame. None if the joint has no servo of its own, or if the
            robot file names no driver.
        unit: Unit of the position: `rad`, or `m` for a prismatic joint.
        swept: Calibrated range [rad], which may exceed the limits; None without a calibration.
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
    swept: tuple[float, float] | None = None

    @property
    def continuous(self) -> bool:
        """True if the joint turns without limits. Positions a whole turn apart are then equal."""
        return self.unit == "rad" and self.lower == -math.inf and self.upper == math.inf

    def words(self, position: float, digits: int = 5) -> str:
        """Return a position [rad] as text in degrees or mm, with `digits` significant digits."""
        scale, unit = DISPLAY_UNITS[self.unit]
        return f"{scale * position:z.{digits}g} {unit}"  # `z` writes 0, not -0


def rounded(position: float, unit: str = "rad") -> str:
    """Return a position in `unit` (`rad` or `m`) as text in degrees or mm, with one decimal."""
    scale, name = DISPLAY_UNITS[unit]
    return f"{scale * position:z.1f} {name}"


def joint_words(positions: Mapping[str, float], units: Mapping[str, str]) -> str:
    """Return positions as text, such as `joint_1 70.0 deg, joint_2 0.0 deg`.

    Args:
        positions: Positions by the names of the joints [rad].
        units: Units by the names of the joints: `rad` or `m`. Default for a joint: `rad`.
    """
    return ", ".join(
        f"{name} {rounded(q, units.get(name, 'rad'))}" for name, q in positions.items()
    )


def check_position(joint: Joint, q: object) -> float:
    """Check that a joint position is a finite number within the limits of the joint.

    Args:
        joint: The joint.
        q: Position of the joint [rad]: any real number except a bool.

    Returns:
        The position as a float [rad].

    Raises:
        BadPosition: The position is not a number, not finite, or outside the limits.
    """
    try:
        value = float(q) if isinstance(q, Real) and not isinstance(q, bool) else math.nan
    except OverflowError:  # an integer too large for a float
        value = math.inf
    if not math.isfinite(value):
        raise BadPosition(f"{joint.name} = {q!r} is not a finite number", joint.name, q)
    if not joint.lower <= value <= joint.upper:
        limits = f"{joint.words(joint.lower)} to {joint.words(joint.upper)}"
        limit = min(max(value, joint.lower), joint.upper)
        words = joint.words(value)
        if words == joint.words(limit):
            further = (joint.words(value, digits) for digits in range(6, 18))
            words = next((each for each in further if each != joint.words(limit)), words)
        raise BadPosition(
            f"{joint.name} = {words} is outside its limits, {limits}",
            joint.name,
            q,
            limit,
        )
    return value


def check_positions(joints: Sequence[Joint], positions: Sequence[object]) -> tuple[float, ...]:
    """Check positions, one per joint [rad], and return them as floats. See `check_position`.

    Raises:
        BadPosition: A position is missing, not a number, not finite or outside its limits.
    """
    if len(positions) != len(joints):
        names = ", ".join(joint.name for joint in joints)
        raise BadPosition(f"{len(positions)} values for {len(joints)} joints: {names}")
    pairs = zip(joints, positions, strict=True)
    return tuple(check_position(joint, q) for joint, q in pairs)

"""What a robot file allows of measured values, in the table `guards`."""

from dataclasses import dataclass

HOLD, TORQUE_OFF = "hold", "torque_off"


@dataclass(frozen=True, slots=True)
class Guards:
    """Limits of measured values. Fields are the keys of the table, in its units.

    Attributes:
        following_deg: Largest difference of a measured from a commanded position [deg].
        following_s: How long a larger one is allowed [s].
        stall_effort: Effort from which a joint may be stalled, part of the largest torque.
        stall_deg: Difference from the commanded position from which it is, with that effort [deg].
        stall_s: How long that is allowed [s].
        settle_deg: Largest difference of a joint of the arm from the end of a motion [deg].
        settle_s: Longest time that it may take to get there, after the last frame [s].
        warn_c: Temperature of a servo from which armtree warns [C].
        most_c: Highest temperature of a servo [C].
        warn_v: Voltage below which armtree warns [V].
        least_v: Lowest voltage [V].
        on_fault: What servos do after a fault: `hold` where they are, or `torque_off`.
    """

    following_deg: float = 10.0
    following_s: float = 0.03
    stall_effort: float = 0.9
    stall_deg: float = 2.0
    stall_s: float = 0.08
    settle_deg: float = 3.0
    settle_s: float = 1.0
    warn_c: float = 55.0
    most_c: float = 65.0
    warn_v: float = 4.8
    least_v: float = 4.4
    on_fault: str = HOLD

"""Limits of measured values: the table `guards` of a robot file."""

from hardware.loading.dataclass import dataclass

HOLD, TORQUE_OFF = "hold", "torque_off"
CLOSING, OPENING = "closing", "opening"


@dataclass(frozen=True, slots=True)
class Guards:
    """Limits of measured values. Fields are the keys of the table, in its units.

    Attributes:
        following_deg: Largest difference of a measured from a commanded position [deg].
        following_s: Longest time with a larger difference [s].
        stall_effort: Smallest effort of a stalled joint, as a share of the largest torque.
        stall_a: Smallest current of a stalled joint [A]; unused if no current is measured.
        stall_deg: Smallest difference from the commanded position of a stalled joint [deg].
        stall_s: Longest time with such an effort, current and difference [s].
        grips: Motion with which a gripper grips: `closing`, or `opening` from within an object.
        grip_effort: Smallest effort of a gripper that pushes against an object, as a share.
        squeeze_deg: Largest difference of a gripper that holds an object from its commanded
            position [deg].
        settle_deg: Largest difference between a joint of the arm and the end of a motion [deg].
        settle_s: Longest time from the last frame until the joints have reached the end [s].
        warn_c: Temperature of a servo at which armtree begins to warn [C].
        most_c: Highest temperature of a servo [C].
        warn_v: Voltage below which armtree warns [V].
        least_v: Lowest voltage [V].
        on_fault: Reaction of the servos to a fault: `hold` (keep their positions) or `torque_off`.
    """

    following_deg: float = 10.0
    following_s: float = 0.03
    stall_effort: float = 0.9
    stall_a: float = 0.2
    stall_deg: float = 0.3
    stall_s: float = 0.08
    grips: str = CLOSING
    grip_effort: float = 0.6
    squeeze_deg: float = 1.5
    settle_deg: float = 3.0
    settle_s: float = 1.0
    warn_c: float = 55.0
    most_c: float = 65.0
    warn_v: float = 4.8
    least_v: float = 4.4
    on_fault: str = HOLD

    @property
    def effect(self) -> str:
        """Effect of a fault on the arm, as a sentence of its message."""
        if self.on_fault == TORQUE_OFF:
            return "The torque goes off (on_fault), and gravity moves the arm: support it"
        return "The servos hold their measured positions. Gravity moves a joint whose servo lets go"

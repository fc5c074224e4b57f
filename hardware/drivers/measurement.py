"""What a board measures of the joints."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Measurement:
    """Measured values, one per actuated joint. What the board does not measure is empty.

    Attributes:
        position: Positions [rad].
        velocity: Velocities [rad/s].
        effort: Parts of the largest torque of the servo, from -1 to 1.
        temperature: Temperatures of the servos [C].
        voltage: Voltages of their supply [V].
    """

    position: tuple[float, ...]
    velocity: tuple[float, ...] = ()
    effort: tuple[float, ...] = ()
    temperature: tuple[float, ...] = ()
    voltage: tuple[float, ...] = ()

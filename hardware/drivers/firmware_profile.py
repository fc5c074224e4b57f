"""The profile of a firmware: the properties of the program on a board."""

import math
from collections.abc import Sequence
from enum import Enum

from hardware.loading.dataclass import dataclass


class Ability(Enum):
    """An ability of a board besides moving to frames. The value completes "the board can ...".

    Code checks abilities with `Robot.require`, never the name of a driver.
    """

    MEASURE = "measure where its joints are"
    TORQUE = "switch the torque of its servos off and on"
    LIMITS = "store limits and offsets in its servos"
    IDENTIFY = "find its servos and name them"


@dataclass(frozen=True, slots=True)
class Words:
    """Words of a driver for messages.

    Attributes:
        board: Name for the kind of board.
        unit: Unit of the servo angles in a frame, in the plural.
        start_pose: Name for the pose after the port opens, if the board reports no pose.
        reset_effect: Effect of a reset of the board on the arm.
        advice_outside: Advice for a person if a servo is outside the limits of its joint.
    """

    board: str = "board"
    unit: str = "units"
    start_pose: str = "start pose"
    reset_effect: str = "may move"
    advice_outside: str = "move the joint back inside its limits by hand"


@dataclass(frozen=True, slots=True)
class Firmware:
    """The profile of a firmware. Servo angles are in the unit of the servos.

    Attributes:
        name: Name in a robot file.
        rate: Rate at which motions are sampled into frames [Hz].
        most_rate: Largest rate that a robot file may choose [Hz]; 0 if the rate is fixed. At a
            higher rate, `max_step` is smaller in proportion.
        lost_answers: Number of lost answers of a servo in a row that are a fault; 0 for a board
            without requests. A robot file may override this.
        silent_time: If a board with `Ability.MEASURE` stops measuring, longest time until the
            fault [s]. It also applies on a busy host.
        max_step: Largest total turn of all servos by one frame, at this rate.
        boot_time: Time from opening the port until the board reads bytes [s].
        baud: Speed of the line [bit/s]; 0 if any speed is possible.
        ring: Size of the receive buffer for unread bytes [bytes].
        unit_time: Time for which a turn by one unit blocks the board [s]; 0 if the board can read
            meanwhile.
        turn_time: Additional time for which each turning servo blocks the board [s].
        resets: True if opening the port resets the board. A robot file may override this.
        reports_pose: True if the board reports the pose of the arm after the port opens.
        abilities: Abilities of the board besides moving to frames.
        bauds: Possible speeds of bus servos [bit/s], for a search; empty for other servos.
        words: Words of the driver for messages.
    """

    name: str
    rate: float
    max_step: int
    boot_time: float = 0.0
    baud: int = 0
    ring: float = math.inf
    unit_time: float = 0.0
    turn_time: float = 0.0
    resets: bool = True
    reports_pose: bool = False
    abilities: frozenset[Ability] = frozenset()
    bauds: tuple[int, ...] = ()
    most_rate: float = 0.0
    lost_answers: int = 0
    silent_time: float = 1.0
    words: Words = Words()

    def service_time(self, before: Sequence[int], after: Sequence[int]) -> float:
        """Return the time for which a frame blocks the board [s].

        Args:
            before: Servo angles before the frame.
            after: Servo angles of the frame.
        """
        steps = [abs(b - a) + 1 for a, b in zip(before, after, strict=True)]
        return self.unit_time * sum(steps) + self.turn_time * len(steps)

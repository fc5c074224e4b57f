"""The profile of a firmware: what the host must know of the program on a board."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum


class Ability(Enum):
    """What a board can do beside following frames. The value completes "it can ...".

    Who needs an ability asks for it, never for the name of a driver: `Robot.require`.
    """

    MEASURE = "measure where its joints are"
    TORQUE = "switch the torque of its servos off and on"
    LIMITS = "keep limits and offsets in its servos"
    IDENTIFY = "find its servos and name them"


@dataclass(frozen=True, slots=True)
class Words:
    """How messages name what a driver drives.

    Attributes:
        board: Kind of board.
        unit: Unit of the servo angles in a frame, in the plural.
        start_pose: Pose of the arm after the port opens, if the board reports none.
        reset_effect: What the arm does when the board is reset.
        advice_outside: What a person does if a servo is outside the limits of its joint.
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
        max_step: Largest change of one frame, total of all servos.
        boot_time: Time from opening the port until the board reads from its line [s].
        baud: Speed of its line [bit/s]; 0 if any speed is possible.
        ring: Size of the receive buffer for unread bytes [bytes].
        unit_time: Time for which one unit of one servo blocks the board [s]; 0 if it does not
            block.
        turn_time: Time for which a servo blocks the board in addition to its units [s].
        resets: Whether opening the port resets the board, unless the robot file denies it.
        reports_pose: Whether the board reports the pose of the arm after the port opens.
        abilities: What the board can do beside following frames.
        bauds: Speeds that its servos may have [bit/s], for a search; empty if it has none.
        words: How messages name what the driver drives.
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
    words: Words = Words()

    def service_time(self, before: Sequence[int], after: Sequence[int]) -> float:
        """Return for how long a frame blocks the board [s].

        Args:
            before: Servo angles before the frame.
            after: Servo angles of the frame.
        """
        steps = [abs(b - a) + 1 for a, b in zip(before, after, strict=True)]
        return self.unit_time * sum(steps) + self.turn_time * len(steps)

"""The opening of a gripper: the distance between two points, one on each finger."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

from hardware.errors import BadPosition
from hardware.joints import Joint

from .forward_kinematics import ForwardKinematics
from .urdf import Vector

WIDTH = "width"  # the word for it in a move
_SAMPLES = 33  # widths that are compared to find whether they only grow, or only shrink
_HALVINGS = 60
_SHOWN = 5e-5  # half of the last digit that people see [m]


@dataclass(frozen=True, slots=True)
class Gripper:
    """A gripper whose opening can be given as a width.

    Attributes:
        joint: The joint that moves its fingers.
        pads: A point of each finger, by link, in the frame of that link [m]. The distance between
            the two is the width.
    """

    joint: Joint
    pads: Mapping[str, Vector]

    def width(self, kinematics: ForwardKinematics, position: float) -> float:
        """Return the width [m] at a position of the joint [rad]."""
        one, other = (
            kinematics.locate(link, point, {self.joint.name: position})
            for link, point in self.pads.items()
        )
        return math.dist(one, other)

    def is_monotonic(self, kinematics: ForwardKinematics) -> bool:
        """Return True if no two positions of the joint have the same width."""
        lower, upper = self.joint.lower, self.joint.upper
        if not math.isfinite(upper - lower):
            return False
        step = (upper - lower) / (_SAMPLES - 1)
        widths = [self.width(kinematics, lower + step * count) for count in range(_SAMPLES)]
        return sorted(widths) in (widths, widths[::-1]) and len({*widths}) == _SAMPLES

    def position(self, kinematics: ForwardKinematics, width: float) -> float:
        """Return the position of the joint at which the gripper has a width.

        Args:
            kinematics: Forward kinematics of the robot.
            width: The width [m].

        Raises:
            BadPosition: The gripper does not open or close so far.
        """
        narrow, wide = sorted(
            (self.joint.lower, self.joint.upper), key=lambda q: self.width(kinematics, q)
        )
        least, most = self.width(kinematics, narrow), self.width(kinematics, wide)
        if not least - _SHOWN <= width <= most + _SHOWN:
            limit = least if width < least else most
            limits = f"its limits, {1e3 * least:.1f} mm to {1e3 * most:.1f} mm"
            why = f"{WIDTH} = {1e3 * width:.1f} mm is outside {limits}"
            raise BadPosition(why, self.joint.name, width, limit)
        for _ in range(_HALVINGS):
            middle = 0.5 * (narrow + wide)
            if self.width(kinematics, middle) < width:
                narrow = middle
            else:
                wide = middle
        return 0.5 * (narrow + wide)

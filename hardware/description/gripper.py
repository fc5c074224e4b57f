"""The opening of a gripper: the distance between two points, one on each finger."""

import math
from collections.abc import Callable, Mapping

from hardware.errors import BadPosition
from hardware.joints import Joint
from hardware.loading.dataclass import dataclass

from .forward_kinematics import ForwardKinematics
from .urdf import Vector

WIDTH = "width"  # name of the width in a move
_SAMPLES = 33  # number of widths that `is_monotonic` compares
_HALVINGS = 60
_SHOWN = 5e-5  # half of the last digit in messages [m]


def closing(joint: Joint, width: Callable[[float], float] = abs) -> int:
    """Return the sign of the motion that closes a gripper: 1 or -1.

    Args:
        joint: A joint of the gripper. It closes towards the limit with the smaller width.
        width: Callback that returns the width [m] at a position of the joint [rad]. Default: the
            distance of the position from 0.
    """
    return -1 if width(joint.lower) <= width(joint.upper) else 1


@dataclass(frozen=True, slots=True)
class Gripper:
    """A gripper with a width: the distance between two points, one on each finger.

    Attributes:
        joint: The joint that moves the fingers.
        pads: The point on each finger in the frame of its link [m], by the name of the link.
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
        """Return the position of the joint at a width: [rad], or [m] for a prismatic joint.

        Args:
            kinematics: Forward kinematics of the robot.
            width: The width [m].

        Raises:
            BadPosition: The gripper cannot reach this width.
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

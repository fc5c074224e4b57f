"""From the name of a port to the link behind it."""

from .board import Board
from .frames import Codec
from .link import Link
from .profiles import Firmware
from .robot import Robot
from .serial_link import SerialLink
from .virtual_arduino import VirtualLink

VIRTUAL = "virtual"


def virtual_board(robot: Robot) -> Board:
    """The model of the board that a robot description names."""
    return Board(*_board_of(robot))


def link_to(robot: Robot, port: str) -> Link:
    """The link to a port.

    Args:
        robot: Whose baud and, for the virtual Arduino, whose board.
        port: A device, or `virtual` for the virtual Arduino.
    """
    if port == VIRTUAL:
        return VirtualLink(*_board_of(robot))
    return SerialLink(port, robot.serial.baud)


def _board_of(robot: Robot) -> tuple[str, tuple[int, ...], Firmware, int]:
    codec = Codec(robot.actuated)
    boot = codec.encode(robot.boot_pose).servos
    return codec.letters, boot, robot.firmware, robot.serial.baud

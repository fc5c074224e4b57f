"""The board of a robot as a model in this process, for simulated time."""

from .clock import Clock
from .description.robot import Robot
from .drivers.arduino.firmware_profile import ArduinoFirmware
from .drivers.arduino.frames import Codec
from .drivers.arduino.virtual.board import Board
from .drivers.arduino.virtual.link import BoardLink
from .drivers.null_driver import NullLink
from .link.link import Link


def virtual_board(robot: Robot) -> Board:
    """Return a model of the board that a robot file describes. It is in its boot pose."""
    codec = Codec(robot.actuated)
    assert isinstance(robot.firmware, ArduinoFirmware)
    angles = codec.encode(robot.boot_pose).servos
    return Board(codec.letters, angles, robot.firmware, robot.serial.baud)


def simulated_link(robot: Robot, clock: Clock) -> Link:
    """Return a link to the virtual board of a robot, or to none if it names no driver."""
    return BoardLink(virtual_board(robot), clock) if robot.has_driver else NullLink(clock)

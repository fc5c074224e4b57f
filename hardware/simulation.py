"""The board of a robot as a model in this process, for simulated time."""

from .description.robot import Robot
from .drivers.arduino.frames import Codec
from .drivers.arduino.virtual.board import Board


def virtual_board(robot: Robot) -> Board:
    """Return a model of the board that a robot file describes. It is in its boot pose."""
    codec = Codec(robot.actuated)
    angles = codec.encode(robot.boot_pose).servos
    return Board(codec.letters, angles, robot.firmware, robot.serial.baud)

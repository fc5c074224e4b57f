"""The model of the board of an Arduinobot."""

from hardware import Robot
from hardware.drivers.arduino.virtual.board import Board


def virtual_board(robot: Robot) -> Board:
    """An Arduino in the start pose of the robot."""
    board = robot.model()
    assert isinstance(board, Board)
    return board

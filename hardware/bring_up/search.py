"""The search for servos on a port: their ids, their speed, and problems."""

from collections.abc import Iterable
from dataclasses import replace

from hardware.clock import RealClock
from hardware.description.robot import Robot
from hardware.drivers.servo_bus import Found, ServoBus, ServoReport
from hardware.drivers.servo_errors import NoServos, ServoMissing, ServoTwice

_ROUNDS = 4  # rounds of requests to the servos of the arm
_PATIENCE = 0.2  # total time for the answers of a servo [s]
_SEARCHED = range(30)  # ids to ask if a servo is missing, or alone on the bus


def find_servos(robot: Robot, bus: ServoBus) -> Found:
    """Return the servos on the open bus of an arm. Repeats the requests to silent servos."""
    found = bus.find(robot.servos.values())
    for _ in range(_ROUNDS - 1):
        missing = [servo for servo in robot.servos.values() if servo not in found.servos]
        if not missing or found.noise:
            break
        again = bus.find(missing)
        found = replace(again, servos={**found.servos, **again.servos})
    return found


def answering(robot: Robot, bus: ServoBus, port: str) -> dict[int, ServoReport]:
    """Return the report of each servo of an arm, by its id.

    Args:
        robot: The robot.
        bus: The open bus.
        port: Name of the port, for messages.

    Raises:
        ServoTwice: Two servos have one id.
        NoServos: The received bytes are not packets.
        ServoMissing: A servo does not answer.
    """
    found = find_servos(robot, bus)
    if found.damaged and found.servos:
        raise ServoTwice(found.damaged)
    if found.noise and not found.servos:
        raise NoServos(port, _PATIENCE, found.noise)
    if missing := [f"{s} ({j})" for j, s in robot.servos.items() if s not in found.servos]:
        names = found.strangers.values()
        raise ServoMissing(port, _PATIENCE, missing, len(found.servos), names, found.noise)
    return dict(found.servos)


def search_speeds(robot: Robot, port: str) -> tuple[int, Found]:
    """Return the first speed of the line at which servos answer [bit/s], and these servos.

    The speed of the robot file comes first. It is also returned if no servo answers. At other
    speeds, requests go only to the ids in the robot file and to id 1.

    Args:
        robot: The robot.
        port: Name of the port.

    Raises:
        LinkError: The port cannot be opened.
    """
    speeds = dict.fromkeys((robot.serial.baud, *robot.firmware.bauds))
    likely, heard = {1, *robot.servos.values()}, Found()
    for baud in speeds:
        with robot.servo_bus(port, baud, RealClock()) as bus:
            found = bus.find(_SEARCHED if baud == robot.serial.baud else likely)
        if found.servos:
            return baud, found
        heard = heard if heard.noise else found
    return robot.serial.baud, heard


def likely_cable(robot: Robot, present: Iterable[int]) -> str:
    """Return text for the cable or servo that is the likely cause of missing answers.

    The servos form a chain in the order of their joints. No servo after a broken cable answers. The
    text is empty if all servos are present.
    """
    servos, there = list(robot.servos.items()), set(present)
    missing = [place for place, (_, servo) in enumerate(servos) if servo not in there]
    if not missing:
        return ""
    first = missing[0]
    joint, servo = servos[first]
    if missing != list(range(first, len(servos))):
        # Two servos with one id and equal values look like one.
        others = "servos after it answer, so no cable is broken: the servo is defective, its id is "
        others += "wrong, or another servo has the same id"
        return f"servo {servo} of {joint}: {others}"
    if first == 0:
        return "the power supply, the adapter or the cable to the first servo: no servo answers"
    before, number = servos[first - 1]
    return f"the cable between servo {number} ({before}) and servo {servo} ({joint}), or its power"

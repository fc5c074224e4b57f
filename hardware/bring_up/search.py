"""The search for servos on a port: which ids answer, at which speed, and what is wrong."""

from collections.abc import Iterable
from dataclasses import replace

from hardware.clock import Clock, RealClock
from hardware.description.robot import Robot
from hardware.drivers.servo_bus import Found, ServoBus, ServoReport
from hardware.drivers.servo_errors import NoServos, ServoMissing, ServoTwice

_ROUNDS = 4  # of questions to servos that should be there
_PATIENCE = 0.2  # for the answer of a servo, in all rounds [s]


def find_servos(robot: Robot, bus: ServoBus) -> Found:
    """Find the servos on the open bus of an arm. A servo that does not answer is asked again."""
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
        NoServos: Bytes come, but no packets.
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


def search_speeds(
    robot: Robot, port: str, ids: Iterable[int], clock: Clock | None = None
) -> tuple[int, Found]:
    """Return the first speed of the line at which servos answer [bit/s], and what answers there.

    The speed of the robot file comes first. It is returned if nothing answers at any.

    Args:
        robot: The robot.
        port: Name of the port.
        ids: The ids that are asked at that speed; at others, those of the robot file and 1.
        clock: Time source. Default: the system's.

    Raises:
        LinkError: The port cannot be opened.
    """
    speeds = dict.fromkeys((robot.serial.baud, *robot.firmware.bauds))
    wanted, likely, heard = list(ids), {1, *robot.servos.values()}, Found()
    for baud in speeds:
        with robot.servo_bus(port, baud, clock or RealClock()) as bus:
            found = bus.find(wanted if baud == robot.serial.baud else likely)
        if found.servos:
            return baud, found
        heard = heard if heard.noise else found
    return robot.serial.baud, heard


def likely_cable(robot: Robot, present: Iterable[int]) -> str:
    """Return the cable or servo that explains which servos do not answer, for people.

    Servos are a chain in the order of their joints: behind a broken cable none answers.
    """
    servos, there = list(robot.servos.items()), set(present)
    missing = [place for place, (_, servo) in enumerate(servos) if servo not in there]
    if not missing:
        return ""
    first = missing[0]
    joint, servo = servos[first]
    if missing != list(range(first, len(servos))):
        others = "others behind it answer, so its id or the servo itself is wrong, not a cable"
        return f"servo {servo} of {joint}: {others}"
    if first == 0:
        return "the power supply, the adapter, and the cable to the first servo: none answers"
    before, number = servos[first - 1]
    return f"the cable between servo {number} ({before}) and servo {servo} ({joint}), or its power"

"""Checks of a bus with servos. They open its port and read from every servo, but write nothing."""

import os
from collections.abc import Iterator
from dataclasses import asdict

from hardware.clock import RealClock
from hardware.description.calibration import calibrate_command
from hardware.description.robot import Robot
from hardware.drivers.servo_bus import POSITION_MODE, Found, ServoReport
from hardware.drivers.servo_errors import (
    CalibrationDiffers,
    CalibrationMissing,
    NoServos,
    ServoFault,
    ServoMissing,
    ServoTwice,
    WrongMode,
)
from hardware.errors import HardwareError, PoseOutsideLimits, SupplyTooLow
from hardware.link.link import VIRTUAL
from hardware.link.serial_ports import Check, serial_ports

from .search import find_servos, likely_cable, search_speeds


def check_bus(robot: Robot, port: str) -> Iterator[Check]:
    """Yield the result of each check of a bus.

    Args:
        robot: A robot whose board can identify servos.
        port: Name of the port.
    """
    baud = robot.serial.baud
    if port != VIRTUAL:
        yield _adapter(port)
    try:
        with robot.servo_bus(port, baud, RealClock()) as bus:
            found = find_servos(robot, bus)
        if len(found.servos) < len(robot.servos) and port != VIRTUAL:
            yield from _missing(robot, port, found)
            return
    except HardwareError as error:
        yield Check("servos", False, str(error), code=error.code)
        return
    servos = [found.servos[servo] for servo in robot.servos.values()]
    ids = " ".join(str(each.servo) for each in servos)
    what = f"all {len(servos)} answer at {baud} bit/s: ids {ids}"
    yield Check("servos", True, what, values=[asdict(each) for each in servos])
    yield from _health(robot, servos)
    yield _calibration(robot, found, port)
    yield _pose(robot, servos)


def _adapter(port: str) -> Check:
    device = os.path.realpath(port)
    for each in serial_ports():
        if os.path.realpath(each.device) == device:
            return Check("adapter", True, " ".join(filter(None, (each.usb, each.name))) or device)
    return Check("adapter", None, f"{port} is not in the list of serial ports")


def _missing(robot: Robot, port: str, found: Found) -> Iterator[Check]:
    """Return the check that names the missing servos and likely causes."""
    present, speed = found.servos, robot.serial.baud
    if found.damaged and present:
        ids = ", ".join(map(str, sorted(found.damaged)))
        what = f"the answers with the id {ids} are damaged, as if two servos had that id"
        remedy = "connect the servos one by one: armtree calibrate --ids"
        yield Check("double ids", False, what, remedy, ServoTwice.code)
    for servo, name in found.strangers.items():
        what = f"the answer to a request for servo {servo} has the id {name}"
        remedy = "another servo answers with that id: connect it alone: armtree calibrate --ids"
        yield Check("other ids", False, what, remedy, ServoMissing.code)
    baud, others = search_speeds(robot, port)
    if baud != speed:
        numbers = " ".join(map(str, others.servos))
        what = f"servos {numbers} answer at {baud} bit/s; the robot file has {speed}"
        remedy = f"write baud = {baud} under [serial] in {robot.path}"
        yield Check("baud", False, what, remedy, ServoMissing.code, values=_plain(others))
        return
    if not others.servos and found.noise:
        what = f"{found.noise} received bytes are not answers of servos"
        remedy = "check that the bus is on this port, and not another device; and check its cable, "
        remedy += "which may catch noise"
        yield Check("servos", False, what, remedy, NoServos.code)
        return
    names = {servo: joint for joint, servo in robot.servos.items()}
    missing = ", ".join(f"{s} ({joint})" for s, joint in names.items() if s not in present)
    what = f"{len(present)} of {len(names)} answer at {speed} bit/s; missing: {missing}"
    remedy = f"check {likely_cable(robot, present)}"
    if strange := ", ".join(str(servo) for servo in others.servos if servo not in names):
        ids = f"servos answer with ids that no joint has: {strange}. Give them the right ids with "
        ids += "armtree calibrate --ids"
        remedy = f"{remedy}; {ids}" if present else ids
    yield Check("servos", False, what, remedy, ServoMissing.code, values=_plain(others))


def _plain(found: Found) -> list[dict[str, object]]:
    return [asdict(each) for each in found.servos.values()]


def _health(robot: Robot, servos: list[ServoReport]) -> Iterator[Check]:
    """Check the firmware, the supply, the errors and the modes of all servos."""
    versions = sorted({each.firmware for each in servos})
    models = ", ".join(sorted({str(each.model) for each in servos}))
    same = len(versions) == 1
    what = f"{', '.join(versions)}; model {models}"
    yield Check("servo code", True if same else None, what + ("" if same else "; they differ"))
    volts, least = [each.voltage for each in servos], robot.guards.least_v
    hottest = max(each.temperature for each in servos)
    what = f"{min(volts):g} to {max(volts):g} V, at most {hottest:g} degrees Celsius"
    low = min(volts) < least
    remedy = f"the arm stops below {least:g} V (least_v); check the supply and its cable"
    yield Check("supply", not low, what, remedy if low else "", SupplyTooLow.code if low else "")
    for each in servos:
        if each.errors:
            what = f"servo {each.servo} reports {' and '.join(each.errors)}"
            remedy = "free its joint, let it cool down, and switch the power off and on"
            yield Check("error", False, what, remedy, ServoFault.code)
    for joint, each in zip(robot.servos, servos, strict=True):
        if (mode := each.kept.get("mode", POSITION_MODE)) != POSITION_MODE:
            error = WrongMode(each.servo, joint, mode)
            yield Check("mode", False, str(error), code=error.code)


def no_calibration(robot: Robot, port: str) -> Check:
    """Return the check of an arm without a calibration. It fails if the arm needs one."""
    needed = robot.needs_calibration and port != VIRTUAL
    what = "there is none" + ("" if needed else "; the offsets are those of the robot file")
    code = CalibrationMissing.code if needed else ""
    remedy = f"type {calibrate_command(robot.path, port)}"
    return Check("calibration", not needed and None, what, remedy, code)


def _calibration(robot: Robot, found: Found, port: str) -> Check:
    if robot.calibration is None:
        return no_calibration(robot, port)
    for joint, values in robot.kept.items():
        servo = robot.servos[joint]
        for name, value in values.items():
            if (kept := found.servos[servo].kept.get(name)) != value:
                error = CalibrationDiffers(servo, joint, name, kept or 0, value)
                return Check("calibration", False, str(error), code=error.code)
    return Check("calibration", True, f"{robot.calibration.name} fits the servos")


def _pose(robot: Robot, servos: list[ServoReport]) -> Check:
    """Check that every joint is within its limits, so that the arm may be activated."""
    try:
        frame = robot.wire_format.frame([each.position for each in servos])
        pose = robot.unlimited.decode(frame)
        robot.within_limits(pose, resting=True)
    except PoseOutsideLimits as error:
        return Check("measured", False, str(error), code=error.code)
    return Check("measured", True, robot.words(robot.by_joint(pose)))

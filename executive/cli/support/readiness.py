"""Checks of everything that a run needs. Only a check that opens the port may move the arm."""

import tempfile
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from queue import SimpleQueue
from textwrap import shorten

from hardware import (
    VIRTUAL,
    Ability,
    Arm,
    ArmEvent,
    BytesReceived,
    Check,
    HardwareError,
    NoDriver,
    PortNotGiven,
    RealClock,
    Robot,
    SerialLink,
    check_port,
    load_robot,
)
from hardware.bring_up.checks import check_bus, no_calibration
from hardware.description.neighbours import advice_for_contact, shape_warnings
from hardware.printable import wire_text
from logs import LogError, check_space
from skills.motion import MotionCollides, MotionError, Pool, Result, Verify
from trees import FileError, Library, TreeError


def check_readiness(
    robot_file: Path | None,
    port: str | None,
    trees: Path | None,
    recordings: Path,
    opens_port: bool,
) -> Iterator[Check]:
    """Yield the result of each check.

    Args:
        robot_file: Robot file; None for the default robot.
        port: Serial port; None for the port of the robot file.
        trees: Folder with further tasks, or None.
        recordings: Folder for recordings.
        opens_port: True to open the port, which resets the board and may move the arm.
    """
    try:
        robot = load_robot(robot_file)
    except HardwareError as error:
        yield Check("robot", False, str(error), error.hint, error.code)
        return
    yield Check("robot", True, f"{robot.name}, firmware {robot.firmware.name}")
    port = robot.serial.port if port is None else port
    if robot.has_driver:
        yield _pose(robot, port)
        yield _boot_wait(robot)
    else:
        yield Check("driver", None, "no driver is named: the arm moves only on the port virtual")
    yield _tasks(trees, robot)
    yield _planner(robot)
    for why in shape_warnings(robot):
        yield Check("shapes", None, why)
    if robot.can(Ability.MEASURE) and robot.grips:
        yield _grip(robot)
    yield from _recordings(recordings)
    yield from _port(robot, port, opens_port)


def _resets(robot: Robot, port: str) -> bool:
    return robot.firmware.resets and (robot.serial.resets or port == VIRTUAL)


def _pose(robot: Robot, port: str) -> Check:
    if robot.firmware.reports_pose:
        return Check("pose", True, "the board reports the pose of the arm")
    if not _resets(robot, port):
        what = "nothing resets the board: a run needs --pose"
        return Check("pose", True, what)
    pose = robot.words(robot.by_joint(robot.boot_pose))
    return Check("pose", True, f"after a reset the arm is at {pose}")


def _boot_wait(robot: Robot) -> Check:
    wait, firmware = robot.serial.boot_wait, robot.firmware
    what = f"{wait:g} s after the port opens; {firmware.name} needs {firmware.boot_time:g} s"
    return Check("boot wait", True, what)


def _tasks(trees: Path | None, robot: Robot) -> Check:
    try:
        library = Library(trees, robot.name)
        for number in library.numbers():
            library.task(number)
        if library.mistakes:
            raise FileError(library.mistakes)
    except TreeError as error:
        return Check("tasks", False, str(error), "correct that file", error.code)
    there = ", ".join(map(str, library.numbers()))
    return Check("tasks", True, f"{there} can be read" if there else f"no task for {robot.name}")


def _planner(robot: Robot) -> Check:
    answer, pose = _boot_pose_verified(robot), robot.firmware.words.start_pose
    if isinstance(answer, MotionCollides):
        remedy = advice_for_contact(robot, answer.first, answer.second)
        remedy = remedy or f"choose another {pose} in the robot file, or correct its URDF"
        why = f"in its {pose}, {answer.contact}"
        return Check("planner", False, why, remedy, answer.code)
    if isinstance(answer, MotionError):
        return Check("planner", False, str(answer), code=answer.code)
    free = f"a planner process has loaded the robot; the {pose} is free of collisions"
    return Check("planner", True, free)


def _boot_pose_verified(robot: Robot) -> Result:
    answers: SimpleQueue[Result] = SimpleQueue()
    try:
        with closing(Pool(robot, 1, RealClock())) as pool:
            pool.start()
            pool.submit(Verify([robot.boot_pose], 0.0), answers.put)
            return answers.get()
    except MotionError as error:
        return error


def _grip(robot: Robot) -> Check:
    joints = robot.actuated_in("gripper")
    ends = {each.name: each.upper if robot.grips[each.name] > 0 else each.lower for each in joints}
    what = f"{robot.guards.grips}, towards {robot.words(ends)}"
    if not robot.gripper:
        what += "; guessed without pads: if it is wrong, change grips in the robot file"
    return Check("grip", True, what)


def _recordings(folder: Path) -> Iterator[Check]:
    existing = next(path for path in (folder, *folder.absolute().parents) if path.exists())
    try:
        with tempfile.TemporaryFile(dir=existing):
            yield Check("recorder", True, f"{folder} is writable")
    except OSError as error:
        remedy = "give another folder with --recordings"
        yield Check("recorder", False, f"{folder}: {error.strerror}", remedy, LogError.code)
        return
    try:
        yield Check("free disk", True, f"{check_space(folder) / 1e6:.0f} MB")
    except LogError as error:
        yield Check("free disk", False, str(error), code=error.code)


def _port(robot: Robot, port: str, opens_port: bool) -> Iterator[Check]:
    if not port:
        remedy = "give --port PORT, or --port virtual"
        yield Check("port", False, "no port is given", remedy, PortNotGiven.code)
        return
    if port == VIRTUAL:
        yield Check("port", True, "virtual: nothing real moves")
        if not robot.has_driver:
            return
    elif not robot.has_driver:
        yield Check("port", False, str(NoDriver(robot.path, port)), code=NoDriver.code)
        return
    elif not robot.can(Ability.IDENTIFY) and not isinstance(robot.link(port), SerialLink):
        yield Check("port", True, f"{port}: the driver checks the port when it opens it")
    else:
        checks = check_port(port)
        yield from checks
        if not all(check.ok for check in checks):
            return
    if opens_port and robot.can(Ability.IDENTIFY):
        yield Check("opening", True, "this reads from the servos; it does not move or change them")
        yield from check_bus(robot, port)
    elif robot.needs_calibration and robot.calibration is None and port != VIRTUAL:
        yield no_calibration(robot, port)
    elif opens_port:
        does = "it resets the board" if _resets(robot, port) else "the board is not reset"
        yield Check("opening", True, f"{does}, and the arm {robot.open_effect}")
        yield _open(robot, port)


def _open(robot: Robot, port: str) -> Check:
    heard: list[bytes] = []

    def listen(event: ArmEvent) -> None:
        if isinstance(event, BytesReceived):
            heard.append(event.data)

    try:
        with Arm(robot, robot.link(port), RealClock(), listen) as arm:
            arm.configure()
            arm.activate()
            positions = robot.words(robot.by_joint(arm.commanded))
    except HardwareError as error:
        return Check("board", False, f"{error}; {_heard(heard)}", code=error.code)
    if not robot.firmware.reports_pose:
        silent = f"{robot.firmware.name} never answers, so a board may be missing"
        known = f"assumed: {positions}" if _resets(robot, port) else "unknown: a run needs --pose"
        return Check("board", None, f"opened; {_heard(heard)}; {silent}; the pose is {known}")
    return Check("board", True, f"booted; {_heard(heard)}; commanded to {positions}")


def _heard(pieces: list[bytes]) -> str:
    """Return the first 60 characters that a board has sent, for people."""
    text = " ".join(wire_text(b"".join(pieces)).split())
    return f"received {shorten(text, 60, placeholder=' ...')}" if text else "received nothing"

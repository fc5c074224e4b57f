"""The reader of robot files: one TOML file and the URDF that it names."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from pathlib import Path

from hardware.drivers.driver import Driver, load_driver
from hardware.drivers.firmware_profile import Ability, Firmware
from hardware.drivers.null_driver import NO_BAUD, NO_FIRMWARE, NullDriver
from hardware.errors import DescriptionError
from hardware.joints import Joint
from hardware.link.link import VIRTUAL
from hardware.spelling import closest, did_you_mean, suggestion, there_are
from hardware.toml_table import TomlTable

from .calibration import ROBOTS, calibration_file, is_robot_file, read_calibration
from .forward_kinematics import ForwardKinematics
from .gripper import Gripper
from .guards import CLOSING, HOLD, OPENING, TORQUE_OFF, Guards
from .robot import CollisionRules, Robot, Serial, Tool
from .urdf import Urdf, UrdfError, UrdfJoint

BAUD_RATES = range(1200, 4_000_001)  # [bit/s]; at 1200 a frame of 20 bytes takes 0.17 s
MAX_BOOT_WAIT = 60.0  # [s]
MAX_BRAKE = 10.0  # [s]
MAX_LOST = 20  # lost answers in a row; at 50 Hz the arm is blind for 0.4 s
_TABLES = ("joints", "groups", "serial", "collision", "tool", "gripper", "guards")
_ROUNDING = 1.0 + 1e-9  # factor of a velocity limit: allows rounding errors of multipliers


def load_robot(
    path: Path | None = None, urdf: Path | None = None, calibrated: bool = True
) -> Robot:
    """Load a robot.

    Args:
        path: The robot file, or the name of a shipped robot. Default: the Arduinobot.
        urdf: The URDF file. Default: the file that the robot file names.
        calibrated: False to ignore the calibration file. Default: True.

    Raises:
        DescriptionError: The file or its URDF is wrong. The message names file, line, key and valid
            choices.
    """
    path = _robot_file(path or Path("arduinobot"))
    root, file = TomlTable.read(path, patient=True), calibration_file(path)
    described = driver = calibration = None
    with root.later():
        named = path.parent / root.text("urdf")
        urdf = urdf or named
        described = _urdf(root, urdf)
    with root.later():
        driver = load_driver(root) if "driver" in root or "serial" in root else NullDriver(path)
    with root.later():
        name = root.text("name")
        calibration = read_calibration(file, name) if calibrated else None
    if described:
        with root.later():
            joints = _joints(root, described, driver, calibration)
        with root.later():
            groups = _groups(root, [*described.moving])
    if driver:
        with root.later():
            serial, firmware = _board(root, driver)
    if described:
        with root.later():
            collision = _collision(root.table("collision"), described.links)
        with root.later():
            tool = _tool(root.table("tool"), described.links) if "tool" in root else None
    with root.later():
        home = tuple(root.text("home", default="").split())
    with root.later():
        acceleration_sum = root.number("acceleration_sum", above=0, default=math.inf)
    with root.later():
        needs_calibration = root.boolean("needs_calibration", default=False)
    with root.later():
        brake = root.number("brake_s", least=0, most=MAX_BRAKE, default=0.0)
    there = {key for key in _TABLES if key in root}
    with root.later():
        root.done()
    root.raise_mistakes()
    assert urdf
    assert described
    assert driver
    robot = Robot(
        name=name,
        path=path,
        urdf=urdf,
        joints=joints,
        groups=groups,
        serial=serial,
        driver=driver,
        firmware=firmware,
        collision=collision,
        tool=tool,
        gripper=_gripper(root, joints, groups, described) if "gripper" in there else None,
        guards=_guards(root, firmware) if "guards" in there else Guards(),
        links=described.links,
        home=home,
        acceleration_sum=acceleration_sum,
        needs_calibration=needs_calibration,
        calibration=file if calibration else None,
        brake=brake,
    )
    driver.check(root, robot.actuated, firmware)
    if firmware is not NO_FIRMWARE:
        _check_serial(root.table("serial"), serial, firmware)
    return robot


def shipped_robots() -> dict[str, Path]:
    """Return the shipped robot files, by the name of the robot."""
    files = filter(is_robot_file, ROBOTS.glob("*/*.toml"))
    return {file.stem: file for file in sorted(files)}


def _robot_file(path: Path) -> Path:
    """Return the robot file for a path or a name.

    Raises:
        DescriptionError: There is no such file, and no shipped robot has that name.
    """
    shipped = shipped_robots()
    if not path.is_file() and len(path.parts) == 1 and path.name in shipped:
        return shipped[path.name]
    if path.suffix.lower() == ".urdf":
        why = f"is a URDF, not a robot file; make a robot file with `armtree new-arm {path}`"
        raise DescriptionError(path, 0, why)
    if path.exists():
        return path
    beside = {file.stem: str(file) for file in path.parent.glob("*.toml") if is_robot_file(file)}
    known = dict(zip(shipped, shipped, strict=True)) | beside
    near = did_you_mean(known.get(closest(path.stem, known), ""))
    present = f"the shipped robots are {', '.join(shipped)}"
    present += near or "; `armtree new-arm` makes one from a URDF"
    why = f"there is no such file, and no shipped robot of that name; {present}"
    raise DescriptionError(path, 0, why)


def _urdf(root: TomlTable, path: Path) -> Urdf:
    try:
        return Urdf.read(path)
    except UrdfError as error:
        raise DescriptionError(path, error.line, str(error)) from error
    except (OSError, ValueError, LookupError) as error:  # the path or its encoding is invalid
        if "://" in (uri := root.text("urdf")):
            way = "give the path of the file, relative to the folder of this file"
            root.fail("urdf", f"{uri!r} is a URI; {way}", uri, f'"{path.name}"')
        why = f"{path} cannot be read: {getattr(error, 'strerror', error)}"
        way = "; give a file, relative to the folder of this file"
        root.fail("urdf", why + (way if isinstance(error, FileNotFoundError) else ""))


def _board(root: TomlTable, driver: Driver | NullDriver) -> tuple[Serial, Firmware]:
    """Return the serial line and the firmware of the board."""
    if isinstance(driver, NullDriver):
        return Serial(port=VIRTUAL, baud=NO_BAUD, boot_wait=0.0), NO_FIRMWARE
    table = root.table("serial")
    firmware = driver.firmwares[table.choice("firmware", driver.firmwares)]
    if firmware.most_rate:
        least, most = firmware.rate, firmware.most_rate
        rate = table.number("rate_hz", least=least, most=most, default=least)
        step = int(firmware.max_step * least / rate)  # keeps the speed of the servos
        firmware = replace(firmware, rate=rate, max_step=step)
    if firmware.lost_answers and "lost_answers" in table:
        lost = table.integer("lost_answers", range(1, MAX_LOST + 1))
        firmware = replace(firmware, lost_answers=lost)
    serial = Serial(
        port=table.text("port", default=""),
        baud=table.integer("baud", BAUD_RATES),
        boot_wait=table.number("boot_wait_s", least=0, most=MAX_BOOT_WAIT),
        resets=table.boolean("reset_on_open", default=firmware.resets),
    )
    table.done()
    return serial, firmware


def _guards(root: TomlTable, firmware: Firmware) -> Guards:
    if Ability.MEASURE not in firmware.abilities:
        why = f"a board with {firmware.name} measures nothing"
        root.fail("guards", f"the table is not allowed, because {why}; remove the table")
    table = root.table("guards")
    limits = {field.name for field in fields(Guards)} - {"grips", "on_fault"}
    guards = Guards(
        grips=table.choice("grips", (CLOSING, OPENING), default=CLOSING),
        on_fault=table.choice("on_fault", (HOLD, TORQUE_OFF), default=HOLD),
        **{name: table.number(name, above=0) for name in limits if name in table},
    )
    table.done()
    return guards


def _check_serial(table: TomlTable, serial: Serial, firmware: Firmware) -> None:
    """Check the serial line against the firmware."""
    if firmware.baud not in (0, serial.baud):
        table.fail("baud", f"{serial.baud} is not {firmware.baud}, the speed of {firmware.name}")
    fixed = firmware.reports_pose or not firmware.resets
    if fixed and serial.resets is not firmware.resets:
        does = "resets" if firmware.resets else "does not reset"
        why = f"opening the port {does} a board with {firmware.name}"
        table.fail("reset_on_open", f"{str(serial.resets).lower()} is not allowed: {why}")
    if serial.boot_wait < firmware.boot_time:
        needs = f"{firmware.name} needs {firmware.boot_time:g} s from reset to its first byte"
        table.fail("boot_wait_s", f"{serial.boot_wait:g} s is too short: {needs}")


def _joints(
    root: TomlTable, urdf: Urdf, driver: Driver | NullDriver | None, calibration: TomlTable | None
) -> tuple[Joint, ...]:
    """Return the joints of the robot file in its order, then the mimic joints of the URDF."""
    table, moving = root.table("joints"), urdf.moving
    own, mimics = dict[str, Joint](), []
    for name in table:
        with table.later():
            if name not in moving:
                near = suggestion(name, moving, [*table])
                table.fail(name, f"the URDF has no such joint; it has {', '.join(moving)}{near}")
            if moving[name].mimic:
                table.fail(name, "follows another joint in the URDF and has no servo; remove it")
            if joint := _joint(name, table.table(name), moving[name], driver, calibration):
                own[name] = joint
    if table.mistakes:
        return ()
    for name, described in moving.items():
        if described.mimic and described.mimic.leader in own:
            leader = described.mimic.leader
            mimics.append(_mimic_joint(table.table(leader), described, own[leader]))
        elif described.mimic:
            why = f"the URDF's joint {name} follows {described.mimic.leader}, which has no table"
            root.fail("joints", f"{why}; let it follow one of these: {', '.join(own)}")
        elif name not in own:
            root.fail("joints", f"the joint {name} of the URDF is missing; add [joints.{name}]")
    return (*own.values(), *mimics)


def _joint(
    name: str,
    table: TomlTable,
    urdf: UrdfJoint,
    driver: Driver | NullDriver | None,
    calibration: TomlTable | None,
) -> Joint | None:
    """Return a joint, or None if this or an earlier joint has mistakes, which the table keeps."""
    lower, upper, wired, swept = urdf.lower, urdf.upper, table, None
    if calibration and "wire" in table:
        wired = calibration.table(name)
        swept = math.radians(wired.number("lower_deg")), math.radians(wired.number("upper_deg"))
        lower, upper = max(lower, swept[0]), min(upper, swept[1])
        if lower >= upper:
            wired.fail("lower_deg", "this range and the limits of the URDF do not overlap")
    with table.later():
        boot = table.number("boot")
        if not urdf.lower <= boot <= urdf.upper:
            outside = f"{boot:g} is outside [{urdf.lower:g}, {urdf.upper:g}]"
            right = _in_radians(boot, urdf)
            words = f"; {boot:g} degrees are {right} rad" if right else ""
            table.fail("boot", outside + words, f"{boot:g}", right)
    with table.later():
        velocity = table.number("velocity", above=0)
        if velocity > urdf.velocity:
            most = f"the URDF's limit, {urdf.velocity:g} {urdf.unit}/s"
            words = f"{velocity:g} {urdf.unit}/s is more than {most}"
            table.fail("velocity", words, f"{velocity:g}", f"{urdf.velocity:g}")
    with table.later():
        acceleration = table.number("acceleration", above=0)
    with table.later():
        # Without a driver, only the name of the key is known.
        wire = driver.wire(wired, lower, upper) if driver else "wire" in table
    table.done()
    if table.mistakes:
        return None
    return Joint(
        name=name,
        lower=lower,
        upper=upper,
        velocity=velocity,
        acceleration=acceleration,
        boot=min(max(boot, lower), upper),  # a calibrated range may exclude the boot position
        mimic=None,
        wire=wire,
        unit=urdf.unit,
        swept=swept,
    )


def _in_radians(boot: float, urdf: UrdfJoint) -> str:
    """Return a position in degrees as text in radians; "" if it may be rad, or is out of limits."""
    exact = math.radians(boot)
    right = next((q for q in (round(exact, 4), exact) if urdf.lower <= q <= urdf.upper), None)
    return "" if urdf.unit != "rad" or abs(boot) <= math.tau or right is None else f"{right}"


def _mimic_joint(table: TomlTable, urdf: UrdfJoint, leader: Joint) -> Joint:
    joint = urdf.following(leader)
    if joint.velocity > urdf.velocity * _ROUNDING:
        drives = f"{leader.velocity:g} {leader.unit}/s moves {joint.name} at {joint.velocity:g}"
        most = f"the URDF's limit, {urdf.velocity:g} {urdf.unit}/s"
        table.fail("velocity", f"{drives} {urdf.unit}/s, more than {most}")
    return joint


def _groups(root: TomlTable, names: Sequence[str]) -> dict[str, tuple[str, ...]]:
    """Return the groups `arm` and `gripper` of joints. An arm may have no gripper."""
    table = root.table("groups")
    groups = {
        "arm": table.names("arm", names),
        "gripper": table.names("gripper", names, default=[]),
    }
    table.done()
    members = [name for group in groups.values() for name in group]
    for name in names:
        if members.count(name) != 1:
            root.fail("groups", f"joint {name} is in {members.count(name)} groups; write it in one")
    return groups


def _collision(table: TomlTable, links: tuple[str, ...]) -> CollisionRules:
    rules = CollisionRules(
        margin=table.number("margin_m", least=0),
        allowed=table.pairs("allowed", links),
        floor=table.number("floor_m") if "floor_m" in table else None,
        floor_ignores=frozenset(table.names("floor_ignores", links)),
        start_contact=table.number("start_contact_m", least=0, default=0.0),
    )
    table.done()
    return rules


def _tool(table: TomlTable, links: tuple[str, ...]) -> Tool:
    tool = Tool(
        link=table.choice("link", links),
        offset=table.vector("offset_m", default=(0.0, 0.0, 0.0)),
        axis=table.vector("axis", default=(0.0, 0.0, 1.0)),
    )
    if not any(tool.axis):
        table.fail("axis", "is zero; give a vector with a length")
    table.done()
    return tool


def _gripper(
    root: TomlTable,
    joints: tuple[Joint, ...],
    groups: Mapping[str, tuple[str, ...]],
    described: Urdf,
) -> Gripper:
    table = root.table("gripper")
    pads = table.table("pads")
    if len([*pads]) != 2:
        table.fail("pads", "must have two points: one on each finger, by the name of its link")
    for link in pads:
        if link not in described.links:
            pads.fail(link, f"the URDF has no such link; {there_are(link, described.links)}")
    points = {link: pads.vector(link) for link in pads}
    table.done()
    own = [each for each in joints if each.name in groups["gripper"] and each.mimic is None]
    if len(own) != 1:
        root.fail("gripper", f"the group gripper has {len(own)} independent joints; it needs one")
    gripper = Gripper(own[0], points)
    if not gripper.is_monotonic(ForwardKinematics(described)):
        why = "two positions of the joint have the same distance between these points"
        table.fail("pads", f"{why}; give points on the inner faces of the fingers")
    return gripper

"""Reading a robot description: one TOML file and the URDF it names."""

import math
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from xml.etree import ElementTree

from .errors import DescriptionError
from .firmware import FIRMWARES
from .frames import servo_angle
from .robot import CollisionRules, Joint, Mimic, Robot, Serial, WireField
from .toml_table import TomlTable

_MOVING = ("revolute", "continuous", "prismatic")


def load_robot(path: Path | None = None) -> Robot:
    """The robot described in a file; the shipped Arduinobot where none is given.

    Raises:
        DescriptionError: The file or its URDF is wrong; names file, line, key and valid choices.
    """
    if path is None:
        path = Path(str(resources.files(__package__).joinpath("arduinobot.toml")))
    root = TomlTable.read(path)
    urdf_path = path.parent / root.text("urdf")
    urdf = _read_urdf(urdf_path)
    joints = _joints(root, urdf)
    groups = _groups(root, joints)
    robot = Robot(
        name=root.text("name"),
        path=path,
        urdf=urdf_path,
        joints=joints,
        groups=groups,
        serial=_serial(root.table("serial")),
        firmware=FIRMWARES[root.table("serial").choice("firmware", FIRMWARES)],
        collision=_collision(root.table("collision"), urdf.links),
    )
    root.done()
    return robot


@dataclass(frozen=True)
class _UrdfJoint:
    lower: float
    upper: float
    mimic: Mimic | None


@dataclass(frozen=True)
class _Urdf:
    links: tuple[str, ...]
    joints: dict[str, _UrdfJoint]


def _read_urdf(path: Path) -> _Urdf:
    """The links and moving joints of a URDF."""
    try:
        root = ElementTree.parse(path).getroot()
    except OSError as error:
        raise DescriptionError(path, 0, f"cannot be read: {error.strerror}") from error
    except ElementTree.ParseError as error:
        raise DescriptionError(path, error.position[0], f"is not XML: {error}") from error
    links = tuple(link.get("name", "") for link in root.iter("link"))
    moving = [j for j in root.findall("joint") if j.get("type") in _MOVING]
    return _Urdf(links, {j.get("name", ""): _urdf_joint(path, j) for j in moving})


def _urdf_joint(path: Path, element: ElementTree.Element) -> _UrdfJoint:
    name, limit, mimic = element.get("name"), element.find("limit"), element.find("mimic")
    bounds = {} if limit is None else limit.attrib
    if element.get("type") == "continuous":
        bounds = {"lower": "-inf", "upper": "inf"}
    try:
        lower, upper = float(bounds["lower"]), float(bounds["upper"])
        leader = None if mimic is None else _mimic(mimic)
    except KeyError as error:
        raise DescriptionError(path, 0, f"joint {name} lacks {error.args[0]}") from error
    except ValueError as error:
        raise DescriptionError(path, 0, f"joint {name}: {error}") from error
    if not lower <= upper:
        raise DescriptionError(path, 0, f"joint {name}: lower {lower:g} is above upper {upper:g}")
    return _UrdfJoint(lower, upper, leader)


def _mimic(element: ElementTree.Element) -> Mimic:
    multiplier, offset = element.get("multiplier", "1"), element.get("offset", "0")
    return Mimic(element.attrib["joint"], float(multiplier), float(offset))


def _joints(root: TomlTable, urdf: _Urdf) -> tuple[Joint, ...]:
    """The joints of the robot file in its order, then the mimics of the URDF."""
    table = root.table("joints")
    for name in table:
        if name not in urdf.joints:
            table.fail(name, f"the URDF has no such joint; it has {', '.join(urdf.joints)}")
        if urdf.joints[name].mimic:
            table.fail(name, "follows another joint in the URDF and has no servo of its own")
    own = {name: _joint(name, table.table(name), urdf.joints[name]) for name in table}
    letters = [joint.wire.letter for joint in own.values() if joint.wire]
    if len(set(letters)) != len(letters) or not letters:
        root.fail("joints", f"the letters on the wire must differ, not {', '.join(letters)}")
    mimics = []
    for name, described in urdf.joints.items():
        if described.mimic and described.mimic.leader in own:
            mimics.append(_mimic_joint(name, described, own[described.mimic.leader]))
        elif name not in own:
            root.fail("joints", f"the URDF's joint {name} is not described")
    return (*own.values(), *mimics)


def _joint(name: str, table: TomlTable, urdf: _UrdfJoint) -> Joint:
    joint = Joint(
        name=name,
        lower=urdf.lower,
        upper=urdf.upper,
        velocity=table.number("velocity", above=0),
        acceleration=table.number("acceleration", above=0),
        boot=table.number("boot"),
        mimic=None,
        wire=_wire(table.table("wire")),
    )
    if not joint.lower <= joint.boot <= joint.upper:
        table.fail("boot", f"{joint.boot:g} is outside [{joint.lower:g}, {joint.upper:g}]")
    _check_travel(joint, table)
    table.done()
    return joint


def _check_travel(joint: Joint, table: TomlTable) -> None:
    """A frame has three digits, and a servo turns from 0 to 180 degrees."""
    assert joint.wire is not None
    for limit in (joint.lower, joint.upper):
        if not math.isfinite(limit) or not 0 <= servo_angle(joint.wire, limit) <= 180:
            what = f"the URDF's limit {limit:g} rad"
            table.fail("wire", f"{what} is no servo angle from 0 to 180 degrees with this field")


def _mimic_joint(name: str, urdf: _UrdfJoint, leader: Joint) -> Joint:
    assert urdf.mimic is not None
    scale = abs(urdf.mimic.multiplier)
    return Joint(
        name=name,
        lower=urdf.lower,
        upper=urdf.upper,
        velocity=leader.velocity * scale,
        acceleration=leader.acceleration * scale,
        boot=urdf.mimic.value(leader.boot),
        mimic=urdf.mimic,
        wire=None,
    )


def _wire(table: TomlTable) -> WireField:
    letter = table.text("letter")
    if len(letter) != 1 or not ("a" <= letter <= "z"):
        table.fail("letter", f"{letter!r} is not one letter from a to z")
    field = WireField(
        letter=letter,
        sign=table.integer("sign", choices=(-1, 1)),
        offset=math.radians(table.number("offset_deg")),
        span=math.radians(table.number("span_deg", above=0)),
        reversed=table.boolean("reversed"),
    )
    table.done()
    return field


def _groups(root: TomlTable, joints: tuple[Joint, ...]) -> dict[str, tuple[str, ...]]:
    table, names = root.table("groups"), [joint.name for joint in joints]
    groups = {group: table.names(group, names) for group in table}
    members = [name for group in groups.values() for name in group]
    for name in names:
        if members.count(name) != 1:
            root.fail("groups", f"joint {name} is in {members.count(name)} groups, not in one")
    return groups


def _serial(table: TomlTable) -> Serial:
    table.text("firmware")
    serial = Serial(
        port=table.text("port", default=""),
        baud=table.integer("baud"),
        boot_wait=table.number("boot_wait_s", least=0),
    )
    table.done()
    return serial


def _collision(table: TomlTable, links: tuple[str, ...]) -> CollisionRules:
    rules = CollisionRules(
        margin=table.number("margin_m", least=0),
        allowed=table.pairs("allowed", links),
        floor=table.number("floor_m") if "floor_m" in table else None,
        floor_ignores=frozenset(table.names("floor_ignores", links)),
    )
    table.done()
    return rules

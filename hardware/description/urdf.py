"""Reading a URDF: its links, and its moving joints with their limits.

All that pinocchio would refuse without naming it is refused here, with its joint or link and key.
"""

import math
import re
import reprlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from xml.etree.ElementTree import Element, ParseError, parse

from hardware.errors import DescriptionError

from .joints import Mimic
from .toml_table import TomlTable

_MOVING = ("revolute", "continuous", "prismatic")
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)  # float() takes more
_SHORTEST = 1e-6  # that a joint's axis can be


@dataclass(frozen=True)
class UrdfJoint:
    """A joint that moves.

    Attributes:
        lower, upper: Limits [rad or m]; infinite where it turns without an end.
        velocity: Limit [rad/s or m/s]; infinite where it turns without an end and none is given.
        mimic: What it follows; None if it moves of its own.
        unit: rad or m.
    """

    lower: float
    upper: float
    velocity: float
    mimic: Mimic | None
    unit: str


@dataclass(frozen=True)
class Urdf:
    """What a robot file needs of its URDF: names of all links, and the joints that move."""

    links: tuple[str, ...]
    joints: dict[str, UrdfJoint]


def read_urdf(table: TomlTable, path: Path) -> Urdf:
    """The links and moving joints of the URDF that a robot file names.

    Raises:
        DescriptionError: It cannot be read, or is no tree of links with joints that make sense.
    """
    try:
        root = parse(path).getroot()
    except ParseError as error:
        raise DescriptionError(path, error.position[0], f"is not XML: {error}") from error
    except (OSError, ValueError, LookupError) as error:  # the name or encoding is impossible
        table.fail("urdf", f"{path} cannot be read: {getattr(error, 'strerror', error)}")
    if root.tag != "robot":
        raise DescriptionError(path, 0, f"is no URDF: it is a <{root.tag}>; give it a <robot>")
    joints = root.findall("joint")
    links = tuple(link.get("name", "") for link in root.findall("link"))
    names = [joint.get("name", "") for joint in joints]
    why = _misnamed("link", links) or _misnamed("joint", names)
    if why := why or _no_joint(joints) or _no_tree(joints, links):
        raise DescriptionError(path, 0, why)
    found = {}
    for name, joint in zip(names, joints, strict=True):
        try:
            if read := _read(name, joint):
                found[name] = read
        except ValueError as error:
            raise DescriptionError(path, 0, f"joint {name}: {error}") from error
    return Urdf(links, found)


def _misnamed(kind: str, names: Sequence[str]) -> str:
    """Why names are none; empty if they are."""
    if "" in names:
        return f"{kind} {names.index('') + 1} of {len(names)} has no name; give it one"
    for name in names:
        if names.count(name) > 1:
            return f"two {kind}s are called {name}; give each a name of its own"
    return ""


def _no_joint(joints: list[Element]) -> str:
    """Why one is of no type that can be planned for; empty if all are."""
    for joint in joints:
        if joint.get("type") not in (*_MOVING, "fixed"):
            why = f"joint {joint.get('name')} is {joint.get('type')}"
            return f"{why}; it must be {', '.join(_MOVING)} or fixed"
    return ""


def _no_tree(joints: list[Element], links: tuple[str, ...]) -> str:
    """Why the joints do not make a tree of the links; empty if they do."""
    ends = {
        joint.get("name", ""): (_end(joint, "parent"), _end(joint, "child")) for joint in joints
    }
    above = dict[str, str]()  # the joint that each link hangs from
    for name, (parent, child) in ends.items():
        for link in (parent, child):
            if link not in links:
                return f"joint {name}: there is no link {link!r}; there are {', '.join(links)}"
        if child in above:
            return f"joint {name}: its child {child} hangs from {above[child]} already"
        above[child] = name
    for name, (parent, child) in ends.items():
        way, end = list[str](), parent
        while end != child and end in above and above[end] not in way:
            way.append(above[end])
            end, _ = ends[way[-1]]
        if end == child:
            loop = f"by way of {', '.join(way)}" if way else "as its child is its parent"
            return f"joint {name} hangs from itself, {loop}; let its child be another link"
    return _no_root([link for link in links if link not in above])


def _no_root(roots: list[str]) -> str:
    """Why there is not one link that all others hang from; empty if there is."""
    if not roots:
        return "has no links; give it one at least"
    if len(roots) > 1:
        why = f"links {' and '.join(roots)} hang from no joint, as only one link may"
        return f"{why}; let each other one be the child of a joint"
    return ""


def _end(joint: Element, which: str) -> str:
    element = joint.find(which)
    return "" if element is None else element.get("link", "")


def _read(name: str, joint: Element) -> UrdfJoint | None:
    """The joint; None where it is fixed.

    Raises:
        ValueError: It makes no sense.
    """
    kind = joint.get("type", "")
    unit = "m" if kind == "prismatic" else "rad"
    _check_origin(joint)
    lower, upper, velocity = _limits(kind, unit, joint.find("limit"))
    if kind == "fixed":
        return None
    axis = joint.find("axis")
    xyz = "1 0 0" if axis is None else axis.get("xyz", "1 0 0")
    if not _is_direction(xyz):
        wanted = "give x, y, z of a vector with a length, such as 0 0 1"
        raise ValueError(f"its axis is {reprlib.repr(xyz)}; {wanted}")
    mimic = joint.find("mimic")
    return UrdfJoint(lower, upper, velocity, None if mimic is None else _mimic(name, mimic), unit)


def _check_origin(joint: Element) -> None:
    for origin in joint.findall("origin"):
        for key, unit in (("xyz", "m"), ("rpy", "rad")):
            if len(_numbers(origin.get(key, "0 0 0"))) != 3:
                wanted = f"three finite numbers [{unit}], such as 0 0 0.1"
                raise ValueError(_told(origin, key, wanted))


def _limits(kind: str, unit: str, limit: Element | None) -> tuple[float, float, float]:
    """Lower, upper, and of the velocity; infinite where there may be none, and is none."""
    ends = kind in ("revolute", "prismatic")
    if limit is None:
        if ends:
            raise ValueError("it has no limit; give one with its lower, upper, velocity and effort")
        return -math.inf, math.inf, math.inf
    number, above, missing = (
        "a finite number",
        "a finite number of at least 0",
        None if ends else "0",
    )
    lower = _number(limit, "lower", f"{number} [{unit}]", default=missing)
    upper = _number(limit, "upper", f"{number} [{unit}]", default=missing)
    velocity = _number(limit, "velocity", f"{above} [{unit}/s]", least=0.0)
    _number(limit, "effort", above, least=0.0)
    if not ends:
        return -math.inf, math.inf, velocity
    if not lower <= upper:
        raise ValueError(f"lower {lower:g} is above upper {upper:g}")
    return lower, upper, velocity


def _is_direction(xyz: str) -> bool:
    """Whether it is a vector; pinocchio makes nothing of one whose square is no number."""
    numbers = _numbers(xyz)
    return len(numbers) == 3 and _SHORTEST <= math.hypot(*numbers) <= 1.0 / _SHORTEST


def _mimic(name: str, element: Element) -> Mimic:
    leader = element.get("joint", "")
    if not leader:
        raise ValueError(_told(element, "joint", "the name of the joint to follow"))
    if leader == name:
        raise ValueError("it mimics itself; let it mimic another joint, or none")
    multiplier = _number(element, "multiplier", "a finite number", default="1")
    offset = _number(element, "offset", "a finite number", default="0")
    return Mimic(leader, multiplier, offset)


def _number(
    element: Element, key: str, wanted: str, least: float = -math.inf, default: str | None = None
) -> float:
    """An attribute; what is wanted of it is for the message."""
    text = element.get(key, default)
    if text is None or not _NUMBER.fullmatch(text) or not least <= float(text) < math.inf:
        raise ValueError(_told(element, key, wanted))
    return float(text)


def _numbers(text: str) -> list[float]:
    """Finite numbers with spaces between; none at all where one of them is none."""
    words = text.split(" ")
    numbers = [float(word) for word in words if _NUMBER.fullmatch(word)]
    right = len(numbers) == len([word for word in words if word])
    return numbers if right and all(map(math.isfinite, numbers)) else []


def _told(element: Element, key: str, wanted: str) -> str:
    value = element.get(key)
    what = "is missing" if value is None else f"is {reprlib.repr(value)}"
    return f"the {key} of its {element.tag} {what}; give {wanted}"

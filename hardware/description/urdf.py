"""Reads URDF files: links, joints, and the collision shapes of links.

It rejects elements that pinocchio would silently ignore, or reject without a name. Its errors name
the link or joint, the key and the value.
"""

import math
import re
import reprlib
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from copy import deepcopy
from functools import cached_property
from pathlib import Path
from typing import Self
from xml.etree import ElementTree
from xml.etree.ElementTree import Element
from xml.parsers import expat

from hardware.files import read_file
from hardware.joints import Joint, Mimic
from hardware.loading.dataclass import dataclass
from hardware.spelling import there_are

from .urdf_attributes import SHAPES, SIZES, corrected_end, given, misspelt, others

Vector = tuple[float, float, float]
_Mistake = tuple[Element | None, str]  # the wrong element, or None for the file; the message

MAX_BYTES = 2**20
_XACRO = re.compile(r"\{[^}]*xacro\}")  # namespace of its elements
_EXPRESSION = re.compile(r"\$[{(]")  # an expression of xacro in a value
_MOVING = ("revolute", "continuous", "prismatic")
# Form of a number in XML. float() accepts more.
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)
_MAX_LINKS = 1000  # pinocchio takes a minute for 4000 shapes
_SHORTEST_AXIS = 1e-6  # pinocchio cannot normalise an axis with a square near 0


class UrdfError(ValueError):
    """A URDF is wrong.

    Attributes:
        line: Line number in the file; 0 if unknown.
    """

    def __init__(self, message: str, line: int = 0) -> None:
        self.line = line
        super().__init__(message)

    @classmethod
    def of(cls, mistakes: "Sequence[UrdfError]", path: Path) -> "UrdfError":
        """Return one error with all mistakes of a URDF, one per line with the path of the file."""
        if len(mistakes) == 1:
            return mistakes[0]
        words = [f"{path}:{each.line}: {each}" if each.line else str(each) for each in mistakes]
        return cls("\n".join([f"{len(words)} mistakes", *words]))


@dataclass(frozen=True, slots=True)
class UrdfJoint:
    """A joint.

    Attributes:
        name: Name of the joint.
        type: `revolute`, `continuous`, `prismatic` or `fixed`.
        parent: Name of the link that carries the joint.
        child: Name of the link that the joint moves.
        xyz: Position of the joint in the frame of its parent [m].
        rpy: Rotation of the joint about the parent's fixed x, y and z axes, in this order [rad].
        axis: Axis in the frame of the joint. It need not have length 1.
        lower: Smallest position [rad or m]; -inf if there is no limit.
        upper: Largest position [rad or m]; inf if there is no limit.
        velocity: Velocity limit [rad/s or m/s]; inf if there is no limit.
        mimic: Relation to the joint that it follows; None if it moves independently.
    """

    name: str
    type: str
    parent: str
    child: str
    xyz: Vector
    rpy: Vector
    axis: Vector
    lower: float
    upper: float
    velocity: float
    mimic: Mimic | None

    @property
    def unit(self) -> str:
        """Unit of the joint's position: `m` for a prismatic joint, else `rad`."""
        return _unit(self.type)

    def following(self, leader: Joint) -> Joint:
        """Return this joint with its leader's velocity and acceleration times the multiplier."""
        assert self.mimic
        scale = abs(self.mimic.multiplier)
        return Joint(
            name=self.name,
            lower=self.lower,
            upper=self.upper,
            velocity=leader.velocity * scale,
            acceleration=leader.acceleration * scale,
            boot=self.mimic.value(leader.boot),
            mimic=self.mimic,
            wire=None,
            unit=self.unit,
        )


@dataclass(frozen=True, slots=True)
class Shape:
    """A visual shape of a link.

    Attributes:
        link: Name of the link.
        kind: `box`, `sphere`, `cylinder` or `mesh`.
        sizes: By kind: lengths along x, y and z; radius; radius and length [m]; scale of a mesh
            along x, y and z.
        mesh: Name of the file of a mesh; empty for other shapes.
        xyz: Position in the frame of the link [m].
        rpy: Rotation about the link's fixed x, y and z axes, in this order [rad].
        color: Red, green, blue and opacity, 0 to 1; None if the URDF gives none.
    """

    link: str
    kind: str
    sizes: tuple[float, ...]
    mesh: str
    xyz: Vector
    rpy: Vector
    color: tuple[float, ...] | None


class Urdf:
    """A URDF, parsed once. Its links and joints are valid if `mistakes` yields nothing.

    Args:
        text: Text of the file, or its bytes.

    Raises:
        UrdfError: The text is not XML.
        LookupError: The encoding of the text is unknown.
    """

    def __init__(self, text: str | bytes) -> None:
        try:
            self._root = ElementTree.fromstring(text)
        except ElementTree.ParseError as error:
            raise UrdfError(f"is not XML: {error}", error.position[0]) from error
        self._text = text

    @classmethod
    def read(cls, path: Path) -> Self:
        """Read a file, and check its links and joints.

        Raises:
            OSError: The file cannot be read.
            UrdfError: The file is not XML, or not a tree of links with valid joints.
            LookupError: The encoding of the text is unknown.
            ValueError: The path is invalid.
        """
        return cls(read_file(path, MAX_BYTES)).checked(path)

    def checked(self, path: Path = Path("URDF")) -> Self:
        """Check its links and joints, and return the URDF itself.

        Args:
            path: The file, for the message. Default: a text without a file.

        Raises:
            UrdfError: The URDF is not a tree of links with valid joints.
        """
        if mistakes := list(self.mistakes()):
            raise UrdfError.of(mistakes, path)
        return self

    @cached_property
    def links(self) -> tuple[str, ...]:
        """Names of all links."""
        return tuple(link.get("name", "") for link in self._root.findall("link"))

    @cached_property
    def joints(self) -> tuple[UrdfJoint, ...]:
        """All joints, in the order of the file."""
        return tuple(_joint(each, []) for each in self._root.findall("joint"))

    @cached_property
    def joint_lines(self) -> list[int]:
        """Line number of each joint, in the order of the file."""
        return [self._lines[joint] for joint in self._root.findall("joint")]

    @cached_property
    def _lines(self) -> dict[Element, int]:
        """Line number of each element. Only mistakes need it, so the text is parsed again."""
        numbers, parser = list[int](), expat.ParserCreate()
        parser.StartElementHandler = lambda *_: numbers.append(parser.CurrentLineNumber)
        parser.Parse(self._text, True)
        return dict(zip(self._root.iter(), numbers, strict=True))

    @cached_property
    def moving(self) -> dict[str, UrdfJoint]:
        """The joints that are not fixed, by name."""
        return {joint.name: joint for joint in self.joints if joint.type in _MOVING}

    @property
    def is_xacro(self) -> bool:
        """True if the program xacro must convert the file first."""
        return any(
            _XACRO.match(element.tag) or any(map(_EXPRESSION.search, element.attrib.values()))
            for element in self._root.iter()
        )

    def mistakes(self) -> Iterator[UrdfError]:
        """Yield every mistake of links and joints."""
        yield from self._errors(self._mistakes())

    def _errors(self, mistakes: Iterable[_Mistake]) -> Iterator[UrdfError]:
        for element, message in mistakes:
            yield UrdfError(message, 0 if element is None else self._lines[element])

    def _mistakes(self) -> Iterator[_Mistake]:
        root = self._root
        if root.tag != "robot":
            yield None, f"is not a URDF: its root element is <{root.tag}>, not <robot>"
            return
        if self.is_xacro:
            yield None, "is a xacro file; first run xacro FILE > robot.urdf"
            return
        joints = root.findall("joint")
        if len(self.links) > _MAX_LINKS:
            yield None, f"has {len(self.links)} links; the limit is {_MAX_LINKS}"
            return
        if "name" not in root.attrib:
            yield root, 'the robot has no name; write <robot name="my_arm">'
        yield from _name_mistakes("link", root.findall("link"))
        yield from _name_mistakes("joint", joints)
        known = []
        for joint in joints:
            if joint.get("type") in (*_MOVING, "fixed"):
                known.append(joint)
            else:
                why = f"joint {joint.get('name')} is {joint.get('type')}"
                yield joint, f"{why}; it must be {', '.join(_MOVING)} or fixed"
        yield from _tree_mistakes(joints, root.findall("link"))
        for joint in known:
            wrong = list[_Mistake]()
            _joint(joint, wrong)
            name = joint.get("name", "")
            yield from ((element, f"joint {name}: {message}") for element, message in wrong)

    def shape_mistakes(self, largest: float) -> Iterator[UrdfError]:
        """Yield every mistake of collision shapes.

        Args:
            largest: Largest size of a shape, and largest coordinate of a shape in its link [m].
        """
        for link in self._root.findall("link"):
            for collision in link.findall("collision"):
                wrong = _collision_mistakes(link.get("name", ""), collision, largest)
                yield from self._errors(wrong)

    def shape_sizes(self) -> Iterator[tuple[int, str, str, list[float]]]:
        """Yield line, name, key and numbers [m] of each size of a collision or visual shape."""
        for link in self._root.findall("link"):
            for shape in link.findall("*/geometry/*"):
                for key in SIZES.get(shape.tag, {}):
                    where = f"the {shape.tag} of {link.get('name', '')}"
                    yield self._lines[shape], where, key, _numbers(shape.get(key, ""))

    def mesh_scales(self) -> Iterator[tuple[int, str, list[float]]]:
        """Yield line, name and scale of each mesh of a collision shape."""
        for mesh in self._root.findall("link/collision/geometry/mesh"):
            yield self._lines[mesh], mesh.get("filename", ""), _numbers(mesh.get("scale", "1 1 1"))

    def shape_counts(self, kind: str = "collision") -> dict[str, int]:
        """Return the number of `collision` or `visual` shapes of each link."""
        links = self._root.findall("link")
        return {link.get("name", ""): len(link.findall(kind)) for link in links}

    def visible_shapes(self, usable: Callable[[str], bool]) -> list[Shape]:
        """Return the visual shapes of links, or their collision shapes if none is usable.

        Args:
            usable: Callback that returns True for the name of a usable mesh.
        """
        colors = {each.get("name", ""): _color(each) for each in self._root.findall("material")}
        found = []
        for link in self._root.findall("link"):
            for kind in ("visual", "collision"):
                shapes = [_shape(link.get("name", ""), each, colors) for each in link.findall(kind)]
                shown = [each for each in shapes if each and (not each.mesh or usable(each.mesh))]
                found += shown
                if shown:
                    break
        return found

    def meshes(self) -> dict[str, bool]:
        """Return the names of the mesh files: True for the files that collision shapes use."""
        names = dict[str, bool]()
        for kind in ("collision", "visual"):
            for mesh in self._root.findall(f"link/{kind}/geometry/mesh"):
                names.setdefault(mesh.get("filename", ""), kind == "collision")
        return names

    def text_with_meshes(
        self, find: Callable[[str], Path | str], kinds: Sequence[str] = ("collision",)
    ) -> str:
        """Return the text of the URDF with new names of mesh files.

        Args:
            find: Callback that returns the new name of a mesh, from its name in the URDF.
            kinds: Elements with the meshes to rename: `collision`, `visual`.

        Raises:
            UrdfError: A mesh is not found. The message names the link.
        """
        root = deepcopy(self._root)
        for link in root.findall("link"):
            for mesh in (mesh for kind in kinds for mesh in link.findall(f"{kind}/geometry/mesh")):
                try:
                    mesh.set("filename", str(find(mesh.get("filename", ""))))
                except UrdfError as error:
                    raise UrdfError(f"link {link.get('name')}: {error}") from error
        return ElementTree.tostring(root, encoding="unicode")


# Links and joints --------------------------------------------------------------------------------


def _name_mistakes(kind: str, elements: Sequence[Element]) -> Iterator[_Mistake]:
    by_name = dict[str, list[Element]]()
    for element in elements:
        by_name.setdefault(element.get("name", ""), []).append(element)
    if nameless := by_name.pop("", None):
        number = f"{kind} {elements.index(nameless[0]) + 1} of {len(elements)}"
        yield nameless[0], f"{number} has no name; give it one"
    for name, found in by_name.items():
        if len(found) > 1:
            yield found[1], f"two {kind}s are called {name}; give each a name of its own"


def _tree_mistakes(joints: list[Element], bodies: list[Element]) -> Iterator[_Mistake]:
    """Yield the mistakes of joints that do not connect all links to one tree."""
    links = {link.get("name", ""): link for link in bodies}
    elements = dict[str, Element]()  # each joint
    ends = dict[str, tuple[str, str]]()  # parent and child of each joint
    above = dict[str, str]()  # the joint above each link
    counts = Counter[str]()  # joints by name
    for joint in joints:
        name, parent, child = joint.get("name", ""), _link(joint, "parent"), _link(joint, "child")
        counts[name] += 1
        if counts[name] > 1:  # `_name_mistakes` yields this mistake; it must not hide others
            name += f" ({counts[name]})"
        ends[name], elements[name] = (parent, child), joint
        for tag, link in (("parent", parent), ("child", child)):
            if not link:
                yield joint, f"joint {name} has no {tag}; write {corrected_end(joint, tag)} in it"
            elif link not in links:
                why = f"joint {name}: its {tag} {link} is not a link; {there_are(link, links)}"
                if not why.endswith("?"):
                    why += f'; name one of them, or add <link name="{link}"/>'
                yield joint, why
        if child in above:
            what = f"its child {child} is already the child of {above[child]}"
            yield joint, f"joint {name}: {what}; let one of the two move another link"
        above[child] = name
    yield from _loop_mistakes(elements, ends, above)
    roots = [link for link in links if link not in above]
    if not links:
        yield None, "has no links; give it at least one"
    if len(roots) > 1 and all(each in links for both in ends.values() for each in both):
        why = f"links {' and '.join(roots)} have no parent joint; only one link may have none"
        between = f'<parent link="{roots[0]}"/><child link="{roots[1]}"/>'
        fixed = f'<joint name="to_{roots[1]}" type="fixed">{between}</joint>'
        yield links[roots[1]], f"{why}; give each other link a joint, such as {fixed}"


def _loop_mistakes(
    joints: Mapping[str, Element], ends: Mapping[str, tuple[str, str]], above: Mapping[str, str]
) -> Iterator[_Mistake]:
    """Yield the mistake of a joint that is its own ancestor.

    Args:
        joints: The joints.
        ends: Parent and child of each joint.
        above: The joint above each link.
    """
    connected = set[str]()  # links with a path to a root
    for name, (parent, child) in ends.items():
        path, end = dict[str, None](), parent
        while end != child and end not in connected and end in above and above[end] not in path:
            path[above[end]] = None
            end, _ = ends[above[end]]
        if end == child:
            why = f"joint {name} has the same link as parent and child, {child}"
            if path:
                why = f"joint {name} is its own ancestor, through {', '.join(path)}"
            yield joints[name], f"{why}; give it another child link"
            return
        if end in connected or end not in above:
            connected.update((parent, *(ends[each][0] for each in path)))


def _link(joint: Element, tag: str) -> str:
    element = joint.find(tag)
    return "" if element is None else element.get("link", "")


def _joint(element: Element, wrong: list[_Mistake]) -> UrdfJoint:
    """Return a joint, and append its mistakes to `wrong`. An invalid value becomes 0 or nan."""
    name, kind = element.get("name", ""), element.get("type", "")
    xyz, rpy = _origin(element, wrong)
    lower, upper, velocity = _limits(element, wrong)
    mimic = element.find("mimic")
    return UrdfJoint(
        name=name,
        type=kind,
        parent=_link(element, "parent"),
        child=_link(element, "child"),
        xyz=xyz,
        rpy=rpy,
        axis=_axis(element, wrong) if kind in _MOVING else (1.0, 0.0, 0.0),
        lower=lower,
        upper=upper,
        velocity=velocity,
        mimic=None if mimic is None or kind not in _MOVING else _mimic(name, mimic, wrong),
    )


def _origin(joint: Element, wrong: list[_Mistake]) -> tuple[Vector, Vector]:
    """Return the position [m] and rotation [rad] of a joint in the frame of its parent."""
    found: tuple[Vector, Vector] | None = None
    for origin in joint.findall("origin"):
        xyz, rpy = (
            _vector(origin, key, f"three finite numbers [{unit}], such as 0 0 0.1", wrong)
            for key, unit in (("xyz", "m"), ("rpy", "rad"))
        )
        found = found or (xyz, rpy)
    return found or ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


def _vector(origin: Element, key: str, wanted: str, wrong: list[_Mistake]) -> Vector:
    numbers = _numbers(given(origin, key, "0 0 0"))
    if len(numbers) != 3:
        wrong.append(_mistake(f"its {origin.tag}", origin, key, wanted))
        return 0.0, 0.0, 0.0
    x, y, z = numbers
    return x, y, z


def _limits(joint: Element, wrong: list[_Mistake]) -> tuple[float, float, float]:
    """Return the lower limit, the upper limit and the velocity limit; infinite if absent.

    A velocity of 0 means that the limit is unknown, so it counts as absent.
    """
    kind, limit = joint.get("type", ""), joint.find("limit")
    bounded, unit = kind in ("revolute", "prismatic"), _unit(kind)
    if limit is None:
        if bounded:
            add = "give one with its lower, upper, velocity and effort"
            wrong.append((joint, f"it has no limit; {add}"))
        return -math.inf, math.inf, math.inf
    number, above = "a finite number", "a finite number of at least 0"
    default = None if bounded else "0"
    lower = _number(limit, "lower", f"{number} [{unit}]", wrong, default=default)
    upper = _number(limit, "upper", f"{number} [{unit}]", wrong, default=default)
    velocity = _number(limit, "velocity", f"{above} [{unit}/s]", wrong, least=0.0) or math.inf
    _number(limit, "effort", above, wrong, least=0.0)
    if not bounded:
        return -math.inf, math.inf, velocity
    if lower > upper:
        right = f'lower="{upper:g}" upper="{lower:g}"'
        wrong.append((limit, f"lower {lower:g} is above upper {upper:g}; write {right}"))
    return lower, upper, velocity


def _unit(kind: str) -> str:
    return "m" if kind == "prismatic" else "rad"


def _axis(joint: Element, wrong: list[_Mistake]) -> Vector:
    axis = joint.find("axis")
    text = "1 0 0" if axis is None else given(axis, "xyz", "1 0 0")
    numbers = _numbers(text)
    if len(numbers) != 3 or not _SHORTEST_AXIS <= math.hypot(*numbers) <= 1.0 / _SHORTEST_AXIS:
        wanted = "give x, y, z of a vector with a length, such as 0 0 1"
        wrong.append((axis, f"its axis is {reprlib.repr(text)}; {wanted}"))
        return 0.0, 0.0, 0.0
    x, y, z = numbers
    return x, y, z


def _mimic(name: str, element: Element, wrong: list[_Mistake]) -> Mimic:
    leader = element.get("joint", "")
    if not leader:
        wrong.append(_mistake("its mimic", element, "joint", "the name of the joint to follow"))
    if leader == name:
        wrong.append((element, "it mimics itself; let it mimic another joint, or none"))
    multiplier = _number(element, "multiplier", "a finite number", wrong, default="1")
    offset = _number(element, "offset", "a finite number", wrong, default="0")
    return Mimic(leader, multiplier, offset)


def _number(
    element: Element,
    key: str,
    wanted: str,
    wrong: list[_Mistake],
    least: float = -math.inf,
    default: str | None = None,
) -> float:
    text = given(element, key, default or "")
    if not _NUMBER.fullmatch(text) or not least <= float(text) < math.inf:
        wrong.append(_mistake(f"its {element.tag}", element, key, wanted))
        return math.nan
    return float(text)


# Collision shapes --------------------------------------------------------------------------------


def _collision_mistakes(link: str, collision: Element, largest: float) -> Iterator[_Mistake]:
    for origin in collision.findall("origin"):
        for key in ("xyz", "rpy"):
            numbers = _numbers(given(origin, key, "0 0 0"))
            if len(numbers) != 3 or max(map(abs, numbers)) > largest:
                wanted = f"three numbers from {-largest:g} to {largest:g}"
                yield _mistake(f"an origin of {link}", origin, key, wanted)
    shapes = collision.findall("geometry/*")
    if len(shapes) != 1:
        yield collision, f"a collision of {link} has {len(shapes)} shapes; give each one shape"
    for shape in shapes:
        yield from _shape_mistakes(link, shape, largest)


def _shape_mistakes(link: str, shape: Element, largest: float) -> Iterator[_Mistake]:
    where = f"the {shape.tag} of {link}"
    if shape.tag not in SHAPES:
        yield shape, f"{link} has a {shape.tag}; give one of {', '.join(SHAPES)}"
    for key, count in SIZES.get(shape.tag, {}).items():
        numbers = _numbers(shape.get(key, ""))
        if len(numbers) != count or not all(0.0 < number <= largest for number in numbers):
            wanted = "a number" if count == 1 else "three numbers"
            yield _mistake(where, shape, key, f"{wanted} above 0, up to {largest:g} m")
    if shape.tag == "mesh":
        if not shape.get("filename"):
            yield _mistake(where, shape, "filename", "the name of a file")
        scale = _numbers(given(shape, "scale", "1 1 1"))  # a negative scale mirrors the mesh
        if len(scale) != 3 or not all(0.0 < abs(number) <= largest for number in scale):
            wanted = f"three numbers other than 0, from {-largest:g} to {largest:g}"
            yield _mistake(where, shape, "scale", wanted)


# Visible shapes ----------------------------------------------------------------------------------


def _shape(
    link: str, element: Element, colors: Mapping[str, tuple[float, ...] | None]
) -> Shape | None:
    """Return a shape, or None if it is invalid."""
    wrong = list(_collision_mistakes(link, element, math.inf))
    xyz, rpy = _origin(element, wrong)
    if wrong:
        return None
    shape, material = element.find("geometry/*"), element.find("material")
    assert shape is not None
    if shape.tag == "mesh":
        sizes = _numbers(shape.get("scale", "1 1 1"))
    else:
        sizes = [each for key in SIZES[shape.tag] for each in _numbers(shape.get(key, ""))]
    color = None
    if material is not None:
        color = _color(material) or colors.get(material.get("name", ""))
    return Shape(link, shape.tag, tuple(sizes), shape.get("filename", ""), xyz, rpy, color)


def _color(material: Element) -> tuple[float, ...] | None:
    color = material.find("color")
    numbers = [] if color is None else _numbers(color.get("rgba", ""))
    return tuple(numbers) if len(numbers) == 4 else None


# Numbers and messages ----------------------------------------------------------------------------


def _numbers(text: str) -> list[float]:
    """Return the finite numbers in a text with spaces between them; empty if one is invalid."""
    words = [word for word in text.split(" ") if word]
    numbers = [float(word) for word in words if _NUMBER.fullmatch(word)]
    return numbers if len(numbers) == len(words) and all(map(math.isfinite, numbers)) else []


def _mistake(where: str, element: Element, key: str, wanted: str) -> _Mistake:
    value, near = element.get(key), misspelt(element, key)
    what = "is missing" if value is None else f"is {reprlib.repr(value)}"
    way = f"write {key} for {near}" if near else f"give {wanted}{others(element, value)}"
    return element, f"the {key} of {where} {what}; {way}"

"""The shapes of links as the URDF has them: pinocchio leaves out, unasked, what it cannot read."""

from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

from skills.motion.errors import ModelUnusable, shown
from skills.motion.measures import FARTHEST, LEAST, is_number

_Fits = Callable[[float], bool]


def shape_counts(urdf: Path) -> dict[str, int]:
    """How many shapes each link has, by its name; all of them have been found to make sense.

    Raises:
        ModelUnusable: The URDF cannot be read, or a shape or its place makes no sense.
    """
    try:
        links = ElementTree.parse(urdf).getroot().findall("link")
    except (OSError, ElementTree.ParseError) as error:
        raise ModelUnusable(str(urdf), str(error)) from error
    found = dict[str, int]()
    for link in links:
        name, collisions = link.get("name", ""), link.findall("collision")
        for collision in collisions:
            if why := _wrong(name, collision):
                raise ModelUnusable(str(urdf), why)
        found[name] = len(collisions)
    return found


def _wrong(link: str, collision: ElementTree.Element) -> str:
    """What is wrong with a shape; empty if nothing is."""
    for origin in collision.findall("origin"):
        for key in ("xyz", "rpy"):
            if not _numbers(origin.get(key, "0 0 0"), 3, _is_place):
                wanted = f"three numbers, up to {FARTHEST:g} either way"
                return _told(f"an origin of {link}", key, origin, wanted)
    shapes = collision.findall("geometry/*")
    if len(shapes) != 1:
        return f"a collision of {link} has {len(shapes)} shapes; give each of them one"
    (shape,) = shapes
    if shape.tag not in _SHAPES:
        return f"{link} has a {shape.tag}; give one of {', '.join(_SHAPES)}"
    for key, (fits, wanted) in _SHAPES[shape.tag].items():
        if not fits(shape.get(key)):
            return _told(f"the {shape.tag} of {link}", key, shape, wanted)
    return ""


def _told(where: str, key: str, element: ElementTree.Element, wanted: str) -> str:
    value = element.get(key)
    return f"the {key} of {where} is {'missing' if value is None else shown(value)}; give {wanted}"


def _numbers(text: str | None, count: int, fits: _Fits) -> bool:
    try:
        numbers = [float(word) for word in (text or "").split()]
    except ValueError:
        return False
    return len(numbers) == count and all(map(fits, numbers))


def _is_place(number: float) -> bool:
    return is_number(number, -FARTHEST, FARTHEST)


def _is_size(number: float) -> bool:
    return is_number(number, LEAST, FARTHEST)


def _is_length(text: str | None) -> bool:
    return _numbers(text, 1, _is_size)


def _are_edges(text: str | None) -> bool:
    return _numbers(text, 3, _is_size)


def _is_scale(text: str | None) -> bool:
    """Makers mirror a mesh by a negative one."""
    return text is None or _numbers(text, 3, lambda number: _is_size(abs(number)))


_LENGTH = (_is_length, f"a number above 0, up to {FARTHEST:g} m")
_EDGES = (_are_edges, f"three numbers above 0, up to {FARTHEST:g} m")
_SCALE = (_is_scale, f"three numbers other than 0, up to {FARTHEST:g} either way")
_FILE = (bool, "that of a file")

# Of each shape that a URDF can have, its attributes, whether one fits, and what to give instead.
_SHAPES: dict[str, dict[str, tuple[Callable[[str | None], bool], str]]] = {
    "box": {"size": _EDGES},
    "sphere": {"radius": _LENGTH},
    "cylinder": {"radius": _LENGTH, "length": _LENGTH},
    "mesh": {"filename": _FILE, "scale": _SCALE},
}

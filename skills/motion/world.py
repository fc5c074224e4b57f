"""The world: bodies around the arm and attached to the arm. They are checked for collision."""

import json
import math
import os
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import MISSING, field, fields
from typing import Any

from hardware.loading.dataclass import dataclass
from hardware.spelling import did_you_mean, suggestion

from .errors import BadWorld, shown
from .validation import MAX_MAGNITUDE, MIN_SIZE

MAX_BODIES = 1000  # loading 1000 bodies takes 1 s; the time of pinocchio grows with the cube
_ROUNDED = 1e-2  # largest error in the length of a quaternion with three or more digits
_METRES = {"mm": 1e-3, "cm": 1e-2, "m": 1.0}
_UNIT = 1e-6  # largest error in the length of a quaternion that was not rounded
_MAX_SHOWN = 60  # largest number of characters of a value in a message

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]
Stamp = tuple[int, int, int]  # inode, size and time of a file


@dataclass(frozen=True, slots=True)
class Box:
    """A box, by the lengths of its edges along x, y and z [m]."""

    size: Vector


@dataclass(frozen=True, slots=True)
class Sphere:
    """A sphere, by its radius [m]."""

    radius: float


@dataclass(frozen=True, slots=True)
class Cylinder:
    """A cylinder along z, by its radius and length [m]."""

    radius: float
    length: float


@dataclass(frozen=True, slots=True)
class Mesh:
    """A mesh: triangles from a file (STL, DAE, OBJ), scaled to metres.

    A closed mesh is solid: an arm inside the mesh is in collision. A mesh with a hole is a surface,
    because it may be a tray or a room with a door. A closed room must have walls with a thickness.

    Attributes:
        path: Path of the file.
        scale: Size of a unit of the file in x, y and z [m].
    """

    path: str
    scale: Vector = (1.0, 1.0, 1.0)


Shape = Box | Sphere | Cylinder | Mesh
_SHAPES: dict[str, type[Shape]] = {"box": Box, "sphere": Sphere, "cylinder": Cylinder, "mesh": Mesh}


@dataclass(frozen=True, slots=True)
class Body:
    """A body that the arm must not touch, or that it carries.

    Attributes:
        name: Name of the body. Links and other bodies must have different names.
        shape: Shape of the body.
        position: Position of the body's centre, or of a mesh's origin, in the frame of `link` [m].
        rotation: Rotation of the body in the frame of `link`: x, y, z, w of a unit quaternion.
        link: Link to which the body is attached. Default: the URDF's root frame.
        touches: Names of links and bodies that the body may touch; may contain `floor`.

    Raises:
        BadWorld: A number is not finite, a size is not above 0, a number is more than
            `validation.MAX_MAGNITUDE`, or a name is missing.
    """

    name: str
    shape: Shape
    position: Vector = (0.0, 0.0, 0.0)
    rotation: Quaternion = (0.0, 0.0, 0.0, 1.0)
    link: str = ""
    touches: frozenset[str] = frozenset()

    def __post_init__(self) -> None:
        if wrong := list(self._mistakes()):
            raise BadWorld.of(wrong)

    def _mistakes(self) -> Iterator[BadWorld]:
        if not _word(self.name):
            yield BadWorld(f"The name of a body is {_shown(self.name)}; give a text", "name")
            return
        what = f"of {self.name} is"
        if isinstance(self.shape, Shape):
            yield from self._wrong_sizes(what)
        else:
            yield BadWorld(f"The shape {what} {shown(self.shape)}; give {', '.join(_SHAPES)}")
        if not _reals(self.position, 3):
            form = f"x, y, z in m, from {-MAX_MAGNITUDE:g} to {MAX_MAGNITUDE:g}"
            words = f"The position {what} {_shown(self.position)}; give {form}"
            words += _meant(self.position, 3) if isinstance(self.position, Mapping) else ""
            yield BadWorld(words, "position")
        if not _is_unit(self.rotation, _UNIT):
            turn = _shown(self.rotation)
            if _reals(self.rotation, 4):
                turn += f", of length {math.hypot(*self.rotation):g}"
            form = "x, y, z, w of a unit quaternion (length 1)"
            words = f"The rotation {what} {turn}; give {form}{_meant(self.rotation, 4)}"
            yield BadWorld(words, "rotation")
        if not isinstance(self.link, str):
            words = f"The link {what} {_shown(self.link)}; give the name of a link, or omit it"
            yield BadWorld(words, "link")
        if not isinstance(self.touches, frozenset) or not all(map(_word, self.touches)):
            words = f"The value touches {what} {shown(self.touches)}; give names, in a frozenset"
            yield BadWorld(words, "touches")

    def _wrong_sizes(self, what: str) -> Iterator[BadWorld]:
        kind = type(self.shape).__name__.lower()
        for part in fields(self.shape):
            value = getattr(self.shape, part.name)
            if part.type is str:
                right, form = _word(value), "the name of a file"
            else:
                vector = part.type == Vector
                right = _reals(value if vector else (value,), 3 if vector else 1, MIN_SIZE)
                form = "x, y, z, each" if vector else "a number"
                form += (
                    f" from {MIN_SIZE:g} to {MAX_MAGNITUDE:g} m{_meant(value, 3 if vector else 1)}"
                )
            if not right:
                words = f"The {part.name} {what} {_shown(value)}; give {form}"
                yield BadWorld(words, kind, part.name)


@dataclass(frozen=True, slots=True)
class World:
    """The bodies around the arm and attached to it.

    The planner keeps the models of the latest worlds. Equal worlds share a model.

    Attributes:
        bodies: The bodies, in the order in which they were added.

    Raises:
        BadWorld: Two bodies have the same name, an element is not a Body, or there are more than
            `MAX_BODIES`.
    """

    bodies: tuple[Body, ...] = field(default=())

    def __post_init__(self) -> None:
        if not isinstance(self.bodies, tuple) or any(not isinstance(b, Body) for b in self.bodies):
            raise BadWorld(f"The bodies are {shown(self.bodies)}; give a tuple of bodies")
        if len(self.bodies) > MAX_BODIES:
            raise BadWorld(
                f"There are {len(self.bodies)} bodies; the limit is {MAX_BODIES}. Give fewer, "
                "larger ones, or one mesh"
            )
        names = [body.name for body in self.bodies]
        if len(set(names)) < len(names):
            number = next(k for k, name in enumerate(names) if name in names[:k])
            why = f"Two bodies have the name {names[number]}; rename one"
            raise BadWorld(why, number, "name")

    def __hash__(self) -> int:
        # Of few attributes, because a planner looks up worlds of hundreds of bodies.
        return hash(tuple((body.name, body.position) for body in self.bodies))

    @property
    def meshes(self) -> list[Mesh]:
        """The mesh of each body that has one."""
        return [body.shape for body in self.bodies if isinstance(body.shape, Mesh)]

    def body(self, name: str) -> Body:
        """Return the body with the given name.

        Raises:
            BadWorld: There is no such body.
        """
        if not _word(name):
            raise BadWorld(f"The name of a body is {_shown(name)}; give a text")
        for body in self.bodies:
            if body.name == name:
                return body
        there = ", ".join(body.name for body in self.bodies) or "none"
        raise BadWorld(f"There is no body {name}; known bodies: {there}")

    def adding(self, body: Body) -> "World":
        """Return a copy of this world with an added body. It replaces a body of the same name."""
        known = {each.name: each for each in self.bodies} | {body.name: body}
        return World(tuple(known.values()))

    def without(self, name: str) -> "World":
        """Return a copy of this world without the body of the given name.

        Raises:
            BadWorld: There is no such body.
        """
        gone = self.body(name)
        return World(tuple(body for body in self.bodies if body is not gone))

    def replacing(self, body: Body) -> "World":
        """Return a copy of this world in which a body replaces the body of the same name.

        Raises:
            BadWorld: There is no body of this name.
        """
        old = self.body(body.name)
        return World(tuple(body if each is old else each for each in self.bodies))

    def plain(self) -> list[dict[str, Any]]:
        """Return the bodies as plain dicts, lists and numbers. `World.parse` is the inverse."""
        return [_plain(body) for body in self.bodies]

    @classmethod
    def parse(cls, bodies: Iterable[Mapping[str, Any]]) -> "World":
        """Return a world, from a list of bodies in the form that `plain` returns.

        A rounded quaternion is scaled to length 1. An exact quaternion is not changed at all.

        Raises:
            BadWorld: The value is not a valid list of bodies.
        """
        if isinstance(bodies, Mapping) and "name" in bodies:
            raise BadWorld(f"{_shown(bodies)} is a body, not a list of bodies; put it into [ ]")
        if not isinstance(bodies, Iterable) or isinstance(bodies, str | Mapping):
            raise BadWorld(f"{_shown(bodies)} is not a list of bodies, such as {_EXAMPLE}")
        found, wrong = [], list[BadWorld]()
        for number, body in enumerate(bodies):
            try:
                found.append(_parsed(body))
            except BadWorld as error:
                wrong += [
                    BadWorld(f"Body {number + 1}: {each}", number, *each.location)
                    for each in error.all
                ]
        if wrong:
            raise BadWorld.of(wrong)
        return cls(tuple(found))


EMPTY = World()
_EXAMPLE = '[{"name": "post", "box": {"size": [0.03, 0.03, 0.2]}, "position": [0.2, 0, 0.1]}]'


def mesh_stamp(mesh: Mesh) -> Stamp | None:
    """Return the stamp of a mesh's file; None if it is missing."""
    try:
        found = os.stat(mesh.path)
    except (OSError, ValueError):  # the loader of the mesh reports the error
        return None
    return found.st_ino, found.st_size, found.st_mtime_ns


def mesh_stamps(world: World) -> list[Stamp | None]:
    """Return the stamp of each mesh file of a world, in the order of the bodies."""
    return list(map(mesh_stamp, world.meshes))


def quaternion(roll: float, pitch: float, yaw: float) -> Quaternion:
    """Return the quaternion x, y, z, w of a rotation about fixed x, then y, then z [rad].

    This is the convention of URDF's `rpy`.
    """
    (a, b, c), (x, y, z) = (
        [turn(0.5 * angle) for angle in (roll, pitch, yaw)] for turn in (math.cos, math.sin)
    )
    return (
        x * b * c - a * y * z,
        a * y * c + x * b * z,
        a * b * z - x * y * c,
        a * b * c + x * y * z,
    )


def _plain(body: Body) -> dict[str, Any]:
    kind = next(name for name, shape in _SHAPES.items() if shape is type(body.shape))
    shape = {f.name: getattr(body.shape, f.name) for f in fields(body.shape)}
    return {
        "name": body.name,
        kind: {key: list(v) if isinstance(v, tuple) else v for key, v in shape.items()},
        "position": list(body.position),
        "rotation": list(body.rotation),
        "link": body.link,
        "touches": sorted(body.touches),
    }


def _parsed(plain: Any) -> Body:
    if not isinstance(plain, Mapping):
        raise BadWorld(f"{_shown(plain)} is not an object with a name and a shape")
    name = plain.get("name", "")
    if not isinstance(name, str) or not name:
        what = f"Its name is {_shown(name)}" if name else "It has no name"
        raise BadWorld(f"{what}; give a text", "name")
    keys = [each.name for each in fields(Body) if each.name != "shape"]
    wrong = [*_unknown_keys(name, plain, [*keys, *_SHAPES], ["position"])]
    forms = [kind for kind in _SHAPES if kind in plain]
    shape: Shape = Sphere(MIN_SIZE)  # replaces an invalid shape, so that other values are checked
    if len(forms) == 1:
        with _kept(wrong):
            shape = _form(name, forms[0], plain[forms[0]])
    elif forms or not wrong:
        what = f"the shapes {' and '.join(forms)}" if forms else "no shape"
        wrong.append(BadWorld(f"{name} has {what}; give one of {', '.join(_SHAPES)}"))
    rest = {key: _tupled(plain[key]) for key in keys if key in plain}
    touches = rest.pop("touches", ())
    if not isinstance(touches, tuple) or not all(map(_word, touches)):
        words = f"The key touches of {name} is {_shown(touches)}; give a list of names"
        wrong.append(BadWorld(words, "touches"))
        touches = ()
    if "rotation" in rest and _is_unit(rest["rotation"], _ROUNDED):
        rest["rotation"] = _scaled(rest["rotation"])
    with _kept(wrong):
        body = Body(shape=shape, touches=frozenset(touches), **rest)
    if wrong:
        raise BadWorld.of(wrong)
    return body


@contextmanager
def _kept(wrong: list[BadWorld]) -> Iterator[None]:
    """Context that adds the mistakes found in its block to a list."""
    try:
        yield
    except BadWorld as error:
        wrong += error.all


def _form(name: str, kind: str, plain: Any) -> Shape:
    shape, parts = _SHAPES[kind], fields(_SHAPES[kind])
    wanted = [part.name for part in parts]
    if not isinstance(plain, Mapping):
        what = f"The {kind} of {name} is {_shown(plain)}"
        words = f"{what}; give an object with its {' and '.join(wanted)}"
        near = "" if wanted[1:] else f"{{{json.dumps(wanted[0])}: {_shown(plain)}}}"
        raise BadWorld(words + did_you_mean(near), kind)
    needed = [part.name for part in parts if part.default is MISSING]
    wrong = [*_unknown_keys(f"the {kind} of {name}", plain, wanted, needed, kind)]
    if not wrong:
        missing = [part for part in needed if part not in plain]
        why = f"The {kind} of {name} has no "
        wrong = [BadWorld(f"{why}{each}; give one", kind) for each in missing]
    if wrong:
        raise BadWorld.of(wrong)
    return shape(**{key: _tupled(value) for key, value in plain.items()})


def _unknown_keys(
    owner: str,
    plain: Mapping[str, Any],
    known: Sequence[str],
    needed: Sequence[str],
    *location: str,
) -> Iterator[BadWorld]:
    """Yield a mistake for each unknown key, with a suggestion if possible.

    If one key is unknown and one needed key is missing, the missing key is the suggestion.
    """
    unknown = [key for key in plain if key not in known]
    missing = [key for key in needed if key not in plain]
    for key in unknown:
        near = suggestion(str(key), known, plain)
        if not near and len(unknown) == len(missing) == 1:
            near = did_you_mean(missing[0])
        words = f"{_shown(key)} is not a key of {owner}; the keys are {', '.join(known)}{near}"
        yield BadWorld(words, *location, key)


def _meant(value: Any, count: int) -> str:
    """Return a suggestion for a message: the numbers that an invalid value most likely means.

    Args:
        value: The invalid value.
        count: Number of expected numbers: 1 or 3 lengths, or 4 for a quaternion.

    Returns:
        The suggestion; empty if the meaning is unclear.
    """
    meant: Any = None
    found = re.fullmatch(r"([\d.]+) ?(mm|cm|m)", value) if isinstance(value, str) else None
    if isinstance(value, Mapping) and [*value] == ["x", "y", "z", "w"][:count]:
        meant = [*value.values()]
    elif count == 1 and found:
        meant = float(f"{float(found[1]) * _METRES[found[2]]:.6g}")
    elif count == 3 and _reals((value,), 1, MIN_SIZE):
        meant = [value] * 3
    elif count == 4 and _reals(value, 3):  # roll, pitch and yaw
        meant = [float(f"{part:.4g}") for part in quaternion(*value)]
    return did_you_mean(json.dumps(meant)) if meant is not None else ""


def _tupled(value: Any) -> Any:
    return tuple(value) if isinstance(value, list) else value


def _is_unit(rotation: Any, tolerance: float) -> bool:
    """Return True if a value is a quaternion: four numbers with a length close to 1."""
    return _reals(rotation, 4) and abs(math.hypot(*rotation) - 1.0) < tolerance


def _scaled(rotation: Quaternion) -> Quaternion:
    if _is_unit(rotation, _UNIT):
        return rotation
    length = math.hypot(*rotation)
    x, y, z, w = (part / length for part in rotation)
    return x, y, z, w


def _shown(value: object) -> str:
    """Return a short text for a value, as JSON if possible."""
    try:
        text = json.dumps(value, ensure_ascii=False)
        if not text.isprintable():
            text = json.dumps(value)
    except (TypeError, ValueError, RecursionError):
        # Not a value of JSON, or a number with too many digits.
        return shown(value)
    return text if len(text) <= _MAX_SHOWN else f"{text[:_MAX_SHOWN]}..."


def _word(value: object) -> bool:
    return isinstance(value, str) and bool(value)


def _reals(values: Any, count: int, least: float = -MAX_MAGNITUDE) -> bool:
    """Return True if a value is a tuple of `count` numbers in [least, MAX_MAGNITUDE]."""
    return (
        isinstance(values, tuple)
        and len(values) == count
        and all(
            isinstance(v, int | float) and not isinstance(v, bool) and least <= v <= MAX_MAGNITUDE
            for v in values
        )
    )

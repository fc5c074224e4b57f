"""What stands around the arm, and what it holds: bodies that are checked like its own links."""

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import MISSING, dataclass, field, fields
from typing import Any

from hardware.suggestions import suggestion

from .errors import BadWorld, shown
from .measures import FARTHEST, LEAST

_ROUNDED = 1e-2  # of the length of a quaternion that was written with three digits or more
_UNIT = 1e-6
_LONGEST = 60  # of a value in a message

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]


@dataclass(frozen=True, slots=True)
class Box:
    """Edges along x, y and z [m]."""

    size: Vector


@dataclass(frozen=True, slots=True)
class Sphere:
    """A ball of a radius [m]."""

    radius: float


@dataclass(frozen=True, slots=True)
class Cylinder:
    """Along z, of a radius and a length [m]."""

    radius: float
    length: float


@dataclass(frozen=True, slots=True)
class Mesh:
    """Triangles from a file (STL, DAE, OBJ), with its units scaled to metres.

    A closed mesh is solid: an arm inside it touches it. One with a hole is a surface, as it may be
    a tray, or a room with a door; a room without one has walls with two sides.
    """

    path: str
    scale: Vector = (1.0, 1.0, 1.0)


Shape = Box | Sphere | Cylinder | Mesh
_SHAPES: dict[str, type[Shape]] = {
    "box": Box,
    "sphere": Sphere,
    "cylinder": Cylinder,
    "mesh": Mesh,
}


@dataclass(frozen=True, slots=True)
class Body:
    """One thing.

    Attributes:
        name: Unlike that of any link or other body.
        shape: Its form.
        position: Of its centre (of a mesh: its origin), in the frame of `link` [m].
        rotation: x, y, z, w of a unit quaternion, in that frame.
        link: The link it moves with; empty for one that stands in the URDF's root frame.
        touches: RobotModel, bodies or `floor` that it may touch.

    Raises:
        BadWorld: A number is not finite, a size not above 0, one of them more than
            `measures.FARTHEST`, or a name is missing.
    """

    name: str
    shape: Shape
    position: Vector = (0.0, 0.0, 0.0)
    rotation: Quaternion = (0.0, 0.0, 0.0, 1.0)
    link: str = ""
    touches: frozenset[str] = frozenset()

    def __post_init__(self) -> None:
        if not _word(self.name):
            raise BadWorld(f"A body is called {_shown(self.name)}; give it a name")
        what = f"of {self.name} is"
        if not isinstance(self.shape, Shape):
            raise BadWorld(f"The shape {what} {shown(self.shape)}; give {', '.join(_SHAPES)}")
        self._check_sizes(what)
        if not _reals(self.position, 3):
            form = f"x, y, z in m, up to {FARTHEST:g} either way"
            raise BadWorld(f"The position {what} {_shown(self.position)}; give {form}")
        if not _is_unit(self.rotation, _UNIT):
            turn = _shown(self.rotation)
            if _reals(self.rotation, 4):
                turn += f", of length {math.hypot(*self.rotation):g}"
            form = "x, y, z, w of a unit quaternion, whose length is 1"
            raise BadWorld(f"The rotation {what} {turn}; give {form}")
        if not isinstance(self.link, str):
            raise BadWorld(f"The link {what} {_shown(self.link)}; give a name, or none")
        if not isinstance(self.touches, frozenset) or not all(map(_word, self.touches)):
            raise BadWorld(f"The touches {what} {shown(self.touches)}; give names, in a frozenset")

    def _check_sizes(self, what: str) -> None:
        for part in fields(self.shape):
            value, vector = getattr(self.shape, part.name), part.type == Vector
            if part.type is str:
                if not _word(value):
                    raise BadWorld(f"The {part.name} {what} {_shown(value)}; give that of a file")
            elif not _reals(value if vector else (value,), 3 if vector else 1, LEAST):
                form = "x, y, z, each" if vector else "a number"
                form += f" above 0, up to {FARTHEST:g}"
                raise BadWorld(f"The {part.name} {what} {_shown(value)}; give {form}")


@dataclass(frozen=True, slots=True)
class World:
    """All bodies; equal worlds are one to the planner, which keeps its models of them.

    Attributes:
        bodies: In the order they came.

    Raises:
        BadWorld: Two bodies have one name, or one is none.
    """

    bodies: tuple[Body, ...] = field(default=())

    def __post_init__(self) -> None:
        if not isinstance(self.bodies, tuple) or any(not isinstance(b, Body) for b in self.bodies):
            raise BadWorld(f"The bodies are {shown(self.bodies)}; give a tuple of bodies")
        names = [body.name for body in self.bodies]
        for name in names:
            if names.count(name) > 1:
                raise BadWorld(f"Two bodies are called {name}; give each a name of its own")

    def body(self, name: str) -> Body:
        """The body of that name.

        Raises:
            BadWorld: There is none.
        """
        if not _word(name):
            raise BadWorld(f"A body is called {_shown(name)}; give a name")
        for body in self.bodies:
            if body.name == name:
                return body
        there = ", ".join(body.name for body in self.bodies) or "none at all"
        raise BadWorld(f"There is no body {name}; there are {there}")

    def adding(self, body: Body) -> "World":
        """This world and one more body."""
        return World((*self.bodies, body))

    def without(self, name: str) -> "World":
        """This world less a body."""
        gone = self.body(name)
        return World(tuple(body for body in self.bodies if body is not gone))

    def replacing(self, body: Body) -> "World":
        """This world with a body in place of the one of its name."""
        old = self.body(body.name)
        return World(tuple(body if each is old else each for each in self.bodies))

    def plain(self) -> list[dict[str, Any]]:
        """As lists and numbers, for a recording; `World.parse` is the way back."""
        return [_plain(body) for body in self.bodies]

    @classmethod
    def parse(cls, bodies: Iterable[Mapping[str, Any]]) -> "World":
        """The world that `plain` wrote down, or a person.

        A quaternion that was rounded is scaled to length 1; one that need not be stays to the bit.

        Raises:
            BadWorld: It is no list of bodies.
        """
        if not isinstance(bodies, Iterable) or isinstance(bodies, str | Mapping):
            raise BadWorld(f"{_shown(bodies)} is no list of bodies")
        found = []
        for number, body in enumerate(bodies, 1):
            try:
                found.append(_parsed(body))
            except BadWorld as error:
                raise BadWorld(f"Body {number}: {error}") from error
        return cls(tuple(found))


EMPTY = World()


def quaternion(roll: float, pitch: float, yaw: float) -> Quaternion:
    """x, y, z, w of a turn about fixed x, then y, then z [rad], as a URDF's rpy."""
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
        raise BadWorld(f"{_shown(plain)} is no object with a name and a form")
    name = plain.get("name", "")
    if not isinstance(name, str) or not name:
        what = f"It is called {_shown(name)}" if name else "It has no name"
        raise BadWorld(f"{what}; give it a name")
    keys = [each.name for each in fields(Body) if each.name != "shape"]
    _check_keys(name, plain, [*keys, *_SHAPES])
    forms = [kind for kind in _SHAPES if kind in plain]
    if len(forms) != 1:
        what = f"are {' and '.join(forms)}" if forms else "is no form"
        raise BadWorld(f"Of {name} there {what}; give one of {', '.join(_SHAPES)}")
    rest = {key: _tupled(plain[key]) for key in keys if key in plain}
    touches = rest.pop("touches", ())
    if not isinstance(touches, tuple) or not all(map(_word, touches)):
        raise BadWorld(f"The touches of {name} is {_shown(touches)}; give a list of names")
    if "rotation" in rest and _is_unit(rest["rotation"], _ROUNDED):
        rest["rotation"] = _scaled(rest["rotation"])
    return Body(shape=_form(name, forms[0], plain[forms[0]]), touches=frozenset(touches), **rest)


def _form(name: str, kind: str, plain: Any) -> Shape:
    shape, parts = _SHAPES[kind], fields(_SHAPES[kind])
    wanted = [part.name for part in parts]
    if not isinstance(plain, Mapping):
        what = f"The {kind} of {name} is {_shown(plain)}"
        raise BadWorld(f"{what}; give an object with its {' and '.join(wanted)}")
    _check_keys(f"the {kind} of {name}", plain, wanted)
    for part in parts:
        if part.name not in plain and part.default is MISSING:
            raise BadWorld(f"The {kind} of {name} has no {part.name}; give one")
    return shape(**{key: _tupled(value) for key, value in plain.items()})


def _check_keys(whose: str, plain: Mapping[str, Any], known: Sequence[str]) -> None:
    for key in plain:
        if key not in known:
            there = ", ".join(known) + suggestion(str(key), known, plain)
            raise BadWorld(f"{_shown(key)} is no key of {whose}; there are {there}")


def _tupled(value: Any) -> Any:
    return tuple(value) if isinstance(value, list) else value


def _is_unit(rotation: Any, off: float) -> bool:
    """Whether it is four numbers whose length is nearly 1."""
    return _reals(rotation, 4) and abs(math.hypot(*rotation) - 1.0) < off


def _scaled(rotation: Quaternion) -> Quaternion:
    if _is_unit(rotation, _UNIT):
        return rotation
    length = math.hypot(*rotation)
    x, y, z, w = (part / length for part in rotation)
    return x, y, z, w


def _shown(value: object) -> str:
    """Somebody's value as JSON, which it was written in, and short."""
    try:
        text = json.dumps(value, ensure_ascii=False)
        if not text.isprintable():
            text = json.dumps(value)
    except (TypeError, ValueError, RecursionError):  # none of JSON, or a number of many digits
        return shown(value)
    return text if len(text) <= _LONGEST else f"{text[:_LONGEST]}..."


def _word(value: object) -> bool:
    return isinstance(value, str) and bool(value)


def _reals(values: Any, count: int, least: float = -FARTHEST) -> bool:
    """Whether they are a tuple of so many numbers, none less than the least nor absurdly large."""
    return (
        isinstance(values, tuple)
        and len(values) == count
        and all(
            isinstance(v, int | float) and not isinstance(v, bool) and least <= v <= FARTHEST
            for v in values
        )
    )

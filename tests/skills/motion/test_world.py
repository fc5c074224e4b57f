"""Worlds from files: invalid bodies are rejected with the reason."""

import math
import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from skills.motion import BadWorld, Body, Box, Cylinder, Mesh, Shape, Sphere, World

BALL: dict[str, Any] = {"name": "b", "sphere": {"radius": 0.1}, "position": [0.0, 0.0, 0.5]}


def test_a_world_of_thousands_of_bodies() -> None:
    bodies = [BALL | {"name": f"b{i}"} for i in range(5000)]
    why = "There are 5000 bodies; the limit is 1000. Give fewer, larger ones, or one mesh"
    with pytest.raises(BadWorld, match=why):
        World.parse(bodies)
    full = World.parse(bodies[:1000])
    with pytest.raises(BadWorld, match="There are 1001 bodies; the limit is 1000"):
        full.adding(Body("more", Sphere(0.1)))


def test_a_world_is_written_and_read_again() -> None:
    shapes: tuple[Shape, ...] = (Box((0.1, 0.2, 0.3)), Sphere(0.1), Cylinder(0.1, 1), Mesh("a.stl"))
    world = World(
        tuple(
            Body(f"b{i}", shape, (0.0, 1.0, i), touches=frozenset({"floor"}))
            for i, shape in enumerate(shapes)
        )
    )
    assert World.parse(world.plain()) == world
    assert World.parse([BALL]).bodies[0].shape == Sphere(0.1)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"sphere": {"radius": "0.1"}}, 'radius of b is "0.1"; give a number from 1e-06'),
        ({"sphere": {"radius": True}}, "radius of b is true;"),
        ({"sphere": {"radius": 0}}, "radius of b is 0"),
        ({"sphere": {"radius": float("nan")}}, "radius of b is NaN;"),
        ({"sphere": {}}, "The sphere of b has no radius; give one"),
        ({"sphere": 0.1}, "sphere of b is 0.1; give an object with its radius"),
        (
            {"sphere": {"size": 0.1}},
            '"size" is not a key of the sphere of b; the keys are radius; did you mean radius',
        ),
        ({"box": {"size": [1, 1, 1]}}, "b has the shapes box and sphere; give one of box, sp"),
        ({"extra": 3}, '"extra" is not a key of b; the keys are name, position, rotation'),
        ({"name": ["b"]}, r'Its name is \["b"\]; give a text'),
        ({"name": ""}, "It has no name; give a text"),
        ({"position": [0, 0]}, r"position of b is \[0, 0\]; give x, y, z"),
        ({"position": 7}, "position of b is 7"),
        ({"position": [0, 0, "x"]}, "give x, y, z in m"),
        ({"rotation": [0, 0, 0]}, "give x, y, z, w of a unit quaternion \\(length 1\\)"),
        ({"rotation": [0, 0, 0, "1"]}, "give x, y, z, w of a unit quaternion \\(length 1\\)"),
        ({"link": 7}, "link of b is 7"),
        ({"position": [0, 0, 10**400]}, "The position of b is .*; give x, y, z in m"),
        ({"position": [0, 10**5000, 0]}, "The position of b is .*; give x, y, z in m"),
        ({"position": [0, 0, -1e200]}, r"is \[0, 0, -1e\+200\]; .* m, from -1e\+06 to 1e\+06"),
        (
            {"rotation": [0, 0, 0, 10**400]},
            "give x, y, z, w of a unit quaternion \\(length 1\\)",
        ),
        (
            {"rotation": [1e200, 0, 0, 1e200]},
            "give x, y, z, w of a unit quaternion \\(length 1\\)",
        ),
        ({"sphere": {"radius": 10**400}}, r"The radius of b is .*; give a number from 1e-06"),
        ({"sphere": {"radius": 1e308}}, r"radius of b is 1e\+308; .* from 1e-06 to 1e\+06 m$"),
        ({"sphere": {"radius": 1e-110}}, r"radius of b is 1e-110; .* from 1e-06 to 1e\+06 m$"),
        ({"link": 10**5000}, "The link of b is"),
        ({"name": 10**5000}, "Its name is .*; give a text"),
        ({"extra": 10**5000}, '"extra" is not a key of b'),
        ({"touches": [10**5000]}, "give a list of names"),
        ({"touches": "floor"}, 'touches of b is "floor"; give a list of names'),
        ({"touches": [7]}, "give a list of names"),
    ],
)
def test_invalid_bodies_are_rejected(change: dict[str, Any], message: str) -> None:
    with pytest.raises(BadWorld, match=message):
        World.parse([BALL | change])


@pytest.mark.parametrize(
    ("shape", "message"),
    [
        ({"box": {"size": [0.1, 0.1]}}, r"size of b is \[0.1, 0.1\]; give x, y, z"),
        ({"box": {"size": 0.1}}, "size of b is 0.1; give x, y, z, each from 1e-06"),
        ({"mesh": {"path": 7}}, "path of b is 7; give the name of a file"),
        ({"mesh": {"path": ""}}, 'path of b is ""'),
        ({"mesh": {"path": "a.stl", "scale": [1, -1, 1]}}, "scale of b"),
        ({"mesh": {"path": "a.stl", "scale": [1, 1, 10**400]}}, "scale of b is"),
        ({"mesh": {"path": 10**5000}}, "path of b is"),
        ({"box": {"size": [1, 1e200, 1]}}, r"size of b is .* each from 1e-06 to 1e\+06"),
        ({"cylinder": {"radius": 0.1, "length": 1e7}}, r"length of b is 10000000.0; give a number"),
        ({"cylinder": {"radius": 0.1}}, "The cylinder of b has no length; give one"),
        ({"box": {"sze": [1, 1, 1]}}, '"sze" is not a key of the box of b; .*; did you mean size'),
        ({}, "b has no shape; give one of box, sphere, cylinder, mesh"),
        ({"spere": {"radius": 0.1}}, '"spere" is not a key of b; .*; did you mean sphere'),
        ({"sphere": {"radius": 0.1}, "pos": [0, 0, 0]}, '"pos" is not a key of b; .* mesh$'),
    ],
)
def test_invalid_shapes_are_rejected(shape: dict[str, Any], message: str) -> None:
    with pytest.raises(BadWorld, match=message):
        World.parse([{"name": "b", "position": [0, 0, 0], **shape}])


@pytest.mark.parametrize(
    ("bodies", "seen"),
    [(7, "7"), ({"box": "b"}, '{"box": "b"}'), ("b", '"b"'), (None, "null"), (True, "true")],
)
def test_other_values_than_a_list_of_bodies(bodies: Any, seen: str) -> None:
    with pytest.raises(BadWorld, match=f"^{re.escape(seen)} is not a list of bodies"):
        World.parse(bodies)


@pytest.mark.parametrize(
    ("body", "seen"),
    [
        ([0] * 1000, r"\[0, 0, [0, ]{50,60}\.\.\."),
        ("é", '"é"'),
        ("\ud800\x9b", r'"\\ud800\\u009b"'),
    ],
)
def test_values_in_messages_are_short_and_readable(body: Any, seen: str) -> None:
    with pytest.raises(BadWorld, match=f"^Body 1: {seen} is not an object"):
        World.parse([body])


@pytest.mark.parametrize("part", [0.7071, 0.707, 0.70711, 0.71, 0.70710678])
def test_a_rounded_quaternion_is_scaled(part: float) -> None:
    (ball,) = World.parse([BALL | {"rotation": [0, 0, part, part]}]).bodies
    if abs(math.hypot(part, part) - 1.0) < 1e-6:
        assert ball.rotation == (0, 0, part, part)
    else:
        assert ball.rotation == pytest.approx((0, 0, 0.5**0.5, 0.5**0.5), abs=1e-15)
    assert World.parse(World((ball,)).plain()).bodies == (ball,)


@pytest.mark.parametrize(
    ("rotation", "length"),
    [([0, 0, 1, 1], "1.41421"), ([0, 0, 0, 0], "0"), ([0.5, 0, 0, 0], "0.5")],
)
def test_a_quaternion_of_another_length_is_rejected_with_its_length(
    rotation: list[float], length: str
) -> None:
    with pytest.raises(BadWorld, match=rf"\], of length {length}; give x, y, z, w of a unit"):
        World.parse([BALL | {"rotation": rotation}])


@pytest.mark.parametrize(
    ("odd", "message"),
    [
        ({"position": [0.0, 0.0, 0.5]}, "position of b is"),
        ({"position": np.zeros(3)}, "position of b is"),
        ({"shape": None}, "shape of b is None; give box, sphere, cylinder, mesh"),
        ({"shape": Box([0.1, 0.1, 0.1])}, "size of b is"),  # type: ignore[arg-type]
        ({"touches": None}, "touches of b is None; give names, in a frozenset"),
        ({"touches": {"floor"}}, "touches of b is {'floor'}"),
    ],
)
def test_bodies_that_are_not_hashable(odd: dict[str, Any], message: str) -> None:
    """The planner looks up its scenes by their worlds, so these must be hashable."""
    with pytest.raises(BadWorld, match=message):
        replace(Body("b", Sphere(0.1)), **odd)


@pytest.mark.parametrize("bodies", [None, [Body("b", Sphere(0.1))], ("b",)])
def test_other_values_than_a_tuple_of_bodies(bodies: Any) -> None:
    with pytest.raises(BadWorld, match="give a tuple of bodies"):
        World(bodies)


@pytest.mark.parametrize(
    ("body", "message"),
    [
        (7, "Body 2: 7 is not an object with a name and a shape"),
        ([], "Body 2: [] is not an object"),
        (BALL | {"name": "c", "sphere": {"radius": 0}}, "Body 2: The radius of c is 0"),
        ({"sphere": {"radius": 0.1}}, "Body 2: It has no name; give a text"),
    ],
)
def test_the_body_is_named_by_its_number(body: Any, message: str) -> None:
    with pytest.raises(BadWorld, match=re.escape(message)):
        World.parse([BALL, body])

"""The ports of skills, converted to declarations of the grammar."""

from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from typing import Any, get_args, get_origin

from py_trees.ports import PortInformation, get_ports_registry

from skills import Port, Positions, Skill
from skills.user_skills import is_broken
from trees.declarations import ANY, LIST, Declaration, type_fits
from trees.reading.document import Located
from trees.reading.literals import measured
from trees.reading.specs import Value

_TYPES: dict[Any, str] = {
    int: "integer",
    bool: "boolean",
    str: "text",
    Positions: "positions",
    object: ANY,
}
_UNITS = {"": "number", "rad": "angle", "s": "duration", "m": "length"}


def known_skills() -> dict[str, type[Skill]]:
    """Return all skills, by name."""
    registry = get_ports_registry().items()
    return {
        name: kind
        for name, kind in registry
        if issubclass(kind, Skill) and not is_broken(kind.__module__)
    }


def declaration(port: PortInformation, output: bool = False) -> Declaration:
    """Return the declaration of a port."""
    unit = port.unit if isinstance(port, Port) else ""
    plain = Declaration(
        _type(port.data_type, unit),
        default=port.default_value,
        optional=not port.required,
        output=output,
        description=port.description,
    )
    if not isinstance(port, Port):
        return plain
    return replace(
        plain,
        least=port.least,
        most=port.most,
        choices=port.choices,
        count=port.count,
        relative=port.relative,
    )


def _type(kind: Any, unit: str) -> str:
    if get_origin(kind) is list:
        return LIST + _type(get_args(kind)[0], unit)
    if kind is float:
        return _UNITS[unit]
    return _TYPES.get(kind) or str(getattr(kind, "__name__", "value"))


@cache
def declarations(kind: type[Skill]) -> Mapping[str, Declaration]:
    """Return the declarations of all ports of a skill, inputs first."""
    inputs = {name: declaration(port) for name, port in kind.input_ports().items()}
    outputs = {name: declaration(port, True) for name, port in kind.output_ports().items()}
    return inputs | outputs


def wanted_at(
    kind: type[Skill], port: str, value: Value | None, types: Mapping[str, str]
) -> Declaration:
    """Return the declaration of an input port. It may depend on the types of earlier ports.

    If two ports must have the same type, a number with a unit is a quantity. As texts, two numbers
    would be compared by their letters.
    """
    info, wanted = kind.input_ports()[port], declarations(kind)[port]
    ports = (kind.input_ports() | kind.output_ports()).values()
    like = types.get(info.like) if isinstance(info, Port) else None
    typed = like or any(isinstance(each, Port) and each.like == port for each in ports)
    unit = measured(value) if typed and isinstance(value, Located) else ""
    # Any quantity may be a plain number.
    if unit and like in (None, "", ANY, "number", "integer"):
        like = unit
    return Declaration(like, wanted.default, wanted.optional) if like else wanted


def port_value(fitted: Any) -> Any:
    """Convert a checked value to the type that skills receive."""
    if isinstance(fitted, list):
        return [port_value(item) for item in fitted]
    return Positions(fitted) if isinstance(fitted, dict) else fitted


def type_of(value: object) -> str:
    """Return the type of a converted value at a port that accepts several types."""
    return {bool: "boolean", float: "number", str: "text"}.get(type(value), ANY)


def writers_of(port: str, wanted: Declaration) -> list[str]:
    """Return the skills that can write the value of a port: a class, or an output of this name."""
    own_type = wanted.type[:1].isupper()
    return [
        name
        for name, skill in known_skills().items()
        for output, info in skill.output_ports().items()
        if (kind := declaration(info).type) not in ("", ANY)
        if type_fits(kind, wanted.type) and (own_type or output == port)
    ]

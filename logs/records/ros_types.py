"""The ROS 2 message types of a recording: their fields, definitions and hashes."""

import hashlib
import json
import re
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

# Each `.msg` file in this folder defines one type; `standard.msg` defines the types of ROS 2.
_OURS = tuple(
    f"arduinobot_msgs/msg/{name}" for name in ("SerialFrame", "TaskFeedback", "MeasuredJoints")
)

_NESTED = f"{'=' * 80}\nMSG: "  # line before each nested type in a definition
_FIELD = re.compile(r"([\w/]+)(\[(\d*)\])? +(\w+)")

# Number of each type in the type descriptions of ROS 2 (REP 2016). Arrays add an offset.
_NUMBERS = {
    "int8": 2,
    "uint8": 3,
    "int16": 4,
    "uint16": 5,
    "int32": 6,
    "uint32": 7,
    "int64": 8,
    "uint64": 9,
    "float32": 10,
    "float64": 11,
    "char": 13,
    "bool": 15,
    "byte": 16,
    "string": 17,
}
_MESSAGE, _ARRAY, _SEQUENCE = 1, 48, 144


class Field(NamedTuple):
    """A field of a message type.

    Attributes:
        name: Name of the field.
        type: Type of the value, or of each element: `float64`, `std_msgs/msg/Header` and others.
        length: Number of elements; 0 if any number is allowed, None for a single value.
    """

    name: str
    type: str
    length: int | None

    @property
    def is_message(self) -> bool:
        """True if the type of the field is a message type."""
        return "/" in self.type


@cache
def fields(name: str) -> tuple[Field, ...]:
    """Return the fields of a message type.

    Raises:
        ValueError: The type is unknown: armtree records no messages of this type.
    """
    if name not in _definitions():
        raise ValueError(f"the message type {name} is unknown")
    lines = (line.partition("#")[0].strip() for line in _definitions()[name].splitlines())
    return tuple(_field(line) for line in lines if line and "=" not in line)


@cache
def schema(name: str) -> str:
    """Return the definition of a message type in `ros2msg` form, with all nested types."""
    nested = (
        f"{_NESTED}{each.replace('/msg/', '/')}\n{_definitions()[each]}" for each in _nested(name)
    )
    return "".join([_definitions()[name], *nested])


@cache
def type_hash(name: str) -> str:
    """Return the hash of a message type: `RIHS01_` and 64 hexadecimal digits."""
    described = {
        "type_description": _description(name),
        "referenced_type_descriptions": [_description(each) for each in sorted(_nested(name))],
    }
    return f"RIHS01_{hashlib.sha256(json.dumps(described).encode()).hexdigest()}"


@cache
def _definitions() -> Mapping[str, str]:
    """Return the definitions of all message types, by name of the type."""
    texts = [_text("standard"), *(f"MSG: {name}\n{_text(name)}" for name in _OURS)]
    pairs = (each.partition("\n") for text in texts for each in text.split("MSG: ")[1:])
    return {name: f"{text.strip()}\n" for name, _, text in pairs}


def _text(name: str) -> str:
    """Return the content of the `.msg` file of a message type."""
    return Path(__file__).with_name(f"{name.rpartition('/')[2]}.msg").read_text()


def _field(line: str) -> Field:
    """Return the field that a line defines, such as `string name` or `float64[] position`."""
    found = _FIELD.fullmatch(line)
    assert found, line
    kind, array, length, name = found.groups()
    return Field(name, kind.replace("/", "/msg/"), int(length or 0) if array else None)


def _nested(name: str) -> tuple[str, ...]:
    """Return all message types that a message type contains at any depth, each once."""
    inner = (field.type for field in fields(name) if field.is_message)
    return tuple(dict.fromkeys(each for kind in inner for each in (kind, *_nested(kind))))


def _description(name: str) -> dict[str, Any]:
    return {"type_name": name, "fields": [_described(field) for field in fields(name)]}


def _described(field: Field) -> dict[str, Any]:
    array = 0 if field.length is None else _ARRAY if field.length else _SEQUENCE
    kind = _MESSAGE if field.is_message else _NUMBERS[field.type]
    return {
        "name": field.name,
        "type": {
            "type_id": array + kind,
            "capacity": field.length or 0,
            "string_capacity": 0,
            "nested_type_name": field.type if field.is_message else "",
        },
    }

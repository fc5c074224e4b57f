"""Checks the types of record fields from JSON. Any program may have written the JSON."""

from collections.abc import Mapping
from dataclasses import is_dataclass
from functools import cache
from typing import Any, get_args, get_origin, get_type_hints

LARGEST = 2**64  # limit of an integer in a float field, and of a time [ns]


@cache
def _fields(type_: type) -> tuple[tuple[str, Any], ...]:
    return (*get_type_hints(type_).items(),) if is_dataclass(type_) else ()


@cache
def _parts(type_: Any) -> tuple[Any, tuple[Any, ...]]:
    return get_origin(type_), get_args(type_)


def frozen(value: Any) -> Any:
    """Convert lists to tuples, also nested ones: JSON has only lists, and records have tuples."""
    return tuple(map(frozen, value)) if isinstance(value, list) else value


def has_type(value: Any, type_: Any) -> bool:
    """Return True if a value has the annotated type of a field.

    If the value is a dataclass, also checks the types of its fields.
    """
    if type(value) is type_:
        return all(has_type(getattr(value, name), kind) for name, kind in _fields(value.__class__))
    origin, inner = _parts(type_)
    if origin is tuple:
        return isinstance(value, tuple) and all(has_type(each, inner[0]) for each in value)
    if origin in (dict, Mapping):
        values = value.values() if isinstance(value, Mapping) else ()
        return isinstance(value, Mapping) and all(has_type(each, inner[1]) for each in values)
    if inner:
        return any(has_type(value, each) for each in inner)
    if type_ is float and type(value) is int:
        return abs(value) < LARGEST
    return type_ is Any

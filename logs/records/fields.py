"""What the fields of a record may hold, for those that are read from a file."""

import re
from collections.abc import Mapping
from functools import cache
from typing import Any, get_args, get_origin, get_type_hints

from .records import Plan, Schedule, Sent

# Fields of one length, and tables with as many columns as the first of them.
_LENGTHS: dict[type, tuple[tuple[str, ...], ...]] = {
    Sent: (("joints", "positions"),),
    Plan: (("joints", "velocity_limits", "acceleration_limits"), ("times", "positions")),
    Schedule: (("times", "frames", "delays_s"), ("sample_times", "samples")),
}
_COLUMNS: dict[type, tuple[tuple[str, str], ...]] = {
    Plan: (("joints", "waypoints"), ("joints", "positions")),
    Schedule: (("start", "samples"),),
}

_TIMES, _LONGEST = ("time", "duration"), 1e9  # [s]
_IDENTITY = re.compile("[0-9a-f]{32}")


def misshapen(kind: type, values: Mapping[str, Any]) -> str:
    """The first field of a record that cannot be as it is, or nothing."""
    for name, type_ in _types(kind).items():
        if name in values and not (_is(values[name], type_) and _fits(name, values[name])):
            return name
    for names in _LENGTHS.get(kind, ()):
        if len({len(values[name]) for name in names}) > 1:
            return names[-1]
    for joints, table in _COLUMNS.get(kind, ()):
        if any(len(row) != len(values[joints]) for row in values[table]):
            return table
    return ""


@cache
def _types(kind: type) -> dict[str, Any]:
    return get_type_hints(kind)


def _fits(name: str, value: Any) -> bool:
    if name in _TIMES:
        return abs(float(value)) < _LONGEST
    return name != "goal_id" or _IDENTITY.fullmatch(value) is not None


def _is(value: Any, type_: Any) -> bool:
    origin, inner = get_origin(type_), get_args(type_)
    if origin is tuple:
        return isinstance(value, tuple) and all(_is(each, inner[0]) for each in value)
    if origin is dict:
        return isinstance(value, dict) and all(_is(each, inner[1]) for each in value.values())
    if inner:
        return any(_is(value, each) for each in inner)
    kinds = (int, float) if type_ is float else (type_,)
    return type_ is Any or type(value) in kinds

"""The table of the fields of every JSON topic, made of the code."""

import re
from collections.abc import Iterator, Mapping
from types import NoneType, UnionType
from typing import Any, get_args, get_origin, get_type_hints

from executive.api.schemas import field_words
from logs.records.conversions import Timing, sent_timing
from logs.records.topics import TOPICS, Topic

_JSON = "std_msgs/msg/String"
_URDF = "/robot_description"
_WORDS = {float: "number", int: "integer", str: "text", bool: "true or false", NoneType: "null"}
_UNIT = re.compile(r" \[([^\]]+)\]")


def table() -> list[str]:
    """Its lines."""
    head = ["| topic | field | type | unit | meaning |", "|---|---|---|---|---|"]
    return head + [row for topic in TOPICS for row in _rows(topic)]


def _rows(topic: Topic) -> Iterator[str]:
    if topic.type != _JSON or topic.name == _URDF:
        return
    kind: type = Timing if topic.convert is sent_timing else topic.record
    reported = field_words(kind)
    for name, of in get_type_hints(kind).items():
        words = reported[name]
        unit = ", ".join(_UNIT.findall(words)) or "-"
        meaning = _UNIT.sub("", words).rstrip(".").replace("None", "null")
        place = topic.name.replace("record.", "")
        yield f"| `{place}` | `{name}` | {_in_words(of)} | {unit} | {meaning} |"


def _in_words(of: Any) -> str:
    parts = get_args(of)
    if isinstance(of, UnionType):
        return " or ".join(map(_in_words, parts))
    if get_origin(of) is tuple:
        return f"list of {_in_words(parts[0])}"
    if get_origin(of) in (dict, Mapping):
        return "object" if parts[1] is Any else f"object of {_in_words(parts[1])}"
    return _WORDS[of]

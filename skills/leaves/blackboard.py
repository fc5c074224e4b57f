"""Leaves that write a key of the blackboard, and compare two values."""

import operator
from collections.abc import Callable, Mapping
from typing import Any

from py_trees.common import Status

from skills.base import Skill
from skills.errors import ConditionFails
from skills.ports import Port

_RELATIONS: Mapping[str, Callable[[Any, Any], bool]] = {
    "==": operator.eq,
    "!=": operator.ne,
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
}

_ORDER = ("<", "<=", ">", ">=")
_NO_ORDER = "texts have no order; compare numbers, or numbers with a known unit such as 200 ms"
_NO_MATCH = "a text is equal only to a text; compare two texts, or two numbers"


class Set(Skill):
    """Write a value to a key."""

    may_fail = False
    synonyms = ("script", "setblackboard", "set_fact")

    INPUT_PORTS = {"value": Port(object, description="value to write")}
    OUTPUT_PORTS = {"key": Port(object, description="key to write to", like="value")}

    def on_start(self) -> Status:
        """Write the value."""
        self._set_output("key", self.get_input("value"))
        return Status.SUCCESS


class Compare(Skill):
    """Succeed if a comparison of two values is true, else fail."""

    condition = True
    pure = True

    INPUT_PORTS = {
        "left": Port(object, description="first value"),
        "is": Port(str, description="comparison operator", choices=tuple(_RELATIONS)),
        "right": Port(object, description="second value, of the same type", like="left"),
    }

    @classmethod
    def mistyped(cls, inputs: Mapping[str, Any], types: Mapping[str, str]) -> str:
        """Return an error if a text is compared by order (`<`, `<=`, `>`, `>=`), else ""."""
        text = "text" in (types.get("left"), types.get("right"))
        return _NO_ORDER if text and inputs.get("is") in _ORDER else ""

    def on_start(self) -> Status:
        """Compare the values."""
        left, relation = self.get_input("left"), self.get_input("is")
        right = self.get_input("right")
        texts = [isinstance(value, str) for value in (left, right)]
        if any(texts) and (relation in _ORDER or not all(texts)):
            why = _NO_ORDER if relation in _ORDER else _NO_MATCH
            raise TypeError(f"{left!r} {relation} {right!r}: {why}")
        if not _RELATIONS[relation](left, right):
            raise ConditionFails(f"{left} {relation} {right} is false")
        return Status.SUCCESS

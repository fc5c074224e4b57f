"""Keys of the blackboard: writing one, comparing one."""

import operator
from collections.abc import Callable, Mapping
from typing import Any

from py_trees.common import Status
from py_trees.ports import PortInformation

from .base import Skill
from .errors import ConditionFails
from .ports import Port

_RELATIONS: Mapping[str, Callable[[Any, Any], bool]] = {
    "==": operator.eq,
    "!=": operator.ne,
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
}


class Set(Skill):
    """Write a value under a key."""

    may_fail = False

    INPUT_PORTS = {"value": Port(object, description="what to write")}
    OUTPUT_PORTS = {"key": Port(object, description="where", like="value")}

    def on_start(self) -> Status:
        """Write it."""
        self._set_output("key", self.get_input("value"))
        return Status.SUCCESS


class Compare(Skill):
    """Succeed if a comparison is true, else fail."""

    condition = True
    pure = True

    INPUT_PORTS = {
        "left": Port(object, description="a value"),
        "is": Port(str, description="how they compare", choices=tuple(_RELATIONS)),
        "right": Port(object, description="another of the same type", like="left"),
    }
    OUTPUT_PORTS: dict[str, PortInformation] = {}

    def on_start(self) -> Status:
        """Compare."""
        left, relation = self.get_input("left"), self.get_input("is")
        right = self.get_input("right")
        if not _RELATIONS[relation](left, right):
            raise ConditionFails(f"{left} {relation} {right} is not so")
        return Status.SUCCESS

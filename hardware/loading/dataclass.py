"""Frozen dataclasses with slots that are made in a third of the time.

`dataclasses.dataclass` compiles six methods for each class. `armtree run` makes 120 such classes
before the arm starts; they took 0.1 of 0.5 s. Here a class compiles `__init__` only. Instances take
three times as long to make, so classes with thousands of instances use the standard library, such
as records. Type checkers see the decorator of the standard library.
"""

import dataclasses
from collections.abc import Callable
from operator import attrgetter
from typing import TYPE_CHECKING, Any, Literal

if TYPE_CHECKING:
    from dataclasses import dataclass as dataclass
else:

    def dataclass(*, frozen: Literal[True], slots: Literal[True], kw_only: bool = False):
        """`dataclasses.dataclass`, for the one kind of class that the rooms have most of."""
        return lambda cls: _frozen_with_slots(cls, kw_only)


def _frozen_with_slots(cls: type, kw_only: bool) -> Any:
    if any(map(dataclasses.is_dataclass, cls.__bases__)):
        return dataclasses.dataclass(frozen=True, slots=True, kw_only=kw_only)(cls)
    made: Any = dataclasses.dataclass(slots=True, repr=False, eq=False, kw_only=kw_only)(cls)
    fields = dataclasses.fields(made)
    shown = [field.name for field in fields if field.repr]
    # With the class, there are always two values or more, so that the getter returns a tuple.
    values = attrgetter("__class__", *(field.name for field in fields if field.compare))

    def represent(self: object) -> str:
        listed = ", ".join(f"{name}={getattr(self, name)!r}" for name in shown)
        return f"{type(self).__qualname__}({listed})"

    def equals(self: object, other: object) -> Any:
        same_class = other.__class__ is self.__class__
        return values(self) == values(other) if same_class else NotImplemented

    methods: dict[str, Callable[..., Any]] = {
        "__repr__": represent,
        "__eq__": equals,
        "__hash__": lambda self: hash(values(self)[1:]),  # the hash of a class is its address
        "__setattr__": _set_once,
        "__delattr__": _refuse_delete,
    }
    for name in methods.keys() - vars(cls).keys():
        setattr(made, name, methods[name])
    made.__dataclass_params__.frozen = True  # a subclass must be frozen, too
    return made


def _set_once(self: object, name: str, value: object) -> None:
    if hasattr(self, name):  # `__init__` sets each field once
        raise dataclasses.FrozenInstanceError(f"cannot assign to field {name!r}")
    object.__setattr__(self, name, value)


def _refuse_delete(self: object, name: str) -> None:
    raise dataclasses.FrozenInstanceError(f"cannot delete field {name!r}")

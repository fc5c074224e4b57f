"""Frozen dataclasses with slots that are made in a tenth of the time.

`dataclasses.dataclass` compiles six methods for each class, in 0.9 ms. `armtree run` makes 104 such
classes before its board boots. Here a class is made in 0.1 ms. It compiles `__init__`, and nothing
else, when its first instance is made, in 0.2 ms. `InitVar` and `init=False` are not supported.
Type checkers see the decorator of the standard library.
"""

import dataclasses
from operator import attrgetter
from typing import TYPE_CHECKING, Any, Literal

if TYPE_CHECKING:
    from dataclasses import dataclass as dataclass
else:

    def dataclass(*, frozen: Literal[True], slots: Literal[True], kw_only: bool = False):
        """`dataclasses.dataclass`, for the one kind of class that the rooms have most of."""
        return lambda cls: _frozen_with_slots(cls, kw_only)


def _frozen_with_slots(cls: type, kw_only: bool) -> Any:
    derived = any(map(dataclasses.is_dataclass, cls.__bases__))  # must be frozen like its base
    make = dataclasses.dataclass(
        init=False, repr=False, eq=False, frozen=derived, slots=True, kw_only=kw_only
    )
    made: Any = make(cls)
    fields = dataclasses.fields(made)
    shown = [field.name for field in fields if field.repr]
    # With the class twice, there are always two values or more, so that the getter returns a tuple.
    compared = (field.name for field in fields if field.compare)
    values = attrgetter("__class__", "__class__", *compared)

    def represent(self: object) -> str:
        listed = ", ".join(f"{name}={getattr(self, name)!r}" for name in shown)
        return f"{type(self).__qualname__}({listed})"

    def equals(self: object, other: object) -> Any:
        same_class = other.__class__ is self.__class__
        return values(self) == values(other) if same_class else NotImplemented

    methods: dict[str, Any] = {
        "__init__": _Init(made),
        "__repr__": represent,
        "__eq__": equals,
        "__hash__": lambda self: hash(values(self)[2:]),  # the hash of a class is its address
        "__setattr__": _set_once,
        "__delattr__": _refuse_delete,
    }
    for name in methods.keys() - vars(cls).keys():
        setattr(made, name, methods[name])
    made.__dataclass_params__.frozen = True  # a subclass must be frozen, too
    return made


class _Init:
    """The `__init__` of a class until its first use, which replaces it by the compiled one."""

    def __init__(self, made: type) -> None:
        self._made: Any = made

    def __get__(self, instance: object, owner: type) -> Any:
        self._made.__init__ = compiled = _compiled_init(self._made)
        return compiled.__get__(instance, owner)


class _Factory:
    """In a signature, the default value of a field with a factory."""

    def __repr__(self) -> str:
        return "<factory>"


_FACTORY = _Factory()


def _compiled_init(made: Any) -> Any:
    known: dict[str, Any] = {"__set__": object.__setattr__, "__factory__": _FACTORY}
    by_place, by_name, body = ["self"], ["*"], []
    fields = dataclasses.fields(made)
    for field in fields:
        name, default = field.name, f"__default_{field.name}__"
        value, parameter = name, name
        if field.default is not dataclasses.MISSING:
            known[default], parameter = field.default, f"{name}={default}"
        elif field.default_factory is not dataclasses.MISSING:
            known[default], parameter = field.default_factory, f"{name}=__factory__"
            value = f"{default}() if {name} is __factory__ else {name}"
        (by_name if field.kw_only else by_place).append(parameter)
        body.append(f"__set__(self, {name!r}, {value})")
    if hasattr(made, "__post_init__"):
        body.append("self.__post_init__()")
    parameters = by_place + by_name * (len(by_name) > 1)
    exec(f"def __init__({', '.join(parameters)}):\n " + "\n ".join(body or ["pass"]), known)
    init = known["__init__"]
    init.__module__ = made.__module__
    init.__qualname__ = f"{made.__qualname__}.__init__"
    init.__annotations__ = {**{field.name: field.type for field in fields}, "return": None}
    return init


def _set_once(self: object, name: str, value: object) -> None:
    if hasattr(self, name):  # `pickle` and `copy` set each field once
        raise dataclasses.FrozenInstanceError(f"cannot assign to field {name!r}")
    object.__setattr__(self, name, value)


def _refuse_delete(self: object, name: str) -> None:
    raise dataclasses.FrozenInstanceError(f"cannot delete field {name!r}")

"""Frozen dataclasses with slots behave as those of the standard library do."""

import copy
import dataclasses
import inspect
import pickle
from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import given, strategies as st

from hardware.loading.dataclass import dataclass


@dataclass(frozen=True, slots=True)
class Ours:
    """A value."""

    first: object
    second: object = "two"
    hidden: object = dataclasses.field(default=None, compare=False, repr=False)
    made: object = dataclasses.field(default_factory=list)


@dataclasses.dataclass(frozen=True, slots=True)
class Theirs:
    """The same value, made by the standard library."""

    first: object
    second: object = "two"
    hidden: object = dataclasses.field(default=None, compare=False, repr=False)
    made: object = dataclasses.field(default_factory=list)


@dataclass(frozen=True, slots=True)
class Longer(Ours):
    """A value with one more field."""

    last: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class Named:
    """A value with a field that must be named."""

    name: str


@dataclass(frozen=True, slots=True)
class Nothing:
    """A value without fields."""


_VALUES = st.one_of(st.integers(0, 2), st.floats(0, 1), st.text(max_size=1), st.none())
_FIELDS = st.tuples(_VALUES, _VALUES, _VALUES)


def _result(call: Callable[[], object]) -> object:
    """What a call returns, or the class of the error that it raises."""
    try:
        return call()
    except (TypeError, dataclasses.FrozenInstanceError) as error:
        return type(error), str(error).replace("Theirs", "Ours")


@given(_FIELDS, _FIELDS)
def test_values_compare_hash_and_show_as_in_the_standard_library(
    one: tuple[object, ...], other: tuple[object, ...]
) -> None:
    ours, theirs = (Ours(*one), Ours(*other)), (Theirs(*one), Theirs(*other))
    assert (ours[0] == ours[1]) == (theirs[0] == theirs[1])
    assert repr(ours[0]).replace("Ours", "Theirs") == repr(theirs[0])
    assert dataclasses.asdict(ours[0]) == dataclasses.asdict(theirs[0])
    hashable = (dataclasses.replace(each, made=()) for each in ours)
    if ours[0] == ours[1]:
        assert len({hash(each) for each in hashable}) == 1


@pytest.mark.parametrize(
    "use",
    [
        lambda made: made(),
        lambda made: made(1, 2, 3, 4, 5),
        lambda made: made(1, wrong=2),
        lambda made: hash(made(1)),
        lambda made: setattr(made(1), "first", 2),
        lambda made: setattr(made(1), "second", 2),
        lambda made: delattr(made(1), "first"),
        lambda made: made.__match_args__,
        lambda made: made.__slots__,
        lambda made: str(inspect.signature(made)),
        lambda made: made(1) != made(2),
        lambda made: made(1).made is made(1).made,
    ],
)
def test_a_use_has_the_result_of_the_standard_library(use: Callable[[Any], object]) -> None:
    assert _result(lambda: use(Ours)) == _result(lambda: use(Theirs))


def test_a_value_with_another_class_is_not_equal() -> None:
    for other in (Theirs(1), Longer(1), 1):
        assert Ours(1) != other
    assert Longer(1, last=2) == Longer(1, last=2) != Longer(1, last=3)


@dataclass(frozen=True, slots=True)
class Own:
    """A value with methods of its own in place of those of a dataclass."""

    number: int

    def __repr__(self) -> str:
        return f"number {self.number}"

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Own) and self.number % 10 == other.number % 10

    def __hash__(self) -> int:
        return self.number % 10


def test_methods_of_a_class_are_kept() -> None:
    assert repr(Own(3)) == "number 3"
    assert Own(3) == Own(13) != Own(4)
    assert hash(Own(13)) == 3


def test_a_hash_does_not_depend_on_the_process() -> None:
    assert hash(Ours(1, 2, made=())) == hash(Theirs(1, 2, made=()))
    assert hash(Nothing()) == hash(())


def test_no_attribute_can_be_added() -> None:
    value: Any = Ours(1)
    with pytest.raises(AttributeError):
        value.other = 2


@pytest.mark.parametrize(
    "value", [Ours(1, made=[2]), Longer(1, last=3), Named(name="x"), Nothing()]
)
def test_copies_are_equal(value: object) -> None:
    assert pickle.loads(pickle.dumps(value)) == copy.copy(value) == copy.deepcopy(value) == value


def test_a_field_that_must_be_named_is_refused_by_place() -> None:
    make: Any = Named
    with pytest.raises(TypeError):
        make("x")

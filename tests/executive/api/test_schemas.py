"""Schemas of answers are made of their classes: types, units in names, and words."""

import pytest

from executive.api import Policy
from executive.api.events import Status, Where
from executive.api.schemas import ERROR, RESULT, STATUS, WHERE, Component, inlined
from hardware import State


@pytest.mark.parametrize("answer", [ERROR, RESULT, STATUS, WHERE], ids=lambda each: each.name)
def test_each_field_of_a_class_has_its_words(answer: Component) -> None:
    properties = answer.schema["properties"]
    assert answer.schema["required"] == [*properties]
    silent = {name for name, schema in properties.items() if not schema.get("description")}
    assert silent <= {"goal_id", "success"}  # they are no fields


def test_a_position_has_the_keys_of_its_schema_and_comes_back() -> None:
    where = Where(units={"a": "rad"}, limits={"a": (0.0, 1.0)}, boot_wait=2.0, turns=("roll",))
    plain = where.to_json()
    assert set(plain) == set(WHERE.schema["properties"])
    assert plain["boot_wait_s"] == 2.0
    assert Where.from_json(plain) == where


def test_a_status_has_the_keys_of_its_schema_and_comes_back() -> None:
    status = Status(
        State.ACTIVE, None, "virtual", {"a": 1.0}, None, None, None, "", "", 1, ("0" * 32,),
        Policy.QUEUE, False, ("t/A",), 2, 3.25, 4.5,
    )  # fmt: skip
    plain = status.to_json()
    assert set(plain) == set(STATUS.schema["properties"])
    assert Status.from_json(plain) == status


def test_types_become_schemas() -> None:
    properties = inlined(WHERE)["properties"]
    assert properties["arm"]["enum"] == [state.value for state in State]
    pair = {"type": "array", "items": {"type": "number"}, "minItems": 2, "maxItems": 2}
    assert properties["limits"]["additionalProperties"] == {"anyOf": [pair, {"type": "null"}]}
    assert properties["turns"] == {
        "type": "array",
        "items": {"type": "string"},
        "description": "The turns of the tool that the arm can make while the tool stays at its "
        "point: `roll`, `pitch` and `yaw`, or fewer.",
    }

"""Invalid requests: the planner rejects them, for all kinds of values."""

import dataclasses
import math
from typing import Any

import numpy as np
import pytest

from hardware import load_robot
from skills.motion import (
    EMPTY,
    BadQuery,
    Body,
    Carry,
    Plan,
    PlanTimeout,
    Query,
    Request,
    Rest,
    Sphere,
    ToolQuery,
    Verify,
)
from skills.motion.planner import Planner

HOME = (0.0, 0.0, 0.0, 0.0)
PICK = Query("arm", HOME, (-1.4, -0.6, -0.07))
TOOL = ToolQuery("arm", HOME, (0.1, 0.0, 0.1))


@pytest.fixture(scope="module")
def planner() -> Planner:
    return Planner(load_robot())


@pytest.mark.parametrize(
    ("odd", "message"),
    [
        ({"offset": None}, "The offset is None; give x, y, z"),
        ({"offset": "abc"}, "The offset is 'abc'; give x, y, z"),
        ({"direction": 5}, "The direction is 5; give x, y, z"),
        ({"direction": (0.0, 1.0)}, r"The direction is \(0.0, 1.0\); give x, y, z"),
        ({"axis": np.array([0.0, 0.0, 1.0])}, "The axis is array"),
        ({"point": None}, "The point is None; give x, y, z"),
        ({"relative": np.zeros(3)}, "The value of relative is array.*; give True or False"),
        ({"link": 7}, "The link is 7; give the name of a link, or omit it"),
    ],
)
def test_invalid_tool_queries(planner: Planner, odd: dict[str, Any], message: str) -> None:
    with pytest.raises(BadQuery, match=message):
        planner.reach(dataclasses.replace(TOOL, **odd))


@pytest.mark.parametrize("request_", [PICK, TOOL, Verify([HOME], 0.0), Carry(EMPTY, "b", "", HOME)])
@pytest.mark.parametrize("odd", [None, (), "world", [Body("b", Sphere(0.1))]])
def test_a_world_of_another_type(planner: Planner, request_: Request, odd: Any) -> None:
    with pytest.raises(BadQuery, match=r"The world is .*; give a World"):
        planner.answer(dataclasses.replace(request_, world=odd))


@pytest.mark.parametrize("odd", [None, "arm", PICK])
def test_a_rest_of_no_plan(planner: Planner, odd: Any) -> None:
    with pytest.raises(BadQuery, match=r"The plan is .*; give a Plan of this planner"):
        planner.answer(Rest(odd, 0.0, HOME))


@pytest.mark.parametrize("request_", [PICK, TOOL, Verify([HOME], 0.0)])
@pytest.mark.parametrize("odd", [math.nan, "a", None, np.zeros(3)])
def test_invalid_timeouts(planner: Planner, request_: Request, odd: Any) -> None:
    """A timeout of NaN would never pass."""
    with pytest.raises(BadQuery, match=r"The timeout is .* s; give a number"):
        planner.answer(dataclasses.replace(request_, timeout=odd))


def test_a_timeout_larger_than_any_float(planner: Planner) -> None:
    assert isinstance(planner.answer(dataclasses.replace(PICK, timeout=10**400)), Plan)
    with pytest.raises(PlanTimeout):
        planner.answer(dataclasses.replace(PICK, timeout=-(10**400)))


def test_a_group_name_of_thousands_of_digits(planner: Planner) -> None:
    group: Any = 10**5000
    with pytest.raises(
        BadQuery, match="The group is a int that cannot be shown; give the name of a group"
    ):
        planner.answer(dataclasses.replace(PICK, group=group))

"""Joint positions for a tool: found where there are any, and told truly where there are none."""

import pytest

from hardware import load_robot
from skills.motion import NotFinite, ToolQuery
from skills.motion.planner import Planner

HOME = (0.0, 0.0, 0.0, 0.0)
WITHIN = (0.1, 0.05, 0.08)


@pytest.fixture(scope="module")
def planner() -> Planner:
    return Planner(load_robot())


def test_what_is_not_finite_is_named(planner: Planner) -> None:
    axis = (0.0, 1.0, float("inf"))
    with pytest.raises(NotFinite, match=r"^The z of the axis is inf; give") as caught:
        planner.reach(ToolQuery("arm", HOME, WITHIN, axis=axis))
    assert caught.value.joint == ""

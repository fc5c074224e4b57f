"""Command and state interfaces, and their claims."""

import pytest

from hardware import Measurement, load_robot
from hardware.arm.interfaces import Claim, Claims, command_interfaces, state_interfaces
from hardware.errors import InterfaceClaimed, InterfaceUnknown, StaleGeneration

STALE = "^the arm was stopped or moved since this motion was planned$"
STOPPED = "^this motion was stopped; nothing more is sent for it$"


def test_every_joint_with_a_servo_has_a_command_interface_in_the_order_of_the_frame() -> None:
    names = ("joint_1/position", "joint_2/position", "joint_3/position", "joint_4/position")
    assert command_interfaces(load_robot()) == names


def test_every_joint_has_a_state_and_mimic_joints_follow_their_leaders() -> None:
    assert state_interfaces(load_robot(), (0.1, 0.2, 0.3, -0.4)) == {
        "joint_1/position": 0.1,
        "joint_2/position": 0.2,
        "joint_3/position": 0.3,
        "joint_4/position": -0.4,
        "joint_5/position": 0.4,
    }


def test_what_is_measured_is_beside_what_is_commanded() -> None:
    measured = Measurement((0.1, 0.2, 0.3, -0.4), temperature=(25.0, 26.0, 27.0, 28.0))
    states = state_interfaces(load_robot(), (0.0,) * 4, measured)
    assert (states["joint_4/position"], states["joint_4/measured/position"]) == (0.0, -0.4)
    assert states["joint_2/measured/temperature"] == 26.0
    assert len(states) == 5 + 4 + 4


@pytest.mark.parametrize("count", [3, 5])
def test_states_need_one_value_per_actuated_joint(count: int) -> None:
    with pytest.raises(ValueError, match=r"argument 2 is (shorter|longer)"):
        state_interfaces(load_robot(), [0.0] * count)


def test_every_end_of_a_claim_counts_one_generation() -> None:
    claims = Claims(["a", "b"])
    assert claims.generation == 0
    first = claims.acquire("one", ["a"], 0)
    assert first == Claim("one", ("a",), 0)
    claims.acquire("two", ["b"], 0)
    assert claims.generation == 0
    claims.release_all()
    assert claims.generation == 1
    claims.release_all()  # a stop without a motion counts too
    assert claims.generation == 2
    third = claims.acquire("one", ["a"], 2)
    claims.release(third)
    assert claims.generation == 3
    claims.release(third)  # has ended already
    assert claims.generation == 3


def test_a_claim_of_another_joint_makes_no_plan_stale() -> None:
    claims = Claims(["a", "b"])
    decided = claims.generation
    first = claims.acquire("one", ["a"], decided)
    second = claims.acquire("two", ["b"], decided)
    claims.check(first)
    claims.check(second)
    claims.release(first)
    with pytest.raises(StaleGeneration, match=STALE):
        claims.acquire("three", ["a"], decided)


def test_to_give_up_one_claim_leaves_the_others() -> None:
    claims = Claims(["a", "b"])
    first, second = claims.acquire("one", ["a"], 0), claims.acquire("two", ["b"], 0)
    claims.release(first)
    claims.check(second)
    with pytest.raises(StaleGeneration, match=STOPPED):
        claims.check(first)


def test_a_new_claim_never_equals_an_old_one() -> None:
    claims = Claims(["a"])
    old = claims.acquire("one", ["a"], 0)
    claims.release_all()
    new = claims.acquire("one", ["a"], claims.generation)
    claims.check(new)
    with pytest.raises(StaleGeneration, match=STOPPED):
        claims.check(old)
    claims.release(old)
    claims.check(new)


def test_a_claim_of_nothing_ends_like_any_other() -> None:
    claims = Claims(["a"])
    empty = claims.acquire("one", [], 0)
    claims.check(empty)
    claims.release_all()
    with pytest.raises(StaleGeneration, match=STOPPED):
        claims.check(empty)


def test_a_claim_that_is_refused_takes_nothing() -> None:
    claims = Claims(["a", "b"])
    claims.release_all()
    claims.acquire("one", ["b"], 1)
    with pytest.raises(InterfaceClaimed, match="b is claimed by one, so two cannot command it"):
        claims.acquire("two", ["a", "b"], 1)
    with pytest.raises(InterfaceUnknown, match=r"no command interface c; there are a, b$"):
        claims.acquire("two", ["a", "c"], 1)
    for never in (0, 2):
        with pytest.raises(StaleGeneration, match=STALE):
            claims.acquire("two", ["a"], never)
    assert claims.generation == 1
    claims.acquire("two", ["a"], 1)

"""What is taken for the arm, the gripper and the tool."""

import pytest

from hardware.description.groups import guess_gripper, guess_tool
from hardware.description.urdf import Urdf, UrdfError
from tests.support.arms.urdfs import urdf

ARM = ["world -> base: fixed stand", "base -> upper: revolute shoulder"]
ARM += ["upper -> lower: revolute elbow", "lower -> hand: revolute wrist"]
MIMIC = '<mimic joint="left"/>'
GUESSED = {
    "no gripper": (ARM, [], "hand"),
    "the last joint of the chain": ([*ARM, "hand -> jaw: revolute gripper"], ["gripper"], "hand"),
    "a link says it": ([*ARM, "hand -> claw: revolute joint_4"], ["joint_4"], "hand"),
    "fingers": (
        [*ARM, "hand -> a: prismatic left", "hand -> b: prismatic right"],
        ["left", "right"],
        "hand",
    ),
    "a finger that mimics": (
        [*ARM, "hand -> a: prismatic left", f"hand -> b: prismatic right {MIMIC}"],
        ["left"],
        "hand",
    ),
    "fingers that mimic, by name": (
        [*ARM, "hand -> a: prismatic finger", 'hand -> b: prismatic r <mimic joint="finger"/>'],
        ["finger"],
        "hand",
    ),
    "a tool frame": ([*ARM, "hand -> plate: fixed f", "plate -> tool0: fixed t"], [], "tool0"),
    "a camera beside the chain": ([*ARM, "base -> camera: fixed mount"], [], "hand"),
    "a gripper's own joint beside the wrist": (
        [*ARM, "lower -> finger_1: revolute f1", "lower -> finger_2: revolute f2"],
        ["f1", "f2"],
        "hand",
    ),
    "nothing but a gripper": (["base -> jaw: revolute gripper"], [], "jaw"),
}


@pytest.mark.parametrize(("joints", "gripper", "tool"), GUESSED.values(), ids=GUESSED)
def test_the_guess(joints: list[str], gripper: list[str], tool: str) -> None:
    description = Urdf(urdf(joints)).checked()
    assert list(guess_gripper(description)) == gripper
    assert guess_tool(description, gripper) == tool


def test_two_arms_are_refused() -> None:
    sides = [f"body -> {side}_1: revolute {side}_j1" for side in ("l", "r")]
    sides += [f"{side}_1 -> {side}_2: revolute {side}_j2" for side in ("l", "r")]
    sides.append("body -> head: revolute pan")
    ways = r"l_j1 \(2 joints\), r_j1 \(2 joints\), pan \(1 joint\);"
    with pytest.raises(UrdfError, match=f"branches at body into {ways}"):
        guess_gripper(Urdf(urdf(sides)).checked())


def test_nothing_that_moves_is_refused() -> None:
    with pytest.raises(UrdfError, match="no joint moves; give one the type revolute"):
        guess_gripper(Urdf(urdf(["a -> b: fixed weld"])).checked())

"""Files of newcomers from other programs become right if a person writes what is printed."""

from collections.abc import Mapping

import pytest

from hardware import Robot
from tests.support.generated.wrong_tasks import corrected, mistakes_of
from trees.errors import Mistake

HEAD = "task: 20\nname: m\ndescription: A first try.\n"
ROUNDS = 6  # a person checks the file again after each correction

FILES = {
    "a word and its values": "tree:\n  sequence:\n    - action: move_joints\n      data:\n"
    '        joints: upright\n    - Wait: {duration: "00:00:05"}\n',
    "a condition in a list": "tree:\n  sequence:\n    - if:\n        - Compare: {left: 1, is: "
    '"==", right: 2}\n      then:\n        - subtree: close_gripper\n',
    "a text beside a subtree": "tree:\n  sequence:\n    - alias: go up\n      subtree: "
    "move_joints\n      with:\n        joints: upright\n",
    "a mapping of used names": "env:\n  ANGLE: 20 deg\ntree:\n  subtree: move_joints\n  with:\n"
    "    joints:\n      joint_1: ${{ env.ANGLE }}\n",
    "two lists at ports": "tree:\n  subtree: move_joints\n  with:\n    joint_names: [joint_1, "
    "joint_2]\n    positions: [0.1, 0.2]\n",
    "nodes without a list": "tree:\n  sequence:\n    open_gripper:\n    move_joints:\n      "
    "joints: right\n    close_gripper:\n",
    "a text with quotes": 'tree:\n  sequence:\n    - Say: {text: f"round {i}"}\n',
    "a pose as a text parameter": "parameters:\n  where: {type: text, default: upright}\n"
    "tree:\n  subtree: move_joints\n  with: {joints: $where}\n",
    "an assignment": "tree:\n  sequence:\n    - set: count = 3\n    - Compare: {left: $count, is: "
    '"<", right: 4}\n',
    "a joint by name and value": "tree:\n  sequence:\n    - set_joint: {name: joint_1, value: 30 "
    "deg}\n    - set_joint: {name: joint_2, value: 10 deg}\n",
    "a second node below then": "tree:\n  subtree: open_gripper\n  then:\n    subtree: "
    "close_gripper\n",
    "a text of several lines": "tree:\n  subtree: move_joints\n  with: |\n    joints: upright\n",
    "parameters in a list": "parameters:\n  - name: swing\n    type: angle\n    default: 20 deg\n"
    "tree:\n  subtree: move_joints\n  with: {joints: {joint_1: $swing}}\n",
}


@pytest.fixture(scope="module")
def left(robot: Robot, tmp_path_factory: pytest.TempPathFactory) -> Mapping[str, list[Mistake]]:
    """Mistakes of each file after the first correction was followed, again and again."""
    texts, found = {name: HEAD + text for name, text in FILES.items()}, dict[str, list[Mistake]]()
    for _ in range(ROUNDS):
        files = [{"20_m.yaml": text} for text in texts.values()]
        mistakes = mistakes_of(robot, tmp_path_factory.mktemp("round"), files)
        found = dict(zip(texts, mistakes, strict=True))
        for name, each in found.items():
            if right := next((mistake.instead for mistake in each if mistake.instead), None):
                texts[name] = corrected(texts[name], right)
    return found


@pytest.mark.parametrize("name", FILES)
def test_following_what_is_printed_makes_the_file_right(
    left: Mapping[str, list[Mistake]], name: str
) -> None:
    assert not left[name], "\n".join(map(str, left[name]))

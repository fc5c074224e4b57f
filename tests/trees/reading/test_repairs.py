"""Slips in the layout of a task file: one message at their line, and the line as it should be."""

from pathlib import Path

import pytest

from tests.support.generated.wrong_tasks import TASK, corrected
from trees import FileError, Mistake
from trees.errors import Correction
from trees.reading.grammar import draft_poses, draft_task

FILE = Path("20_m.yaml")
RIGHT = f"""{TASK}\
    - AddBox: {{body: cube, size: [1 cm, 1 cm, 1 cm], position: [20 cm, 0, 5 cm]}}
    - retry: CheckHardware
      attempts: 3
"""


def found(text: str) -> list[Mistake]:
    try:
        return draft_task(FILE, text)[1]
    except FileError as error:
        return list(error.mistakes)


# What is written instead of which part of a right file; line, column and message; the right line.
SLIPS = [
    ("      with: {joints", "     with: {joints", "9:6 `with` is indented by 5 spaces, not 6: "
     "indent it like `subtree` in line 8"),
    ("      with: {arm", "        with: {arm", "7:9 `with` is indented by 8 spaces, not 6"),
    ("    - subtree: move_joints\n      with", "     - subtree: move_joints\n       with",
     "8:6 `- subtree` is indented by 5 spaces, not 4: indent it like `- subtree` in line 6; move "
     "the lines that belong to it, too"),
    ("name: m", "  name: m", "2:3 `name` is indented by 2 spaces, not 0"),
    ("      attempts", "        attempts", "12:9 `attempts` is indented by 8 spaces, not 6"),
    ("      with: {arm", "\twith: {arm", "7:2 tabs cannot indent; use spaces"),
    ("      with: {arm", "\xa0\xa0\xa0\xa0\xa0\xa0with: {arm", "7:1 this is a non-breaking space"),
    ("    - subtree: move", "    subtree: move", "8:5 a `-` is missing before `subtree`"),
    ("    - subtree: move", "      subtree: move", "8:7 a `-` is missing before `subtree`"),
    ("- subtree: reach", "-subtree: reach", "6:5 a space is missing after the `-`"),
    ("task: 20", "task:20", "1:1 a space is missing after the colon of `task`"),
    ("subtree: reach", "subtree:reach", "6:7 a space is missing after the colon of `subtree`"),
    ("joint_1: 20", "joint_1:20", "9:23 a space is missing after the colon of `joint_1`"),
    ("arm: upright, gripper: open", "arm:upright, gripper:open",
     "7:14 a space is missing after the colon of `arm`"),
    ("  sequence:", "  sequence", "5:3 a colon is missing after `sequence`"),
    ("- subtree: reach", "- subtree reach", "6:7 a colon is missing after `subtree`"),
    ("arm: upright", "arm upright", "7:14 a colon is missing after `arm`"),
    ("task: 20", "task = 20", "1:1 a colon separates `task` from its value, not `=`"),
    ("gripper: open}", "gripper: open", "7:13 the { of line 7, column 13 is not closed"),
    ("gripper: open}", "gripper: open]", "7:41 ] does not close what is open here; write }"),
    ("20 deg}}", "20 deg}", "9:13 the { of line 9, column 13 is not closed"),
    ("20 deg}}", "20 deg}}}", "9:40 this } closes nothing"),
    ("1 cm],", "1 cm,", "10:34 the [ of line 10, column 34 is not closed"),
    ("upright, gripper", "upright gripper", "7:27 a comma is missing before `gripper`"),
    ("upright, gripper", "upright; gripper", "7:26 a comma separates values, not `;`"),
    ("{joint_1: 20 deg}", "(joint_1: 20 deg)", "9:22 write braces, not parentheses"),
    ("One mistake.", "'One mistake.", "3:14 the ' of line 3, column 14 is not closed"),
    ("One mistake.", "Pick: the cube", "3:14 a text with special characters must be in"),
    ("One mistake.", "@home", "3:14 a text with special characters must be in quotes"),
    ("name: m", "name: \u201cm\u201d", '2:7 write the plain quote "'),
    ("{arm: upright", "arm: upright", "7:13 a { is missing before `arm`"),
    ("{joint_1: 20", "joint_1: 20", "9:22 a { is missing before `joint_1`"),
    ("[1 cm, 1 cm", "1 cm, 1 cm", "10:34 a [ is missing here"),
    ("{joints: {joint", "{{joints: {joint", "9:14 one { too many"),
    ("{joint_1: 20 deg}", "joint_1: 20 deg", "9:22 a { is missing before `joint_1`"),
    ("{joint_1: 20", "{joint_1, 20", "9:23 a colon separates `joint_1` from its value"),
    ("[1 cm, 1 cm, 1 cm]", "[1, 1, 1] cm", "10:35 each number of a list has its own unit"),
    ("open}", 'open}\n    - Say: {text: "a "b" c"}', '8:19 put a text that contains " in single'),
    ("- subtree: reach", "1. subtree: reach", "6:6 every node of a list begins with a `-`"),
    ("- subtree: reach", "* subtree: reach", "6:5 every node of a list begins with a `-`"),
    ("- retry: CheckHardware", "- 1: {retry: CheckHardware, attempts: 3}\n    - retry: "
     "CheckHardware", "11:7 leave out the number: the nodes of a list run in order"),
    ("subtree: reach", "subtree: reach:", "6:21 leave out the `:` at the end of the line"),
    ("subtree: reach", "subtree: reach()", "6:16 write `reach`, without parentheses"),
    ("task: 20", "- task: 20", "1:1 leave out the `-` before `task`"),
    ("{arm: upright, gripper: open}", "{\n        arm: upright\n        gripper: open}",
     "8:21 a comma is missing at the end of the line"),
    ("AddBox: {body: cube, size: [1 cm, 1 cm, 1 cm], position: [20 cm, 0, 5 cm]}",
     "AddBox:\n      body: cube\n      size: [1 cm, 1 cm, 1 cm]\n      position: [20 cm, 0, 5 cm]",
     "11:7 `body` is indented by 6 spaces, not 8: it belongs to `AddBox` in line 10; move the "
     "lines below it, too"),
]  # fmt: skip


@pytest.mark.parametrize(("right", "wrong", "said"), SLIPS, ids=range(len(SLIPS)))
def test_a_slip_has_one_message_and_the_line_as_it_should_be(
    right: str, wrong: str, said: str
) -> None:
    assert found(RIGHT) == []
    assert RIGHT.count(right) == 1
    (mistake,) = found(RIGHT.replace(right, wrong))
    place = mistake.place
    assert f"{place.line}:{place.column} {mistake.message}".startswith(said)
    assert mistake.instead
    assert found(corrected(RIGHT.replace(right, wrong), mistake.instead)) == [], (
        "what is written instead is not right"
    )


SEVERAL = [
    (
        "    - subtree: open_gripper\n    - subtree: close_gripper\n",
        "    subtree: open_gripper\n    subtree: close_gripper\n",
        ["6:5 a `-` is missing before `subtree`: every node of a list begins with one; the same "
         "mistake is in line 7"],
    ),
    (
        "    - subtree: reach\n      with:\n        arm: upright\n        gripper: open\n",
        "    - subtree: reach\n      with: {\n        arm: upright,\n        gripper: open\n",
        ["9:22 the { of line 7, column 13 is not closed"],
    ),
    (
        "    - Succeed\n    - Succeed\n",
        "\t\t- Succeed\n\t\t- Succeed\n",
        ["6:1 tabs cannot indent; use spaces; the same mistake is in line 7"],
    ),
    (
        "    - Compare: {left: 1, is: '!=', right: 2}\n",
        "    - Compare: {left: 1, is: !=, right: 2}\n",
        ["6:30 != must be in quotes"],
    ),
    (
        "    - subtree: reach\n      with: {arm: upright}\n",
        "    - subtree reach\n      with {arm: upright}\n",
        ["6:7 a colon is missing after `subtree`; the same mistake is in line 7"],
    ),
    (
        "    - subtree: reach\n      with: {arm: upright}\n",
        "    - subtree: reach\n      wiht: {arm: upright\n",
        ["7:13 the { of line 7, column 13 is not closed",
         "7:7 unknown key wiht; beside subtree there are name, with; did you mean with?"],
    ),
]  # fmt: skip


@pytest.mark.parametrize(("right", "wrong", "said"), SEVERAL, ids=range(len(SEVERAL)))
def test_slips_in_several_lines(right: str, wrong: str, said: list[str]) -> None:
    head = "task: 20\nname: m\ndescription: x\ntree:\n  sequence:\n"
    assert found(head + right) == []
    mistakes = found(head + wrong)
    assert [f"{m.place.line}:{m.place.column} {m.message}" for m in mistakes] == said


@pytest.mark.parametrize(
    ("wrong", "right"),
    [
        ("{joint_1: 0, joint_2: 0, gripper: open}", "{joint_1: 0, joint_2: 0}, gripper: open}"),
        ("{pan: 2 deg, lift: 1 deg, speed: 0.5}", "{pan: 2 deg, lift: 1 deg}, speed: 0.5}"),
        ("{pan: 0, lift: 1}", "{pan: 0, lift: 1}}"),
    ],
)
def test_a_bracket_ends_before_a_key_of_another_kind(wrong: str, right: str) -> None:
    (mistake,) = found(f"{TASK}    - subtree: x\n      with: {{arm: {wrong}\n")
    assert mistake.instead
    assert mistake.instead.text == f"      with: {{arm: {right}"


def test_the_rest_of_a_repaired_file_is_read() -> None:
    task, _ = draft_task(FILE, RIGHT.replace("subtree: reach", "subtree:reach"))
    assert task.tree == draft_task(FILE, RIGHT)[0].tree


def test_poses_have_slips_too() -> None:
    text = "poses:\n  left: {joint_1: 1}\n  right:{joint_1: 2}\n"
    file, (mistake,) = draft_poses(Path("poses.yaml"), text)
    assert mistake.message == "a space is missing after the colon of `right`"
    assert mistake.instead == Correction("  right: {joint_1: 2}", 3)
    assert file.poses == {"left": {"joint_1": 1.0}, "right": {"joint_1": 2.0}}


@pytest.mark.parametrize(
    "text",
    [
        RIGHT.replace("One mistake.", "[]"),
        RIGHT.replace("subtree: reach", "subtree: {reach: 1}"),
        RIGHT + "    - {subtree: a, task: 3}\n",
    ],
)
def test_a_mistake_of_another_kind_keeps_its_message(text: str) -> None:
    (mistake,) = found(text)
    assert not mistake.instead


def test_the_message_shows_the_line_as_it_should_be() -> None:
    (mistake,) = found(RIGHT.replace("20 deg}}", "20 deg}"))
    assert str(mistake).endswith("\n  write:\n          with: {joints: {joint_1: 20 deg}}")


def test_a_long_file_is_not_searched() -> None:
    long = RIGHT + "    - Succeed\n" * 2000 + "    Succeed: {}\n"
    (mistake,) = found(long)
    assert mistake.place.line == 2013
    assert "check indentation" in mistake.message

"""Task and subtree files: what they say, and every way to say it wrong."""

from collections.abc import Sequence
from pathlib import Path

import pytest
from hypothesis import given, settings, strategies as st

from trees import FileError, Library, Located, Mistake
from trees.reading.grammar import draft_subtree, parse_task
from trees.reading.specs import ControlNode, Key, SkillNode, SubtreeNode

FILE = Path("3_x.yaml")
SHIPPED = [Library().task(number).text for number in Library().numbers()]

TASK = """\
task: 3
name: x
description: >
  What it
  does.
tree:
  sequence:
    - Succeed
    - SetStart: {start: $start}
    - parallel: [Succeed]
    - subtree: reach
      with: {arm: {joint_1: 0}}
"""


def task_mistakes(path: Path, text: str) -> Sequence[Mistake]:
    try:
        parse_task(path, text)
    except FileError as error:
        return error.mistakes
    return ()


def subtree_mistakes(path: Path, text: str) -> Sequence[Mistake]:
    try:
        return draft_subtree(path, text)[1]
    except FileError as error:
        return error.mistakes


def test_a_task() -> None:
    task = parse_task(FILE, TASK)
    assert (task.number, task.name, task.description) == (3, "x", "What it does.")
    assert task.text == TASK
    tree = task.tree
    assert isinstance(tree, ControlNode)
    plain, skill, side, subtree = tree.children
    assert isinstance(plain, SkillNode)
    assert (plain.skill, plain.ports, plain.place.line) == ("Succeed", {}, 8)
    assert isinstance(skill, SkillNode)
    start = skill.ports["start"]
    assert isinstance(start, Key)
    assert (start.name, start.place.line, start.place.column) == ("start", 9, 25)
    assert (start.label.line, start.label.column) == (9, 18)
    assert isinstance(side, ControlNode)
    assert side.kind == "parallel"
    assert isinstance(subtree, SubtreeNode)
    arm = subtree.values["arm"]
    assert isinstance(arm, Located)
    assert arm.plain() == {"joint_1": 0}


HEAD = "task: 3\nname: x\ndescription: y\n"
T = f"{HEAD}tree:\n"

WRONG = [
    ("just text", 1, 1, "expected the keys task, name, description, tree"),
    ("- a\n- b\n", 1, 1, "expected the keys"),
    ("{}", 1, 1, "expected the keys"),
    ("tree: Succeed\nname: x\ndescription: y\n", 1, 1, "the key task is missing"),
    ("task: 3\nname: x\ntree: Succeed\n", 1, 1, "the key description is missing"),
    (HEAD, 1, 1, "the key tree is missing"),
    (f"{HEAD}tree: Succeed\nspeed: 1\n", 5, 1, "unknown key speed"),
    (f"{HEAD}tree: Succeed\nTree: Succeed\n", 5, 1, "did you mean tree?"),
    (f"{HEAD}trea:\n  Succeed\n", 4, 1, "unknown key trea"),
    (f"{HEAD}<<: {{tree: Succeed}}\n", 4, 1, "unknown key <<"),
    (HEAD.replace("3", "three"), 1, 7, "task: 'three' is not a number"),
    (HEAD.replace("3", "-1"), 1, 7, "task: -1 is not a number from 0 to 2147483647"),
    (HEAD.replace("3", "2147483648"), 1, 7, "is not a number"),
    (HEAD.replace("3", "3.0"), 1, 7, "task: 3.0 is not a number"),
    (HEAD.replace("3", "true"), 1, 7, "task: true is not a number"),
    (HEAD.replace("3", "'3'"), 1, 7, "task: '3' is a text; leave out the quotes"),
    (HEAD.replace("3", ".inf"), 1, 7, "task: inf is not a number"),
    (HEAD.replace("3", "[3]"), 1, 7, "task: [3] is not a number"),
    (HEAD.replace("name: x", "name: a b"), 2, 7, "or -); the name of the file gives x"),
    (HEAD.replace("name: x", "name: a/b"), 2, 7, "is not a name"),
    (HEAD.replace("name: x", "name: off/"), 2, 7, "is not a name"),
    (HEAD.replace("name: x", "name: 1"), 2, 7, "name: 1 is not a name"),
    (HEAD.replace("name: x", "name:"), 2, 1, "name: nothing is not a name"),
    (HEAD.replace("name: x", "name: {x: 1}"), 2, 7, "is not a name"),
    (HEAD.replace("description: y", "description: ''"), 3, 14, "description: '' is not a text"),
    (HEAD.replace("description: y", "description: [y]"), 3, 14, "is not a text"),
    (
        f"{HEAD}tree: 5\n",
        4,
        7,
        "a node is a skill, a subtree, or a control node such as sequence, not 5",
    ),
    (f"{HEAD}tree:\n", 4, 1, "not nothing"),
    (f"{HEAD}tree: []\n", 4, 7, "a list of nodes needs a node above it"),
    (f"{HEAD}tree: {{}}\n", 4, 7, "not {}"),
    (f"{HEAD}tree: $start\n", 4, 7, "a node compares values: write {Comp"),
    (f"{HEAD}tree: ''\n", 4, 7, "a node: '' is not a name"),
    (f"{T}  sequence: Succeed\n", 5, 13, "sequence needs a list of nodes, not 'Succeed'"),
    (f"{T}  sequence: []\n", 5, 13, "sequence needs a list of nodes"),
    (f"{T}  sequence:\n    Succeed: {{}}\n", 6, 5, "a `-` is missing before `Succeed`"),
    (
        f"{T}  sequence: [Succeed]\n  parallel: [Succeed]\n",
        5,
        3,
        "sequence and parallel are several nodes",
    ),
    (f"{T}  sequnce: [Succeed]\n", 5, 3, "did you mean sequence?"),
    (f"{T}  subtre: reach\n  with: {{}}\n", 5, 3, "did you mean subtree?"),
    (f"{T}  - Succeed\n", 5, 3, "a list of nodes needs a node above it"),
    (f"{T}  SetStart:\n  start: $start\n", 6, 3, "`start` is indented by 2 spaces, not 4"),
    (f"{T}  SetStart: {{start: $}}\n", 5, 21, "the name after $: '' is not a name"),
    (f"{T}  SetStart: {{start: $/a}}\n", 5, 21, "the name after $: '/a' is not a name"),
    (f"{T}  SetStart: {{start: $a.b}}\n", 5, 21, "the name after $"),
    (f"{T}  SetStart: {{start: '$a b'}}\n", 5, 21, "the name after $"),
    (f"{T}  subtree: 5\n", 5, 3, "a subtree has a name; a task has a number: write task: 5"),
    (
        f"{T}  subtree: reach\n  wiht: {{}}\n",
        6,
        3,
        "beside subtree there are name, with; did you mean with?",
    ),
]


@pytest.mark.parametrize(("text", "line", "column", "words"), WRONG, ids=range(len(WRONG)))
def test_wrong_task_files(text: str, line: int, column: int, words: str) -> None:
    with pytest.raises(FileError) as caught:
        parse_task(FILE, text)
    said = {(m.place.line, m.place.column): m.message for m in caught.value.mistakes}
    assert words in said[line, column]


def test_all_mistakes_at_once_in_the_order_of_lines() -> None:
    text = "nam: x\ntask: z\ndescription: 5\ntree:\n  sequence: [[], 3]\n"
    with pytest.raises(FileError) as caught:
        parse_task(FILE, text)
    places = [(m.place.line, m.place.column) for m in caught.value.mistakes]
    assert places == [(1, 1), (2, 7), (3, 14), (5, 14), (5, 18)]
    lines = str(caught.value).splitlines()
    assert len(lines) == 19  # each mistake with its line and a caret, two with a correction


@pytest.mark.slow
def test_very_many_mistakes_are_not_all_reported() -> None:
    text = f"{T}  sequence: [{', '.join(['{Say: []}'] * 1000)}]\n"
    with pytest.raises(FileError) as caught:
        parse_task(FILE, text)
    assert len(caught.value.mistakes) == 1000
    assert str(caught.value).splitlines()[-1] == "and 980 more mistakes"


@pytest.mark.parametrize("text", ["~: 7\ndescription: y\ntree: Succeed\n", "~: 7\n"])
def test_a_wrong_first_key_hides_nothing_of_what_it_stands_in(text: str) -> None:
    reported = [(m.place.line, m.place.column, m.message) for m in task_mistakes(FILE, text)]
    lacks = ["the key name is missing", "the key task is missing"]
    if "tree" not in text:
        keys = "expected the keys task, name, description, tree"
        lacks = [f"{keys}; `armtree new` writes a task that runs"]
    messages = sorted([*lacks, "the key null is not a text"])
    assert sorted(reported) == [(1, 1, message) for message in messages]


def test_a_value_that_is_refused_is_reported_once() -> None:
    for text in (HEAD.replace("3", "!!int 3"), HEAD.replace("3", "*a"), "!!map\n" + HEAD):
        (reported,) = task_mistakes(FILE, text + "tree: Succeed\n")
        assert "not allowed" in reported.message


def test_a_long_value_is_shortened() -> None:
    with pytest.raises(FileError) as caught:
        parse_task(FILE, HEAD.replace("3", str(list(range(5000)))))
    assert len(str(caught.value)) < 500


SUB = "subtree: s\ndescription: y\nports: [a, b]\ntree: {SetStart: {start: $a, x: $b}}\n"
WRONG_SUB = [
    (SUB.replace("[a, b]", "[{a: b}]"), 3, 9, "is not a name"),
    ("task: 3\n" + SUB, 1, 1, "unknown key task"),
    (SUB.replace("[a, b]", "a"), 3, 8, "ports: 'a' is not a mapping of names to types"),
    (SUB.replace("[a, b]", "{a: 1, b: 2}"), 3, 12, "ports: a needs a type, and 1 is a value"),
    (SUB.replace("[a, b]", "[a, b, 5]"), 3, 15, "ports: 5 is not a name"),
    (SUB.replace("[a, b]", "[a, b, {c: 1}]"), 3, 15, "is not a name"),
    (SUB.replace("[a, b]", "[a, b, $c]"), 3, 15, "ports: '$c' is not a name"),
    (SUB.replace("[a, b]", "[a, b, a]"), 3, 15, "ports: a is given twice"),
    (SUB.replace("[a, b]", "[a, b, c]"), 3, 15, "ports: nothing in the tree uses $c"),
    (SUB.replace("subtree: s", "subtree: [s]"), 1, 10, "subtree: [s] is not a name"),
]


@pytest.mark.parametrize(("text", "line", "column", "words"), WRONG_SUB, ids=range(len(WRONG_SUB)))
def test_wrong_subtree_files(text: str, line: int, column: int, words: str) -> None:
    mistakes = subtree_mistakes(Path("s.yaml"), text)
    assert any(words in m.message for m in mistakes if m.place.line == line)
    assert column in [m.place.column for m in mistakes]


def test_a_subtree() -> None:
    subtree, mistakes = draft_subtree(Path("s.yaml"), SUB)
    assert mistakes == []
    assert (subtree.name, list(subtree.parameters)) == ("s", ["a", "b"])


@settings(max_examples=200, deadline=None)
@given(st.text())
def test_any_text(text: str) -> None:
    for read in (task_mistakes, subtree_mistakes):
        read(FILE, text)


@pytest.mark.slow
@settings(max_examples=150, deadline=None)
@given(
    st.sampled_from([TASK, SUB, *SHIPPED]),
    st.lists(
        st.tuples(st.integers(0, 400), st.integers(0, 3), st.sampled_from(" \t\n:-{}[]$#'0aé"))
    ),
)
def test_any_change_of_a_file(text: str, changes: list[tuple[int, int, str]]) -> None:
    for at, cut, put in changes:
        place = at % (len(text) + 1)
        text = text[:place] + put + text[place + cut :]
    places: set[int] = set()
    for read in (task_mistakes, subtree_mistakes):
        places.update(mistake.place.line for mistake in read(FILE, text))
    assert 0 not in places


def test_a_task_says_that_it_may_run_again() -> None:
    head = "task: 3\nname: x\ndescription: y\n"
    plain, safe = f"{head}tree:\n  Succeed:\n", f"{head}retry: safe\ntree:\n  Succeed:\n"
    assert [parse_task(FILE, each).retry_safe for each in (plain, safe)] == [False, True]
    (wrong,) = task_mistakes(FILE, safe.replace("safe", "always"))
    assert str(wrong.message) == "retry: 'always' is not safe, the only value of this key"
    first, *_ = task_mistakes(FILE, f"{head}retry:\n  Succeed:\n")
    assert first.message == "retry must be below the key tree"

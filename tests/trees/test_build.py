"""From files to trees: what a task may say about skills, ports and keys, and what not."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings, strategies as st
from py_trees.blackboard import Blackboard
from py_trees.composites import Sequence

from hardware import Arm, Robot, SimulatedClock
from skills import BadTarget, Context, OutOfBounds, SkillError
from skills.leaves.check_bounds import CheckBounds
from skills.leaves.execute import Execute
from skills.motion import Pool
from trees import FileError, Library
from trees.build import Tree, build
from trees.compile.compiler import MAX_NODES
from trees.export.resolved import RESOLVED
from trees.nodes.parallel import Join

HEAD = "task: 3\nname: x\ndescription: y\ntree:\n  sequence:\n"
SUB = "subtree: {name}\ndescription: y\nports: [{ports}]\ntree: {tree}\n"


@dataclass
class Shop:
    """Writes files and builds them."""

    folder: Path
    context: Context

    def write(self, name: str, text: str) -> None:
        (self.folder / name).write_text(text)

    def subtree(self, name: str, ports: str, tree: str) -> None:
        self.write(f"{name}.yaml", SUB.format(name=name, ports=ports, tree=tree))

    def build(self, *lines: str) -> Tree:
        self.write("3_x.yaml", HEAD + "".join(f"    {line}\n" for line in lines))
        library = Library(self.folder)
        return build(library.draft(3), library, self.context, "run")


@pytest.fixture
def shop(robot: Robot, shared_clock: SimulatedClock, tmp_path: Path) -> Iterator[Shop]:
    arm = Arm(robot, None, shared_clock)
    pool = Pool(robot, 1, shared_clock)  # never started
    nothing: Callable[..., None] = lambda *_: None  # noqa: E731
    context = Context(robot, arm, pool, 1, 5.0, nothing, nothing, shared_clock, nothing)
    yield Shop(tmp_path, context)
    assert (Blackboard.storage, Blackboard.metadata, Blackboard.clients) == ({}, {}, {})


START = "- SetStart: {start: $start}"
BOUNDS = (
    "- CheckBounds: {arm: {joint_1: 0, joint_2: 0, joint_3: 0}, gripper: {joint_4: 0}, goal: $goal}"
)
PLAN = "- PlanArm: {start: $start, goal: $goal, plan: $plan}"

WRONG = [
    (["- Sukseed"], 6, 7, "no skill Sukseed; did you mean Succeed?"),
    (["- Suceed"], 6, 7, "did you mean Succeed?"),
    (["- succeed"], 6, 7, "did you mean Succeed?"),
    (["- subtree: rech"], 6, 16, "no subtree rech; did you mean reach?"),
    (["- subtree: rech"], 6, 16, "did you mean reach?"),
    (["- Skill"], 6, 7, "no skill Skill"),
    (["- _PlanGroup"], 6, 7, "is not a name"),
    (["- SetStart: {strat: $start}"], 6, 18, "strat is not a port of SetStart; there is only"),
    (["- Succeed: {speed: 1}"], 6, 17, "speed is not a port of Succeed; there are none"),
    (["- SetStart:", "    strat:", "      $start"], 7, 9, "there is only start"),
    (["- SetStart: {start: 5}"], 6, 25, "SetStart writes start; name a key such as $start"),
    (["- SetStart: {start: start}"], 6, 25, "name a key such as $start"),
    ([BOUNDS, PLAN], 7, 24, "nothing has written $start when PlanArm.start reads it"),
    ([PLAN, START, BOUNDS], 6, 24, "nothing has written $start"),
    ([START, PLAN.replace("$goal", "$gaol"), BOUNDS], 7, 38, "nothing has written $gaol"),
    ([START, PLAN.replace("goal: $goal, ", "")], 7, 7, "PlanArm needs goal: target of every"),
    (["- AddSphere: {body: b, position: 3, radius: 1}"], 6, 38, "not a list, each item a length"),
    (["- AddSphere: {body: b, position: [1, 2], radius: 1}"], 6, 38, "has 2 items, not 3"),
    (
        ["- AddSphere: {body: b, position: [1, 2 s, 3], radius: 1}"],
        6,
        42,
        "no unit s; there are cm",
    ),
    (["- AddBox: {body: b, position: [0, 0, 0], size: [1, 0, 1]}"], 6, 56, "is less than 0.001 mm"),
    ([START, PLAN.replace("plan:", "via: [{joint_1: x}], plan:")], 7, 61, "is not an angle in rad"),
    ([START, PLAN.replace("plan:", "via: [nowhere], plan:")], 7, 51, "no pose nowhere"),
    (["- Attach: {body: b, link: c, touches: [a]}"], 6, 34, "touches is not a port of Attach"),
    ([START, PLAN.replace("$goal", "5")], 7, 38, "PlanArm.goal: 5 is not a mapping from joint"),
    ([START, PLAN.replace("$goal", "goal")], 7, 38, "PlanArm.goal: no pose goal; there are"),
    ([START, PLAN.replace("$goal", "[0]")], 7, 38, "is not a mapping"),
    (
        [START, PLAN.replace("$goal", "{joint_1: true}")],
        7,
        48,
        "true is not an angle in rad or deg",
    ),
    ([START, PLAN.replace("$goal", "{joint_1: $x}")], 7, 48, "there is no parameter for $x"),
    ([START, PLAN.replace("$goal", "{joint_1: 1_0}")], 7, 48, "'1_0' is not an angle"),
    ([START, PLAN.replace("$goal", "{joint_1: 1:30}")], 7, 48, "'1:30' is not an angle"),
    (
        [START, BOUNDS, PLAN, "- Execute: {arm_plan: $plan, gripper_plan: $start}"],
        9,
        48,
        "$start is a mapping from joint names to angles, or a pose, not a Plan",
    ),
    (
        [START, BOUNDS, PLAN, "- Execute: {arm_plan: $plan, gripper_plan: 1}"],
        9,
        48,
        "Execute.gripper_plan: 1 is not a Plan",
    ),
    (
        [
            START,
            BOUNDS,
            PLAN,
            "- Execute: {arm_plan: $plan, gripper_plan: $plan, together: 'true'}",
        ],
        9,
        65,
        "Execute.together: 'true' is not true or false",
    ),
    (
        [START, BOUNDS, PLAN, "- Execute: {arm_plan: $plan, gripper_plan: $plan, together: 1}"],
        9,
        65,
        "is not true or false",
    ),
    (
        ["- parallel:", "    " + START, "    " + BOUNDS, "    " + PLAN],
        9,
        28,
        "nothing has written $start",
    ),
    (["- subtree: rech"], 6, 16, "did you mean reach?"),
    (["- subtree: reach"], 6, 7, "subtree reach needs arm"),
    (["- subtree: reach", "  with: {arm: {}}"], 6, 7, "subtree reach needs gripper"),
    (
        ["- subtree: reach", "  with: {arm: {}, gripper: {}, griper: {}}"],
        7,
        36,
        "griper is not a port of subtree reach; there are arm, gripper; did you mean gripper?",
    ),
    (
        ["- subtree: reach", "  with: {arm: $arm, gripper: {}}"],
        7,
        19,
        "nothing has written $arm when CheckBounds.arm reads it",
    ),
    (
        ["- subtree: reach", "  with: {arm: 5, gripper: {}}"],
        7,
        19,
        "arm: 5 is not a mapping",
    ),
]


@pytest.mark.parametrize(("lines", "line", "column", "words"), WRONG, ids=range(len(WRONG)))
def test_mistakes_have_their_places(
    shop: Shop, lines: list[str], line: int, column: int, words: str
) -> None:
    with pytest.raises(FileError) as caught:
        shop.build(*lines)
    said = [
        mistake.message
        for mistake in caught.value.mistakes
        if (mistake.place.line, mistake.place.column) == (line, column)
    ]
    assert any(words in message for message in said), str(caught.value)


def test_a_subtree_that_needs_more_is_not_blamed_itself(shop: Shop) -> None:
    with pytest.raises(FileError) as caught:
        shop.build("- subtree: reach")
    assert {mistake.place.path.name for mistake in caught.value.mistakes} == {"3_x.yaml"}


def test_a_broken_subtree_is_reported_once(shop: Shop) -> None:
    shop.subtree("a", "", "Sukseed")
    shop.write("b.yaml", "subtree: b\n")
    with pytest.raises(FileError) as caught:
        shop.build("- subtree: a", "- subtree: a", "- subtree: b", "- subtree: b")
    names = [mistake.place.path.name for mistake in caught.value.mistakes]
    assert names.count("a.yaml") == 1
    assert names == sorted(names)


def test_subtrees_that_hold_themselves(shop: Shop) -> None:
    shop.subtree("a", "", "{subtree: b}")
    shop.subtree("b", "", "{sequence: [Succeed, subtree: a]}")
    with pytest.raises(
        FileError, match=r"b.yaml:4:28: a would contain itself: a -> b \(a.yaml:\d+\) -> a \(b"
    ):
        shop.build("- subtree: a")


def test_subtrees_too_deep_in_each_other(shop: Shop) -> None:
    for number in range(20):
        shop.subtree(f"s{number}", "", f"{{subtree: s{number + 1}}}")
    with pytest.raises(FileError, match="more than 8 nested subtrees"):
        shop.build("- subtree: s0")


@pytest.mark.slow
def test_a_bomb_of_subtrees(shop: Shop) -> None:
    for number in range(7):
        many = ", ".join([f"subtree: s{number + 1}"] * 20)
        shop.subtree(f"s{number}", "", f"{{sequence: [{many}]}}")
    shop.subtree("s7", "", "Succeed")
    with pytest.raises(FileError, match=f"the tree has more than {MAX_NODES} nodes"):
        shop.build("- subtree: s0")


def ports(tree: Tree, kind: type) -> list[dict[str, object]]:
    skills = [skill for skill in tree.skills if isinstance(skill, kind)]
    return [{port: skill.get_input(port) for port in ("arm", "gripper")} for skill in skills]


def test_what_is_built(shop: Shop) -> None:
    tree = shop.build(START, BOUNDS, "- parallel: [Succeed, Succeed]")
    assert isinstance(tree.root, Sequence)
    assert tree.root.name == "x"
    assert [child.name for child in tree.root.children] == ["SetStart", "CheckBounds", "parallel"]
    assert isinstance(tree.root.children[2], Join)
    assert list(tree.files) == ["3_x.yaml", RESOLVED]
    tree.discard()


def test_a_subtree_twice_keeps_its_values_apart(shop: Shop) -> None:
    def use(value: float) -> list[str]:
        arm = f"{{joint_1: {value}, joint_2: 0, joint_3: 0}}"
        return ["- subtree: reach", f"  with: {{arm: {arm}, gripper: {{joint_4: 0}}}}"]

    tree = shop.build(*use(0.5), *use(1))
    targets = [values["arm"] for values in ports(tree, CheckBounds)]
    assert targets == [
        {"joint_1": 0.5, "joint_2": 0.0, "joint_3": 0.0},
        {"joint_1": 1.0, "joint_2": 0.0, "joint_3": 0.0},
    ]
    keys = [key for key in Blackboard.metadata if key.endswith("/start")]
    assert len(keys) == 2
    assert sorted(tree.files) == ["3_x.yaml", "reach.yaml", RESOLVED]
    tree.discard()


def test_only_one_node_of_a_parallel_may_move_the_arm(shop: Shop) -> None:
    reach = "      - subtree: reach"
    target = "{arm: {joint_1: 0, joint_2: 0, joint_3: 0}, gripper: {joint_4: 0}}"
    lines = ["- parallel:", *[reach, f"        with: {target}"] * 2]
    with pytest.raises(FileError, match=r"3_x\.yaml:6:7: only one node of a parallel may move"):
        shop.build(*lines)


def test_a_value_goes_through_two_subtrees(shop: Shop) -> None:
    shop.subtree("outer", "a", "{subtree: reach, with: {arm: $a, gripper: {joint_4: 0}}}")
    arm = "{joint_1: 0.5, joint_2: 0, joint_3: 0}"
    tree = shop.build("- subtree: outer", f"  with: {{a: {arm}}}")
    assert ports(tree, CheckBounds)[0]["arm"] == {"joint_1": 0.5, "joint_2": 0.0, "joint_3": 0.0}
    tree.discard()


def test_a_subtree_may_write_a_key_of_its_caller(shop: Shop) -> None:
    shop.subtree("begin", "where", "{SetStart: {start: $where}}")
    tree = shop.build(
        "- subtree: begin", "  with: {where: $here}", BOUNDS, PLAN.replace("$start", "$here")
    )
    tree.discard()


def test_a_key_written_in_a_parallel_may_be_read_after_it(shop: Shop) -> None:
    tree = shop.build("- parallel:", "    " + START, "    " + BOUNDS, PLAN)
    tree.discard()


def test_defaults_need_no_wire(shop: Shop) -> None:
    tree = shop.build(START, BOUNDS, PLAN, "- Execute: {arm_plan: $plan, gripper_plan: $plan}")
    (execute,) = [skill for skill in tree.skills if isinstance(skill, Execute)]
    assert execute.get_input("together") is False
    tree.discard()


REFUSED: list[tuple[type[Exception], str, str]] = [
    (OutOfBounds, "joint_1: 9, joint_2: 0, joint_3: -9", "joint_1.*joint_3"),
    (BadTarget, "joint_1: 0, joint_2: 0", "joint_3 is missing"),
    (BadTarget, "joint_1: 0, joint_2: 0, joint_3: 0, joint_9: 0", "joint_9 is not a joint of"),
]


@pytest.mark.parametrize(("error", "target", "words"), REFUSED)
def test_a_skill_refuses_what_is_spelled_out(
    shop: Shop, error: type[Exception], target: str, words: str
) -> None:
    line = BOUNDS.replace("joint_1: 0, joint_2: 0, joint_3: 0", target)
    with pytest.raises(error, match=words):
        shop.build(START, line)


def test_nothing_is_left_behind(shop: Shop) -> None:
    tree = shop.build(START, BOUNDS, PLAN)
    assert Blackboard.clients
    tree.discard()


def test_two_trees_do_not_meet(shop: Shop) -> None:
    library = Library(shop.folder)
    build_one: Callable[[str], Tree] = lambda name: build(  # noqa: E731
        library.draft(1), library, shop.context, name
    )
    first, second = build_one("run_1"), build_one("run_2")
    first.discard()
    assert ports(second, CheckBounds)[0]["gripper"] == {"joint_4": 0.0, "joint_5": 0.0}
    second.discard()


@pytest.mark.slow
@settings(
    max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(
    st.lists(
        st.tuples(st.integers(0, 600), st.integers(0, 4), st.sampled_from(" \n:-{}[]$'01aé")),
        max_size=4,
    )
)
def test_any_change_of_a_task_is_built_or_refused(
    shop: Shop, changes: list[tuple[int, int, str]]
) -> None:
    text = HEAD + "".join(f"    {line}\n" for line in (START, BOUNDS, PLAN))
    text += "    - subtree: reach\n      with: {arm: $goal, gripper: {joint_4: 0}}\n"
    for at, cut, put in changes:
        place = at % (len(text) + 1)
        text = text[:place] + put + text[place + cut :]
    (shop.folder / "3_x.yaml").write_text(text)
    library = Library(shop.folder)
    try:
        build(library.draft(3), library, shop.context, "run").discard()
    except (FileError, SkillError) as error:
        assert str(error)  # noqa: PT017  what matters is that nothing else comes out

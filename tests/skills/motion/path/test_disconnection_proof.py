"""If a joint cannot pass a position, the planner reports at once that there is no path."""

import dataclasses
from math import cos, pi, radians, sin
from pathlib import Path

import numpy as np
import pytest

from hardware import CollisionRules, Robot, load_robot
from skills.motion import Barred, Body, Box, MotionError, NoPath, PlanTimeout, Query, World
from skills.motion.path import disconnection_proof
from skills.motion.planner import Planner
from tests.support.arms.robots import foreign, pair_file, robot_of

UPRIGHT = (0.0,) * 6
# The column of the arm that turns without end holds a bar, and posts stand where that would pass.
BAR = Body("bar", Box((0.6, 0.02, 0.02)), (0.5, 0.0, 0.1), link="column")
LEFT = Body("left", Box((0.05, 0.05, 0.3)), (0.0, 0.6, 0.1))
RIGHT = Body("right", Box((0.05, 0.05, 0.3)), (0.0, -0.6, 0.1))
ACROSS = (radians(150.0), 0.0, 0.0, 0.0, 0.0, 0.0)


LEADER_URDF = """<robot name="arm">
<link name="base"/>
<link name="a"><collision><origin xyz="0.2 0 0"/><geometry><box size=".2 .02 .02"/></geometry>
</collision></link><link name="b"/>
<joint name="lead" type="continuous"><parent link="base"/><child link="a"/>
<axis xyz="0 0 1"/><limit velocity="2" effort="1"/></joint>
<joint name="mate" type="continuous"><parent link="base"/><child link="b"/>
<axis xyz="0 0 1"/><limit velocity="2" effort="1"/><mimic joint="lead"/></joint>
</robot>"""

# The link `fork` is two bars, one above the other: its hull contains the gap between them.
FORK_URDF = """<robot name="arm">
<link name="base"/>
<link name="fork">
<collision><origin xyz="0.3 0 0"/><geometry><box size=".4 .02 .02"/></geometry></collision>
<collision><origin xyz="0.3 0 0.4"/><geometry><box size=".4 .02 .02"/></geometry></collision>
</link>
<link name="blade">
<collision><origin xyz="0.17 0 0"/><geometry><box size=".26 .02 .02"/></geometry></collision>
</link>
<joint name="turn" type="revolute"><parent link="base"/><child link="fork"/>
<axis xyz="0 0 1"/><limit lower="-3" upper="3" velocity="2" effort="1"/></joint>
<joint name="fold" type="revolute"><parent link="fork"/><child link="blade"/>
<origin xyz="0.5 0 0.2"/><axis xyz="0 0 1"/>
<limit lower="-2" upper="2" velocity="2" effort="1"/></joint>
</robot>"""


@pytest.fixture(scope="module")
def rolling() -> Robot:
    """Six axes over a floor. Without the floor the second joint could make a whole turn."""
    robot = foreign("six_axes")
    turn, lift, *rest = robot.joints
    joints = (turn, dataclasses.replace(lift, lower=-2.0 * pi, upper=2.0 * pi), *rest)
    rules = robot.collision
    floor = CollisionRules(rules.margin, rules.allowed, 0.0, frozenset(("base", "shoulder")))
    return dataclasses.replace(robot, joints=joints, collision=floor)


def test_a_motion_through_the_floor(rolling: Robot) -> None:
    with pytest.raises(Barred) as caught:
        Planner(rolling).plan(Query("arm", UPRIGHT, (0.0, 2.0 * pi, 0.0, 0.0, 0.0, 0.0)))
    error = caught.value
    assert (error.joint, error.unit, error.first, error.second) == (
        "lift", "rad", "upper_arm", "floor",
    )  # fmt: skip
    assert 0.25 * pi < error.value < 1.75 * pi
    assert "lift would have to pass" in str(error)


def test_a_continuous_joint_takes_the_other_direction() -> None:
    planner = Planner(foreign("endless"))
    plan = planner.plan(Query("arm", UPRIGHT, ACROSS, world=World((BAR, LEFT))))
    assert plan.goal[0] == pytest.approx(radians(150.0 - 360.0))


def test_a_continuous_joint_that_is_blocked_in_both_directions() -> None:
    planner = Planner(foreign("endless"))
    with pytest.raises(Barred, match=r"turn would have to pass \d+\.?\d* deg, where bar .* left"):
        planner.plan(Query("arm", UPRIGHT, ACROSS, world=World((BAR, LEFT, RIGHT))))


def test_two_continuous_joints_that_must_take_the_other_direction() -> None:
    stick = Body(
        "stick", Box((0.3, 0.01, 0.01)), (0.2, 0.0, 0.05), link="fist",
        touches=frozenset(("wrist_bend",)),
    )  # fmt: skip
    peg = Body(
        "peg", Box((0.02, 0.02, 0.1)), (0.0, 0.2, 0.13), link="wrist_bend",
        touches=frozenset(("fist", "column", "forearm")),
    )  # fmt: skip
    goal = (ACROSS[0], 0.0, 0.0, 0.0, 0.0, ACROSS[0])
    query = Query("arm", UPRIGHT, goal, world=World((BAR, LEFT, stick, peg)), timeout=30.0)
    plan = Planner(foreign("endless")).plan(query)
    assert plan.goal[[0, 5]] == pytest.approx(radians(150.0 - 360.0))


def test_a_via_point_that_is_reached_in_the_other_direction() -> None:
    lifted = (ACROSS[0], 0.3, 0.0, 0.0, 0.0, 0.0)
    world = World((BAR, LEFT))
    query = Query("arm", UPRIGHT, lifted, via=(ACROSS,), world=world, timeout=30.0)
    plan = Planner(foreign("endless")).plan(query)
    turned = np.array(ACROSS) - [2.0 * pi, *UPRIGHT[1:]]
    assert plan.goal == pytest.approx([turned[0], 0.3, *turned[2:]])
    times = np.linspace(0.0, plan.duration, 2000)
    assert np.linalg.norm(plan.sample(times) - turned, axis=1).min() < 0.02


def test_a_continuous_leader_is_never_barred(tmp_path: Path) -> None:
    (tmp_path / "arm.urdf").write_text(LEADER_URDF)
    (tmp_path / "arm.toml").write_text(pair_file("lead", "mate"))
    post = Body("post", Box((0.03, 0.03, 0.3)), (-0.2, 0.05, 0.0))
    planner = Planner(load_robot(tmp_path / "arm.toml"))
    query = Query("arm", (0.0,), (radians(300.0),), world=World((post,)), timeout=0.1)
    with pytest.raises((NoPath, PlanTimeout)):
        planner.plan(query)


def test_a_contact_of_other_links_is_no_barrier(tmp_path: Path) -> None:
    """A joint turns the gap of a fork past a block. On the line, the blade behind hits posts."""
    (tmp_path / "fork.urdf").write_text(FORK_URDF)
    block = Body("block", Box((0.04, 0.04, 0.04)), (0.3, 0.0, 0.2))
    posts = [
        Body(f"post_{i}", Box((0.04, 0.04, 0.2)), (0.75 * cos(angle), 0.75 * sin(angle), 0.2))
        for i, angle in enumerate(np.linspace(-1.0, 1.0, 41).tolist())
    ]
    query = Query("arm", (-1.3, 0.0), (1.3, 0.0), world=World((block, *posts)), timeout=30.0)
    plan = Planner(robot_of(tmp_path / "fork.urdf", margin=0.005)).plan(query)
    assert "search" in plan.milliseconds


@pytest.mark.slow
def test_no_search_finds_a_barred_path(rolling: Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    """Compares the proof with the result of a search."""
    planner, random, results = Planner(rolling), np.random.default_rng(1), list[tuple[bool, bool]]()
    lower, upper = [-2.9, -6.28, -2.5, -2.9, -2.0, -2.9], [2.9, 6.28, 2.5, 2.9, 2.0, 2.9]
    check, barred = disconnection_proof.check_passable, list[bool]()

    def noted(*arguments: object) -> None:
        try:
            check(*arguments)  # type: ignore[arg-type]
        except Barred:
            barred.append(True)

    monkeypatch.setattr("skills.motion.planner.check_passable", noted)
    monkeypatch.setattr("skills.motion.path.rrt_connect._FIRST_SAMPLES", 300)
    monkeypatch.setattr("skills.motion.path.rrt_connect._MAX_SEARCHES", 1)
    for start, goal in random.uniform(lower, upper, (120, 2, 6)).tolist():
        barred.clear()
        try:
            found = bool(planner.plan(Query("arm", tuple(start), tuple(goal))))
        except MotionError:
            found = False
        results.append((bool(barred), found))
    assert (True, True) not in results
    assert results.count((True, False)) > 5

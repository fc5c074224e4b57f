"""A motion of the SO-101 may start in the contacts of its folded arm, and deepens none."""

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from hardware import SimulatedClock, load_robot
from skills.motion import GoalInCollision, MotionCollides, PlanTimeout, StartInCollision, Verify
from skills.motion.collision.start_contacts import StartContacts
from skills.motion.deadline import Deadline
from skills.motion.errors import ContactDeepened
from skills.motion.planner import Planner
from skills.motion.query import Query
from skills.motion.trajectory.plan import Plan
from skills.motion.world import EMPTY, Body, Box, World

pytestmark = pytest.mark.slow

SO101 = load_robot(Path("so101"))
DEPTH = SO101.collision.start_contact
Pose = tuple[float, ...]  # [deg]
READY, REST = (0, -40, 40, 60, 0), (0, -90, 80, 60, 0)
# Poses as they are when the power is on: the forearm rests on the shoulder, the hand on the table.
FOLDED, ON_TABLE, BOTH = (0, -100, 91, 50, 0, 0), (0, -80, 90, 50, 0, 0), (0, -98, 93, 70, 0, 0)


@pytest.fixture(scope="module")
def planner() -> Planner:
    return Planner(SO101)


def query(start: Pose, goal: Pose, group: str = "arm") -> Query:
    # A busy machine may need longer than the default timeout.
    return Query(group, tuple(np.radians(start)), tuple(np.radians(goal)), timeout=60.0)


def depths(planner: Planner, plan: Plan) -> list[float]:
    """Depth of the deepest contact along a plan of the arm [m]."""
    rows = np.tile(plan.start, (12, 1))
    rows[:, : len(plan.joints)] = plan.sample(np.linspace(0.0, plan.duration, 12))
    nearest = [planner.checker.nearest(row) for row in rows]
    return [-each.distance for each in nearest if each]


@pytest.mark.parametrize(
    ("start", "goal"), [(FOLDED, READY), (ON_TABLE, REST), ((0, -99, 95.5, 39, 0, 0), REST)]
)
def test_a_folded_arm_leaves_its_contacts(planner: Planner, start: Pose, goal: Pose) -> None:
    plan = planner.plan(query(start, goal))
    before, *after = depths(planner, plan)
    assert 0.0 < before < DEPTH
    assert max(after) < before + 0.001
    assert after[-1] < -SO101.collision.margin


@pytest.mark.parametrize(
    ("start", "goal"),
    [
        (BOTH, READY),  # the gripper would turn into the shoulder
        ((29, -77, 91, 17, -13, 7), (-23, -87, 73, 35, -12)),  # past a wall that it touches
        ((-14, -95, 93, 45, 66, 5), (-48, -78, 46, -30, -145)),
        ((4, -70, 91, 29, -81, -7), (96, 9, 60, -57, 123)),
    ],
)
def test_a_motion_that_would_deepen_a_contact_first_leaves_it(
    planner: Planner, start: Pose, goal: Pose
) -> None:
    """All links keep the margin afterwards, also those that touched."""
    world = World((Body("wall", Box((0.02, 0.4, 0.12)), (0.22, -0.05, 0.0)),))
    plan = planner.plan(replace(query(start, goal), world=world if start != BOTH else EMPTY))
    rows = np.tile(plan.start, (60, 1))
    rows[:, : len(plan.joints)] = plan.sample(np.linspace(0.0, plan.duration, 60))
    checker, margin = planner.checker if start == BOTH else planner._checker(world), 0.005
    free = [not checker.contacts(row, 0.5 * margin) for row in rows]
    assert not free[0]
    out = free.index(True)
    assert out < 40
    assert all(free[out:])


def test_only_the_contacts_of_the_start_count(planner: Planner) -> None:
    checker, margin = planner.checker, SO101.collision.margin
    contacts = StartContacts(checker, np.radians(FOLDED), margin)
    both = checker.contacts(np.radians(BOTH), margin)
    assert contacts.clearance(np.radians((*READY, 0))) == 0.0
    ((pair, own),) = ((k, each) for k, each in both.items() if set(each[:2]) in contacts.pairs)
    assert len(both) > 1
    assert contacts.clearance(np.radians(BOTH)) == round(own.distance - margin, 6)
    assert list(checker.contacts(np.radians(BOTH), margin, [pair])) == [pair]


def test_joints_that_do_not_change_a_contact_move(planner: Planner) -> None:
    assert planner.plan(query(FOLDED, (20, *FOLDED[1:5]))).curve.straight
    assert planner.plan(query(FOLDED, (60,), "gripper")).duration > 1.0
    assert planner.plan(query(FOLDED, (0, -100, 90, 50, 0))).duration < 0.3


def test_a_goal_may_not_be_deeper(planner: Planner) -> None:
    with pytest.raises(GoalInCollision, match=r"shoulder_link would be .* in lower_arm_link"):
        planner.plan(query(FOLDED, (0, -100, 92, 50, 0)))


def test_motion_after_motion_closes_no_gap(planner: Planner) -> None:
    poses = [(0.0, -100.0, 89.0 + 0.4 * number, 50.0, 0.0) for number in range(20)]
    reached = poses[:1]  # some millimetres before the contact

    def close() -> None:
        for start, goal in pairwise(poses):
            planner.plan(query((*start, 0), goal))
            reached.append(goal)

    with pytest.raises(GoalInCollision, match="lower_arm_link"):
        close()
    nearest = planner.checker.nearest(np.radians((*reached[-1], 0)))
    assert nearest
    assert 0.0 < nearest.distance < 0.002


def test_other_links_keep_the_margin(planner: Planner) -> None:
    with pytest.raises(GoalInCollision, match="gripper_link"):
        planner.plan(query(FOLDED, (0, 0, 80, 90, 0)))


def test_a_motion_that_can_only_deepen_a_contact_is_refused() -> None:
    """The jaw, alone, must pass the table."""
    table = frozenset(("base_link", "shoulder_link"))
    rules = replace(SO101.collision, floor=0.03, floor_ignores=table)
    planner = Planner(replace(SO101, collision=rules))
    with pytest.raises(
        ContactDeepened, match=r"jaw.* floor .*would make this contact deeper.* by hand"
    ):
        planner.plan(query((0, 0, 20, 90, 0, -10), (95,), "gripper"))


def test_a_refusal_names_the_links_that_would_come_closer(planner: Planner) -> None:
    """The forearm rests on the shoulder, deeper. The jaw is 4 mm above the table."""
    with pytest.raises(ContactDeepened, match=r"jaw.* within 3\.\d mm of floor"):
        planner.plan(query((0, -100, 92, 70, 90, -10), (60,), "gripper"))


def test_a_deeper_start_is_refused_with_the_way_out(planner: Planner) -> None:
    with pytest.raises(StartInCollision) as caught:
        planner.plan(query((0, -99, 95.3, 75, 0, 0), READY))
    assert -caught.value.distance > DEPTH
    assert "by hand, with its power off if it holds" in str(caught.value)


def test_without_the_key_a_start_keeps_the_margin() -> None:
    rules = replace(SO101.collision, start_contact=0.0)
    planner = Planner(replace(SO101, collision=rules))
    with pytest.raises(StartInCollision):
        planner.plan(query(FOLDED, READY))


def test_frames_may_start_in_a_contact_and_a_pose_may_not(planner: Planner) -> None:
    folded, deeper, out = np.radians([FOLDED, (0, -100, 93, 50, 0, 0), (0, -100, 85, 50, 0, 0)])
    planner.verify(Verify([folded, out], 0.001))
    for rows in [folded], [folded, deeper], [out, folded]:
        with pytest.raises(MotionCollides, match="lower_arm_link"):
            planner.verify(Verify(rows, 0.001))
    # Steps of a longer motion count from its start, so that they cannot creep deeper.
    creeping = np.radians([(0, -100, 91.4, 50, 0, 0), (0, -100, 91.8, 50, 0, 0)])
    planner.verify(Verify(creeping, 0.001))
    with pytest.raises(MotionCollides):
        planner.verify(Verify(creeping, 0.001, start=tuple(folded)))
    planner.verify(Verify([out, folded], 0.001, start=tuple(folded)))


def test_the_deadline_covers_the_way_out(planner: Planner) -> None:
    with pytest.raises(PlanTimeout) as caught:
        planner.plan(replace(query(BOTH, READY), timeout=0.02))
    assert "straight" not in caught.value.milliseconds


def test_depths_of_contacts_keep_the_deadline(planner: Planner) -> None:
    """A depth takes milliseconds, and a motion out of contacts measures hundreds."""
    checker, folded = planner.checker, np.radians(FOLDED)
    with checker.within(Deadline(SimulatedClock(), -1.0)):
        with pytest.raises(PlanTimeout):
            checker.contacts(folded, SO101.collision.margin)
        with pytest.raises(PlanTimeout):
            checker.nearest(folded)

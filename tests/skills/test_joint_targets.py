"""Checks of targets: an error names every joint outside its limits, with value and limits."""

import dataclasses
import math

import pytest
from py_trees.common import Status

from hardware import Mimic, Robot
from skills import (
    BadTarget,
    OutOfBounds,
    Positions,
    SkillError,
    check_targets,
    known_errors,
    refuse,
)
from skills.joint_targets import (
    configuration_errors,
    distance_errors,
    joint_errors,
    link_errors,
    mimic_errors,
    missing_joint_errors,
    split_by_group,
    unknown_joint_errors,
)
from skills.leaves.check_bounds import CheckBounds
from skills.leaves.target import Shift, Target
from tests.conftest import Bench
from tests.support.arms.robots import foreign

ZERO = {"arm": {"joint_1": 0.0, "joint_2": 0.0, "joint_3": 0.0}, "gripper": {"joint_4": 0.0}}


def target(**joints: float) -> dict[str, dict[str, float]]:
    arm = {name: q for name, q in joints.items() if name in ("joint_1", "joint_2", "joint_3")}
    gripper = {name: q for name, q in joints.items() if name not in arm}
    return {"arm": {**ZERO["arm"], **arm}, "gripper": {**ZERO["gripper"], **gripper}}


def with_mimic(robot: Robot, multiplier: float, offset: float) -> Robot:
    """Return the robot with another law for joint_5, which follows joint_4."""
    follower = dataclasses.replace(
        robot.joint("joint_5"), mimic=Mimic("joint_4", multiplier, offset)
    )
    joints = tuple(follower if joint.name == follower.name else joint for joint in robot.joints)
    return dataclasses.replace(robot, joints=joints)


def test_the_limits_themselves_are_within(robot: Robot) -> None:
    for group in robot.groups:
        for joint in robot.actuated_in(group):
            for q in (joint.lower, joint.upper):
                check_targets(robot, target(**{joint.name: q}))


def test_the_next_number_is_out(robot: Robot) -> None:
    for group in robot.groups:
        for joint in robot.actuated_in(group):
            for q in (math.nextafter(joint.lower, -9), math.nextafter(joint.upper, 9)):
                with pytest.raises(OutOfBounds, match=joint.name):
                    check_targets(robot, target(**{joint.name: q}))


def test_every_joint_that_is_out_is_named(robot: Robot) -> None:
    wrong = target(joint_1=9.0, joint_2=-9.0, joint_3=math.inf, joint_4=math.nan)
    with pytest.raises(OutOfBounds) as caught:
        check_targets(robot, wrong)
    causes = str(caught.value).split("; ")
    assert [cause.split()[0] for cause in causes] == ["joint_1", "joint_2", "joint_3", "joint_4"]
    for cause, value in zip(causes, ("9", "-9", "inf", "nan"), strict=True):
        assert value in cause
    assert "-90 deg to 90 deg" in causes[0]


def test_a_mimic_joint_may_be_left_out_or_agree(robot: Robot) -> None:
    check_targets(robot, target(joint_4=-0.7))
    check_targets(robot, target(joint_4=-0.7, joint_5=0.7))
    check_targets(robot, target(joint_4=-(0.1 + 0.2), joint_5=0.3))
    check_targets(robot, target(joint_4=-(0.1 + 0.2 - 0.3), joint_5=0.0))


WRONG: list[tuple[dict[str, dict[str, float]], str]] = [
    ({"arm": {}}, "joint_1, joint_2, joint_3 are missing"),
    ({"arm": {"joint_1": 0.0}}, "joint_2, joint_3 are missing"),
    (target(joint_4=-0.7, joint_5=0.2), "joint_5 = 11.459 deg contradicts joint_4 = -40.107 deg"),
    ({"arm": {**ZERO["arm"], "joint_9": 0.0}, "gripper": {}},
     "^joint_9 is not a joint of the arm; the arm has joint_1, joint_2, joint_3; "
     "joint_4 is missing; the gripper has joint_4, joint_5$"),
    (target(joint_9=0.0), "joint_9 is not a joint of the gripper; the gripper has joint_4, "),
    ({"leg": {}}, "the robot has no group leg; it has arm, gripper"),
    ({**ZERO, "arm": ZERO["gripper"]}, "^the arm has joint_1, joint_2, joint_3, not joint_4$"),
    ({**ZERO, "gripper": {"joint_2": 0.0, "joint_1": 0.0}},
     "^the gripper has joint_4, joint_5, not joint_2, joint_1$"),
]  # fmt: skip


@pytest.mark.parametrize(("targets", "words"), WRONG)
def test_what_makes_no_sense(
    robot: Robot, targets: dict[str, dict[str, float]], words: str
) -> None:
    with pytest.raises(BadTarget, match=words):
        check_targets(robot, targets)


@pytest.mark.parametrize(
    ("targets", "kind", "way"),
    [({"arm": {}}, BadTarget, ("arm", "joint_1")),
     (target(joint_1=9.0, joint_4=9.0), OutOfBounds, ("arm", "joint_1")),
     (target(joint_4=9.0), OutOfBounds, ("gripper", "joint_4")),
     (target(joint_9=0.0), BadTarget, ("gripper", "joint_9")),
     ({**ZERO, "arm": ZERO["gripper"]}, BadTarget, ("arm", "arm"))],
)  # fmt: skip
def test_the_first_wrong_value_is_reported_with_its_place(
    robot: Robot,
    targets: dict[str, dict[str, float]],
    kind: type[SkillError],
    way: tuple[str, ...],
) -> None:
    with pytest.raises(kind) as caught:
        check_targets(robot, targets)
    assert caught.value.location == way
    with pytest.raises(kind) as caught:
        check_targets(robot, targets, ("goal", 3))
    assert caught.value.location == ("goal", 3, way[-1])


def test_a_configuration_names_every_joint_that_is_moved(robot: Robot) -> None:
    whole = {"joint_1": 0.0, "joint_2": 0.0, "joint_3": 0.0, "joint_4": 0.0}
    assert missing_joint_errors(robot, "start", whole) == []
    why = "the start lacks joint_2, joint_4; it must name joint_1, joint_2, joint_3, joint_4"
    (error,) = missing_joint_errors(robot, "start", {"joint_1": 0.0, "joint_3": 0.0})
    assert str(error) == why
    assert error.location == ("start",)


def test_every_error_of_a_configuration_names_its_place(robot: Robot) -> None:
    whole = {"joint_1": 0.0, "joint_2": 0.0, "joint_3": 0.0, "joint_4": 0.0}
    assert configuration_errors(robot, "goal", whole) == []
    wrong = {"joint_1": 9.0, "joint_2": 0.0, "joint_4": -0.7, "joint_5": 0.2, "elbow": 0.0}
    outside, contradiction, missing, unknown = configuration_errors(robot, "goal", wrong)
    assert isinstance(outside, OutOfBounds)
    assert outside.location == ("goal", "joint_1")
    assert str(contradiction).startswith("joint_5 = 11.459 deg contradicts joint_4 = -40.107 deg")
    assert contradiction.location == ("goal", "joint_5")
    assert isinstance(contradiction, BadTarget)
    assert contradiction.superfluous is True
    assert str(missing).startswith("the goal lacks joint_3; it must name")
    assert missing.location == ("goal",)
    assert str(unknown).startswith("elbow is not a joint of the robot")
    assert unknown.location == ("goal", "elbow")


def test_a_link_is_one_of_the_robots(robot: Robot) -> None:
    for name in robot.links:
        refuse(link_errors(robot, "to", name))
    with pytest.raises(BadTarget) as caught:
        refuse(link_errors(robot, "to", "claw"))
    there = f"it has {', '.join(robot.links)}; did you mean claw_support?"
    assert str(caught.value) == f"the robot has no link claw; {there}"
    assert caught.value.location == ("to",)


def test_joints_are_distinguished_by_their_groups(robot: Robot) -> None:
    assert split_by_group(robot, {"joint_4": 0.1, "joint_1": 0.2}, "to") == {
        "arm": {"joint_1": 0.2},
        "gripper": {"joint_4": 0.1},
    }
    why = (
        "^joint_8 is not a joint of the robot; it has joint_1, joint_2, joint_3 .arm. and joint_4 "
        ".*; joint_9 is not a joint of the robot"
    )
    with pytest.raises(BadTarget, match=why) as caught:
        split_by_group(robot, {"joint_8": 0.0, "joint_1": 0.0, "joint_9": 0.0}, "to")
    assert caught.value.location == ("to", "joint_8")


def test_a_joint_that_is_named_already_is_not_suggested(robot: Robot) -> None:
    joints = {"joint_1": 0.0, "jont_1": 0.0}
    (error,) = unknown_joint_errors(robot, joints, "to")
    assert str(error).endswith("(arm) and joint_4 (gripper)")


@pytest.mark.parametrize(
    ("multiplier", "offset", "law"),
    [(-1.0, 0.0, "-1 times joint_4"), (0.5, 0.1, "0.5 times joint_4 plus 5.7296 deg")],
)
def test_a_contradiction_names_both_positions_and_how_the_joint_follows(
    robot: Robot, multiplier: float, offset: float, law: str
) -> None:
    with pytest.raises(BadTarget) as caught:
        check_targets(with_mimic(robot, multiplier, offset), target(joint_4=-0.7, joint_5=0.2))
    positions = "joint_5 = 11.459 deg contradicts joint_4 = -40.107 deg"
    assert str(caught.value) == f"{positions}: joint_5 is always {law}; leave joint_5 out"


def test_after_a_contradiction_the_joints_that_come_later_are_checked(robot: Robot) -> None:
    follower_first = dataclasses.replace(robot, joints=robot.joints[::-1])
    wrong = {**START, "joint_1": 9.0, "joint_5": 0.2}
    errors = configuration_errors(follower_first, "goal", wrong)
    assert [error.location for error in errors] == [("goal", "joint_5"), ("goal", "joint_1")]


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_a_mimic_joint_that_is_no_finite_number_is_out_of_bounds(
    robot: Robot, value: float
) -> None:
    with pytest.raises(OutOfBounds, match=f"^joint_5 = {value} is not a finite number$"):
        check_targets(robot, target(joint_4=-0.7, joint_5=value))


def test_only_what_is_spelled_out_is_judged(robot: Robot) -> None:
    CheckBounds.validate(robot, {})
    CheckBounds.validate(robot, {"arm": ZERO["arm"]})
    with pytest.raises(OutOfBounds, match="joint_4"):
        CheckBounds.validate(robot, {"gripper": {"joint_4": 9.0}})


def test_the_goal_of_all_actuated_joints(bench: Bench) -> None:
    skill = bench.skill(
        CheckBounds,
        gripper=Positions(joint_5=0.7, joint_4=-0.7),
        arm=Positions(joint_3=0.3, joint_1=0.1, joint_2=0.2),
    )
    skill.tick_once()
    assert skill.status is Status.SUCCESS
    names = [joint.name for joint in bench.robot.actuated]
    assert list(bench.output("goal").items()) == list(
        zip(names, (0.1, 0.2, 0.3, -0.7), strict=True)
    )


def test_the_goal_is_known_beforehand_where_both_targets_are_spelled_out(robot: Robot) -> None:
    arm = {"joint_3": 0.3, "joint_1": 0.1, "joint_2": 0.2}
    gripper = {"joint_5": 0.7, "joint_4": -0.7}
    assert CheckBounds.poses(robot, {"arm": arm, "gripper": gripper}) == [(0.1, 0.2, 0.3, -0.7)]
    for inputs in ({}, {"arm": arm}, {"gripper": gripper}):
        assert CheckBounds.poses(robot, inputs) == []


def test_a_target_out_of_bounds_fails_the_skill(bench: Bench) -> None:
    skill = bench.skill(
        CheckBounds, arm=Positions(target(joint_1=9.0)["arm"]), gripper=Positions(joint_4=0.0)
    )
    skill.tick_once()
    assert skill.status is Status.FAILURE
    assert isinstance(skill.failure, OutOfBounds)


def test_a_distance_beyond_the_limits_names_where_the_joint_starts(bench: Bench) -> None:
    start = Positions(joint_1=0.5, joint_2=0.0, joint_3=0.0, joint_4=0.0)
    skill = bench.skill(Shift, start=start, by=Positions(joint_1=1.5))
    skill.tick_once()
    assert str(skill.failure) == (
        "joint_1 = 114.59 deg is outside its limits, -90 deg to 90 deg; joint_1 starts at "
        "28.648 deg"
    )


@pytest.mark.parametrize("turns", [3.2, -3.2])
def test_a_joint_without_an_end_is_moved_half_a_turn_at_the_most(turns: float) -> None:
    """A continuous joint would take the shorter, opposite direction."""
    Shift.validate(foreign("endless"), {"by": {"turn": math.copysign(3.1, turns)}})
    with pytest.raises(OutOfBounds, match="more than half a turn"):
        Shift.validate(foreign("endless"), {"by": {"turn": turns}})


def test_everything_that_is_wrong_is_reported_each_with_its_value(robot: Robot) -> None:
    arm = Positions(joint_1=9.0, joint_7=0.2)
    arm.unknown = ("joint_3",)
    with pytest.raises(ExceptionGroup) as caught:
        CheckBounds.validate(robot, {"arm": arm, "gripper": {"joint_4": -0.3, "joint_5": 0.1}})
    errors = [error for error in known_errors(caught.value) if isinstance(error, SkillError)]
    reported = [(error.location, str(error)) for error in errors if error.location]
    assert [way for way, _ in reported] == [
        ("arm", "joint_1"),
        ("arm", "joint_7"),
        ("gripper", "joint_5"),
    ]
    assert reported[1][1].endswith("did you mean joint_2?")  # so it is not reported as missing too


def test_at_run_time_all_of_it_is_one_cause(bench: Bench) -> None:
    arm = Positions(joint_1=9.0, joint_7=0.2, joint_3=0.0)
    skill = bench.skill(CheckBounds, arm=arm, gripper=Positions(joint_4=0.0))
    skill.tick_once()
    assert isinstance(skill.failure, OutOfBounds)
    assert "joint_1 = 515.66 deg" in str(skill.failure)
    assert "joint_7 is not a joint of the arm" in str(skill.failure)


START = {"joint_1": 0.0, "joint_2": 0.0, "joint_3": 0.0, "joint_4": -0.7}


@pytest.mark.parametrize("q", [0.0, 0.7])
def test_a_mimic_joint_by_itself_is_refused_wherever_its_leader_stands(
    bench: Bench, q: float
) -> None:
    skill = bench.skill(Target, start=Positions(START), joints=Positions(joint_5=q))
    skill.tick_once()
    assert isinstance(skill.failure, BadTarget)
    leader = f"{0 - math.degrees(q):.5g} deg"
    words = f"joint_5 follows joint_4; name joint_4 instead (joint_4 = {leader} gives"
    assert words in str(skill.failure)
    with pytest.raises(BadTarget, match="joint_5 follows joint_4") as caught:
        Target.validate(bench.robot, {"joints": Positions(joint_5=q)})
    assert caught.value.location == ("joints", "joint_5")


def test_the_position_for_the_leader_is_that_which_gives_the_mimic_joint_its_own(
    robot: Robot,
) -> None:
    halved = with_mimic(robot, 0.5, 0.1)
    (error,) = mimic_errors(halved, {"joint_5": 0.3}, "to")
    assert str(error).endswith("(joint_4 = 22.918 deg gives joint_5 = 17.189 deg)")


@pytest.mark.parametrize(("multiplier", "q"), [(-1.0, math.nan), (-1.0, math.inf), (0.0, 0.3)])
def test_no_position_is_suggested_for_the_leader_if_none_gives_the_wanted_one(
    robot: Robot, multiplier: float, q: float
) -> None:
    arm = with_mimic(robot, multiplier, 0.0)
    (error,) = mimic_errors(arm, {"joint_5": q}, "to")
    assert str(error) == "joint_5 follows joint_4; name joint_4 instead"


def test_a_mimic_joint_whose_leader_is_named_only_later_or_misspelt_is_not_alone(
    robot: Robot,
) -> None:
    later = Positions(joint_5=0.7)
    later.unknown = ("joint_4",)
    Target.validate(robot, {"joints": later})
    with pytest.raises(BadTarget, match="did you mean joint_4") as caught:
        Target.validate(robot, {"joints": Positions(joint4=-0.7, joint_5=0.7)})
    assert "follows" not in str(caught.value)
    alone = Positions()
    alone.unknown = ("joint_5",)
    with pytest.raises(BadTarget, match=r"name joint_4 instead$"):
        Target.validate(robot, {"joints": alone})


def test_a_target_of_one_joint_is_checked_without_the_others(robot: Robot) -> None:
    assert joint_errors(robot, Positions(joint_2=0.3)) == []
    (error,) = joint_errors(robot, Positions(joint_2=3.0))
    assert isinstance(error, OutOfBounds)
    assert str(error).startswith("joint_2 = 171.89 deg")
    assert error.location == ("joints", "joint_2")


def test_a_distance_of_one_joint_is_checked_without_the_others(robot: Robot) -> None:
    assert distance_errors(robot, {"joint_2": 0.3}) == []
    (error,) = distance_errors(robot, {"joint_2": 7.0})
    assert isinstance(error, OutOfBounds)
    assert str(error).startswith("joint_2 by ")
    assert error.location == ("by", "joint_2")


def test_an_unknown_joint_is_reported_beside_the_errors_of_others(robot: Robot) -> None:
    errors = joint_errors(robot, Positions(joint_8=0.0, joint_2=3.0))
    assert [error.location for error in errors] == [("joints", "joint_8"), ("joints", "joint_2")]


def test_an_unknown_joint_is_reported_with_its_port_at_run_time(bench: Bench) -> None:
    skill = bench.skill(Target, start=Positions(START), joints=Positions(joint_8=0.0))
    skill.tick_once()
    assert isinstance(skill.failure, BadTarget)
    assert skill.failure.location == ("joints", "joint_8")


def test_a_distance_is_at_most_the_range_of_its_joint(robot: Robot) -> None:
    span = robot.joint("joint_2").upper - robot.joint("joint_2").lower
    assert distance_errors(robot, {"joint_2": span}) == []
    assert distance_errors(robot, {"joint_2": -span}) == []
    (error,) = distance_errors(robot, {"joint_2": math.nextafter(span, 9)})
    assert isinstance(error, OutOfBounds)


@pytest.mark.parametrize(
    ("distance", "words", "limit"),
    [
        (7.0, "401.07", math.pi),
        (-7.0, "-401.07", -math.pi),
        (math.inf, "inf", None),
        (math.nan, "nan", None),
    ],
)
def test_too_large_a_distance_is_reported_with_the_limit_in_its_direction(
    robot: Robot, distance: float, words: str, limit: float | None
) -> None:
    (error,) = distance_errors(robot, {"joint_2": distance})
    assert isinstance(error, OutOfBounds)
    assert str(error) == f"joint_2 by {words} deg is more than its range, 180 deg"
    assert (error.joint, error.value, error.limit) == (
        "joint_2",
        pytest.approx(distance, nan_ok=True),
        limit and pytest.approx(limit),
    )


@pytest.mark.parametrize(
    ("by", "unknown", "name", "near"),
    [
        ({"jont_1": 0.1}, (), "jont_1", "; did you mean joint_1?"),
        ({"jont_1": 0.1, "joint_1": 0.1}, (), "jont_1", ""),
        ({}, ("joint_5",), "joint_5", ""),
    ],
)
def test_a_distance_of_a_joint_that_does_not_turn_names_those_that_do(
    robot: Robot, by: dict[str, float], unknown: tuple[str, ...], name: str, near: str
) -> None:
    distances = Positions(by)
    distances.unknown = unknown
    (error,) = distance_errors(robot, distances)
    joints = "joint_1, joint_2, joint_3, joint_4"
    assert str(error) == f"{name} is not an actuated joint; choose from {joints}{near}"
    assert error.location == ("by", name)

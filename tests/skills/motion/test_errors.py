"""Errors of motion planning: they say what to do, and can be pickled."""

import pickle

import pytest

import skills.motion as motion

ERRORS = [
    motion.MotionError("something"),
    motion.BadQuery.group("legs", ["arm", "gripper"]),
    motion.NotFinite("start", "joint_1", float("inf")),
    motion.ModelUnusable("robot.urdf", "no such file"),
    motion.StartOutOfBounds("joint_1", 2.0, -1.5, 1.5),
    motion.GoalOutOfBounds("joint_2", -2.0, -1.5, 1.5),
    motion.StartInCollision("hand", "floor", -0.012, 0.005),
    motion.GoalInCollision("hand", "base", 0.0031, 0.005),
    motion.NoPath(20_000, 10, 900, 30),
    motion.Barred("joint_2", 1.5, "rad", "upper_arm", "floor"),
    motion.PlanTimeout(5.0, 20_000, 10, 900, 30),
    motion.MotionCollides(17, 1.25, "hand", "floor", -0.001, 0.002),
    motion.PlanCanceled(),
    motion.WorkerDied("ended by SIGABRT"),
    motion.TooLittleMemory(2**29, 2**30),
    motion.TooLong("joint_1", 1e7, 600.0, "1e-05 deg/s and 1 deg/s2"),
    motion.Unreachable((0.1, 0.0, 0.2), (0.1, 0.0, 0.15), 0.05, 0.3, (0.0, 0.0, 1.0), 1e-6),
]


@pytest.mark.parametrize("error", ERRORS, ids=lambda error: type(error).__name__)
def test_errors_can_be_pickled(error: motion.MotionError) -> None:
    twin = pickle.loads(pickle.dumps(error))
    assert type(twin) is type(error)
    assert (str(twin), twin.__dict__) == (str(error), error.__dict__)


def test_codes_are_distinct() -> None:
    codes = [type(error).code for error in ERRORS]
    assert len(set(codes)) == len(codes)
    assert all(code.startswith("plan.") for code in codes)


def test_collision_says_how_deep_or_how_near() -> None:
    assert "hand would be up to 12.0 mm deep in floor" in str(ERRORS[6])
    assert "hand would come within 3.1 mm of base (margin: 5.0 mm)" in str(ERRORS[7])
    assert "At 1.25 s into the motion" in str(ERRORS[11])


def test_a_missing_library_names_its_package() -> None:
    died = motion.WorkerDied("ImportError: libgomp.so.1: cannot open shared object file")
    assert died.hint == "install the system's package of this library, on Debian libgomp1"
    assert died.hint in str(died)
    assert pickle.loads(pickle.dumps(died)).hint == died.hint


def test_bounds_say_joint_value_and_limits() -> None:
    assert "goal of joint_2, -114.592 deg, is outside its limits, -85.9437 deg to" in str(ERRORS[5])


def test_a_failed_search_names_the_narrow_end() -> None:
    assert "; the goal is in the narrow place;" in str(motion.NoPath(1000, 1, 900, 30))
    assert "; the start is in the narrow place;" in str(motion.NoPath(1000, 1, 3, 13))
    assert "is in the narrow place" not in str(motion.NoPath(1000, 1, 300, 200))


def test_a_timeout_says_what_was_tried() -> None:
    assert str(motion.PlanTimeout(5.0)) == (
        "No plan within 5 s; raise planning_timeout, add a via pose, or choose another goal"
    )
    assert str(motion.PlanTimeout(5.0, 1400, 2, 900, 30)) == (
        "No plan within 5 s by a line, by bends, or by 2 searches with 1400 samples, which reached "
        "900 configurations from the start and 30 from the goal; the goal is in the narrow place; "
        "raise planning_timeout, choose another goal, or add a via pose in front of the narrow "
        "place"
    )
    assert "by 1 search with 8 samples" in str(motion.PlanTimeout(5.0, 8, 1, 3, 2))

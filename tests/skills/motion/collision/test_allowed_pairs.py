"""Which pairs of links need no check."""

from pathlib import Path

import pytest

from hardware import Robot, load_robot
from hardware.description.new_robot import draft_robot
from skills.motion.collision.allowed_pairs import AllowedPairs, find_allowed_pairs
from skills.motion.errors import ModelUnusable
from tests.support.arms.urdfs import LIMIT
from tests.support.paths import DATA


def link(name: str, size: str, at: str = "0 0 0") -> str:
    shape = f'<origin xyz="{at}"/><geometry><box size="{size}"/></geometry>'
    return f'<link name="{name}"><collision>{shape}</collision></link>'


def joint(name: str, parent: str, child: str, at: str, limit: str = LIMIT) -> str:
    ends = f'<parent link="{parent}"/><child link="{child}"/><origin xyz="{at}"/>'
    return f'<joint name="{name}" type="revolute">{ends}<axis xyz="0 1 0"/>{limit}</joint>'


def arm(folder: Path, *elements: str) -> Robot:
    path = folder / "arm.urdf"
    path.write_text(f'<robot name="r">{"".join(elements)}</robot>')
    return draft_robot(path, 1e6)


def chain(folder: Path, *more: str, reach: str = "-1") -> Robot:
    """A base, an upper and a lower arm, which folds onto the base at less than the reach."""
    limit = LIMIT.replace('"-1"', f'"{reach}"')
    return arm(
        folder,
        *(link("base", "0.4 0.1 0.04"), link("upper", "0.04 0.04 0.4", "0 0 0.25")),
        *(link("lower", "0.04 0.04 0.4", "0 0 0.25"), *more),
        joint("shoulder", "base", "upper", "0 0 0"),
        joint("elbow", "upper", "lower", "0 0 0.5", limit),
    )


def reasons(found: AllowedPairs) -> dict[tuple[str, str], str]:
    return dict(found.reasons)


def test_neighbours_and_links_that_never_meet(tmp_path: Path) -> None:
    found = find_allowed_pairs(chain(tmp_path))
    assert reasons(found) == {
        ("base", "upper"): "adjacent",
        ("upper", "lower"): "adjacent",
        ("base", "lower"): "never",
    }
    assert (found.count, found.boot, found.nearest) == (3, (0.0, 0.0), None)


def test_a_mesh_in_mm_is_reported(tmp_path: Path) -> None:
    mesh = f'<mesh filename="{DATA}/beam.stl" scale="500 500 500"/>'
    beam = f'<link name="beam"><collision><geometry>{mesh}</geometry></collision></link>'
    robot = arm(tmp_path, link("base", "1 1 1"), beam, joint("j", "base", "beam", "0 0 2"))
    said = r'mesh beam.stl is \d+ m long, which looks like mm; write scale="0\.5 0\.5 0\.5" in its'
    with pytest.raises(ModelUnusable, match=said):
        find_allowed_pairs(robot)


def test_a_pair_that_may_meet_is_checked(tmp_path: Path) -> None:
    found = find_allowed_pairs(chain(tmp_path, reach="-3.1"))
    assert ("base", "lower") not in found.reasons
    assert found.nearest
    assert {found.nearest.first, found.nearest.second} == {"base", "lower"}


def test_links_that_always_overlap(tmp_path: Path) -> None:
    rod = link("rod", "0.3 0.1 0.3")
    hinge = joint("hinge", "lower", "rod", "0 0 -0.1")
    found = reasons(find_allowed_pairs(chain(tmp_path, rod, hinge, reach="-0.1")))
    assert found["upper", "rod"] == "always"


def test_a_link_without_a_shape_does_not_separate_neighbours(tmp_path: Path) -> None:
    bare = '<link name="bare"/>'
    top = [link("top", "0.1 0.1 0.1"), joint("roll", "lower", "bare", "0 0 0.5")]
    top += [joint("pitch", "bare", "top", "0 0 0")]
    assert reasons(find_allowed_pairs(chain(tmp_path, bare, *top)))["lower", "top"] == "adjacent"


FOLDED = '<limit lower="{}" upper="{}" velocity="2" effort="1"/>'


def folding(
    folder: Path,
    lower: str,
    upper: str = "3",
    base: str = "0.1 0.1 0.1",
    at: str = "0 0 0",
    *more: str,
) -> Robot:
    """An arm whose last link is inside the base if all joints are at 0."""
    return arm(
        folder,
        *(link("base", base, at), link("upper", "0.1 0.02 0.02", "0.2 0 0")),
        *(link("lower", "0.1 0.02 0.02", "-0.3 0 0"), joint("a", "base", "upper", "0 0 0")),
        joint("b", "upper", "lower", "0.3 0 0", FOLDED.format(lower, upper)),
        *more,
    )


def test_the_arm_starts_in_the_middle_if_it_collides_at_zero(tmp_path: Path) -> None:
    found = find_allowed_pairs(folding(tmp_path, "-0.2"))
    assert found.boot == pytest.approx((0.0, 1.4))
    assert "default" not in found.reasons.values()


def test_the_arm_starts_in_the_free_sample_nearest_to_the_middle_if_that_collides_too(
    tmp_path: Path,
) -> None:
    found = find_allowed_pairs(folding(tmp_path, "-3"))
    assert "default" not in found.reasons.values()
    assert found.nearest
    assert found.nearest.distance >= 0.005
    assert 0.1 < abs(found.boot[1]) < 1.0


def test_where_no_start_is_free_what_touches_there_is_not_checked(tmp_path: Path) -> None:
    weld = '<joint name="w" type="fixed"><parent link="base"/><child link="below"/></joint>'
    wall = (link("below", "0.1 0.1 2", "0 0 -1"), weld)
    robot = folding(tmp_path, "-0.25", "0.25", "0.1 0.1 2", "0 0 1", *wall)
    found = find_allowed_pairs(robot)
    assert found.boot == (0.0, 0.0)
    assert "default" in found.reasons.values()


def test_a_pose_in_collision_is_moved_towards_the_start(tmp_path: Path) -> None:
    poses = {"up": {"b": 1.0}, "folded": {"b": 0.0}}
    found = find_allowed_pairs(folding(tmp_path, "-0.2"), poses).poses
    assert found["up"] == poses["up"]
    assert 0.0 < found["folded"]["b"] < 0.8


def test_the_shipped_pairs_of_the_arduinobot_are_found_again() -> None:
    robot = load_robot()
    found = find_allowed_pairs(draft_robot(robot.urdf, 1e6))
    touching = {frozenset(pair) for pair, why in found.reasons.items() if why != "never"}
    assert touching <= robot.collision.allowed
    assert found.boot == (0.0,) * 4

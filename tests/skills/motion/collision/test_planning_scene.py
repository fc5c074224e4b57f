"""Robot model and planning scene: contacts, mimic joints, and bounds on travel."""

import dataclasses
import gc
import weakref
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from numpy.typing import NDArray

from hardware import Mimic, Robot, load_robot
from skills.motion import (
    BadWorld,
    Body,
    Box,
    Carry,
    GoalInCollision,
    ModelUnusable,
    NotFinite,
    Query,
    Sphere,
    World,
)
from skills.motion.collision.checker import CollisionChecker
from skills.motion.collision.planning_scene import PlanningScene, geometry_of, part_of
from skills.motion.planner import Planner
from skills.motion.robot_model.geometry import corners
from skills.motion.robot_model.motion_bounds import floor_lever_arms
from tests.support.arms.robots import pair_file, robot_of
from tests.support.arms.urdfs import urdf

Array = NDArray[np.float64]


@pytest.fixture(scope="module")
def robot() -> Robot:
    return load_robot()


@pytest.fixture(scope="module")
def checker(robot: Robot) -> CollisionChecker:
    return CollisionChecker(PlanningScene(robot))


def test_tasks_keep_ten_millimetres(checker: CollisionChecker) -> None:
    poses = [(0, 0, 0, 0), (0, 0, 0, -0.7), (-1.4, -0.6, -0.07, 0), (-1.57, 0, -0.9, 0)]
    assert checker.first_collision(poses, 0.010) is None


def test_first_collision_is_the_first(checker: CollisionChecker) -> None:
    free, hit = (0.0, 0.0, 0.0, 0.0), (0.0, -1.5, -0.5, 0.0)
    assert checker.first_collision([free, free, hit, free, hit], 0.005) == 2
    assert checker.first_collision([free] * 1500 + [hit], 0.005) == 1500
    assert checker.first_collision([free], 0.005) is None
    assert checker.first_collision(np.empty((0, 4)), 0.005) is None


def test_old_scenes_are_freed_without_the_garbage_collector(robot: Robot) -> None:
    """Each holds megabytes of pinocchio and coal, which Python's garbage collector cannot see."""
    planner, scenes = Planner(robot), list[weakref.ref[PlanningScene]]()
    gc.disable()
    try:
        for k in range(8):
            world = World((Body("block", Box((0.03, 0.03, 0.1)), (0.25, 0.001 * k, 0.05)),))
            planner.plan(Query("arm", (0.0,) * 4, (-1.4, -0.6, -0.07), world=world))
            scenes.append(weakref.ref(planner._checkers[world, frozenset()].scene))
        assert [scene() is None for scene in scenes] == [True] * 5 + [False] * 3
    finally:
        gc.enable()


def test_a_geometry_has_the_shapes_that_were_given(robot: Robot) -> None:
    shapes = [*PlanningScene(robot).hulls.geometryObjects]
    added = pin.GeometryModel()
    for shape in shapes:
        added.addGeometryObject(shape)
    assert geometry_of(shapes) == added
    assert geometry_of(shapes[::-1]) != added
    assert geometry_of([]) == pin.GeometryModel()


def test_the_ends_of_pairs_are_those_of_pinocchio_also_in_a_part(robot: Robot) -> None:
    def named(geometry: pin.GeometryModel, ends: Iterable[Sequence[int]]) -> list[tuple[str, str]]:
        return [tuple(geometry.geometryObjects[end].name for end in pair) for pair in ends]

    bodies = (Body(f"body_{i}", Sphere(0.01), (1.0, 0.0, 0.1 * i)) for i in range(5))
    scene = PlanningScene(robot, World(tuple(bodies)))
    for whole in scene.exact, scene.hulls:
        ends = scene.ends(whole)
        part, part_ends = part_of(whole, ends[1:8:3])
        assert len(part.geometryObjects) < len(whole.geometryObjects)
        assert named(part, part_ends.tolist()) == named(whole, ends[1:8:3].tolist())
        for geometry, known in (whole, ends), (part, part_ends):
            pairs = [[pair.first, pair.second] for pair in geometry.collisionPairs]
            assert pairs == known.tolist()


@pytest.mark.parametrize("name", ["arduinobot", "so101"])
def test_every_configuration_in_collision_is_found(name: str) -> None:
    arm, random = load_robot(Path(name)), np.random.default_rng(7)
    lower, upper = np.array([(joint.lower, joint.upper) for joint in arm.actuated]).T
    rows = random.uniform(lower, upper, (150, len(lower)))
    checker = CollisionChecker(PlanningScene(arm))
    hits = checker.collisions(rows, 0.005)
    assert 0 < hits.sum() < len(rows)
    assert hits.tolist() == [checker.first_collision([row], 0.005) == 0 for row in rows]


def test_answers_do_not_depend_on_earlier_checks(robot: Robot) -> None:
    rows = np.random.default_rng(5).uniform(-1.5, 0.0, (200, 4))
    one = CollisionChecker(PlanningScene(robot))
    first = [one.first_collision([row], 0.005) for row in rows]
    again = [one.first_collision([row], 0.005) for row in rows[::-1]][::-1]
    assert first == again


@pytest.mark.slow
def test_a_world_with_as_many_bodies_as_it_may_have(robot: Robot) -> None:
    """A row of cubes beside the arm; one of them is where the hand would be at the goal."""
    cubes = [
        Body(f"cube_{i}", Box((0.005,) * 3), (0.3 + 0.01 * (i % 50), 0.01 * (i // 50), 0.0))
        for i in range(999)
    ]
    query = Query("arm", (0.0,) * 4, (-1.4, -0.6, -0.07), timeout=60.0)
    hand = Planner(robot).carry(
        Carry(
            World((Body("there", Sphere(0.01), link="claw_support"),)),
            "there",
            "",
            (*query.goal, 0.0),
        )
    )
    planner = Planner(robot)
    assert planner.plan(dataclasses.replace(query, world=World(tuple(cubes)))).curve.straight
    with pytest.raises(GoalInCollision, match="there"):
        planner.plan(dataclasses.replace(query, world=World((*cubes, hand))))


@pytest.mark.slow
def test_bodies_on_two_links_give_too_many_pairs(robot: Robot) -> None:
    bodies = [
        Body(f"b{i}", Sphere(0.001), link=("claw_support", "base_plate")[i % 2]) for i in range(900)
    ]
    why = "31 shapes of the robot and 900 bodies give more than 40000 pairs to check; give fewer"
    with pytest.raises(BadWorld, match=why):
        PlanningScene(robot, World(tuple(bodies)))


def test_nan_is_rejected(checker: CollisionChecker) -> None:
    for poison in (np.nan, np.inf, -np.inf):
        with pytest.raises(NotFinite, match=r"Row 1 of joint_3"):
            checker.first_collision([(0.0, 0.0, 0.0, 0.0), (0.0, 0.0, poison, 0.0)], 0.005)
    assert checker.first_collision([(0.0, 0.0, 0.0, 0.0)], 0.005) is None


def test_mimic_joints_move_with_their_leader(checker: CollisionChecker) -> None:
    """Opening the gripper moves both fingers apart, and none through the floor."""
    model = PlanningScene(load_robot())
    assert model.kinematics.nq == 4
    q = model.robot_model.coordinates(np.array([[0.0, 0.0, 0.0, -0.7]]))[:, 0]
    data = model.kinematics.createData()
    pin.forwardKinematics(model.kinematics, data, q)
    turned = [
        pin.log3(data.oMi[model.kinematics.getJointId(name)].rotation)[2]
        for name in ("joint_4", "joint_5")
    ]
    assert turned == pytest.approx([-0.7, 0.7])


@pytest.mark.slow
def test_no_pair_exceeds_its_bound_on_travel(robot: Robot) -> None:
    """Corners of the outer link in the frame of the inner one, for random moves of each joint."""
    model, random = PlanningScene(robot), np.random.default_rng(1)
    lower = np.array([joint.lower for joint in robot.actuated])
    upper = np.array([joint.upper for joint in robot.actuated])
    most = np.zeros_like(model.lever_arms)
    for configuration in random.uniform(lower, upper, (500, 4)):
        here = seen(model, configuration)
        for j, move in enumerate(1e-4 * np.eye(4)):
            there = seen(model, configuration + move)
            for row, before, after in zip(most, here, there, strict=True):
                travel = np.linalg.norm(after - before, axis=1).max()
                row[j] = max(row[j], travel / 1e-4)
    assert np.all(most <= model.lever_arms + 1e-9)
    assert np.all(most[:, :3] >= 0.9 * model.lever_arms[:, :3])  # and it is a bound worth having


def seen(model: PlanningScene, configuration: Array) -> list[Array]:
    """For each pair of links, points of the outer one in the frame of the inner one.

    The floor sees heights alone.
    """
    data = model.kinematics.createData()
    pin.forwardKinematics(
        model.kinematics, data, model.robot_model.coordinates(configuration[None, :])[:, 0]
    )
    found = []
    for pair in model.hulls.collisionPairs:
        shapes = (model.hulls.geometryObjects[index] for index in (pair.first, pair.second))
        inner, outer = sorted(shapes, key=lambda shape: shape.parentJoint)
        place = data.oMi[inner.parentJoint].actInv(data.oMi[outer.parentJoint])
        points = corners(outer) @ place.rotation.T + place.translation
        found.append(points[:, 2:] if inner.name == "floor" else points)
    return found


UPRIGHT, LEVEL = (0, 0, 1), (1, 0, 0)


@pytest.mark.parametrize(
    ("axes", "expected"),
    [
        ([("revolute", UPRIGHT), ("revolute", LEVEL), ("revolute", UPRIGHT)], ["j0"]),
        (
            [("prismatic", LEVEL), ("revolute", (0, 0, -1)), ("prismatic", LEVEL)],
            ["j0", "j1", "j2"],
        ),
        ([("prismatic", UPRIGHT), ("revolute", UPRIGHT)], []),
        ([("revolute", (0, 1e-3, 1)), ("prismatic", LEVEL)], []),
        ([("continuous", UPRIGHT), ("prismatic", (1, 0, 0.01))], ["j0"]),
    ],
)
def test_joints_that_change_no_height(
    axes: list[tuple[str, tuple[float, ...]]], expected: list[str]
) -> None:
    links = "".join(f"<link name='l{i}'/>" for i in range(len(axes) + 1))
    for i, (kind, axis) in enumerate(axes):
        links += f"""
            <joint name='j{i}' type='{kind}'><parent link='l{i}'/><child link='l{i + 1}'/>
            <origin xyz='0.1 0 0.1'/><axis xyz='{" ".join(map(str, axis))}'/>
            <limit lower='-1' upper='1' velocity='1' effort='1'/></joint>"""
    found = floor_lever_arms(pin.buildModelFromXML(f"<robot name='r'>{links}</robot>"))
    assert found == dict.fromkeys(expected, 0.0)


def test_unusable_urdf(robot: Robot, tmp_path: Path) -> None:
    broken = tmp_path / "broken.urdf"
    broken.write_text("<robot name='x'><link name='a'/><link name='b'/></robot>")
    with pytest.raises(ModelUnusable, match=r"broken\.urdf is unusable for planning"):
        PlanningScene(dataclasses.replace(robot, urdf=broken))


def test_no_link_is_named_like_the_floor(tmp_path: Path) -> None:
    file = tmp_path / "arm.urdf"
    file.write_text(urdf(["floor -> arm: revolute shoulder"]))
    with pytest.raises(ModelUnusable, match=r"a link is named floor.*; rename the link"):
        PlanningScene(robot_of(file))


@pytest.mark.parametrize("other", ["joint_1", "universe", "nosuch"])
def test_a_body_may_touch_links_and_bodies_only(robot: Robot, other: str) -> None:
    body = Body("b", Sphere(0.1), (0.0, 0.0, 1.0), touches=frozenset({other}))
    with pytest.raises(BadWorld, match=f"may touch {other}, but there is no such") as caught:
        PlanningScene(robot, World((body,)))
    there = str(caught.value).partition("choose from ")[2].split(", ")
    assert "base_link" in there
    assert not {"joint_2", "b"} & set(there)


_LINK = '<link name="{0}"/>'
_JOINT = """<joint name="{0}" type="{4}"><parent link="{1}"/><child link="{2}"/>
<origin xyz="0.3 0 0"/><axis xyz="0 0.6 0.8"/><limit lower="-2" upper="2" velocity="2" effort="1"/>
{3}</joint>"""
_FOLLOWS = '<mimic joint="z_lead" multiplier="-0.5" offset="0.1"/>'


def tied(
    folder: Path, lead_on: str, mate_on: str, lead_is: str = "revolute", mate_is: str = "revolute"
) -> Robot:
    """Two joints. The first in alphabetical order follows the other one."""
    lead = _JOINT.format("z_lead", lead_on, "led", "", lead_is)
    mate = _JOINT.format("a_mate", mate_on, "mated", _FOLLOWS, mate_is)
    links = "".join(_LINK.format(name) for name in ("base", "led", "mated"))
    (folder / "arm.urdf").write_text(f'<robot name="arm">{links}{mate}{lead}</robot>')
    (folder / "arm.toml").write_text(pair_file("z_lead", "a_mate"))
    return load_robot(folder / "arm.toml")


KINDS = ("revolute", "continuous", "prismatic")


@pytest.mark.parametrize("mate_on", ["base", "led"])
@pytest.mark.parametrize("mate_is", KINDS)
@pytest.mark.parametrize("lead_is", KINDS)
def test_a_joint_may_follow_a_later_one(
    tmp_path: Path, lead_is: str, mate_is: str, mate_on: str
) -> None:
    model = PlanningScene(tied(tmp_path, "base", mate_on, lead_is, mate_is))
    loose = pin.buildModelFromUrdf(str(tmp_path / "arm.urdf"))
    ours, free, q = model.kinematics.createData(), loose.createData(), list[float]()
    for name, kind, value in (("a_mate", mate_is, -0.3), ("z_lead", lead_is, 0.8)):
        place = loose.joints[loose.getJointId(name)].idx_q
        q[place:place] = [np.cos(value), np.sin(value)] if kind == "continuous" else [value]
    pin.framesForwardKinematics(
        model.kinematics, ours, model.robot_model.coordinates(np.array([[0.8]]))[:, 0]
    )
    pin.framesForwardKinematics(loose, free, np.array(q))
    for link in ("led", "mated"):
        here, there = model.kinematics.getFrameId(link), loose.getFrameId(link)
        assert ours.oMf[here].isApprox(free.oMf[there])


def test_a_joint_that_follows_one_it_carries_is_rejected(tmp_path: Path) -> None:
    with pytest.raises(ModelUnusable, match=r"a_mate follows z_lead, .* let z_lead follow"):
        PlanningScene(tied(tmp_path, "mated", "base"))


def test_a_mimic_joint_with_multiplier_0_is_rejected(tmp_path: Path) -> None:
    robot = tied(tmp_path, "base", "base")
    first, *rest = robot.joints
    follows = [dataclasses.replace(j, mimic=Mimic("z_lead", 0.0, 0.1)) for j in rest]
    with pytest.raises(
        ModelUnusable, match="a_mate follows z_lead with multiplier 0; make it a fixed"
    ):
        Planner(dataclasses.replace(robot, joints=(first, *follows)))

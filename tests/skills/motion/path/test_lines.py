"""A straight motion is not checked again after timing: the proof for its line holds."""

from contextlib import suppress
from pathlib import Path

import coal
import numpy as np
import pinocchio as pin
import pytest
from numpy.typing import NDArray

from hardware import Robot, load_robot
from skills.motion import Body, MotionError, Plan, Query, Sphere, World
from skills.motion.planner import Planner
from skills.motion.robot_model.joint_group import JointGroup
from tests.support.arms.real_arms import FILES, real
from tests.support.arms.robots import ARMS, foreign, free_poses

pytestmark = pytest.mark.slow

Array = NDArray[np.float64]
RADIUS = 0.0005
LINES = 10


@pytest.fixture(scope="module", params=["arduinobot", *ARMS, "panda", "jaco"])
def robot(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Robot:
    if request.param in FILES:
        return real(request.param, tmp_path_factory.mktemp("arm"))
    return foreign(request.param) if request.param in ARMS else load_robot()


class ReferenceChecker:
    """Measures the distance to one point from the URDF, with pinocchio only."""

    def __init__(self, robot: Robot) -> None:
        self.robot, urdf = robot, str(robot.urdf)
        self.model = pin.buildModelFromUrdf(urdf)  # followers have coordinates of their own
        self.data = self.model.createData()
        folders = [str(folder) for folder in Path(urdf).parents]
        kind = pin.GeometryType.COLLISION
        self.shapes = pin.buildGeomFromUrdf(self.model, urdf, kind, None, folders)
        self.moving = [i for i, s in enumerate(self.shapes.geometryObjects) if s.parentJoint]
        pea = pin.GeometryObject("pea", 0, 0, pin.SE3.Identity(), coal.Sphere(RADIUS))
        self.pea = self.shapes.addGeometryObject(pea)
        for i in self.moving:
            self.shapes.addCollisionPair(pin.CollisionPair(i, self.pea))
        self.placed = self.shapes.createData()

    def coordinates(self, row: Array) -> Array:
        """Converts a configuration (A,) to pinocchio's coordinates (nq,)."""
        own = dict(zip([joint.name for joint in self.robot.actuated], row.tolist(), strict=True))
        q = np.zeros(self.model.nq)
        for joint in self.robot.joints:
            value = own[joint.mimic.leader] if joint.mimic else own[joint.name]
            if joint.mimic:
                value = joint.mimic.multiplier * value + joint.mimic.offset
            place = self.model.joints[self.model.getJointId(joint.name)]
            both = [np.cos(value), np.sin(value)] if place.nq == 2 else [value]
            q[place.idx_q : place.idx_q + place.nq] = both
        return q

    def hits(self, rows: Array, point: Array, margin: float) -> Array:
        """True for rows with a moving link closer than a margin [m] to a small sphere (N,)."""
        self.shapes.geometryObjects[self.pea].placement = pin.SE3(np.eye(3), point)
        pool = pin.GeometryPool(self.model, self.shapes, 1)
        for request in pool.getGeometryData(0).collisionRequests:
            request.security_margin = margin
        q = np.array([self.coordinates(row) for row in rows]).T
        return np.array(pin.computeCollisionsInParallel(1, pool, q, True, False), bool)

    def beside(self, rows: Array, random: np.random.Generator, margin: float) -> Array:
        """A point that the rows pass at about a margin [m] (3,)."""
        while True:
            row = random.choice(rows)
            link = int(random.choice(self.moving))
            shape = self.shapes.geometryObjects[link].geometry
            shape.computeLocalAABB()
            box, q = shape.aabb_local, self.coordinates(row)
            pin.updateGeometryPlacements(self.model, self.data, self.shapes, self.placed, q)
            wide = box.max_ - box.min_ + 2.0 * margin
            point = 0.5 * (box.max_ + box.min_ + random.uniform(-1.0, 1.0, 3) * wide)
            point = np.asarray(self.placed.oMg[link].act(point))
            thin, all_but = rows[:: len(rows) // 9], 0.8 * margin
            if self.hits(thin, point, 0.0).any() or self.hits(rows, point, all_but).any():
                continue
            if self.hits(rows, point, 1.2 * margin).any():
                return point


def moments(robot: Robot, plan: Plan) -> Array:
    """All actuated joints, every millisecond of a motion (N, A) [rad]."""
    times = np.arange(0.0, plan.duration + 0.001, 0.001)
    rows = np.tile(plan.start, (len(times), 1))
    rows[:, JointGroup(robot, plan.group).columns] = plan.sample(times)
    return rows


def test_lines_past_a_small_sphere_keep_half_the_margin(robot: Robot) -> None:
    """The sphere is placed so that some lines just pass it and others do not."""
    reference, planner, margin = ReferenceChecker(robot), Planner(robot), robot.collision.margin
    random, passed = np.random.default_rng(4), 0
    poses = free_poses(robot, 2 * LINES, 5, planner.checker)
    for number, (start, goal) in enumerate(zip(poses[::2], poses[1::2], strict=True)):
        group = "gripper" if robot.groups["gripper"] and number % 3 == 0 else "arm"
        joints = JointGroup(robot, group)
        own = joints.columns
        way = joints.nearest_turn(start[own], goal[own]) - start[own]
        rows = np.tile(start, (60, 1))
        rows[:, own] += np.linspace(0.0, 1.0, 60)[:, None] * way
        point = reference.beside(rows, random, margin)
        world = World((Body("pea", Sphere(RADIUS), tuple(point.tolist())),))
        query = Query(group, tuple(start), tuple(goal[own]), world=world, timeout=0.5)
        with suppress(MotionError):
            plan = planner.plan(query)
            if plan.curve.straight:
                passed += 1
                _follow(reference, plan, moments(robot, plan), point)
    assert passed


def _follow(reference: ReferenceChecker, plan: Plan, rows: Array, point: Array) -> None:
    assert not reference.hits(rows, point, 0.5 * reference.robot.collision.margin - 1e-6).any()
    _, *aside = np.linalg.svd(rows - plan.start, full_matrices=False)[2]
    assert abs((rows - plan.start) @ np.array(aside).T).max() < 1e-12

"""drake: its checker and its TOPP-RA; as it has no planner in Python, an RRT-Connect here."""

import logging
import tempfile
from pathlib import Path

import numpy as np
from common import TICK, serve
from pydrake.multibody.optimization import CalcGridPointsOptions, Toppra
from pydrake.planning import RobotDiagramBuilder, SceneGraphCollisionChecker
from pydrake.trajectories import PathParameterizedTrajectory, PiecewisePolynomial

_RANGE = 0.5  # longest new branch [rad]
_ITERATIONS = 2_000
_SHORTCUTS = 30

logging.getLogger("drake").setLevel(logging.ERROR)


def make(problem):
    builder = RobotDiagramBuilder(time_step=0.0)
    urdf = Path(tempfile.mkdtemp()) / "arm.urdf"  # it reads meshes of a file only
    urdf.write_text(problem["urdf"])
    (arm,) = builder.parser().AddModels(urdf)
    plant = builder.plant()
    root = plant.get_body(plant.GetBodyIndices(arm)[0])
    if root.name() != "world" and not plant.GetBodiesWeldedTo(plant.world_body())[1:]:
        plant.WeldFrames(plant.world_frame(), root.body_frame())
    checker = SceneGraphCollisionChecker(
        model=builder.Build(),
        robot_model_instances=[arm],
        edge_step_size=problem["step"],
        configuration_distance_function=lambda a, b: float(np.linalg.norm(b - a)),
    )
    plant = checker.plant()
    checked = {frozenset(pair) for pair in problem["checked"]}
    bodies = [plant.get_body(index) for index in plant.GetBodyIndices(arm)]
    for i, one in enumerate(bodies):
        for other in bodies[i + 1 :]:
            if frozenset((one.name(), other.name())) not in checked:
                checker.SetCollisionFilteredBetween(one.index(), other.index(), True)
    order = [plant.GetJointByName(name).position_start() for name in problem["joints"]]
    lower, upper = plant.GetPositionLowerLimits(), plant.GetPositionUpperLimits()
    velocity, acceleration = (
        np.array(problem[key])[np.argsort(order)] for key in ("velocity", "acceleration")
    )

    def solve(start, goal, seed):
        ends = [np.array(end)[np.argsort(order)] for end in (start, goal)]
        draw = np.random.default_rng(seed)
        path = [*ends] if checker.CheckEdgeCollisionFree(*ends) else None
        path = path or connect(checker, *ends, lower, upper, draw)
        if path is None:
            return None
        way = shorter(checker, path, draw)
        trajectory = time(way)
        return (
            None
            if trajectory is None
            else (trajectory, trajectory.vector_values(np.arange(0.0, trajectory.end_time(), 0.02)))
        )

    def time(way):
        lengths = np.linalg.norm(np.diff(way, axis=0), axis=1)
        breaks, points = np.concatenate(([0.0], np.cumsum(lengths))), np.array(way).T
        if len(way) == 2:
            path = PiecewisePolynomial.FirstOrderHold(breaks, points)
        else:
            path = PiecewisePolynomial.CubicShapePreserving(breaks, points, True)
        toppra = Toppra(path, plant, Toppra.CalcGridPoints(path, CalcGridPointsOptions()))
        toppra.AddJointVelocityLimit(-velocity, velocity)
        toppra.AddJointAccelerationLimit(-acceleration, acceleration)
        law = toppra.SolvePathParameterization()
        return None if law is None else PathParameterizedTrajectory(path, law)

    def sample(found):
        trajectory, _ = found
        ticks = np.append(np.arange(0.0, trajectory.end_time(), TICK), trajectory.end_time())
        return trajectory.vector_values(ticks).T[:, order]

    return solve, sample


def connect(checker, start, goal, lower, upper, draw):
    """Kuffner and LaValle's RRT-Connect, 2000."""
    trees = [([start], [-1]), ([goal], [-1])]
    for turn in range(_ITERATIONS):
        one, other = trees[turn % 2], trees[1 - turn % 2]
        if extend(checker, one, draw.uniform(lower, upper)) is None:
            continue
        target = one[0][-1]
        while (step := extend(checker, other, target)) is not None:
            if step:
                ways = [back(tree) for tree in trees]
                return ways[0][::-1] + ways[1][1:]
    return None


def extend(checker, tree, target):
    """A branch towards the target; whether it is reached, None where it is not free."""
    points, parents = tree
    nearest = int(np.argmin(np.linalg.norm(np.array(points) - target, axis=1)))
    away = target - points[nearest]
    far = float(np.linalg.norm(away))
    new = target if far <= _RANGE else points[nearest] + away * (_RANGE / far)
    if far < 1e-9 or not checker.CheckEdgeCollisionFree(points[nearest], new):
        return None
    points.append(new)
    parents.append(nearest)
    return far <= _RANGE


def back(tree):
    points, parents = tree
    way, i = [], len(points) - 1
    while i >= 0:
        way.append(points[i])
        i = parents[i]
    return way


def shorter(checker, path, draw):
    path = list(path)
    for _ in range(_SHORTCUTS):
        if len(path) < 3:
            break
        i, j = sorted(draw.choice(len(path), 2, replace=False))
        if j - i > 1 and checker.CheckEdgeCollisionFree(path[i], path[j]):
            del path[i + 1 : j]
    return path


serve("drake", make)

"""pyroboplan: its two-tree RRT-Connect, its shortcutter, and a trapezoid for each joint."""

import contextlib
import io

import numpy as np
import pinocchio as pin
from common import TICK, serve
from pyroboplan.planning.path_shortcutting import shortcut_path
from pyroboplan.planning.rrt import RRTPlanner, RRTPlannerOptions
from pyroboplan.trajectory.trapezoidal_velocity import TrapezoidalVelocityTrajectory


def make(problem):
    model = pin.buildModelFromXML(problem["urdf"])
    geometry = pin.buildGeomFromUrdfString(model, problem["urdf"], pin.GeometryType.COLLISION)
    links = [model.frames[shape.parentFrame].name for shape in geometry.geometryObjects]
    for one, other in problem["checked"]:
        for i, first in enumerate(links):
            for j, second in enumerate(links):
                if i < j and {first, second} == {one, other}:
                    geometry.addCollisionPair(pin.CollisionPair(i, j))
    limits = [np.array(problem[key]) for key in ("velocity", "acceleration")]

    def solve(start, goal, seed):
        options = RRTPlannerOptions(
            max_step_size=problem["step"],
            max_connection_dist=3.0,
            rrt_connect=True,
            bidirectional_rrt=True,
            max_planning_time=problem["timeout"],
            rng_seed=seed,
        )
        with contextlib.redirect_stdout(io.StringIO()):
            path = RRTPlanner(model, geometry, options).plan(np.array(start), np.array(goal))
        if not path:
            return None
        if len(path) > 2:
            path = shortcut_path(model, geometry, path, max_step_size=problem["step"])
        trajectory = TrapezoidalVelocityTrajectory(np.array(path).T, *limits)
        trajectory.generate(0.02)
        return trajectory

    def sample(trajectory):
        _, positions, _, _ = trajectory.generate(TICK)
        return positions.T

    return solve, sample


serve("pyroboplan", make)

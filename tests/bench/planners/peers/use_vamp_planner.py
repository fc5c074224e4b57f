"""VAMP: its RRT-Connect on the Panda as spheres, and its simplifier. It does not time paths.

So a path is timed by toppra for the reference checker, and this is not part of the measured time.
"""

from xml.etree import ElementTree

import numpy as np
import toppra
import vamp
from common import TICK, serve
from toppra.algorithm import TOPPRA
from toppra.constraint import JointAccelerationConstraint, JointVelocityConstraint


def make(problem):
    names = "panda", "rrtc"
    panda, plan, settings, simplify = vamp.configure_robot_and_planner_with_kwargs(*names)
    settings.max_iterations = settings.max_samples = 100_000  # it has no timeout
    environment, sampler = vamp.Environment(), panda.xorshift()
    for cuboid in cuboids(ElementTree.fromstring(problem["urdf"]), problem["bodies"]):
        environment.add_cuboid(cuboid)

    def solve(start, goal, seed):
        ends = np.array([start, goal])
        if not all(panda.validate(end, environment) for end in ends):
            return None  # it would not notice
        sampler.reset()
        sampler.skip(seed)
        found = plan(*ends, environment, settings, sampler)
        if not found.solved:
            return None
        return panda.simplify(found.path, environment, simplify, sampler).path.numpy()

    def sample(path):
        path = path[np.append(True, np.linalg.norm(np.diff(path, axis=0), axis=1) > 1e-6)]
        lengths = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1)))
        limits = (
            kind(np.outer(problem[name], (-1.0, 1.0)))
            for kind, name in (
                (JointVelocityConstraint, "velocity"),
                (JointAccelerationConstraint, "acceleration"),
            )
        )
        spline = toppra.SplineInterpolator(lengths, path.astype(float))
        motion = TOPPRA(
            [*limits], spline, parametrizer="ParametrizeConstAccel"
        ).compute_trajectory()
        ticks = np.append(np.arange(0.0, motion.duration, TICK), motion.duration)
        return motion(ticks)

    return solve, sample


def cuboids(urdf, bodies):
    """Yield the bodies. It has no cylinders, so a box around each; the problems have no spheres."""
    for name in bodies:
        shape = urdf.find(f"link[@name='{name}']/collision/geometry")[0]
        origin = urdf.find(f"joint[@name='{name}_joint']/origin")
        if shape.tag == "box":
            size = [float(value) for value in shape.get("size").split()]
        else:
            radius, length = (float(shape.get(key)) for key in ("radius", "length"))
            size = [2.0 * radius, 2.0 * radius, length]
        center = [float(value) for value in origin.get("xyz").split()]
        turn = [float(value) for value in origin.get("rpy").split()]
        yield vamp.Cuboid(center, reversed_axes(turn), [0.5 * value for value in size])


def reversed_axes(rpy):
    """Return the angles of turns about x, then the new y, then the new z, for roll, pitch, yaw."""
    (sr, sp, sy), (cr, cp, cy) = np.sin(rpy), np.cos(rpy)
    row = cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr
    return [
        float(np.arctan2(-(sy * sp * cr - cy * sr), cp * cr)),
        float(np.arcsin(np.clip(row[2], -1.0, 1.0))),
        float(np.arctan2(-row[1], row[0])),
    ]


serve("vamp-planner", make)

"""mplib: OMPL's RRTConnect over FCL, simplified, timed by toppra."""

import re
import tempfile
from pathlib import Path

import numpy as np
from common import TICK, serve
from mplib import Planner


def make(problem):
    folder = Path(tempfile.mkdtemp())
    urdf, srdf = folder / "arm.urdf", folder / "arm.srdf"
    urdf.write_text(
        re.sub('filename="(.*?)"', lambda m: f'filename="{kept(m[1], folder)}"', problem["urdf"])
    )
    srdf.write_text(problem["srdf"])
    planner = Planner(
        urdf,
        problem["tip"],
        srdf=srdf,
        user_joint_names=problem["joints"],
        joint_vel_limits=problem["velocity"],
        joint_acc_limits=problem["acceleration"],
    )

    def solve(start, goal, seed):
        found = planner.plan_qpos(
            [np.array(goal)],
            np.array(start),
            time_step=0.02,
            rrt_range=0.5,
            planning_time=problem["timeout"],
            fix_joint_limits=False,
        )
        return found if found["status"] == "Success" else None

    def sample(found):
        """Its own timing does not keep the path, so that its samples are what is left: a spline."""
        from scipy.interpolate import CubicHermiteSpline

        spline = CubicHermiteSpline(found["time"], found["position"], found["velocity"])
        ticks = np.append(np.arange(0.0, found["duration"], TICK), found["duration"])
        return spline(np.minimum(ticks, found["time"][-1]))

    return solve, sample


def kept(mesh, folder):
    """Copy a mesh beside the URDF, where it is looked for, without lines, which it cannot read."""
    lines = Path(mesh).read_text().splitlines()
    copy = folder / Path(mesh).name
    copy.write_text("\n".join(line for line in lines if not line.startswith("l ")))
    return copy.name


serve("mplib", make)

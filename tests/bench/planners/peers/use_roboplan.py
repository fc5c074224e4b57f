"""roboplan: RRT-Connect, its shortcutter, and its TOPP-RA with corners blended."""

import tempfile

import numpy as np
from common import TICK, serve
from roboplan.core import (
    JointConfiguration,
    PathShortcutter,
    PathShortcuttingOptions,
    Scene,
    loadJointLimitsConfig,
    loadUrdfSceneDescriptionFromXml,
)
from roboplan.rrt import RRT, RRTOptions
from roboplan.toppra import PathParameterizerTOPPRA, SplineFittingMode, TOPPRAOptions


def make(problem):
    scene = Scene("bench", loadUrdfSceneDescriptionFromXml(problem["urdf"]))
    scene.importSrdf(problem["srdf"])
    with tempfile.NamedTemporaryFile("w", suffix=".yaml") as limits:
        limits.write("joint_limits:\n")
        for name, v, a in zip(
            problem["joints"], problem["velocity"], problem["acceleration"], strict=True
        ):
            limits.write(f"  {name}:\n    max_velocity: [{v}]\n    max_acceleration: [{a}]\n")
        limits.flush()
        scene.importJointLimitsFromConfig(loadJointLimitsConfig(limits.name))
    step = problem["step"]
    rrt = RRT(
        scene,
        RRTOptions(
            group_name="arm",
            max_connection_distance=3.0,
            collision_check_step_size=step,
            max_planning_time=problem["timeout"],
            rrt_connect=True,
        ),
    )
    shortcutter = PathShortcutter(
        scene, PathShortcuttingOptions(group_name="arm", max_step_size=step, seed=1)
    )
    timing = PathParameterizerTOPPRA(scene, "arm")
    ends = [JointConfiguration(), JointConfiguration()]
    for end in ends:
        end.joint_names = problem["joints"]

    def options(dt):
        chosen = TOPPRAOptions()
        chosen.dt, chosen.mode = dt, SplineFittingMode.LinearBlend
        return chosen

    coarse, fine = options(0.02), options(TICK)

    def solve(start, goal, seed):
        rrt.setRngSeed(seed)
        ends[0].positions, ends[1].positions = np.array(start), np.array(goal)
        path = rrt.plan(*ends)
        if path is None:
            return None
        if len(path.positions) > 2:
            path = shortcutter.shortcut(path)
        timing.generate(path, coarse)
        return path

    return solve, lambda path: timing.generate(path, fine).positions


serve("roboplan", make)

"""Shapes of a moving robot, for drawings of plans and recordings."""

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from executive.recording.archive import restore_robot, restore_world
from hardware import Robot
from logs import Goal, Plan, Recording, Sent
from logs.views.motion_figure import MotionDrawing
from logs.views.narrative import bodies_text
from logs.views.run_figure import MotionScene
from skills.motion import World
from skills.motion.collision.link_outlines import convex_outlines
from skills.motion.collision.planning_scene import PlanningScene

POSES = 14  # largest number of drawn poses of a motion
_MOST_POSES = 4 * POSES


def motion_drawing(robot: Robot, world: World, configurations: ArrayLike) -> MotionDrawing:
    """Return the shapes of the robot and of the bodies, for each configuration of a motion.

    Args:
        robot: Description of the robot.
        world: Bodies around the robot and attached to it.
        configurations: Positions of all A actuated joints, shape (N, A) [rad].

    Raises:
        BadWorld: The world cannot be loaded.
    """
    scene = PlanningScene(robot, world)
    links = {body.name: body.link for body in world.bodies}
    poses, bodies, hollow, held = [], [], [], []
    for outlines in convex_outlines(scene, np.asarray(configurations, dtype=np.float64)):
        shapes = [(name, points.tolist()) for name, points in outlines]
        poses.append([points for name, points in shapes if name not in links])
        held.append([points for name, points in shapes if links.get(name)])
        around = [(name, points) for name, points in shapes if links.get(name) == ""]
        bodies = [points for name, points in around if name not in scene.hollow]
        hollow = [points for name, points in around if name in scene.hollow]
    return MotionDrawing(poses, bodies, held, hollow)


@dataclass
class _Motion:
    """A motion: its first plan, its start, and its commanded positions, by joint [rad]."""

    plan: Plan
    start: dict[str, float] = field(default_factory=dict)
    commanded: list[dict[str, float]] = field(default_factory=list)

    def add(self, plan: Plan) -> None:
        """Add the plan of a group. The start positions in the plan are valid for its own joints."""
        own = {name: q for name, q in plan.start.items() if name in plan.joints}
        self.start = plan.start | self.start | own

    def poses(self) -> list[dict[str, float]]:
        """Return at most POSES configurations, from the first to the last."""
        every = [self.start, *self.commanded]
        chosen = np.linspace(0, len(every) - 1, min(POSES, len(every))).round().astype(int)
        return [self.start | every[index] for index in chosen]


def scenes_of(path: Path) -> list[MotionScene]:
    """Return one scene per world with bodies: the bodies, and the motions of the run among them.

    Raises:
        RecordingError: The recording cannot be read, or does not contain a valid robot.
        BadWorld: A body is invalid, or its file is missing.
    """
    recording = Recording(path)
    motions = [each for each in _by_world(recording.records(Goal, Plan, Sent)) if each.world]
    return [_scene(restore_robot(recording), recording.files, each) for each in motions]


def scenes_in(records: Iterable[object], robot: Robot) -> list[MotionScene]:
    """Return one scene per world, also for a world without bodies. Bodies with a mesh are left out.

    Args:
        records: Events of a run. Only goals, plans and sent frames are used.
        robot: Description of the robot.

    Raises:
        BadWorld: A body is invalid.
    """
    found = _by_world(records)
    for each in found:
        each.world = [body for body in each.world if "mesh" not in body]
    return [_scene(robot, {}, each) for each in found]


@dataclass
class _InWorld:
    """The recorded bodies of one world, and the motions in this world, by number."""

    world: Sequence[Mapping[str, Any]]
    motions: dict[int, _Motion] = field(default_factory=dict)


def _by_world(records: Iterable[object]) -> list[_InWorld]:
    worlds: dict[str, _InWorld] = {}
    for number, motion in enumerate(_motions(records), 1):
        world = motion.plan.world
        worlds.setdefault(json.dumps(world), _InWorld(world)).motions[number] = motion
    return [*worlds.values()]


def _motions(records: Iterable[object]) -> list[_Motion]:
    motions: list[_Motion] = []
    for record in records:
        if isinstance(record, Goal):
            motions = []
        elif isinstance(record, Plan):
            if not motions or motions[-1].commanded:
                motions.append(_Motion(record))
            motions[-1].add(record)
        elif isinstance(record, Sent) and record.joints and motions:
            motions[-1].commanded.append(dict(zip(record.joints, record.positions, strict=True)))
    return motions


def _scene(robot: Robot, files: Mapping[str, bytes], found: _InWorld) -> MotionScene:
    world = restore_world(found.world, files)
    poses = [pose for motion in found.motions.values() for pose in motion.poses()]
    chosen = np.linspace(0, len(poses) - 1, min(_MOST_POSES, len(poses))).round().astype(int)
    rows = [[poses[index][joint.name] for joint in robot.actuated] for index in chosen]
    numbers = ", ".join(map(str, found.motions))
    around = bodies_text(found.world) or "nothing"
    title = f"Motion{'s' * (len(found.motions) > 1)} {numbers}; bodies in the world: {around}"
    return MotionScene(title, motion_drawing(robot, world, rows))

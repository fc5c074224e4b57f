"""MotionBenchMaker's problems for the Panda: goals in shelves, boxes and cages, and on tables.

C. Chamzas et al., "MotionBenchMaker: a tool to generate and benchmark motion planning datasets",
RA-L 2022. The problems are those that VAMP is measured with, from a checkout of its repository.
Every motion is checked each millisecond with the exact shapes. The other planners get the first
problems of each scene. For them, the bodies are padded by the whole margin.
"""

import json
import subprocess
import sys
import tarfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin
from ruamel.yaml import YAML

from hardware import Clock, RealClock, Robot, load_robot
from skills.motion import (
    Body,
    Box,
    Cylinder,
    EndInCollision,
    MotionError,
    Query,
    Shape,
    Sphere,
    World,
)
from skills.motion.collision.checker import CollisionChecker
from skills.motion.collision.planning_scene import PlanningScene
from skills.motion.planner import Planner
from tests.bench.planners.problems import Problem
from tests.bench.planners.reference.reference_checker import Array, ticks

_SHARES = (1.0, 0.9, 0.8, 0.7, 0.6, 0.5)  # of the margin; planning proves half of it
MARGINS = (0.005, 0.002)  # the second one if the first one forbids an end of the motion [m]
_ARM = tuple(f"panda_joint{i}" for i in range(1, 8))
_VAMP = "https://github.com/KavrakiLab/vamp"
_YAML = YAML(typ="safe")


@dataclass(frozen=True)
class ClutterProblem:
    """One query.

    Attributes:
        name: Kind of scene and number.
        world: The scene.
        start: Start [rad].
        goal: Goal [rad].
    """

    name: str
    world: World
    start: tuple[float, ...]
    goal: tuple[float, ...]

    def query(self, seed: int = 1, timeout: float = 1.0) -> Query:
        """Return the query for our planner."""
        return Query("arm", self.start, self.goal, seed, timeout, world=self.world)


def panda(folder: Path, margin: float, into: Path) -> Robot:
    """Return the arm of the problems; its robot file is written into a folder.

    Args:
        folder: VAMP's `resources/panda`.
        margin: Distance to keep [m].
        into: Folder for the robot file.
    """
    urdf, allowed = folder / "panda.urdf", []
    for pair in ElementTree.parse(folder / "panda.srdf").getroot().iter("disable_collisions"):
        allowed.append([pair.get("link1", ""), pair.get("link2", "")])
    lines = [f'name = "panda"\nurdf = {json.dumps(str(urdf))}\n[groups]\narm = {json.dumps(_ARM)}']
    for joint in ElementTree.parse(urdf).getroot().findall("joint"):
        limit = joint.find("limit")
        if joint.get("name") in _ARM and limit is not None:
            speed, lower, upper = (float(limit.attrib[k]) for k in ("velocity", "lower", "upper"))
            lines.append(
                f"[joints.{joint.get('name')}]\nvelocity = {speed}\nacceleration = {2.0 * speed}\n"
                f"boot = {0.5 * (lower + upper)}"
            )
    lines.append(f"[collision]\nmargin_m = {margin}\nfloor_ignores = []")
    lines.append(f"allowed = {json.dumps(allowed)}\n")
    file = into / f"panda_{1e3 * margin:g}.toml"
    file.write_text("\n".join(lines))
    return load_robot(file)


def clutter(folder: Path, count: int = 100) -> Iterator[ClutterProblem]:
    """Yield the first problems of each of the seven scenes.

    Args:
        folder: VAMP's `resources/panda`.
        count: Problems of each scene.
    """
    with tarfile.open(folder / "problems.tar.bz2") as archive:
        files = {name: archive.extractfile(name) for name in archive.getnames()}
        texts = {Path(name): file.read() for name, file in files.items() if file}
    requests = sorted(path for path in texts if path.stem.startswith("request"))
    for path in requests:
        number = int(path.stem.removeprefix("request"))
        if number <= count:
            scene = _YAML.load(texts[path.with_stem(f"scene{number:04}")])
            yield _problem(f"{path.parent.name}-{number}", scene, _YAML.load(texts[path]))


def checkout(home: Path, tell: Callable[[str], object]) -> Path | None:
    """Return VAMP's `resources/panda`; clone it if necessary. None if that fails."""
    folder = home / "vamp" / "resources" / "panda"
    if not folder.exists():
        tell(f"vamp: cloning {_VAMP} into {home / 'vamp'}\n")
        command = ["git", "clone", "--quiet", "--depth", "1", _VAMP, str(home / "vamp")]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode:
            tell(f"vamp: SKIPPED, its problems are not there: {done.stderr.strip()}\n")
            return None
    return folder


@dataclass(frozen=True)
class ClutterScore:
    """Result for all problems.

    Attributes:
        queries: Number of problems.
        spent: Time for each solved one [ms], by the problem's name.
        durations: Duration of each motion [s], by the problem's name.
        kept: Largest share of its margin that each motion keeps, of 1, 0.9 ... 0.5; 0 if none.
    """

    queries: int
    spent: Mapping[str, float]
    durations: Mapping[str, float]
    kept: Sequence[float]

    def scenes(self) -> Iterator[tuple[str, list[float]]]:
        """Yield the times of the problems of each scene [ms]."""
        for scene, names in groupby(sorted(self.spent), lambda name: name.rpartition("-")[0]):
            yield scene, [self.spent[name] for name in names]


def score(folder: Path, count: int, into: Path, clock: Clock | None = None) -> ClutterScore:
    """Run our planner on the first problems of each scene, with one second each.

    Args:
        folder: VAMP's `resources/panda`.
        count: Problems of each scene.
        into: Folder for robot files.
        clock: Time source. Default: the system's.
    """
    clock, problems = clock or RealClock(), list(clutter(folder, count))
    robots = [panda(folder, margin, into) for margin in MARGINS]
    planners = [Planner(robot, clock) for robot in robots]
    for planner in planners:
        for problem in problems[:2]:  # warm up: not timed
            with suppress(MotionError):
                planner.plan(problem.query(timeout=5.0))
    spent, durations, kept = dict[str, float](), dict[str, float](), list[float]()
    for problem in problems:
        for robot, planner in zip(robots, planners, strict=True):
            begun = clock.now()
            try:
                plan = planner.plan(problem.query())
            except EndInCollision:
                continue
            except MotionError as error:
                sys.stderr.write(f"{problem.name}: {error}\n")
                break
            spent[problem.name] = 1e3 * (clock.now() - begun)
            durations[problem.name] = plan.duration
            scene, margin, rows = (
                PlanningScene(robot, problem.world),
                robot.collision.margin,
                ticks(plan),
            )
            shares = (each for each in _SHARES if not collides(scene, each * margin, rows))
            kept.append(next(shares, 0.0))
            break
    return ClutterScore(len(problems), spent, durations, kept)


def for_peers(folder: Path, count: int, into: Path) -> Iterator[Problem]:
    """Yield the first problems of each scene for the other planners.

    They get the larger margin, as padding of the bodies.
    """
    robot = panda(folder, MARGINS[0], into)
    for each in clutter(folder, count):
        yield Problem(each.name, robot, each.world, [(each.start, each.goal)], boxes=False)


def rates(folder: Path, into: Path) -> Iterator[tuple[float, float]]:
    """Yield configurations checked per second in each scene: ours, and coal's one after another.

    Args:
        folder: VAMP's `resources/panda`.
        into: Folder for the robot file.
    """
    robot = panda(folder, MARGINS[0], into)
    lower, upper = np.array([(joint.lower, joint.upper) for joint in robot.actuated]).T
    rows = np.random.default_rng(1).uniform(lower, upper, (500, len(lower)))
    for problem in clutter(folder, 1):
        scene = PlanningScene(robot, problem.world)
        checker = CollisionChecker(scene)

        def ours(checker: CollisionChecker = checker) -> object:
            return checker.collisions(rows, MARGINS[0])

        def coal(scene: PlanningScene = scene) -> object:
            return collides(scene, 0.5 * MARGINS[0], rows, stop=False)

        ours(), coal()  # warm up
        spent = []
        for check in (ours, coal):
            begun = time.perf_counter()
            check()
            spent.append(time.perf_counter() - begun)
        yield len(rows) / spent[0], len(rows) / spent[1]


def collides(scene: PlanningScene, distance: float, rows: Array, stop: bool = True) -> bool:
    """Return True if two exact shapes are closer than a distance, by pinocchio only.

    Args:
        scene: The scene.
        distance: Distance to keep [m].
        rows: Configurations (N, A) [rad].
        stop: False to check all rows after a collision.
    """
    model, geometry = scene.kinematics, scene.exact
    data, placed = model.createData(), geometry.createData()
    for k in range(len(geometry.collisionPairs)):
        placed.collisionRequests[k].security_margin = distance
    hits = (pin.computeCollisions(model, data, geometry, placed, q, True) for q in rows)
    return any(hits) if stop else any(list(hits))


def _problem(name: str, scene: Mapping[str, Any], request: Mapping[str, Any]) -> ClutterProblem:
    state = request["start_state"]["joint_state"]
    start = dict(zip(state["name"], state["position"], strict=True))
    goal = {
        each["joint_name"]: each["position"]
        for each in request["goal_constraints"][0]["joint_constraints"]
    }
    bodies = tuple(_body(each) for each in scene["world"]["collision_objects"])
    ends = (tuple(float(end[joint]) for joint in _ARM) for end in (start, goal))
    return ClutterProblem(name, World(bodies), *ends)


def _body(plain: Mapping[str, Any]) -> Body:
    pose = _pose(plain["pose"]) if "pose" in plain else pin.SE3.Identity()
    pose = pose * _pose(plain["primitive_poses"][0])
    x, y, z, *rotation = pin.SE3ToXYZQUAT(pose).tolist()
    return Body(plain["id"], _shape(plain["primitives"][0]), (x, y, z), tuple(rotation))


def _pose(plain: Mapping[str, Any]) -> pin.SE3:
    quaternion = np.array(plain["orientation"], dtype=float)
    quaternion /= np.linalg.norm(quaternion)
    return pin.XYZQUATToSE3(np.array((*plain["position"], *quaternion), dtype=float))


def _shape(plain: Mapping[str, Any]) -> Shape:
    sizes = [float(size) for size in plain["dimensions"]]
    match plain["type"]:
        case "box":
            return Box((sizes[0], sizes[1], sizes[2]))
        case "cylinder":
            return Cylinder(sizes[1], sizes[0])
        case "sphere":
            return Sphere(sizes[0])
    raise ValueError(f"{plain['type']} is not a shape of the problems")

"""Ours and its peers on the same problems, in the same run, under the same judge."""

import json
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from hardware import Robot
from skills.motion import MotionError, Plan
from skills.motion.collision.planning_scene import PlanningScene
from skills.motion.planner import Planner
from skills.motion.timing.time_parameterization import time_curve
from skills.motion.trajectory.curve import Curve
from tests.bench.planners.problems import Problem
from tests.bench.planners.reference.padded import padded
from tests.bench.planners.reference.reference_checker import TICK, ReferenceChecker, excess, ticks

Array = NDArray[np.float64]
SCRIPTS = Path(__file__).parent / "peers"

PEERS = {
    "roboplan": "roboplan==0.7.0",
    "pyroboplan": "pyroboplan==1.3.1",
    "mplib": "mplib==0.2.1",
    "drake": "drake==1.51.1",
    "ruckig": "ruckig==0.19.4",
    "vamp_planner": "vamp-planner==0.6.4 toppra==0.6.10",
}
_LEFT = 0.3  # share of the margin that the other planners' steps prove
_PATIENCE = 300.0  # for all queries of a problem [s]


@dataclass(frozen=True)
class Score:
    """Result of a planner for a problem.

    Attributes:
        stack: The planner, with its version.
        problem: The problem's name.
        queries: Number of queries.
        spent: Time for each solved query [ms].
        durations: Duration of each motion [s].
        ratios: The same, divided by that of the straight line.
        colliding: Number of motions in collision.
        over: Largest excess over a limit of each, as a share of the limit.
        detours: Indices in `spent` of the motions that are not straight.
    """

    stack: str
    problem: str
    queries: int
    spent: Sequence[float]
    durations: Sequence[float]
    ratios: Sequence[float]
    colliding: int
    over: Sequence[float]
    detours: Sequence[int]

    def p(self, share: float) -> float:
        """Percentile of the time [ms]."""
        return float(np.percentile(self.spent, share)) if self.spent else float("nan")

    def detour(self, share: float) -> float:
        """Percentile of the time for detours only [ms]."""
        chosen = [self.spent[i] for i in self.detours]
        return float(np.percentile(chosen, share)) if chosen else float("nan")

    def ratio(self) -> float:
        """Mean duration, divided by that of the straight line."""
        return statistics.fmean(self.ratios) if self.ratios else float("nan")

    def worst(self) -> float:
        """Largest excess over a limit, as a share of the limit."""
        return max(self.over, default=float("nan"))


Tell = Callable[[str], object]
Answers = Iterator[tuple[float, Array]]


def ours(problem: Problem) -> Score:
    """Run our planner in this process, as a worker does."""
    planner = Planner(problem.robot)

    queries, found = list(problem.queries()), list[tuple[float, Plan | None]]()
    for query in queries[:3]:
        with suppress(MotionError):
            planner.plan(query)  # warm up: not timed
    for query in queries:
        begun = time.perf_counter()
        try:
            plan = planner.plan(query)
        except MotionError as error:
            sys.stderr.write(f"armtree: {error}\n")
            plan = None
        found.append((1e3 * (time.perf_counter() - begun), plan))
    return _score("armtree", problem, ((spent, ticks(plan)) for spent, plan in found))


def peer(name: str, venv: Path, problem: Problem, folder: Path) -> Score:
    """Run another planner in its own environment.

    Raises:
        RuntimeError: Its script failed; has the last line of its output.
    """
    given, out = folder / f"{problem.name}.json", folder / f"{name}-{problem.name}.json"
    given.write_text(json.dumps(_plain(problem)))
    command = [str(venv / "bin" / "python"), str(SCRIPTS / f"use_{name}.py"), str(given), str(out)]
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, check=False, timeout=_PATIENCE
        )
    except subprocess.TimeoutExpired as error:
        raise RuntimeError(f"not done within {error.timeout:g} s") from error
    if done.returncode or not out.exists():
        lines = done.stderr.strip().splitlines() or [f"ended with {done.returncode}"]
        raise RuntimeError(lines[-1])
    answer = json.loads(out.read_text())
    rows = np.fromfile(out.with_suffix(".bin")).reshape(-1, len(problem.robot.actuated_in("arm")))

    def answers() -> Answers:
        begin = 0
        for row in answer["rows"]:
            yield row["ms"], rows[begin : begin + row["samples"]]
            begin += row["samples"]

    return _score(f"{name} {answer['version']}", problem, answers())


def installed(name: str, home: Path, tell: Tell) -> Path | None:
    """Return the environment of a planner; install it if necessary. None if that fails."""
    venv = home / name
    if (venv / "ready").exists():
        return venv
    tell(f"{name}: installing into {venv}\n")
    for command in (
        [sys.executable, "-m", "venv", str(venv)],
        [str(venv / "bin" / "pip"), "install", "--quiet", *PEERS[name].split()],
    ):
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode:
            lines = (done.stderr or done.stdout).strip().splitlines() or ["no reason given"]
            tell(f"{name}: SKIPPED, it does not install: {lines[-1]}\n")
            return None
    (venv / "ready").touch()
    return venv


def _plain(problem: Problem) -> dict[str, object]:
    robot, description = problem.robot, padded(problem.robot, problem.world, boxes=problem.boxes)
    arm = robot.actuated_in("arm")
    columns = [robot.actuated.index(joint) for joint in arm]
    levers = PlanningScene(robot, problem.world).lever_arms[:, columns].max(axis=0, initial=0.0)
    step = 2.0 * (1.0 - _LEFT) * robot.collision.margin / float(np.linalg.norm(levers))
    return {
        "urdf": description.urdf,
        "srdf": description.srdf,
        "bodies": [body.name for body in problem.world.bodies],
        "joints": description.joints,
        "checked": sorted(sorted(pair) for pair in description.checked),
        "tip": _tip(description.urdf),
        "velocity": [joint.velocity for joint in arm],
        "acceleration": [joint.acceleration for joint in arm],
        "pairs": problem.pairs,
        "step": step,
        "timeout": problem.timeout,
    }


def _tip(urdf: str) -> str:
    """The link at the end of the longest chain."""
    model = pin.buildModelFromXML(urdf)
    last = max(range(model.njoints), key=lambda joint: len(model.supports[joint]))
    bodies = [f for f in model.frames if f.type == pin.FrameType.BODY and f.parentJoint == last]
    return str(bodies[-1].name)


def _score(stack: str, problem: Problem, answers: Answers) -> Score:
    reference, arm = (
        ReferenceChecker(padded(problem.robot, problem.world, 0.0, problem.boxes)),
        problem.robot.actuated_in("arm"),
    )
    velocity = np.array([joint.velocity for joint in arm])
    acceleration = np.array([joint.acceleration for joint in arm])
    spent, durations, over, detours = list[float](), list[float](), list[float](), list[int]()
    ratios, colliding = list[float](), 0
    for (start, goal), (ms, rows) in zip(problem.pairs, answers, strict=True):
        if not len(rows) or _gap(rows[-1] - goal, problem.robot) > 1e-3:
            continue  # not solved, or not at the goal
        ends = np.array([start, goal])
        line = time_curve(Curve.through(ends, np.empty(0)), velocity, acceleration)
        assert line
        if _off(rows, ends) > 1e-3:
            detours.append(len(spent))
        spent.append(ms)
        durations.append((len(rows) - 1) * TICK)
        ratios.append(durations[-1] / line.duration)
        colliding += reference.collides(rows)
        over.append(excess(rows, velocity, acceleration))
    count = len(problem.pairs)
    return Score(stack, problem.name, count, spent, durations, ratios, colliding, over, detours)


def _gap(offsets: Array, robot: Robot) -> float:
    """Largest distance of a joint from its goal; whole turns of a continuous joint are ignored."""
    endless = [not np.isfinite(joint.lower) for joint in robot.actuated_in("arm")]
    turns = np.where(endless, np.round(offsets / (2.0 * np.pi)), 0.0)
    return float(abs(offsets - 2.0 * np.pi * turns).max())


def _off(rows: Array, ends: Array) -> float:
    """Largest distance of a motion from the straight line [rad]."""
    way = (ends[1] - ends[0]) / np.linalg.norm(ends[1] - ends[0])
    offsets = rows - ends[0]
    return float(np.linalg.norm(offsets - np.outer(offsets @ way, way), axis=1).max())

"""Plans motions without an arm, explains them line by line, and draws them."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from hardware import DISPLAY_UNITS, RealClock, Robot
from skills.motion import EMPTY, BadWorld, Plan, World
from skills.motion.deadline import Stopwatch
from skills.motion.planner import Planner
from skills.motion.timing.explain import limits_met, straight_duration

from .plan_request import PlanRequest
from .task_motions import Motion
from .world_file import check_world, read_world

_STEP = 0.005  # time between two points of the curves [s]
_MOST_BODIES = 20  # largest number of names of bodies in the explanation
_MOST_POINTS = 20_000  # largest number of points of the curves, for motions of hours


class Explanation:
    """Plans and draws each motion of a request, and explains it.

    Args:
        request: Arguments of `armtree plan`, with the motions to plan.
        world: JSON or YAML file with a list of bodies, as in `World.plain`; None for no bodies.
        timeout: Longest time to plan a motion [s].
        output: PNG, SVG or PDF file for the drawing of the first motion. Drawings of further
            motions are written to the same folder, with a number in their names.

    Raises:
        BadTarget: Goal or start is invalid.
        BadWorldFile: The world file is invalid or missing.
        MotionError: The tool cannot reach a point.
    """

    def __init__(
        self, request: PlanRequest, world: Path | None, timeout: float, output: Path
    ) -> None:
        self._robot, self._world = request.robot, world
        self._timeout, self._output = timeout, output
        self._watch = Stopwatch(RealClock())
        with self._watch.stage("model"):
            self._planner = Planner(request.robot)
        self._bodies = EMPTY
        if world:
            with self._watch.stage("world"), self._blaming_the_file():
                self._bodies = read_world(world)
                self._planner.prepare(self._bodies)
        with self._watch.stage("goal"), self._blaming_the_file():
            self._motions, self._unknown = request.motions(self._planner, self._bodies)

    def lines(self) -> Iterator[str]:
        """Plan and draw each motion. Yield the explanation line by line.

        Raises:
            MotionError: A motion cannot be planned.
        """
        yield f"Prepared  in {_times(self._watch.milliseconds)}"
        for message in self._unknown:
            yield f"Unplanned {message}"
        for number, motion in enumerate(self._motions, 1):
            first, plan, picture = self._planned(number, motion)
            if len(self._motions) > 1:
                yield f"Motion {number} of {len(self._motions)}"
            if motion.assumed_start:
                start = _joints(self._robot, plan.joints, plan.origin)
                yield f"Start     assumed to be {start}: the start is known only in a run"
            yield from _explain_plan(self._robot, plan, len(motion.query.via), first)
            yield from _bodies(motion.query.world, motion.left_out)
            _draw(self._robot, motion.query.world, plan, picture)
            yield str(picture)

    def to_json(self) -> dict[str, Any]:
        """Plan and draw each motion. Return all motions as JSON objects [rad, m, s].

        Raises:
            MotionError: A motion cannot be planned.
        """
        motions = []
        for number, motion in enumerate(self._motions, 1):
            _, plan, picture = self._planned(number, motion)
            _draw(self._robot, motion.query.world, plan, picture)
            motions.append(_as_json(motion, plan) | {"drawing": str(picture)})
        return {"motions": motions, "not_seen": self._unknown}

    def _planned(self, number: int, motion: Motion) -> tuple[float, Plan, Path]:
        """Return the time of the first planning [ms], the plan, and the file of its drawing."""
        output = self._output
        query = replace(motion.query, timeout=self._timeout)
        with self._blaming_the_file():
            first = sum(self._planner.plan(query).milliseconds.values())
            plan = self._planner.plan(query)
        return first, plan, output if number == 1 else output.with_stem(f"{output.stem}-{number}")

    @contextmanager
    def _blaming_the_file(self) -> Iterator[None]:
        """Raise an error that names the world file if planning fails because of an invalid body.

        If the task added the body, raise the original error.
        """
        try:
            yield
        except BadWorld:
            if self._world:
                check_world(self._world, self._bodies, self._robot)
            raise


def _as_json(motion: Motion, plan: Plan) -> dict[str, Any]:
    return {
        "group": plan.group,
        "joints": list(plan.joints),
        "start": list(map(float, plan.origin)),
        "start_is_assumed": motion.assumed_start,
        "goal": list(map(float, plan.goal)),
        "waypoints": plan.waypoints.tolist(),
        "duration_s": float(plan.duration),
        "straight_duration_s": float(straight_duration(plan)),
        "held_by": [
            {
                "joint": limit.joint,
                "kind": limit.kind,
                "limit": float(limit.value),
                "duration_s": float(limit.seconds),
            }
            for limit in limits_met(plan)
        ],
        "planning_ms": {name: float(ms) for name, ms in plan.milliseconds.items()},
        "bodies": [body.name for body in motion.query.world.bodies],
        "left_out": list(motion.left_out),
    }


def _explain_plan(robot: Robot, plan: Plan, via: int, first: float) -> Iterator[str]:
    """Explain a plan.

    Args:
        robot: Description of the robot.
        plan: The plan.
        via: Number of points that the motion passes.
        first: Time of the first planning in this process [ms].
    """
    straight = straight_duration(plan)
    yield f"Goal      {_joints(robot, plan.joints, plan.goal)}"
    longer = ""
    if len(plan.waypoints) > 2:
        if straight:
            longer = f", the path is {100.0 * (plan.duration / straight - 1.0):.1f} % longer"
        how = f"through {via} point{'s' * (via > 1)}" if via else "around an obstacle"
        yield f"Path      {how}, {len(plan.waypoints)} waypoints"
    else:
        yield f"Path      {'straight' if plan.duration else 'none: the arm is at the goal already'}"
    yield f"Duration  {plan.duration:.3f} s; a straight line would take {straight:.3f} s{longer}"
    yield f"Planned   in {_times(plan.milliseconds)}; the first planning took {first:.2f} ms"
    for limit in limits_met(plan):
        value = robot.joint(limit.joint).words(limit.value) + (
            "/s" if limit.kind == "speed" else "/s²"
        )
        share = 100.0 * limit.seconds / plan.duration
        what = f"the {limit.kind} limit of {limit.joint}, {value}"
        yield f"Held by   {what}: {limit.seconds:.2f} s ({share:.0f} %)"


def _times(milliseconds: Mapping[str, float]) -> str:
    parts = ", ".join(f"{name} {ms:.2f}" for name, ms in milliseconds.items())
    return f"{sum(milliseconds.values()):.2f} ms ({parts})"


def _joints(robot: Robot, names: Iterable[str], positions: Iterable[float]) -> str:
    pairs = zip(names, positions, strict=True)
    return ", ".join(f"{name} {robot.joint(name).words(q)}" for name, q in pairs)


def _bodies(world: World, left_out: Sequence[str]) -> Iterator[str]:
    bodies = (f"{b.name} on {b.link}" if b.link else b.name for b in world.bodies)
    left = len(world.bodies) - _MOST_BODIES
    more = f" and {left} more" if left > 0 else ""
    if world.bodies:
        yield f"Bodies    {', '.join(islice(bodies, _MOST_BODIES))}{more}"
    if left_out:
        yield f"Left out  {', '.join(left_out)}: bodies whose pose is known only in a run"


def _draw(robot: Robot, world: World, plan: Plan, output: Path) -> None:
    from logs.views.plan_figure import PlanDrawing, draw_plan  # matplotlib takes half a second

    from .motion_drawing import POSES, motion_drawing

    step = max(_STEP, plan.duration / _MOST_POINTS)
    times = np.append(np.arange(0.0, plan.duration, step), plan.duration)
    names = [joint.name for joint in robot.actuated]
    columns = [names.index(name) for name in plan.joints]
    rows = np.tile(np.array(plan.start), (POSES, 1))
    rows[:, columns] = plan.sample(np.linspace(0.0, plan.duration, POSES))
    shown = [DISPLAY_UNITS[robot.joint(name).unit] for name in plan.joints]
    scales = np.array([scale for scale, _ in shown])
    draw_plan(
        PlanDrawing(
            title=f"{robot.name}: {plan.group}, {plan.duration:.2f} s",
            joints=plan.joints,
            units=[unit for _, unit in shown],
            times=times.tolist(),
            positions=(scales * plan.sample(times)).tolist(),
            speeds=(scales * plan.velocities(times)).tolist(),
            accelerations=(scales * plan.accelerations(times)).tolist(),
            waypoints=(scales * plan.waypoints).tolist(),
            speed_limits=(scales * plan.velocity).tolist(),
            acceleration_limits=(scales * plan.acceleration).tolist(),
            motion=motion_drawing(robot, world, rows),
        ),
        output,
    )

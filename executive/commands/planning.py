"""`armtree plan`: a motion found, explained and drawn, without an arm."""

import json
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from hardware import Robot
from skills.motion import EMPTY, BadWorld, Plan, World
from skills.motion.explain import limits_met, straight_duration
from skills.motion.planner import Planner

from .plan_goal import Goal

_GRID = 0.005  # of the curves [s]
_MOST = 20_000  # points of the curves of a motion of hours


def explain(goal: Goal, world: Path | None, output: Path) -> Iterator[str]:
    """Plan, draw, and say what was found, line by line.

    Args:
        goal: What to plan for.
        world: JSON file with a list of bodies, as `World.plain` writes them.
        output: The PNG to write; where there are several motions, the others beside it.

    Raises:
        BadTarget: Goal or start cannot be read, or name no joint.
        MotionError: There is no plan.
    """
    robot = goal.robot
    planner = Planner(robot)
    queries = goal.queries(planner, _world(world))
    for number, (query, left_out) in enumerate(queries, 1):
        first = sum(planner.plan(query).milliseconds.values())
        plan = planner.plan(query)
        if len(queries) > 1:
            yield f"Motion {number} of {len(queries)}"
        yield from _told(robot, plan, len(query.via), first)
        yield from _around(query.world, left_out)
        picture = output if number == 1 else output.with_stem(f"{output.stem}-{number}")
        _draw(robot, query.world, plan, picture)
        yield str(picture)


def _world(file: Path | None) -> World:
    if file is None:
        return EMPTY
    try:
        bodies = json.loads(file.read_text())
    except (OSError, ValueError, RecursionError) as error:
        raise BadWorld(f"{file} cannot be read as JSON: {error}") from error
    return World.parse(bodies)


def _told(robot: Robot, plan: Plan, via: int, first: float) -> Iterator[str]:
    """In words; `first` is how long it took the first time [ms]."""
    spent = sum(plan.milliseconds.values())
    rungs = ", ".join(f"{name} {ms:.2f}" for name, ms in plan.milliseconds.items())
    line = straight_duration(plan)
    goal = ", ".join(f"{n} {q:.3f}" for n, q in zip(plan.joints, plan.goal, strict=True))
    yield f"Goal      {goal}"
    if len(plan.waypoints) > 2:
        more = 100.0 * (plan.duration / line - 1.0) if line else 0.0
        how = f"by way of {via} point{'s' * (via > 1)}" if via else "round something"
        yield f"Path      {how}, {len(plan.waypoints)} waypoints, {more:.0f} % longer"
    else:
        yield "Path      straight" if plan.duration else "Path      none: it is there already"
    yield f"Duration  {plan.duration:.3f} s; a straight line would take {line:.3f} s"
    yield f"Found in  {spent:.2f} ms ({rungs}); the first time in {first:.2f} ms"
    for limit in limits_met(plan):
        unit = robot.joint(limit.joint).unit + ("/s" if limit.kind == "speed" else "/s²")
        share = 100.0 * limit.seconds / plan.duration
        what = f"{limit.joint} at its {limit.kind} limit, {limit.value:g} {unit}"
        yield f"Held by   {what}: {limit.seconds:.2f} s ({share:.0f} %)"


def _around(world: World, left_out: Sequence[str]) -> Iterator[str]:
    bodies = (f"{b.name} on {b.link}" if b.link else b.name for b in world.bodies)
    if world.bodies:
        yield f"Around    {', '.join(bodies)}"
    if left_out:
        yield f"Left out  {', '.join(left_out)}: only a run of the task tells whether and where"


def _draw(robot: Robot, world: World, plan: Plan, output: Path) -> None:
    from logs.plan_figure import PlanPicture, draw_plan  # matplotlib takes half a second

    from .sweeps import POSES, sweep_of

    grid = max(_GRID, plan.duration / _MOST)
    times = np.append(np.arange(0.0, plan.duration, grid), plan.duration)
    columns = [_column(robot, name) for name in plan.joints]
    rows = np.tile(np.array(plan.start), (POSES, 1))
    rows[:, columns] = plan.sample(np.linspace(0.0, plan.duration, POSES))
    draw_plan(
        PlanPicture(
            title=f"{robot.name}: {plan.group}, {plan.duration:.2f} s",
            joints=plan.joints,
            units=[robot.joint(name).unit for name in plan.joints],
            times=times.tolist(),
            positions=plan.sample(times).tolist(),
            speeds=plan.velocities(times).tolist(),
            accelerations=plan.accelerations(times).tolist(),
            waypoints=plan.waypoints.tolist(),
            speed_limits=plan.velocity.tolist(),
            acceleration_limits=plan.acceleration.tolist(),
            sweep=sweep_of(robot, world, rows),
        ),
        output,
    )


def _column(robot: Robot, name: str) -> int:
    return [joint.name for joint in robot.actuated].index(name)

"""`armtree plan`: a motion found, explained and drawn, without an arm."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from executive.planning.goals import Goal
from executive.planning.world_file import check_world, read_world
from hardware import RealClock, Robot
from skills.motion import EMPTY, BadWorld, Plan, World
from skills.motion.deadline import Stopwatch
from skills.motion.planner import Planner
from skills.motion.timing.explain import limits_met, straight_duration

_GRID = 0.005  # of the curves [s]
_MOST = 20_000  # points of the curves of a motion of hours


def explain(goal: Goal, world: Path | None, output: Path) -> Iterator[str]:
    """Plan, draw, and say what was found, line by line.

    Args:
        goal: What to plan for.
        world: JSON file with a list of bodies, as `World.plain` writes them.
        output: The PNG, SVG or PDF to write; where there are several motions, the others beside it.

    Raises:
        BadTarget: Goal or start cannot be read, or name no joint.
        BadWorldFile: The file is wrong, or not there.
        MotionError: There is no plan.
    """
    watch = Stopwatch(RealClock())
    with watch.stage("model"):
        planner = Planner(goal.robot)
    bodies = read_world(world) if world else EMPTY
    try:
        yield from _explained(goal, planner, bodies, output, watch)
    except BadWorld:
        if world:  # else it is a body of the task's own that is wrong
            check_world(world, bodies, goal.robot, planner)
        raise


def _explained(
    goal: Goal, planner: Planner, bodies: World, output: Path, watch: Stopwatch
) -> Iterator[str]:
    robot = goal.robot
    with watch.stage("goal"):
        legs, unknown = goal.legs(planner, bodies)
    yield f"Prepared  in {_rungs(watch.milliseconds)}"
    for move in unknown:
        yield f"Not seen  {move}"
    for number, leg in enumerate(legs, 1):
        query = leg.query
        first = sum(planner.plan(query).milliseconds.values())
        plan = planner.plan(query)
        if len(legs) > 1:
            yield f"Motion {number} of {len(legs)}"
        if leg.assumed:
            yield f"Start     taken to be {_joints(plan.joints, plan.origin)}: only a run tells"
        yield from _told(robot, plan, len(query.via), first)
        yield from _around(query.world, leg.left_out)
        picture = output if number == 1 else output.with_stem(f"{output.stem}-{number}")
        _draw(robot, query.world, plan, picture)
        yield str(picture)


def _told(robot: Robot, plan: Plan, via: int, first: float) -> Iterator[str]:
    """In words; `first` is how long it took the first time [ms]."""
    line = straight_duration(plan)
    yield f"Goal      {_joints(plan.joints, plan.goal)}"
    longer = ""
    if len(plan.waypoints) > 2:
        if line:
            longer = f", this one {100.0 * (plan.duration / line - 1.0):.1f} % longer"
        how = f"by way of {via} point{'s' * (via > 1)}" if via else "round something"
        yield f"Path      {how}, {len(plan.waypoints)} waypoints"
    else:
        yield "Path      straight" if plan.duration else "Path      none: it is there already"
    yield f"Duration  {plan.duration:.3f} s; a straight line would take {line:.3f} s{longer}"
    yield f"Found in  {_rungs(plan.milliseconds)}; the first time in {first:.2f} ms"
    for limit in limits_met(plan):
        unit = robot.joint(limit.joint).unit + ("/s" if limit.kind == "speed" else "/s²")
        share = 100.0 * limit.seconds / plan.duration
        what = f"the {limit.kind} limit of {limit.joint}, {limit.value:g} {unit}"
        yield f"Held by   {what}: {limit.seconds:.2f} s ({share:.0f} %)"


def _rungs(milliseconds: Mapping[str, float]) -> str:
    each = ", ".join(f"{name} {ms:.2f}" for name, ms in milliseconds.items())
    return f"{sum(milliseconds.values()):.2f} ms ({each})"


def _joints(names: Iterable[str], positions: Iterable[float]) -> str:
    return ", ".join(f"{name} {q:.3f}" for name, q in zip(names, positions, strict=True))


def _around(world: World, left_out: Sequence[str]) -> Iterator[str]:
    bodies = (f"{b.name} on {b.link}" if b.link else b.name for b in world.bodies)
    if world.bodies:
        yield f"Around    {', '.join(bodies)}"
    if left_out:
        yield f"Left out  {', '.join(left_out)}: only a run of the task tells whether and where"


def _draw(robot: Robot, world: World, plan: Plan, output: Path) -> None:
    from executive.planning.motion_drawing import POSES, motion_drawing
    from logs.views.plan_figure import PlanDrawing, draw_plan  # matplotlib takes half a second

    grid = max(_GRID, plan.duration / _MOST)
    times = np.append(np.arange(0.0, plan.duration, grid), plan.duration)
    columns = [_column(robot, name) for name in plan.joints]
    rows = np.tile(np.array(plan.start), (POSES, 1))
    rows[:, columns] = plan.sample(np.linspace(0.0, plan.duration, POSES))
    draw_plan(
        PlanDrawing(
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
            motion=motion_drawing(robot, world, rows),
        ),
        output,
    )


def _column(robot: Robot, name: str) -> int:
    return [joint.name for joint in robot.actuated].index(name)

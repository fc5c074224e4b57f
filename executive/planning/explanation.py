"""Plans motions without an arm, explains them line by line, and draws them."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from hardware import RealClock, Robot
from skills.motion import EMPTY, BadWorld, Plan, World
from skills.motion.deadline import Stopwatch
from skills.motion.planner import Planner
from skills.motion.timing.explain import limits_met, straight_duration

from .plan_request import PlanRequest
from .world_file import check_world, read_world

_STEP = 0.005  # time between two points of the curves [s]
_MOST_POINTS = 20_000  # most points of the curves, for a motion that takes hours


def explain(request: PlanRequest, world: Path | None, output: Path) -> Iterator[str]:
    """Plan and draw each motion; yield the explanation line by line.

    Args:
        request: What to plan.
        world: JSON file with a list of bodies, as `World.plain` writes them; None for no bodies.
        output: PNG, SVG or PDF file to write. Further motions are written to files beside it, with
            a number in their names.

    Raises:
        BadTarget: Goal or start is invalid.
        BadWorldFile: The world file is invalid or missing.
        MotionError: A motion cannot be planned.
    """
    watch = Stopwatch(RealClock())
    with watch.stage("model"):
        planner = Planner(request.robot)
    bodies = read_world(world) if world else EMPTY
    try:
        yield from _explain_motions(request, planner, bodies, output, watch)
    except BadWorld:
        if world:  # otherwise the task adds the invalid body
            check_world(world, bodies, request.robot)
        raise


def _explain_motions(
    request: PlanRequest, planner: Planner, bodies: World, output: Path, watch: Stopwatch
) -> Iterator[str]:
    robot = request.robot
    with watch.stage("goal"):
        motions, unknown = request.motions(planner, bodies)
    yield f"Prepared  in {_times(watch.milliseconds)}"
    for message in unknown:
        yield f"Not seen  {message}"
    for number, motion in enumerate(motions, 1):
        query = motion.query
        first = sum(planner.plan(query).milliseconds.values())
        plan = planner.plan(query)
        if len(motions) > 1:
            yield f"Motion {number} of {len(motions)}"
        if motion.assumed_start:
            start = _joints(robot, plan.joints, plan.origin)
            yield f"Start     assumed to be {start}: it is known only in a run"
        yield from _explain_plan(robot, plan, len(query.via), first)
        yield from _bodies(query.world, motion.left_out)
        picture = output if number == 1 else output.with_stem(f"{output.stem}-{number}")
        _draw(robot, query.world, plan, picture)
        yield str(picture)


def _explain_plan(robot: Robot, plan: Plan, via: int, first: float) -> Iterator[str]:
    """Explain a plan.

    Args:
        robot: Description of the robot.
        plan: The plan.
        via: Number of points to pass.
        first: Time that planning took in a new process [ms].
    """
    straight = straight_duration(plan)
    yield f"Goal      {_joints(robot, plan.joints, plan.goal)}"
    longer = ""
    if len(plan.waypoints) > 2:
        if straight:
            longer = f", this one {100.0 * (plan.duration / straight - 1.0):.1f} % longer"
        how = f"through {via} point{'s' * (via > 1)}" if via else "around an obstacle"
        yield f"Path      {how}, {len(plan.waypoints)} waypoints"
    else:
        yield "Path      straight" if plan.duration else "Path      none: the arm is there already"
    yield f"Duration  {plan.duration:.3f} s; a straight line would take {straight:.3f} s{longer}"
    yield f"Found in  {_times(plan.milliseconds)}; the first time in {first:.2f} ms"
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
    if world.bodies:
        yield f"Around    {', '.join(bodies)}"
    if left_out:
        yield f"Left out  {', '.join(left_out)}: their place is known only in a run"


def _draw(robot: Robot, world: World, plan: Plan, output: Path) -> None:
    from logs.views.plan_figure import PlanDrawing, draw_plan  # matplotlib takes half a second

    from .motion_drawing import POSES, motion_drawing

    step = max(_STEP, plan.duration / _MOST_POINTS)
    times = np.append(np.arange(0.0, plan.duration, step), plan.duration)
    names = [joint.name for joint in robot.actuated]
    columns = [names.index(name) for name in plan.joints]
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

"""`armtree plan`: a motion found, explained and drawn, without an arm."""

import dataclasses
import json
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from hardware import Robot
from skills import BadTarget, Positions, check_targets, three
from skills.motion import EMPTY, BadWorld, Plan, Query, ToolQuery, World
from skills.motion.explain import limits_met, straight_duration
from skills.motion.model import Model
from skills.motion.outline import outlines
from skills.motion.planner import Planner

_POSES = 14  # of the sweep
_GRID = 0.005  # of the curves [s]
_NOWHERE = (0.0, 0.0, 0.0)


def explain(
    robot: Robot,
    goal: Sequence[str],
    start: Sequence[str],
    world: Path | None,
    group: str,
    seed: int,
    output: Path,
) -> Iterator[str]:
    """Plan, draw, and say what was found, line by line.

    Args:
        robot: Whose motion.
        goal: `JOINT=VALUE` [rad], joints not named staying, or three numbers: where the tool
            shall be [m].
        start: `JOINT=VALUE` [rad]; joints not named are at their boot pose.
        world: JSON file with a list of bodies, as `World.plain` writes them.
        group: That moves.
        seed: Of the search.
        output: The PNG to write.

    Raises:
        BadTarget: Goal or start cannot be read, or name no joint.
        MotionError: There is no plan.
    """
    planner, begin, around = Planner(robot), _start(robot, start), _world(world)
    target = _goal(robot, planner, goal, ToolQuery(group, begin, _NOWHERE, seed=seed, world=around))
    plan = planner.plan(Query(group, begin, target, seed, world=around))
    yield from _told(plan)
    _draw(robot, around, plan, output)
    yield str(output)


def _start(robot: Robot, given: Sequence[str]) -> tuple[float, ...]:
    values = _values(given)
    names = [joint.name for joint in robot.actuated]
    _check_names(values, names)
    return tuple(values.get(joint.name, joint.boot) for joint in robot.actuated)


def _world(file: Path | None) -> World:
    if file is None:
        return EMPTY
    try:
        bodies = json.loads(file.read_text())
    except (OSError, ValueError) as error:
        raise BadWorld(f"{file} cannot be read as JSON: {error}") from error
    return World.parse(bodies)


def _goal(
    robot: Robot, planner: Planner, given: Sequence[str], tool: ToolQuery
) -> tuple[float, ...]:
    group = tool.group
    if group not in robot.groups:
        raise BadTarget(f"the robot has no group {group}; it has {', '.join(robot.groups)}")
    if not any("=" in each for each in given):
        point = three("point", [_number(each) for each in given])
        return planner.reach(dataclasses.replace(tool, point=point)).positions
    values, joints = _values(given), robot.leaders(group)
    _check_names(values, [joint.name for joint in joints])
    now = dict(zip([joint.name for joint in robot.actuated], tool.start, strict=True))
    target = Positions((joint.name, values.get(joint.name, now[joint.name])) for joint in joints)
    check_targets(robot, {group: target})
    return tuple(target.values())


def _values(given: Sequence[str]) -> dict[str, float]:
    values = {}
    for each in given:
        name, _, number = each.partition("=")
        values[name.strip()] = _number(number)
    return values


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError as error:
        raise BadTarget(f"{text!r} is no number; write JOINT=VALUE, or x y z") from error


def _check_names(values: dict[str, float], names: Sequence[str]) -> None:
    for name in values:
        if name not in names:
            raise BadTarget(f"{name} is no joint that can be set; there are {', '.join(names)}")


def _told(plan: Plan) -> Iterator[str]:
    spent = sum(plan.milliseconds.values())
    rungs = ", ".join(f"{name} {ms:.2f}" for name, ms in plan.milliseconds.items())
    line = straight_duration(plan)
    goal = ", ".join(f"{n} {q:.3f}" for n, q in zip(plan.joints, plan.goal, strict=True))
    yield f"Goal      {goal}"
    if len(plan.waypoints) > 2:
        more = 100.0 * (plan.duration / line - 1.0) if line else 0.0
        yield f"Path      round something, {len(plan.waypoints)} waypoints, {more:.0f} % longer"
    else:
        yield "Path      straight" if plan.duration else "Path      none: it is there already"
    yield f"Duration  {plan.duration:.3f} s; a straight line would take {line:.3f} s"
    yield f"Found in  {spent:.2f} ms ({rungs})"
    for limit in limits_met(plan):
        unit = "rad/s" if limit.kind == "speed" else "rad/s²"
        share = 100.0 * limit.seconds / plan.duration
        what = f"{limit.joint} at its {limit.kind} limit, {limit.value:g} {unit}"
        yield f"Held by   {what}: {limit.seconds:.2f} s ({share:.0f} %)"


def _draw(robot: Robot, world: World, plan: Plan, output: Path) -> None:
    from logs.plan_figure import PlanPicture, draw_plan  # matplotlib takes half a second

    times = np.append(np.arange(0.0, plan.duration, _GRID), plan.duration)
    model, columns = Model(robot, world), [_column(robot, name) for name in plan.joints]
    fixed = {body.name for body in world.bodies if not body.link}
    sweep: list[list[list[list[float]]]] = []
    bodies: list[list[list[float]]] = []
    for state in plan.sample(np.linspace(0.0, plan.duration, _POSES)):
        row = np.array(plan.start)
        row[columns] = state
        shapes = [(name, points.tolist()) for name, points in outlines(model, row)]
        sweep.append([points for name, points in shapes if name not in fixed])
        bodies = [points for name, points in shapes if name in fixed]
    draw_plan(
        PlanPicture(
            title=f"{robot.name}: {plan.group}, {plan.duration:.2f} s",
            joints=plan.joints,
            times=times.tolist(),
            positions=plan.sample(times).tolist(),
            speeds=plan.velocities(times).tolist(),
            accelerations=plan.accelerations(times).tolist(),
            waypoints=plan.waypoints.tolist(),
            speed_limits=plan.velocity.tolist(),
            acceleration_limits=plan.acceleration.tolist(),
            sweep=sweep,
            bodies=bodies,
        ),
        output,
    )


def _column(robot: Robot, name: str) -> int:
    return [joint.name for joint in robot.actuated].index(name)

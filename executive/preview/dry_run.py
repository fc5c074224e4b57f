"""A dry run: checks a task and plans its motions. Nothing moves.

The result has the events of a run. Therefore every view of a run can show it.
"""

import uuid
from collections.abc import Mapping
from dataclasses import replace

import logs
from executive.api.events import Event
from executive.api.outcome import GoalState, GoalStatus, Outcome, cause_of
from executive.recording.translate import arm_record, skill_record
from hardware import FrameSent, HardwareError
from hardware.loading.dataclass import dataclass
from skills import Context, Planned, Scheduled
from skills.merged_motion import MergedMotion, verify_query
from skills.motion import MotionError, Plan, Query, World
from trees import Library, Located
from trees.check import compile_task
from trees.compile.node_paths import paths

from .task_motions import task_motions


@dataclass(frozen=True, slots=True)
class DryRun:
    """The result of a dry run.

    Attributes:
        events: Events of the run, with times since its start [s]: goal, plans, schedules, frames
            and result.
        unknown: A message for each motion that is known only in a run.
        worlds: The world during each motion.
    """

    events: tuple[Event, ...]
    unknown: tuple[str, ...]
    worlds: tuple[World, ...]


def dry_run(
    context: Context,
    library: Library,
    number: int,
    arguments: Mapping[str, Located],
    start: tuple[float, ...],
) -> DryRun:
    """Check a task and plan its motions. Blocks until all are planned or one is refused.

    Args:
        context: Robot, planners with seed and timeout, and the world before the task.
        library: Files of the task.
        number: Number of the task.
        arguments: Values of the parameters of the task.
        start: Configuration before the task [rad].

    Raises:
        UnknownTask: No task has that number.
        BadArguments: Only the arguments are wrong.
        FileError: The files have mistakes, or a skill refuses an input.
    """
    tree = compile_task(context.robot, library, number, arguments, validated=True)
    motions, unknown = task_motions(
        tree, context.robot, context.pool, start, context.scene.world, context.seed
    )
    assumed = {each.node for each in motions if each.assumed_start}
    messages = (*unknown, *(f"{node}: the start is known only in a run" for node in assumed))
    identity, name = uuid.uuid4().hex, library.head(number).name
    pose = context.robot.by_joint(start)
    events: list[Event] = [logs.Goal(0.0, identity, number, name, context.seed, pose)]
    events += (_node(0.0, path, "INVALID") for _, path in paths(tree.root))
    outcome = Outcome.of(number, GoalState.SUCCEEDED, None)
    time = 0.0
    for motion in motions:
        events.append(_node(time, motion.node, "RUNNING"))
        try:
            time = _play(context, motion.query, time, events)
            events.append(_node(time, motion.node, "SUCCESS"))
        except (MotionError, HardwareError) as error:
            events.append(_node(time, motion.node, "FAILURE", str(error)))
            cause = cause_of(error, motion.node)
            outcome = Outcome.of(number, GoalState.ABORTED, cause, duration=time)
            break
    events.append(GoalStatus(identity, number, outcome.state, 0, outcome))
    return DryRun(tuple(events), messages, tuple(motion.query.world for motion in motions))


def _play(context: Context, query: Query, begin: float, events: list[Event]) -> float:
    """Plan a motion, check its frames, and add its events. Return the time of its end [s].

    Raises:
        MotionError: There is no such motion, or its frames would collide.
        HardwareError: The motion cannot be compiled to frames.
    """
    robot, start = context.robot, tuple(query.start)
    query = replace(query, timeout=context.timeout)
    plan = context.pool.ask(query)
    assert isinstance(plan, (Plan, MotionError))
    events.append(skill_record(Planned(query, plan), robot, begin))
    if isinstance(plan, MotionError):
        raise plan
    motion = MergedMotion(robot, start, [plan], together=False)
    schedule = motion.compile()
    events.append(skill_record(Scheduled(schedule, start, motion), robot, begin))
    contact = context.pool.ask(verify_query(robot, start, schedule, query.timeout, query.world))
    if isinstance(contact, MotionError):
        raise contact
    for number, setpoint in enumerate(schedule.setpoints, 1):
        time = begin + setpoint.time
        # After the last frame, the arm is at the end of the motion.
        there = schedule.end if number == len(schedule.setpoints) else setpoint.positions
        frame = FrameSent(time, setpoint.frame.data, there, scheduled=time)
        events.append(arm_record(frame, robot))
    return begin + schedule.duration


def _node(time: float, path: str, status: str, message: str = "") -> logs.NodeStatus:
    name = path.rpartition("/")[2].rpartition(":")[2]
    return logs.NodeStatus(time, path, name, status, message)

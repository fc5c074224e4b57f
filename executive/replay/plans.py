"""Goal to plan: plans the recorded queries again and compares the motions.

Each function returns the first difference in words, or an empty string if there is none.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import zip_longest

from executive.recording.archive import restore_world
from hardware import Robot
from logs import Plan, Record, Schedule
from skills.merged_motion import MergedMotion
from skills.motion import MotionError, Plan as Planned, Query, Rest
from skills.motion.planner import Planner

# A busy machine must not fail a plan; the timeout has no influence on the motion.
_TIMEOUT = 120.0  # [s]

# Failures that depend on the machine's load, not on the query.
_BY_CHANCE = ("plan.canceled", "plan.timeout", "plan.worker_died")


def joints_difference(robot: Robot, records: Iterable[Record]) -> str:
    """Check that every plan and schedule is for the joints of the robot.

    Args:
        robot: The robot as it was recorded.
        records: The records, in file order.
    """
    actuated = {joint.name for joint in robot.actuated}
    for record in records:
        if not isinstance(record, Plan | Schedule):
            continue
        groups = (record.group,) if isinstance(record, Plan) else record.groups
        if unknown := [group for group in groups if group not in robot.groups]:
            return (
                f"the group {unknown[0]} is recorded, but the robot has {', '.join(robot.groups)}"
            )
        if record.start.keys() != actuated:
            return f"the recorded start has the joints {', '.join(record.start)}"
        if isinstance(record, Plan):
            joints = tuple(joint.name for joint in robot.actuated_in(record.group))
            if record.joints != joints:
                return f"the {record.group} is recorded with the joints {', '.join(record.joints)}"
    return ""


def plans_difference(
    planner: Callable[[], Planner],
    robot: Robot,
    records: Sequence[Record],
    files: Mapping[str, bytes],
) -> str:
    """Plan every recorded query again, and merge the plans of each schedule again.

    Args:
        planner: Returns the planner for the robot. A recording without a plan needs none, and may
            lack the meshes for it.
        robot: The robot as it was recorded.
        records: The records, in file order.
        files: Attachments of the recording, by name.
    """
    planned: dict[str, Planned] = {}
    before: MergedMotion | None = None
    number = 0
    for record in records:
        words = ""
        if isinstance(record, Plan):
            number += 1
            words = _plan_difference(record, _plan(planner(), robot, record, files), planned)
            words = words and f"plan {number} ({record.group}): {words}"
        elif isinstance(record, Schedule) and record.groups:
            if before and record.resumed is not None:
                planned |= _remaining(planner(), robot, record, before, record.resumed)
            if missing := [group for group in record.groups if group not in planned]:
                return f"a schedule moves the group {missing[0]}, but no plan for it is recorded"
            start = tuple(record.start[joint.name] for joint in robot.actuated)
            plans = [planned[group] for group in record.groups]
            before = MergedMotion(robot, start, plans, record.together)
            words = _merged_difference(robot, record, before, start)
        if words:
            return words
    return ""


def _plan(
    planner: Planner, robot: Robot, recorded: Plan, files: Mapping[str, bytes]
) -> Planned | MotionError | None:
    """Return the answer to a recorded query; None if the recorded answer is not repeatable."""
    if recorded.code in _BY_CHANCE:
        return None
    start = tuple(recorded.start[joint.name] for joint in robot.actuated)
    try:
        query = Query(
            group=recorded.group,
            start=start,
            goal=recorded.goal,
            seed=recorded.seed,
            timeout=_TIMEOUT,
            via=recorded.via,
            world=restore_world(recorded.world, files),
            spare=recorded.spare,
            speed=recorded.speed,
        )
        return planner.plan(query)
    except MotionError as error:
        return error


def _plan_difference(
    recorded: Plan, answer: Planned | MotionError | None, planned: dict[str, Planned]
) -> str:
    planned.pop(recorded.group, None)
    if answer is None:
        return ""
    if isinstance(answer, MotionError):
        if answer.code == recorded.code:
            return ""
        return f"{recorded.code or 'a motion'} is recorded, but now {answer.code}: {answer}"
    if recorded.code:
        return f"{recorded.code} is recorded, but now there is a motion of {answer.duration:.3f} s"
    planned[recorded.group] = answer
    return _motions_difference(recorded, answer)


def _remaining(
    planner: Planner, robot: Robot, recorded: Schedule, before: MergedMotion, time: float
) -> dict[str, Planned]:
    """Return the rest of a motion that was paused at a time [s], by group."""
    start = tuple(recorded.start[joint.name] for joint in robot.actuated)
    rest = before.rest(time, start)
    plans = [planner.rest(part) if isinstance(part, Rest) else part for part in rest]
    return {plan.group: plan for plan in plans}


def _merged_difference(
    robot: Robot, recorded: Schedule, merged: MergedMotion, start: tuple[float, ...]
) -> str:
    if not merged.begins_at(start):
        return f"a motion from {start} rad is recorded, but the plans start elsewhere"
    if merged.duration != recorded.duration:
        return (
            f"a motion of {recorded.duration!r} s is recorded, "
            f"but the plans take {merged.duration!r} s"
        )
    names = [joint.name for joint in robot.actuated]
    rows = [tuple(row) for row in merged.sample(recorded.sample_times)]
    return _rows_difference("merged sample", names, recorded.samples, rows)


def _motions_difference(recorded: Plan, planned: Planned) -> str:
    waypoints = [tuple(row) for row in planned.waypoints.tolist()]
    if words := _rows_difference("waypoint", recorded.joints, recorded.waypoints, waypoints):
        return words
    if recorded.duration != planned.duration:
        return f"duration {recorded.duration!r} s is recorded, but now it is {planned.duration!r} s"
    positions = [tuple(row) for row in planned.sample(recorded.times).tolist()]
    return _rows_difference("sample", recorded.joints, recorded.positions, positions)


def _rows_difference(
    what: str,
    joints: Sequence[str],
    then: Sequence[Sequence[float]],
    now: Sequence[Sequence[float]],
) -> str:
    for number, (a, b) in enumerate(zip_longest(then, now), 1):
        if a is None or b is None:
            return f"{len(then)} {what}s are recorded, but now there are {len(now)}"
        for joint, old, new in zip(joints, a, b, strict=True):
            if old != new:
                return (
                    f"{what} {number}: {joint} = {old!r} rad is recorded, but now it is {new!r} rad"
                )
    return ""

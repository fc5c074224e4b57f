"""Goal to plan: plans the recorded queries again and compares the motions.

Each function returns the first difference in words, or an empty string if there is none.
"""

from collections.abc import Sequence
from itertools import zip_longest

from executive.recording.archive import in_recording, restore_world
from hardware import Robot
from logs import Plan as RecordedPlan, Schedule
from skills import StartMoved
from skills.merged_motion import MergedMotion
from skills.motion import MotionError, Plan, Query, Rest
from skills.motion.errors import PlanCanceled, PlanTimeout, WorkerDied

from .recorded_run import RecordedRun

# Long timeout, so that a busy machine does not fail a plan. It does not affect the motion.
_TIMEOUT = 120.0  # [s]

# Failures that depend on the machine's load, not on the query.
_BY_CHANCE = [kind.code for kind in (PlanCanceled, PlanTimeout, WorkerDied)]


def plans_difference(run: RecordedRun) -> str:
    """Plan every recorded query again, and merge the plans of each schedule again."""
    planned: dict[str, Plan] = {}
    before: MergedMotion | None = None
    number = 0
    for record in run.records:
        words = ""
        if isinstance(record, RecordedPlan):
            number += 1
            words = _plan_difference(record, _plan(run, record), planned)
            words = words and f"plan {number} ({record.group}): {words}"
        elif isinstance(record, Schedule) and record.groups:
            start = run.start(record)
            if before and record.resumed is not None:  # the previous motion was paused
                try:
                    rest = before.rest(record.resumed, start)
                except StartMoved as error:
                    return f"the rest of a motion from {start} rad is recorded, but {error}"
                plans = (run.planner.rest(p) if isinstance(p, Rest) else p for p in rest)
                planned |= {plan.group: plan for plan in plans}
            if missing := [group for group in record.groups if group not in planned]:
                return f"a schedule moves the group {missing[0]}, but no plan for it is recorded"
            merged = [planned[group] for group in record.groups]
            before = MergedMotion(run.robot, start, merged, record.together)
            words = _merged_difference(run.robot, record, before, start)
        if words:
            return words
    return ""


def _plan(run: RecordedRun, recorded: RecordedPlan) -> Plan | MotionError | None:
    """Plan a recorded query again. Return None if the recorded answer is not repeatable."""
    if recorded.code in _BY_CHANCE:
        return None
    try:
        query = Query(
            group=recorded.group,
            start=run.start(recorded),
            goal=recorded.goal,
            seed=recorded.seed,
            timeout=_TIMEOUT,
            via=recorded.via,
            world=restore_world(recorded.world, run.recording.files),
            spare=recorded.spare,
            speed=recorded.speed,
        )
        return run.planner.plan(query)
    except MotionError as error:
        return error


def _plan_difference(
    recorded: RecordedPlan, answer: Plan | MotionError | None, planned: dict[str, Plan]
) -> str:
    planned.pop(recorded.group, None)
    if answer is None:
        return ""
    if isinstance(answer, MotionError):
        if answer.code == recorded.code:
            return ""
        then = recorded.code or "a motion"
        why = in_recording(str(answer))
        return f"the run had {then}; planning again fails with {answer.code}: {why}"
    if recorded.code:
        now = f"planning again finds a motion of {answer.duration:.3f} s"
        return f"the run had {recorded.code}; {now}"
    planned[recorded.group] = answer
    return _motions_difference(recorded, answer)


def _merged_difference(
    robot: Robot, recorded: Schedule, merged: MergedMotion, start: tuple[float, ...]
) -> str:
    if not merged.begins_at(start):
        return f"a motion from {start} rad is recorded, but the plans start at another position"
    if merged.duration != recorded.duration:
        took = f"a motion of {recorded.duration!r} s is recorded"
        return f"{took}, but the plans take {merged.duration!r} s"
    names = [joint.name for joint in robot.actuated]
    rows = [tuple(row) for row in merged.sample(recorded.sample_times)]
    return _rows_difference("merged sample", names, recorded.samples, rows)


def _motions_difference(recorded: RecordedPlan, planned: Plan) -> str:
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
                recorded = f"{what} {number}: {joint} = {old!r} rad is recorded"
                return f"{recorded}, but now it is {new!r} rad"
    return ""

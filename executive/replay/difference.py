"""The first difference between what was recorded and what is made anew."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import pairwise, takewhile, zip_longest

from executive.recording.meshes import world_of
from hardware import HardwareError, Robot, compile_schedule
from hardware import Schedule as Compiled
from logs import NodeStatus, Plan, Record, Schedule, Sent
from skills.merged_motion import MergedMotion
from skills.motion import MotionError, Query, Rest
from skills.motion import Plan as Planned
from skills.motion.planner import Planner

# Clocks that have run for months are read to less than this [s].
_TOLERANCE = 1e-6

# It can only fail a plan, never change one; a busy machine must not.
_TIMEOUT = 120.0  # [s]
# Ends of planning that depend on the day, not on the query.
_BY_CHANCE = ("plan.canceled", "plan.timeout", "plan.worker_died")


def joints_difference(robot: Robot, story: Iterable[Record]) -> str:
    """The first plan or schedule that is not of this robot's joints, or nothing.

    Args:
        robot: As it was recorded.
        story: What was recorded, in its order.
    """
    actuated = {joint.name for joint in robot.actuated}
    for record in story:
        if not isinstance(record, Plan | Schedule):
            continue
        groups = (record.group,) if isinstance(record, Plan) else record.groups
        if unknown := [group for group in groups if group not in robot.groups]:
            return f"the group {unknown[0]} is recorded, the robot has {', '.join(robot.groups)}"
        if record.start.keys() != actuated:
            return f"a start of {', '.join(record.start)} is recorded"
        if isinstance(record, Plan):
            joints = tuple(joint.name for joint in robot.actuated_in(record.group))
            if record.joints != joints:
                return f"the {record.group} is recorded as {', '.join(record.joints)}"
    return ""


def frames_difference(robot: Robot, story: Sequence[Record], whole: bool = True) -> str:
    """Compile every motion of a run again; the first frame that differs, or nothing.

    A motion that was cut passes where what left is a prefix of its schedule, and a hold.

    Args:
        robot: As it was recorded.
        story: What was recorded, in its order.
        whole: Whether that has its end.
    """
    begins = [i for i, record in enumerate(story) if isinstance(record, Schedule)]
    parts = [story[: begins[0]] if begins else story]
    parts += [story[i:j] for i, j in zip_longest(begins, begins[1:])]
    held: bytes | None = None
    for number, (part, cut) in enumerate(zip(parts, _cuts(parts, whole), strict=True)):
        sent = [record for record in part if isinstance(record, Sent) and record.joints]
        schedule = part[0] if part and isinstance(part[0], Schedule) else None
        words = _positions_difference(robot, sent) or _holds_difference(sent, held)
        if not words and schedule:
            compiled, words = _compiled(robot, schedule)
            words = words or _sent_difference(schedule, sent, cut)
            words = words or _timing_difference(schedule, sent, cut)
            words = words or _commanded_difference(compiled, sent)
        elif not words and (moved := [each for each in sent if not each.hold]):
            words = f"{moved[0].text} was sent without a schedule"
        if words:
            return f"motion {number}: {words}"
        held = sent[-1].data if sent else held
    return ""


def _cuts(parts: Sequence[Sequence[Record]], whole: bool) -> Iterator[bool]:
    """Whether each motion was cut off, and the recording says so.

    It does where there is a hold, or where the node that sent the schedule ended otherwise than
    well, or not at all. That node is a leaf that runs when the schedule is made, or that is told
    to run with the first change told after it: the changes of one tick bear one time. A story
    without its end may end within that tick.
    """
    changes = [record for part in parts for record in part if isinstance(record, NodeStatus)]
    inner = {change.path.rpartition("/")[0] for change in changes}
    running: set[str] = set()
    for part in parts:
        told = [r for r in part if isinstance(r, NodeStatus) and r.path not in inner]
        first = min((r.time for r in part if isinstance(r, NodeStatus)), default=None)
        senders, failed = set(running), False
        for change in told:
            if change.status == "RUNNING":
                running.add(change.path)
                senders |= {change.path} if change.time == first else set()
                continue
            failed |= change.status != "SUCCESS" and change.path in senders
            running.discard(change.path)
            senders.discard(change.path)
        held = any(isinstance(record, Sent) and record.hold for record in part)
        ended = not whole and part is parts[-1] and all(change.time == first for change in told)
        yield held or failed or bool(senders) or not told or ended


def _positions_difference(robot: Robot, sent: Iterable[Sent]) -> str:
    codec, joints = robot.wire_format, tuple(joint.name for joint in robot.actuated)
    for frame in sent:
        if frame.joints != joints:
            return f"{frame.text} was sent for {', '.join(frame.joints)}"
        try:
            encoded = codec.encode(frame.positions).data
        except HardwareError as error:
            return f"{frame.text} was sent for what cannot be sent: {error}"
        if encoded != frame.data:
            return f"{frame.text} was sent for positions that encode to {encoded.decode()}"
    return ""


def _holds_difference(sent: Iterable[Sent], last: bytes | None) -> str:
    for frame in sent:
        if frame.hold and last not in (None, frame.data):
            assert last
            return f"the hold {frame.text} does not repeat {last.decode()}"
        last = frame.data
    return ""


def _compiled(robot: Robot, recorded: Schedule) -> tuple[Compiled | None, str]:
    """A schedule made again, and what is wrong with it; None for frames that were not planned."""
    firmware = robot.firmware
    for name, then, now in (
        ("firmware", recorded.firmware, firmware.name),
        ("rate_hz", recorded.rate_hz, firmware.rate),
    ):
        if then != now:
            return None, f"a schedule of {name} {then} is recorded, the robot has {now}"
    if not recorded.groups:
        return None, ""
    if recorded.duration * firmware.rate > len(recorded.sample_times):
        looked = len(recorded.sample_times)
        return None, f"a motion of {recorded.duration} s is recorded, of which {looked} samples are"
    rows = dict(zip(recorded.sample_times, recorded.samples, strict=True))
    start = [recorded.start[joint.name] for joint in robot.actuated]

    def sample(times: Sequence[float]) -> list[tuple[float, ...]]:
        return [rows[time] for time in times]

    try:
        compiled = compile_schedule(robot, start, sample, recorded.duration)
    except KeyError as time:
        return None, f"compiling looks at the motion at {time} s, which was not looked at then"
    except HardwareError as error:
        return None, f"the recorded motion cannot be compiled: {error}"
    return compiled, _schedules_difference(recorded, compiled)


def _schedules_difference(recorded: Schedule, compiled: Compiled) -> str:
    then = zip(recorded.times, recorded.frames, strict=True)
    now = ((setpoint.time, str(setpoint.frame)) for setpoint in compiled.setpoints)
    for number, (a, b) in enumerate(zip_longest(then, now), 1):
        if a != b:
            return f"frame {number}: {_at(a)} is recorded as due, {_at(b)} is compiled"
    delays = tuple(setpoint.delay for setpoint in compiled.setpoints)
    if recorded.delays_s != delays:
        return "the recorded delays_s are not those that are compiled"
    if recorded.slowed_s != compiled.slowed:
        return f"slowed_s of {recorded.slowed_s} s is recorded, {compiled.slowed} s is compiled"
    return ""


def _commanded_difference(compiled: Compiled | None, sent: Iterable[Sent]) -> str:
    moving = (frame for frame in sent if not frame.hold)
    setpoints = compiled.setpoints if compiled else ()
    for number, (due, frame) in enumerate(zip(setpoints, moving, strict=False), 1):
        for joint, told, made in zip(frame.joints, frame.positions, due.positions, strict=True):
            if told != made:
                return f"frame {number}: {joint} at {told!r} rad is recorded, {made!r} is compiled"
    return ""


def _at(due: tuple[float, str] | None) -> str:
    return f"{due[1]} at {due[0]!r} s" if due else "none"


def _sent_difference(schedule: Schedule, sent: Sequence[Sent], cut: bool) -> str:
    moving = [frame.text for frame in sent if not frame.hold]
    before_hold = len(list(takewhile(lambda frame: not frame.hold, sent)))
    if before_hold < len(moving):
        return f"{moving[before_hold]} was sent after the hold"
    for number, (due, left) in enumerate(zip_longest(schedule.frames, moving), 1):
        if left is None and cut:
            return ""
        if due != left:
            return f"frame {number}: {due or 'none'} was due, {left or 'none'} was sent"
    return ""


def _timing_difference(schedule: Schedule, sent: Sequence[Sent], cut: bool) -> str:
    moving = [frame for frame in sent if not frame.hold]
    before, shifted = 0.0, 0.0  # how late the frame before left, and what that added up to [s]
    for number, (due, frame) in enumerate(zip(schedule.times, moving, strict=False), 1):
        first, scheduled = moving[0].scheduled, frame.scheduled
        if first is None or scheduled is None:
            return f"frame {number}: {frame.text} is recorded without the time it was due"
        if first < schedule.time - _TOLERANCE:
            return f"frame 1: {moving[0].text} was due before there was its schedule"
        passed = due - schedule.times[0]
        late = scheduled - first - passed - shifted
        if 1 / schedule.rate_hz - _TOLERANCE < late <= before + _TOLERANCE:  # as the streamer does
            shifted, late = shifted + late, 0.0
        before = frame.time - scheduled
        if late < -_TOLERANCE or (late > _TOLERANCE and not cut):  # a stop may brake
            return (
                f"frame {number}: {frame.text} was due {passed:.6f} s after the first, "
                f"recorded is {scheduled - first:.6f} s"
            )
        if frame.time < scheduled - _TOLERANCE:
            return f"frame {number}: {frame.text} was sent before it was due"
    for number, (one, other) in enumerate(pairwise(sent), 2):
        if other.time < one.time:
            return f"frame {number}: {other.text} was sent before the frame before it"
    return ""


def plans_difference(
    planner: Planner, robot: Robot, story: Sequence[Record], files: Mapping[str, bytes]
) -> str:
    """Plan every recorded query again; the first plan or merged motion that differs, or nothing.

    Args:
        planner: For the robot.
        robot: As it was recorded.
        story: What was recorded, in its order.
        files: What is attached to the recording.
    """
    made: dict[str, Planned] = {}
    before: MergedMotion | None = None
    number = 0
    for record in story:
        words = ""
        if isinstance(record, Plan):
            number += 1
            words = _plan_difference(record, _plan(planner, robot, record, files), made)
            words = words and f"plan {number} ({record.group}): {words}"
        elif isinstance(record, Schedule) and record.groups:
            if before and record.resumed is not None:
                made |= _left(planner, robot, record, before, record.resumed)
            if lacking := [group for group in record.groups if group not in made]:
                return f"a schedule moves the {lacking[0]}, for which no motion is recorded"
            start = tuple(record.start[joint.name] for joint in robot.actuated)
            plans = [made[group] for group in record.groups]
            before = MergedMotion(robot, start, plans, record.together)
            words = _merged_difference(robot, record, before, start)
        if words:
            return words
    return ""


def _plan(
    planner: Planner, robot: Robot, recorded: Plan, files: Mapping[str, bytes]
) -> Planned | MotionError | None:
    """The answer to a recorded query; None where that answer came by chance."""
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
            world=world_of(recorded.world, files),
            spare=recorded.spare,
        )
        return planner.plan(query)
    except MotionError as error:
        return error


def _plan_difference(
    recorded: Plan, answer: Planned | MotionError | None, made: dict[str, Planned]
) -> str:
    made.pop(recorded.group, None)
    if answer is None:
        return ""
    if isinstance(answer, MotionError):
        if answer.code == recorded.code:
            return ""
        return f"{recorded.code or 'a motion'} is recorded, now {answer.code}: {answer}"
    if recorded.code:
        return f"{recorded.code} is recorded, now there is a motion of {answer.duration:.3f} s"
    made[recorded.group] = answer
    return _motions_difference(recorded, answer)


def _left(
    planner: Planner, robot: Robot, recorded: Schedule, before: MergedMotion, time: float
) -> dict[str, Planned]:
    """What was left of a motion that was paused at a time [s], by group."""
    start = tuple(recorded.start[joint.name] for joint in robot.actuated)
    rest = before.rest(time, start)
    plans = [planner.rest(part) if isinstance(part, Rest) else part for part in rest]
    return {plan.group: plan for plan in plans}


def _merged_difference(
    robot: Robot, recorded: Schedule, merged: MergedMotion, start: tuple[float, ...]
) -> str:
    if not merged.begins_at(start):
        return f"a motion from {start} rad is recorded, the plans begin elsewhere"
    if merged.duration != recorded.duration:
        return (
            f"a motion of {recorded.duration!r} s is recorded, the plans take {merged.duration!r}"
        )
    names = [joint.name for joint in robot.actuated]
    rows = [tuple(row) for row in merged.sample(recorded.sample_times)]
    return _rows_difference("merged sample", names, recorded.samples, rows)


def _motions_difference(recorded: Plan, made: Planned) -> str:
    waypoints = [tuple(row) for row in made.waypoints.tolist()]
    if words := _rows_difference("waypoint", recorded.joints, recorded.waypoints, waypoints):
        return words
    if recorded.duration != made.duration:
        return f"duration {recorded.duration!r} s is recorded, now {made.duration!r} s"
    positions = [tuple(row) for row in made.sample(recorded.times).tolist()]
    return _rows_difference("sample", recorded.joints, recorded.positions, positions)


def _rows_difference(
    what: str,
    joints: Sequence[str],
    then: Sequence[Sequence[float]],
    now: Sequence[Sequence[float]],
) -> str:
    for number, (a, b) in enumerate(zip_longest(then, now), 1):
        if a is None or b is None:
            return f"{len(then)} {what}s are recorded, now {len(now)}"
        for joint, old, new in zip(joints, a, b, strict=True):
            if old != new:
                return f"{what} {number}: {joint} = {old!r} rad is recorded, now {new!r} rad"
    return ""

"""Plan to frames: compiles the recorded motions again, and compares them with the sent frames.

Each function returns the first difference in words, or an empty string if there is none.
"""

import math
from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise, takewhile, zip_longest

from executive.api.codes import OK
from executive.api.outcome import GoalState
from executive.errors import GoalCanceled
from hardware import HardwareError, Robot, Schedule as CompiledSchedule, compile_schedule
from hardware.printable import wire_text
from logs import Goal, Measured, NodeStatus, Record, Result, Schedule, Sent, goal_title
from trees.export.resolved import RESOLVED

from .recorded_run import RecordedRun

# Rounding of a clock that has run for months [s].
_TOLERANCE = 1e-6

# Measurements of a joint at rest that differ by less may be missing in the recording [rad].
_AT_REST = math.radians(0.5)

_SUCCESS = "SUCCESS"


def frames_difference(run: RecordedRun) -> str:
    """Check the goals of a run, every motion, and the results."""
    return (
        _goal_difference(run)
        or run.joints_difference
        or _motions_difference(run.robot, run.records, run.recording.whole)
        or result_difference(run.records)
    )


def _goal_difference(run: RecordedRun) -> str:
    """Find a missing goal or result. Only a server's own recording has neither."""
    recording, records = run.recording, run.records
    if not recording.whole:
        return ""
    if not recording.messages:
        return "nothing is recorded"
    ran = RESOLVED in recording.files or any(not isinstance(r, Sent | Measured) for r in records)
    if ran and not any(isinstance(record, Goal) for record in records):
        return "no goal is recorded"
    ended = {record.goal_id for record in records if isinstance(record, Result)}
    goals = (record for record in records if isinstance(record, Goal) and not record.elsewhere)
    if goal := next((goal for goal in goals if goal.goal_id not in ended), None):
        return f"the goal of {goal_title(goal.task)} has no result"
    return ""


def _motions_difference(robot: Robot, records: Sequence[Record], whole: bool) -> str:
    """Compile every motion of a run again and compare frames, positions and times.

    A stopped motion is correct if the sent frames are the beginning of its schedule, followed by a
    hold.

    Args:
        robot: The recorded robot.
        records: The records, in file order.
        whole: False if the recording lacks its end.
    """
    begins = [i for i, record in enumerate(records) if isinstance(record, Schedule)]
    parts = [records[: begins[0]] if begins else records]
    parts += [records[i:j] for i, j in zip_longest(begins, begins[1:])]
    held: Sent | None = None
    measured: Measured | None = None
    for number, (part, stopped) in enumerate(zip(parts, _stopped(parts, whole), strict=True)):
        sent = [record for record in part if isinstance(record, Sent) and record.joints]
        schedule = part[0] if part and isinstance(part[0], Schedule) else None
        words = _positions_difference(robot, sent) or _holds_difference(part, held, measured, robot)
        if not words and schedule:
            compiled, words = _compiled(robot, schedule)
            words = words or _sent_difference(schedule, sent, stopped)
            words = words or _timing_difference(schedule, sent, stopped)
            words = words or _commanded_difference(compiled, sent)
        elif not words and (moved := [each for each in sent if not each.hold]):
            words = f"{moved[0].text} was sent without a schedule"
        if words:
            return f"motion {number}: {words}"
        held = sent[-1] if sent else held
        measured = next((r for r in reversed(part) if isinstance(r, Measured)), measured)
    return ""


def _stopped(parts: Sequence[Sequence[Record]], whole: bool) -> Iterator[bool]:
    """Yield for each part True if the recording shows an early stop of its motion.

    A motion was stopped if there is a hold, or if the node that sent its schedule failed or did not
    end. That node is a leaf. It runs when the schedule is compiled, or starts in the same tick. All
    changes of a tick have the same time. An incomplete recording may end within that tick.
    """
    changes = [record for part in parts for record in part if isinstance(record, NodeStatus)]
    inner = {change.path.rpartition("/")[0] for change in changes}
    running: set[str] = set()
    for part in parts:
        leaves = [r for r in part if isinstance(r, NodeStatus) and r.path not in inner]
        first = min((r.time for r in part if isinstance(r, NodeStatus)), default=None)
        senders, failed = set(running), False
        for change in leaves:
            if change.status == "RUNNING":
                running.add(change.path)
                senders |= {change.path} if change.time == first else set()
                continue
            failed |= change.status != _SUCCESS and change.path in senders
            running.discard(change.path)
            senders.discard(change.path)
        held = any(isinstance(record, Sent) and record.hold for record in part)
        ended = not whole and part is parts[-1] and all(change.time == first for change in leaves)
        yield held or failed or bool(senders) or not leaves or ended


def _positions_difference(robot: Robot, sent: Iterable[Sent]) -> str:
    """Check that each frame is the encoding of its recorded positions."""
    codec, joints = robot.wire_format, tuple(joint.name for joint in robot.actuated)
    for frame in sent:
        if frame.joints != joints:
            return f"{frame.text} was sent for the joints {', '.join(frame.joints)}"
        try:
            encoded = codec.encode(frame.positions).data
        except HardwareError as error:
            return f"{frame.text} was sent for positions that cannot be encoded: {error}"
        if encoded != frame.data:
            return f"{frame.text} was sent for positions that encode to {wire_text(encoded)}"
    return ""


def _holds_difference(
    records: Iterable[Record], before: Sent | None, measured: Measured | None, robot: Robot
) -> str:
    """Check that each hold repeats the previous frame, or loosens a gripper.

    Args:
        records: The records of a motion.
        before: The last frame before them.
        measured: The last measurement before them.
        robot: The recorded robot.

    A server's own recording has no frames of goals, so the last frame after a goal is unknown.
    """
    elsewhere = False
    for record in records:
        match record:
            case Goal() if record.elsewhere:
                elsewhere, before = True, None
            case Result() if elsewhere:
                before = None
            case Measured():
                measured = record
            case Sent() if record.joints:
                moves = record.hold and before is not None and before.data != record.data
                if before and moves and not _loosens(robot, before, record, measured):
                    return f"the hold {record.text} does not repeat {before.text}"
                before = record
    return ""


def _loosens(robot: Robot, before: Sent, hold: Sent, measured: Measured | None) -> bool:
    """Return True if a hold only moves grippers, each nearer to its measured position."""
    if measured is None:
        return False
    rows = zip(hold.joints, before.positions, hold.positions, measured.position, strict=True)
    for name, then, now, there in rows:
        low, high = sorted((then, there))
        near = name in robot.groups["gripper"] and low - _AT_REST <= now <= high + _AT_REST
        if then != now and not near:
            return False
    return True


def _compiled(robot: Robot, recorded: Schedule) -> tuple[CompiledSchedule | None, str]:
    """Compile a schedule again. Return the compiled schedule, and the first difference.

    The compiled schedule is None if it cannot be made, or if the frames were not planned.
    """
    firmware = robot.firmware
    for name, then, now in (
        ("firmware", recorded.firmware, firmware.name),
        ("rate_hz", recorded.rate_hz, firmware.rate),
    ):
        if then != now:
            return None, f"a schedule of {name} {then} is recorded, but the robot has {now}"
    if not recorded.groups:
        return None, ""
    if recorded.duration * firmware.rate > len(recorded.sample_times):
        length, count = recorded.duration, len(recorded.sample_times)
        return None, f"a motion of {length} s is recorded with {count} samples, too few to compile"
    rows = dict(zip(recorded.sample_times, recorded.samples, strict=True))
    start = [recorded.start[joint.name] for joint in robot.actuated]

    def sample(times: Sequence[float]) -> list[tuple[float, ...]]:
        return [rows[time] for time in times]

    try:
        compiled = compile_schedule(robot, start, sample, recorded.duration)
    except KeyError as time:
        return None, f"frames need the motion at {time} s, and no sample at this time is recorded"
    except HardwareError as error:
        return None, f"the recorded motion cannot be compiled: {error}"
    return compiled, _schedules_difference(recorded, compiled)


def _schedules_difference(recorded: Schedule, compiled: CompiledSchedule) -> str:
    then = zip(recorded.times, recorded.frames, strict=True)
    now = ((setpoint.time, str(setpoint.frame)) for setpoint in compiled.setpoints)
    for number, (a, b) in enumerate(zip_longest(then, now), 1):
        if a != b:
            return f"frame {number}: {_at(a)} is recorded as due, but {_at(b)} is compiled"
    delays = tuple(setpoint.delay for setpoint in compiled.setpoints)
    if recorded.delays_s != delays:
        return "the recorded delays_s differ from the compiled ones"
    if recorded.slowed_s != compiled.slowed:
        return f"slowed_s of {recorded.slowed_s} s is recorded, but {compiled.slowed} s is compiled"
    return ""


def _at(due: tuple[float, str] | None) -> str:
    return f"{due[1]} at {due[0]!r} s" if due else "none"


def _sent_difference(schedule: Schedule, sent: Sequence[Sent], stopped: bool) -> str:
    """Check that the frames of the schedule were sent, all or up to the stop."""
    moving = [frame.text for frame in sent if not frame.hold]
    before_hold = len(list(takewhile(lambda frame: not frame.hold, sent)))
    if before_hold < len(moving):
        return f"{moving[before_hold]} was sent after the hold"
    for number, (due, left) in enumerate(zip_longest(schedule.frames, moving), 1):
        if left is None and stopped:
            return ""
        if due != left:
            return f"frame {number}: {due or 'none'} was due, but {left or 'none'} was sent"
    return ""


def _timing_difference(schedule: Schedule, sent: Sequence[Sent], stopped: bool) -> str:
    """Check that each frame was due at its scheduled time, and was not sent earlier."""
    moving = [frame for frame in sent if not frame.hold]
    # Lateness of the previous frame, and total delay of the schedule by late frames [s].
    before, shifted = 0.0, 0.0
    for number, (due, frame) in enumerate(zip(schedule.times, moving, strict=False), 1):
        first, scheduled = moving[0].scheduled, frame.scheduled
        if first is None or scheduled is None:
            return f"frame {number}: {frame.text} has no due time in the recording"
        if first < schedule.time - _TOLERANCE:
            return f"frame 1: {moving[0].text} was due before its schedule was compiled"
        passed = due - schedule.times[0]
        late = scheduled - first - passed - shifted
        # The same rule as in the streamer.
        if 1 / schedule.rate_hz - _TOLERANCE < late <= before + _TOLERANCE:
            shifted, late = shifted + late, 0.0
        before = frame.time - scheduled
        if late < -_TOLERANCE or (late > _TOLERANCE and not stopped):  # a stop may slow down first
            return (
                f"frame {number}: {frame.text} was due {passed:.6f} s after the first, "
                f"but {scheduled - first:.6f} s is recorded"
            )
        if frame.time < scheduled - _TOLERANCE:
            return f"frame {number}: {frame.text} was sent before it was due"
    for number, (one, other) in enumerate(pairwise(sent), 2):
        if other.time < one.time:
            return f"frame {number}: {other.text} has an earlier time than the previous frame"
    return ""


def _commanded_difference(compiled: CompiledSchedule | None, sent: Iterable[Sent]) -> str:
    """Check that the recorded positions equal the compiled ones exactly."""
    moving = (frame for frame in sent if not frame.hold)
    setpoints = compiled.setpoints if compiled else ()
    for number, (due, frame) in enumerate(zip(setpoints, moving, strict=False), 1):
        for joint, then, now in zip(frame.joints, frame.positions, due.positions, strict=True):
            if then != now:
                recorded = f"frame {number}: {joint} at {then!r} rad is recorded"
                return f"{recorded}, but {now!r} is compiled"
    return ""


def result_difference(records: Sequence[Record]) -> str:
    """Check that each result agrees with itself, its goal, the sent frames and the tree.

    Args:
        records: The records, in file order.
    """
    goals = {
        (record.goal_id, record.task): record for record in records if isinstance(record, Goal)
    }
    sent: list[Sent] = []
    root, status = "", ""
    for record in records:
        match record:
            case Sent() if record.joints:
                sent.append(record)
            case NodeStatus():
                root = root or record.path
                status = record.status if record.path == root else status
            case Result():
                goal = goals.get((record.goal_id, record.task))
                if goal is None:
                    title = goal_title(record.task)
                    return f"the result is of {title}, but its goal is not recorded"
                words = _state_difference(record, status)
                words = words or ("" if goal.elsewhere else _count_difference(record, sent))
                if words:
                    return words
    return ""


def _state_difference(result: Result, root: str) -> str:
    """Check that a result's state agrees with its code and the root's last status, if any."""
    done = result.state == GoalState.SUCCEEDED.name
    canceled = result.state == GoalState.CANCELED.name
    found = (result.success, result.code == OK, result.code == GoalCanceled.code)
    if found != (done, done, canceled):
        flags = f"success {result.success} and the code {result.code}"
        return f"the result is {result.state}, but has {flags}"
    if root and ((done and root != _SUCCESS) or (canceled and root == _SUCCESS)):
        return f"the result is {result.state}, but the tree ended with {root}"
    return ""


def _count_difference(result: Result, sent: Sequence[Sent]) -> str:
    """Check the result's number of frames, and that no frame was sent after it."""
    if result.frames != len(sent):
        return f"the result counts {result.frames} frames, but {len(sent)} are recorded"
    if sent and sent[-1].time > result.time:
        return f"{sent[-1].text} was sent after the result, but is recorded before it"
    return ""

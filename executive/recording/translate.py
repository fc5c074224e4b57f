"""Converts events of the arm and of skills to records."""

import math
from collections.abc import Iterable
from dataclasses import fields

import logs
from hardware import (
    ArmEvent,
    BoardReturned,
    BytesReceived,
    CommandSent,
    Faulted,
    FrameSent,
    Measured,
    Robot,
    StateChanged,
)
from skills import LeaderRead, Planned, Scheduled, SkillEvent
from skills.motion import MotionError

_GRID = 0.02  # sampling interval of a recorded motion [s]


def arm_record(event: ArmEvent, robot: Robot) -> logs.Record:
    """Return the record of an event of the arm."""
    match event:
        case FrameSent():
            names = tuple(joint.name for joint in robot.actuated)
            hold = event.scheduled is None
            return logs.Sent(event.time, event.data, event.scheduled, hold, names, event.positions)
        case CommandSent():
            return logs.Sent(event.time, event.data, None, False, (), ())
        case BytesReceived():
            return logs.Received(event.time, event.data)
        case Measured():
            names = tuple(joint.name for joint in robot.actuated)
            there = event.measurement
            values = {field.name: getattr(there, field.name) for field in fields(there)}
            return logs.Measured(event.time, names, **values)
        case StateChanged():
            return logs.Transition(event.time, event.label, event.start.value, event.goal.value)
        case Faulted():
            return logs.LogLine(event.time, 40, "hardware", str(event.error))
        case BoardReturned():
            return logs.LogLine(event.time, 30, "hardware", str(event))


def skill_record(event: SkillEvent, robot: Robot, now: float) -> logs.Record:
    """Return the record of an event of a skill.

    Args:
        event: The event.
        robot: The robot.
        now: Time of the record [s].
    """
    match event:
        case Planned():
            return _plan_record(event, robot, now)
        case Scheduled():
            return _schedule_record(event, robot, now)
        case LeaderRead():
            names = tuple(joint.name for joint in robot.actuated)
            return logs.LeaderState(now, names, event.positions)


def _plan_record(event: Planned, robot: Robot, now: float) -> logs.Plan:
    from .archive import archive_world  # slow to import

    query, answer = event.query, event.answer
    joints = robot.actuated_in(query.group)
    plan, error = (None, answer) if isinstance(answer, MotionError) else (answer, None)
    duration = plan.duration if plan else 0.0
    grid = [_GRID * number for number in range(math.ceil(duration / _GRID))]
    times = (*grid, duration) if plan else ()
    return logs.Plan(
        time=now,
        group=query.group,
        joints=tuple(joint.name for joint in joints),
        start=robot.by_joint(query.start),
        goal=query.goal,
        via=query.via,
        world=archive_world(query.world)[0],
        seed=query.seed,
        velocity_limits=tuple(query.speed * joint.velocity for joint in joints),
        acceleration_limits=tuple(
            query.speed * query.speed * joint.acceleration for joint in joints
        ),
        waypoints=_rows(plan.waypoints.tolist()) if plan else (),
        times=times,
        positions=_rows(plan.sample(times).tolist()) if plan else (),
        duration=duration,
        milliseconds=dict(answer.milliseconds),
        code=error.code if error else "",
        message=str(error) if error else "",
        spare=query.spare,
        speed=query.speed,
    )


def _schedule_record(event: Scheduled, robot: Robot, now: float) -> logs.Schedule:
    schedule, motion = event.schedule, event.motion
    sampled = motion.sampled if motion else {}
    return logs.Schedule(
        time=now,
        rate_hz=robot.firmware.rate,
        firmware=robot.firmware.name,
        times=tuple(setpoint.time for setpoint in schedule.setpoints),
        frames=tuple(str(setpoint.frame) for setpoint in schedule.setpoints),
        delays_s=tuple(setpoint.delay for setpoint in schedule.setpoints),
        slowed_s=schedule.slowed,
        start=robot.by_joint(event.start),
        duration=motion.duration if motion else schedule.duration,
        groups=motion.groups if motion else (),
        together=motion.together if motion else False,
        sample_times=tuple(sampled),
        samples=tuple(tuple(row) for row in sampled.values()),
        resumed=event.resumed,
    )


def _rows(rows: Iterable[Iterable[float]]) -> tuple[tuple[float, ...], ...]:
    return tuple(tuple(row) for row in rows)
